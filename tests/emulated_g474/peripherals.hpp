#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "tests/emulated_g474/time.hpp"

// The STM32G474's peripherals that the drive node touches, each from its own chapter of RM0440; docs/guide/hil.md says
// what was compared with which other description. What the manual forbids is a violation, which fails the test.

namespace fxdyn::emulated {

using Offset = std::uint32_t;
using Complaint = std::function<void(const std::string&)>;

/// What a board's oscillators are like.
struct Oscillators {
  std::uint64_t crystal_hz = 24'000'000;  ///< 0: dead
  std::uint64_t internal_hz = 16'000'000;
  std::uint64_t low_speed_hz = 32'000;
  Time crystal_starts = 2 * millisecond;  ///< data sheet DS12288, "HSE oscillator characteristics"
  bool pll_locks = true;
};

/// RCC, with what of PWR and FLASH_ACR the clocks depend on.
class ClockTree {
 public:
  ClockTree(Complaint complain, const Oscillators& oscillators);

  enum ResetFlag : std::uint32_t { software = 1U << 28, watchdog = 1U << 29, pin = 1U << 26, brown_out = 1U << 27 };
  /// After power-on only `brown_out` and `pin` are set; a later reset adds its flag.
  void power_on();
  void reset(std::uint32_t flags);

  std::uint32_t read(Offset offset, Time now);
  void write(Offset offset, std::uint32_t value, Time now);
  std::uint32_t read_power(Offset offset) const;
  void write_power(Offset offset, std::uint32_t value);
  std::uint32_t read_access() const { return access_; }
  void write_access(std::uint32_t value);

  std::uint64_t system_hz() const;
  std::uint64_t processor_hz() const;  ///< HCLK
  std::uint64_t apb1_hz() const;
  std::uint64_t timer_hz() const;  ///< of the timers on APB1
  std::uint64_t fdcan_hz() const;  ///< 0: its source does not run
  bool runs_from_crystal() const { return (configuration_ & 0b11) == 0b11 && (pll_ & 0b11) == 0b11; }

  enum class Gate { gpio_a, gpio_b, tim2, tim6, fdcan, power };
  /// Whether the peripheral answers; too early after its clock was enabled is a violation.
  bool clocked(Gate gate, Time now);
  bool dead_battery_pull_downs() const { return (power3_ >> 14 & 1U) == 0; }
  bool boost() const { return (power5_ >> 8 & 1U) == 0; }
  std::uint32_t wait_states() const { return access_ & 0xfU; }

 private:
  bool crystal_runs(Time now) const;
  bool pll_runs(Time now) const;
  std::uint64_t pll_hz(std::uint32_t divider) const;
  void write_control(std::uint32_t value, Time now);
  void write_configuration(std::uint32_t value, Time now);
  void write_pll(std::uint32_t value, Time now);
  void check_speed(std::uint64_t from_hz);

  Complaint complain_;
  Oscillators oscillators_;
  std::uint32_t control_ = 0, configuration_ = 0, pll_ = 0, ahb1_ = 0, ahb2_ = 0, apb1_ = 0, kernel_clocks_ = 0;
  std::uint32_t status_ = 0, access_ = 0, power1_ = 0, power3_ = 0, power5_ = 0;
  Time crystal_since_ = never, pll_since_ = never, half_since_ = 0, gates_since_ = 0;
  std::uint32_t new_gates_ahb2_ = 0, new_gates_apb1_ = 0;
};

/// FLASH_ECCR: double words that cannot be corrected are an NMI.
class FlashEcc {
 public:
  bool dual_bank = true;  ///< OPTR.DBANK as the part is shipped
  void reset() { register_ = 0; }
  std::uint32_t read() const { return register_; }
  void write(std::uint32_t value);
  /// The double word at this offset of the flash was read and is torn.
  void detects(std::uint32_t offset);
  bool interrupt() const { return (register_ & (detected | detected2)) != 0; }

 private:
  static constexpr std::uint32_t detected = 1U << 31, corrected = 1U << 30, detected2 = 1U << 29, corrected2 = 1U << 28;
  std::uint32_t register_ = 0;
};

/// One port. Pins that nothing drives and nothing pulls read as they did last.
class GpioPort {
 public:
  struct Edge {
    Time at = 0;
    std::uint32_t pin = 0;
    bool level = false;
  };
  GpioPort(Complaint complain, char name) : complain_(std::move(complain)), name_(name) {}
  void reset();
  std::uint32_t read(Offset offset) const;
  void write(Offset offset, std::uint32_t value, Time now);
  void drive(std::uint32_t pin, std::optional<bool> level) { driven_[pin] = level; }
  /// A pull-down that is not the port's.
  void pull_down(std::uint32_t pin, bool on) { foreign_pull_down_[pin] = on; }

  std::uint32_t mode(std::uint32_t pin) const { return registers_[0] >> 2 * pin & 0b11; }
  std::uint32_t pull(std::uint32_t pin) const { return registers_[3] >> 2 * pin & 0b11; }
  std::uint32_t function(std::uint32_t pin) const { return registers_[8 + pin / 8] >> 4 * (pin % 8) & 0xf; }
  /// Nothing where the pin is an input that floats.
  std::optional<bool> level(std::uint32_t pin) const;
  std::vector<Edge> edges;  ///< of pins that are outputs

 private:
  Complaint complain_;
  char name_;
  std::array<std::uint32_t, 11> registers_{};
  std::array<std::optional<bool>, 16> driven_{};
  std::array<bool, 16> foreign_pull_down_{};
};

/// TIM2 (32 bits) and TIM6 (16 bits), counting up, the prescaler taken at an update.
class Timer {
 public:
  Timer(Complaint complain, int bits) : complain_(std::move(complain)), mask_(bits == 32 ? UINT32_MAX : 0xffff) {}
  void reset();
  /// The clock changes: what was counted so far stays.
  void set_clock(std::uint64_t hz, Time now);
  std::uint32_t read(Offset offset, Time now);
  void write(Offset offset, std::uint32_t value, Time now);
  Time next_event() const;
  void happen(Time now);
  bool interrupt() const { return (status_ & interrupts_ & 1U) != 0; }

 private:
  std::uint64_t counted(Time now) const;
  void rebase(Time now);
  Complaint complain_;
  std::uint32_t mask_;
  std::uint64_t hz_ = 16'000'000;
  std::uint32_t control_ = 0, interrupts_ = 0, status_ = 0, prescaler_ = 0, taken_prescaler_ = 0, reload_ = 0;
  std::uint64_t count_ = 0;  ///< at since_
  Time since_ = 0;
};

/// The independent watchdog on its own oscillator.
class IndependentWatchdog {
 public:
  explicit IndependentWatchdog(Complaint complain) : complain_(std::move(complain)) {}
  void reset();
  void set_clock(std::uint64_t hz) { hz_ = hz; }
  std::uint32_t read(Offset offset, Time now) const;
  void write(Offset offset, std::uint32_t value, Time now);
  bool runs() const { return expires_ != never; }
  Time expires() const { return expires_; }
  Time period() const;

 private:
  Complaint complain_;
  std::uint64_t hz_ = 32'000;
  std::uint32_t prescaler_ = 0, reload_ = 0xfff;
  bool open_ = false;
  Time busy_until_ = 0, expires_ = never;
};

}  // namespace fxdyn::emulated
