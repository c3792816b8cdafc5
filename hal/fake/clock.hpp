#pragma once

#include <cstdint>

#include "hal/clock.hpp"

namespace fxdyn::hal::fake {

/// Each measurement returns the next multiple of 1000; the first one (the calibration) 0.
class CycleCounter {
 public:
  void start() {}
  std::uint32_t stop() { return 1000 * measurements_++; }

 private:
  std::uint32_t measurements_ = 0;
};
static_assert(hal::CycleCounter<CycleCounter>);

}  // namespace fxdyn::hal::fake
