#include "hal/linux/pins.hpp"

#include <gpiod.h>
#include <time.h>

namespace fxdyn::hal::linux {

Pin::~Pin() {
  if (chip_ != nullptr) ::gpiod_chip_close(chip_);  // releases the line, too
}

Status Pin::get_line(const char* chip, unsigned line) {
  chip_ = ::gpiod_chip_open_lookup(chip);
  if (chip_ != nullptr) line_ = ::gpiod_chip_get_line(chip_, line);
  return line_ != nullptr ? Status::ok : Status::failed;
}

Status OutputPin::open(const char* chip, unsigned line, const char* consumer, Polarity polarity, AtStart start) {
  if (get_line(chip, line) != Status::ok) return Status::failed;
  const int flags = polarity == Polarity::active_low ? GPIOD_LINE_REQUEST_FLAG_ACTIVE_LOW : 0;
  if (::gpiod_line_request_output_flags(line_, consumer, flags, start == AtStart::on ? 1 : 0) == 0) return Status::ok;
  line_ = nullptr;
  return Status::failed;
}

Status OutputPin::set(bool on) {
  return line_ != nullptr && ::gpiod_line_set_value(line_, on ? 1 : 0) == 0 ? Status::ok : Status::failed;
}

Status InputPin::open(const char* chip, unsigned line, const char* consumer, Polarity polarity) {
  if (get_line(chip, line) != Status::ok) return Status::failed;
  const int flags = polarity == Polarity::active_low ? GPIOD_LINE_REQUEST_FLAG_ACTIVE_LOW : 0;
  if (::gpiod_line_request_both_edges_events_flags(line_, consumer, flags) == 0) return Status::ok;
  line_ = nullptr;
  return Status::failed;
}

Status InputPin::read(bool& on) {
  const int level = line_ != nullptr ? ::gpiod_line_get_value(line_) : -1;
  if (level < 0) return Status::failed;
  on = level != 0;
  return Status::ok;
}

int InputPin::descriptor() const { return line_ != nullptr ? ::gpiod_line_event_get_fd(line_) : -1; }

std::uint32_t InputPin::events() {
  std::uint32_t count = 0;
  const timespec at_once{};
  gpiod_line_event event;
  while (line_ != nullptr && ::gpiod_line_event_wait(line_, &at_once) > 0 &&
         ::gpiod_line_event_read(line_, &event) == 0) {
    ++count;
  }
  return count;
}

}  // namespace fxdyn::hal::linux
