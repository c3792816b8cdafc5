#include "hal/linux/clock.hpp"

#include <fcntl.h>
#include <linux/perf_event.h>
#include <linux/watchdog.h>
#include <sys/ioctl.h>
#include <sys/syscall.h>
#include <sys/timerfd.h>
#include <time.h>
#include <unistd.h>

namespace fxdyn::hal::linux {
namespace {

std::uint64_t nanoseconds(clockid_t clock) {
  timespec now{};
  ::clock_gettime(clock, &now);
  return static_cast<std::uint64_t>(now.tv_sec) * 1'000'000'000U + static_cast<std::uint64_t>(now.tv_nsec);
}

}  // namespace

std::uint32_t Clock::now_us() const { return static_cast<std::uint32_t>(nanoseconds(CLOCK_MONOTONIC) / 1000); }

TickTimer::~TickTimer() {
  if (timer_ >= 0) ::close(timer_);
}

Status TickTimer::start(std::uint32_t period_us) {
  if (timer_ < 0) timer_ = ::timerfd_create(CLOCK_MONOTONIC, TFD_NONBLOCK | TFD_CLOEXEC);
  if (timer_ < 0) return Status::failed;
  itimerspec period{};
  period.it_value.tv_sec = period_us / 1'000'000;
  period.it_value.tv_nsec = static_cast<long>(period_us % 1'000'000) * 1000;
  period.it_interval = period.it_value;
  return ::timerfd_settime(timer_, 0, &period, nullptr) == 0 ? Status::ok : Status::failed;
}

std::uint32_t TickTimer::expired() {
  std::uint64_t count = 0;
  if (timer_ < 0 || ::read(timer_, &count, sizeof count) != sizeof count) return 0;
  return static_cast<std::uint32_t>(count);
}

CycleCounter::CycleCounter() {
  perf_event_attr attributes{};
  attributes.type = PERF_TYPE_HARDWARE;
  attributes.size = sizeof attributes;
  attributes.config = PERF_COUNT_HW_INSTRUCTIONS;
  attributes.exclude_kernel = 1;
  attributes.exclude_hv = 1;
  events_ = static_cast<int>(::syscall(SYS_perf_event_open, &attributes, 0, -1, -1, PERF_FLAG_FD_CLOEXEC));
}

CycleCounter::~CycleCounter() {
  if (events_ >= 0) ::close(events_);
}

std::uint64_t CycleCounter::now() const {
  std::uint64_t count = 0;
  if (events_ < 0) return nanoseconds(CLOCK_MONOTONIC);
  return ::read(events_, &count, sizeof count) == sizeof count ? count : begin_;
}

Watchdog::~Watchdog() {
  if (device_ < 0) return;
  [[maybe_unused]] const auto written =
      ::write(device_, "V", 1);  // the magic close: disarmed unless the driver forbids it
  ::close(device_);
}

Status Watchdog::open(const char* path, int timeout_s) {
  device_ = ::open(path, O_WRONLY | O_CLOEXEC);
  if (device_ < 0) return Status::failed;
  return ::ioctl(device_, WDIOC_SETTIMEOUT, &timeout_s) == 0 ? Status::ok : Status::failed;
}

void Watchdog::feed() {
  if (device_ >= 0) [[maybe_unused]]
    const auto written = ::write(device_, "", 1);
}

}  // namespace fxdyn::hal::linux
