#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>

#include "model/wrapping.hpp"

namespace fxdyn {

/// What can be wrong with a node, in the order in which it is reported.
enum class Error : std::uint8_t {
  hardware,
  tables,
  update_refused,
  watchdog_reset,
  id_collision,
  heartbeat_lost,
  recovered_from_bus_off,
  error_passive,
  overrun,
  pdo_length,
  sync_length,
  setpoints_stale,
  sync_rate,
};

struct ErrorKind {
  std::uint16_t code = 0;      ///< EMCY, CiA 301 table 26
  std::uint8_t register_ = 0;  ///< bits of the error register 0x1001: 0 generic, 4 communication
  bool event = false;          ///< has no end of its own: counts as gone when it has not happened for a while
};
inline constexpr std::array<ErrorKind, 13> error_kinds{{{0x5000, 0x01, false},
                                                        {0x6320, 0x01, false},
                                                        {0x6320, 0x01, true},
                                                        {0x6010, 0x01, true},
                                                        {0x8150, 0x11, true},
                                                        {0x8130, 0x11, false},
                                                        {0x8140, 0x11, true},
                                                        {0x8120, 0x11, false},
                                                        {0x8110, 0x11, true},
                                                        {0x8210, 0x11, true},
                                                        {0x8240, 0x11, true},
                                                        {0x8250, 0x11, false},
                                                        {0x8700, 0x11, false}}};

/// Which errors are present, which of them still have to be reported, and the history of object 0x1003. An error is
/// reported once, however often it happens while it is present.
class ErrorLog {
 public:
  static constexpr std::size_t history_size = 8;
  static constexpr std::uint32_t event_us = 100'000;  ///< how long an event counts as present

  bool any() const { return present_ != 0; }
  bool is_present(Error error) const { return (present_ & bit(error)) != 0; }
  std::uint8_t error_register() const {
    std::uint8_t bits = 0;
    for (std::size_t i = 0; i < error_kinds.size(); ++i) {
      if ((present_ >> i & 1U) != 0) bits = static_cast<std::uint8_t>(bits | error_kinds[i].register_);
    }
    return bits;
  }

  /// @param detail which joint or node, or how many; goes into the EMCY and the history
  void raise(Error error, std::uint16_t detail, std::uint32_t now_us) {
    const auto i = static_cast<std::size_t>(error);
    last_us_[i] = now_us;
    if (is_present(error)) return;
    present_ |= bit(error);
    report(error, detail);
  }
  /// Reports an error that is present once more.
  void report(Error error, std::uint16_t detail) {
    const auto i = static_cast<std::size_t>(error);
    unreported_ |= bit(error);
    details_[i] = detail;
    for (std::size_t k = history_size - 1; k > 0; --k) history_[k] = history_[k - 1];
    history_[0] = error_kinds[i].code | static_cast<std::uint32_t>(detail) << 16;
    if (history_count_ < history_size) ++history_count_;
    reported_any_ = true;
  }
  void clear(Error error) { present_ &= ~bit(error); }

  /// Lets events end.
  void serve(std::uint32_t now_us) {
    for (std::uint32_t left = present_; left != 0; left &= left - 1) {
      const auto i = static_cast<std::size_t>(std::countr_zero(left));
      if (error_kinds[i].event && wrapping_subtract(now_us, last_us_[i]) >= event_us) present_ &= ~(1U << i);
    }
  }

  struct Message {
    std::uint16_t code = 0, detail = 0;
  };
  /// What has to be reported now, if anything: errors first, then that all are gone.
  bool next(Message& message) {
    if (unreported_ != 0) {
      const auto i = static_cast<std::size_t>(std::countr_zero(unreported_));
      unreported_ &= unreported_ - 1;
      message = {error_kinds[i].code, details_[i]};
      return true;
    }
    if (!reported_any_ || any()) return false;
    reported_any_ = false;
    message = {};
    return true;
  }

  std::uint8_t history_count() const { return history_count_; }
  std::uint32_t history(std::size_t i) const { return history_[i]; }
  void clear_history() { history_count_ = 0; }

 private:
  static constexpr std::uint32_t bit(Error error) { return 1U << static_cast<unsigned>(error); }

  std::uint32_t present_ = 0, unreported_ = 0;
  bool reported_any_ = false;  ///< and not yet that it is gone
  std::uint8_t history_count_ = 0;
  std::array<std::uint16_t, error_kinds.size()> details_{};
  std::array<std::uint32_t, error_kinds.size()> last_us_{};
  std::array<std::uint32_t, history_size> history_{};
};

}  // namespace fxdyn
