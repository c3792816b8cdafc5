#pragma once

#include <cstdint>

#include "hal/clock.hpp"

namespace fxdyn::hal::fake {

/// Each measurement returns the next multiple of 1000; the first one (the calibration) 0. As a counter of a processor
/// it counts on where it is not started again, and since power-on where it never was.
class CycleCounter {
 public:
  static constexpr std::uint32_t since_power_on = 1'000'000'000;
  void start() { counted_ = 0; }
  std::uint32_t stop() { return counted_ += 1000 * measurements_++; }
  static constexpr const char* unit() { return "thousandths"; }
  void start_over() { measurements_ = 0; }  ///< what comes costs less again

 private:
  std::uint32_t measurements_ = 0, counted_ = since_power_on;
};
static_assert(hal::CycleCounter<CycleCounter>);

/// Time passes when a test says so. Starts shortly before the wrap, which every test then sees.
class Clock {
 public:
  std::uint32_t now_us() const { return static_cast<std::uint32_t>(0xFFFF'0000U + elapsed_us_); }
  void advance(std::uint64_t us) { elapsed_us_ += us; }
  std::uint64_t elapsed_us() const { return elapsed_us_; }

 private:
  std::uint64_t elapsed_us_ = 0;
};
static_assert(hal::Clock<Clock>);

class TickTimer {
 public:
  explicit TickTimer(const Clock& clock) : clock_(clock) {}
  Status start(std::uint32_t period_us) {
    if (period_us == 0) return Status::failed;
    period_us_ = period_us;
    next_us_ = clock_.elapsed_us() + period_us;
    return Status::ok;
  }
  std::uint32_t expired() {
    std::uint32_t times = 0;
    for (; period_us_ != 0 && clock_.elapsed_us() >= next_us_; next_us_ += period_us_) ++times;
    return times;
  }

 private:
  const Clock& clock_;
  std::uint32_t period_us_ = 0;
  std::uint64_t next_us_ = 0;
};
static_assert(hal::TickTimer<TickTimer>);

/// Says when it would have reset the processor.
class Watchdog {
 public:
  Watchdog(const Clock& clock, std::uint32_t timeout_us) : clock_(clock), timeout_us_(timeout_us) {}
  void feed() {
    if (bites()) bitten_ = true;
    fed_us_ = clock_.elapsed_us();
    ++feeds;
  }
  bool bites() const { return bitten_ || clock_.elapsed_us() - fed_us_ > timeout_us_; }
  std::uint32_t feeds = 0;

 private:
  const Clock& clock_;
  std::uint64_t timeout_us_, fed_us_ = 0;
  bool bitten_ = false;
};
static_assert(hal::Watchdog<Watchdog>);

}  // namespace fxdyn::hal::fake
