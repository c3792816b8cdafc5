#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <optional>
#include <vector>

#include "hal/can.hpp"
#include "tests/emulated_g474/peripherals.hpp"

namespace fxdyn::emulated {

using Frame = hal::FdFrame;

/// What the wire carries besides frames: rates, and the transceiver's loop delay (255 ns at most, ISO 11898-2).
struct WireRates {
  std::uint64_t nominal = 1'000'000, data = 2'000'000;  ///< [bit/s]
  Time loop_delay = 200 * (second / 1'000'000'000);
};

/// FDCAN1 and its message RAM (RM0440, chapter 44), up to the frames it puts onto the wire and takes from it.
class Fdcan {
 public:
  static constexpr std::uint32_t ram_bytes = 0x350;

  explicit Fdcan(Complaint complain) : complain_(std::move(complain)) {}
  void power_on(std::uint32_t garbage);
  void reset();
  /// The kernel clock as it really is; 0: none.
  void set_clock(std::uint64_t hz) { hz_ = hz; }

  std::uint32_t read(Offset offset, Time now);
  void write(Offset offset, std::uint32_t value, Time now);
  std::uint32_t read_ram(Offset offset);
  void write_ram(Offset offset, std::uint32_t value);
  bool interrupt0() const { return (raised_on(0) && (line_enable_ & 1U) != 0); }
  bool interrupt1() const { return (raised_on(1) && (line_enable_ & 2U) != 0); }

  // --- the wire's side ---
  bool off() const { return init_ || bus_off_; }
  bool initialising() const { return init_; }
  Time joins_after() const { return joins_after_; }  ///< when INIT was cleared
  /// Sequences of 11 recessive bits before it takes part: 0 when it does.
  std::uint32_t sequences_left() const { return sequences_left_; }
  void recessive_sequences(std::uint32_t count);
  bool takes_part() const { return !init_ && sequences_left_ == 0; }
  /// The buffer that would be sent now.
  std::optional<std::uint32_t> candidate() const;
  Frame frame_in(std::uint32_t buffer) const;
  std::uint32_t arbitration_key(std::uint32_t buffer) const { return key(word(transmit_at + 72 * buffer)); }
  static std::uint32_t key(std::uint32_t head);
  void starts(std::uint32_t buffer) { in_flight_ = buffer; }
  void sent(std::uint32_t buffer);
  enum class Failure { bit, acknowledge };
  void failed(std::uint32_t buffer, Failure why);
  void arrives(const Frame& frame);
  void receives_error() { count_receive_error(); }
  /// Whether its bit timing can follow the wire's: rate and clock tolerance (ISO 11898-1, "oscillator tolerance").
  bool follows(const WireRates& wire, bool fd) const;
  /// Whether the transmitter sees its own data bits in spite of the transceiver's delay.
  bool sees_itself(const WireRates& wire) const;
  bool passive() const { return transmit_errors_ > 127 || receive_errors_ > 127; }
  bool fd_enabled() const { return (control_ & 1U << 8) != 0; }
  bool queue_mode() const { return (transmit_mode_ >> 24 & 1U) != 0; }

  std::uint32_t transmit_errors() const { return transmit_errors_; }
  std::uint32_t receive_errors() const { return receive_errors_; }
  bool bus_off() const { return bus_off_; }
  std::uint32_t pending() const { return pending_; }
  std::uint32_t nominal_timing() const { return nominal_; }
  std::uint32_t data_timing() const { return data_; }
  std::uint32_t delay_compensation() const { return delay_; }
  double bit_rate() const;
  double data_bit_rate() const;

 private:
  static constexpr Offset extended_at = 0x70, fifo_at = 0xb0, fifo_bytes = 3 * 72, events_at = 0x260,
                          transmit_at = 0x278;
  struct Fifo {
    std::uint32_t get = 0, level = 0;
  };
  std::uint32_t word(Offset offset) const { return ram_[offset / 4]; }
  bool open() const { return init_ && (control_ & 0b10) != 0; }
  bool raised_on(std::uint32_t line) const;
  void write_control(std::uint32_t value, Time now);
  void reset_fifos();
  void add_requests(std::uint32_t bits);
  void cancel(std::uint32_t bits);
  void free_buffer(std::uint32_t buffer);
  void acknowledge(std::uint32_t fifo, std::uint32_t index);
  std::uint32_t transmit_status() const;
  std::uint32_t protocol_status();
  void count_transmit_error();
  void count_receive_error();
  void update_state(bool was_passive, bool was_warning);
  /// FIFO that takes the frame; nothing: rejected.
  std::optional<std::uint32_t> filter(const Frame& frame) const;
  void store(std::uint32_t fifo, const Frame& frame);

  Complaint complain_;
  std::uint64_t hz_ = 0;
  std::array<std::uint32_t, ram_bytes / 4> ram_{};
  std::uint32_t control_ = 0, nominal_ = 0, data_ = 0, delay_ = 0, filters_ = 0, mask_ = 0, transmit_mode_ = 0,
                divider_ = 0;
  bool init_ = true;
  Time init_visible_ = 0;
  bool init_before_ = true;
  Time joins_after_ = 0;
  std::uint32_t interrupts_ = 0, enabled_ = 0, lines_ = 0, line_enable_ = 0;
  std::array<Fifo, 2> fifos_{};
  std::uint32_t put_ = 0, get_ = 0, pending_ = 0, occurred_ = 0, cancelled_ = 0, cancel_requests_ = 0;
  std::optional<std::uint32_t> in_flight_;
  std::uint32_t transmit_errors_ = 0, receive_errors_ = 0, logged_errors_ = 0, last_error_ = 7;
  bool bus_off_ = false;
  std::uint32_t sequences_left_ = 1;
};

/// The wire between the part and a host whose controller is perfect. Frames last as long as with every stuff bit that
/// can occur (firmware/bus_load.hpp); the lowest identifier wins the arbitration.
class Wire {
 public:
  struct Heard {
    Time at = 0;  ///< end of frame
    Frame frame;
  };

  explicit Wire(Fdcan& node) : node_(node) {}
  WireRates rates;
  std::uint32_t speed = 1;      ///< so many times as fast as its rates say, for tests that a full bus has no part in
  bool host_listens = true;     ///< and acknowledges
  bool stuck_dominant = false;  ///< a short circuit: nothing goes through, no bus idle either
  std::uint32_t disturbed = 0;  ///< so many of the part's next frames are destroyed
  std::vector<Heard> heard;     ///< frames of the part
  std::uint64_t lost_arbitrations = 0;

  void send(const Frame& frame, Time earliest) { queue_.push_back({earliest, frame}); }
  std::size_t waiting() const { return queue_.size() + (host_sends_ ? 1 : 0); }
  /// Does what is due; says when something is due next.
  Time happen(Time now);
  /// The part is powered off: what it sends is cut off.
  void power_off() { busy_until_ = 0, host_sends_ = node_sends_ = false; }

 private:
  Time duration(const Frame& frame) const;
  Time bit_time(std::uint32_t bits) const { return periods(bits, rates.nominal) / speed; }
  void finish();
  bool start(Time now);
  void count_idle(Time now);

  Fdcan& node_;
  struct Waiting {
    Time earliest;
    Frame frame;
  };
  std::deque<Waiting> queue_;
  Frame frame_;
  bool host_sends_ = false, node_sends_ = false;
  std::optional<Fdcan::Failure> failure_;  ///< of the part's frame that is under way
  std::uint32_t buffer_ = 0;
  Time busy_until_ = 0, idle_since_ = 0, idle_counted_ = 0;
};

}  // namespace fxdyn::emulated
