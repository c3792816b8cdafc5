#pragma once

#include <cstdint>

#include "hal/clock.hpp"

namespace fxdyn::hal::linux {

/// CLOCK_MONOTONIC.
class Clock {
 public:
  std::uint32_t now_us() const;
};
static_assert(hal::Clock<Clock>);

/// timerfd on CLOCK_MONOTONIC.
class TickTimer {
 public:
  TickTimer() = default;
  ~TickTimer();
  TickTimer(const TickTimer&) = delete;
  TickTimer& operator=(const TickTimer&) = delete;
  Status start(std::uint32_t period_us);  ///< 0 stops it
  std::uint32_t expired();
  int descriptor() const { return timer_; }  ///< to poll; -1: never started

 private:
  int timer_ = -1;
};
static_assert(hal::TickTimer<TickTimer>);

/// Instructions of this thread in user mode (perf_event_open) where the machine and its permissions
/// (/proc/sys/kernel/perf_event_paranoid <= 2) let us count them, else nanoseconds of CLOCK_MONOTONIC. These contain
/// what interrupts and other processes take, as a deadline does, but asking for them costs no system call.
class CycleCounter {
 public:
  CycleCounter();
  ~CycleCounter();
  CycleCounter(const CycleCounter&) = delete;
  CycleCounter& operator=(const CycleCounter&) = delete;
  void start() { begin_ = now(); }
  std::uint32_t stop() { return static_cast<std::uint32_t>(now() - begin_); }
  const char* unit() const { return events_ < 0 ? "ns" : "instructions"; }

 private:
  std::uint64_t now() const;
  int events_ = -1;
  std::uint64_t begin_ = 0;
};
static_assert(hal::CycleCounter<CycleCounter>);

/// /dev/watchdog (linux/watchdog.h), or none at all: then feed() does nothing and armed() says so. A process that ends
/// by itself disarms it.
class Watchdog {
 public:
  Watchdog() = default;
  ~Watchdog();
  Watchdog(const Watchdog&) = delete;
  Watchdog& operator=(const Watchdog&) = delete;
  Status open(const char* path, int timeout_s);
  bool armed() const { return device_ >= 0; }
  void feed();

 private:
  int device_ = -1;
};
static_assert(hal::Watchdog<Watchdog>);

}  // namespace fxdyn::hal::linux
