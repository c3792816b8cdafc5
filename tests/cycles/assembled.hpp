#pragma once

#include <string>

#include "tests/cycles/core.hpp"
#include "tests/cycles/machine.hpp"

namespace fxdyn::cycles {

/// What a few lines of assembly do: assembled to the begin of the flash and run there up to the end, with
/// addresses in RAM in r0 to r6 and 4 in r7.
class Assembled {
 public:
  explicit Assembled(const std::string& lines);
  const Trace& trace() const { return trace_; }
  Time cycles(const CoreSetup& core, const FlashSetup& flash = {}) const { return Core(core, flash).run(trace_); }

 private:
  Machine machine_;
  Trace trace_;
};

}  // namespace fxdyn::cycles
