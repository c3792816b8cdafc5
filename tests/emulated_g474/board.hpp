#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "tests/emulated_g474/core.hpp"
#include "tests/emulated_g474/fdcan.hpp"
#include "tests/emulated_g474/image.hpp"
#include "tests/emulated_g474/peripherals.hpp"

namespace fxdyn::emulated {

/// An STM32G474 with 512 KB of flash and 128 KB of RAM, its pins and its bus. Everything is a function of the image and
/// of what a test does: no clock of the host, no random device.
class Board : private Surroundings {
 public:
  static constexpr Address flash_base = 0x0800'0000, ram_base = 0x2000'0000;
  static constexpr std::size_t flash_bytes = 512 * 1024, ram_bytes = 128 * 1024;

  explicit Board(const Image& image, Oscillators oscillators = {});

  /// RAM and message RAM hold garbage that depends on `seed`.
  void power_on(std::uint32_t seed = 1);
  void run(Time time);
  /// Until `done` or for `time`; whether it was done. Looked at every 10 us.
  template <class Condition>
  bool run_until(Condition done, Time time) {
    const Time end = now() + time;
    while (!done()) {
      if (now() >= end) return false;
      run(10 * microsecond);
    }
    return true;
  }
  Time now() const { return core.now(); }

  // --- flash as a programmer leaves it ---
  void program(const Image& image);
  void program(Address address, const std::vector<std::uint8_t>& bytes);
  void erase(Address begin, Address end);
  std::vector<std::uint8_t> flash(Address begin, std::size_t bytes) const;
  /// The double word at `address` was half programmed when the power went: what is read from it cannot be corrected.
  void tear(Address address);
  void mend() { torn_.clear(), watch(); }
  /// From here on the first time that data of [begin, end) is read is noted.
  void note_first_read(Address begin, Address end);
  struct FirstRead {
    Time at = 0;
    bool watchdog_runs = false;
    Time watchdog_expires = never;
  };
  const std::optional<FirstRead>& first_read() const { return first_read_; }

  // --- RAM as a debugger sees it ---
  std::uint32_t word(Address address) const;
  void set_word(Address address, std::uint32_t value);
  /// Lowest address in [begin, end) that was written since power-on; `end` where none was.
  Address lowest_written(Address begin, Address end) const;

  const std::vector<std::string>& violations() const { return violations_; }
  std::vector<std::string> take_violations() { return std::exchange(violations_, {}); }
  std::uint32_t watchdog_resets() const { return watchdog_resets_; }
  std::uint32_t resets() const { return resets_; }

  // Hidden or shown, the parts: in the order in which they are built.
 private:
  std::vector<std::uint8_t> flash_, ram_, garbage_;
  std::vector<std::string> violations_;
  Complaint complain_;
  Oscillators oscillators_;

 public:
  ClockTree clocks;
  FlashEcc ecc;
  GpioPort port_a, port_b;
  Timer tim2, tim6;
  IndependentWatchdog watchdog;
  Fdcan fdcan;
  Wire wire;
  Core core;

 private:
  std::optional<std::uint32_t> read(Address address) override;
  bool write(Address address, std::uint32_t value) override;
  void reads_flash(Address address) override;
  Time happen(Time now) override;
  void violates(const std::string& what) override;

  void reset(std::uint32_t flags);
  void follow_clocks();
  void follow_lines();
  void watch();
  bool pins_on_fdcan() const;

  std::set<Address> torn_;
  Address noted_begin_ = 0, noted_end_ = 0;
  std::optional<FirstRead> first_read_;
  std::uint32_t watchdog_resets_ = 0, resets_ = 0;
};

}  // namespace fxdyn::emulated
