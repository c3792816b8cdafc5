#pragma once

#include <cstdint>

#include "hal/gpio.hpp"
#include "hal/status.hpp"

struct gpiod_chip;
struct gpiod_line;

namespace fxdyn::hal::linux {

/// One line of a GPIO chip through libgpiod. Failed opens leave errno: ENOENT no such chip, EINVAL no such line, EBUSY
/// taken by another program, EACCES no permission. A pin that was never opened answers `failed`.
class Pin {
 public:
  Pin() = default;
  ~Pin();
  Pin(const Pin&) = delete;
  Pin& operator=(const Pin&) = delete;
  bool is_open() const { return line_ != nullptr; }

 protected:
  Status get_line(const char* chip, unsigned line);
  gpiod_chip* chip_ = nullptr;
  gpiod_line* line_ = nullptr;
};

enum class Polarity : std::uint8_t { active_high, active_low };

class OutputPin : public Pin {
 public:
  /// Drives the line at once.
  Status open(const char* chip, unsigned line, const char* consumer, Polarity polarity = Polarity::active_high,
              AtStart start = AtStart::off);
  Status set(bool on);
};
static_assert(hal::OutputPin<OutputPin>);

/// An input with both edges as events, so that descriptor() can be polled instead of the level.
class InputPin : public Pin {
 public:
  Status open(const char* chip, unsigned line, const char* consumer, Polarity polarity = Polarity::active_high);
  Status read(bool& on);
  int descriptor() const;
  /// Takes the events that wait; their number.
  std::uint32_t events();
};
static_assert(hal::InputPin<InputPin>);

}  // namespace fxdyn::hal::linux
