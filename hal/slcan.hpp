#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "hal/can.hpp"
#include "hal/serial.hpp"

// CAN over a serial line in ASCII, as the Lawicel CAN232 and after it the CANable and Linux' slcan speak it: one
// command a line, ended by a carriage return (CAN232 manual, "The available CANUSB/CAN232 commands").
//   tIIIL..  data frame, 3 hexadecimal digits of identifier, length, bytes     TIIIIIIIIL..  the same with 29 bits
//   rIIIL    remote frame                                                      RIIIIIIIIL
//   Sn bit rate, O open, C close, F status flags, V version, N serial number: answered by CR, a refusal by BEL

namespace fxdyn::hal::slcan {

inline constexpr std::uint8_t carriage_return = '\r', bell = '\a';
inline constexpr std::size_t longest_line = 1 + 8 + 1 + 16 + 1;  ///< T, identifier, length, eight bytes, CR

namespace detail {
inline constexpr std::array<std::uint8_t, 16> digits{'0', '1', '2', '3', '4', '5', '6', '7',
                                                     '8', '9', 'A', 'B', 'C', 'D', 'E', 'F'};
constexpr std::uint8_t to_hex(std::uint32_t nibble) { return digits[nibble & 0xf]; }

/// Values of hexadecimal digits; 16 of everything else.
inline constexpr auto values = [] {
  std::array<std::uint8_t, 256> table{};
  table.fill(16);
  for (std::uint8_t i = 0; i < 16; ++i) table[digits[i]] = i;
  for (std::uint8_t i = 10; i < 16; ++i) table[static_cast<std::size_t>('a' + i - 10)] = i;
  return table;
}();
constexpr std::uint32_t from_hex(std::uint8_t c) { return values[c]; }
}  // namespace detail

/// Whether SLCAN can carry the frame.
constexpr bool is_valid(const ClassicFrame& frame) {
  return !frame.fd && frame.size <= 8 && frame.id <= (frame.extended ? 0x1fff'ffffU : 0x7ffU);
}

/// Writes the frame's line with its CR to `out`, which must hold longest_line bytes; returns the length, 0 where the
/// frame is not valid.
constexpr std::size_t encode(const ClassicFrame& frame, std::span<std::uint8_t> out) {
  if (!is_valid(frame)) return 0;
  std::size_t at = 0;
  const char type = frame.remote ? (frame.extended ? 'R' : 'r') : (frame.extended ? 'T' : 't');
  out[at++] = static_cast<std::uint8_t>(type);
  for (int digit = frame.extended ? 8 : 3; digit-- > 0;) out[at++] = detail::to_hex(frame.id >> (4 * digit));
  out[at++] = detail::to_hex(frame.size);
  for (std::size_t i = 0; !frame.remote && i < frame.size; ++i) {
    out[at++] = detail::to_hex(frame.data[i] >> 4U);
    out[at++] = detail::to_hex(frame.data[i]);
  }
  out[at++] = carriage_return;
  return at;
}

/// Reads a frame's line, without its CR. False: it is none, in any respect; `frame` is then left alone.
constexpr bool decode(std::span<const std::uint8_t> line, ClassicFrame& frame) {
  if (line.empty()) return false;
  ClassicFrame read;
  switch (line[0]) {
    case 't':
      break;
    case 'T':
      read.extended = true;
      break;
    case 'r':
      read.remote = true;
      break;
    case 'R':
      read.extended = read.remote = true;
      break;
    default:
      return false;
  }
  const std::size_t digits = read.extended ? 8 : 3;
  if (line.size() < 1 + digits + 1) return false;
  for (std::size_t i = 0; i < digits; ++i) {
    const std::uint32_t nibble = detail::from_hex(line[1 + i]);
    if (nibble > 15) return false;
    read.id = read.id << 4 | nibble;
  }
  if (read.id > (read.extended ? 0x1fff'ffffU : 0x7ffU)) return false;
  const std::uint32_t size = detail::from_hex(line[1 + digits]);
  if (size > 8) return false;
  read.size = static_cast<std::uint8_t>(size);
  const std::span<const std::uint8_t> bytes = line.subspan(2 + digits);
  if (bytes.size() != (read.remote ? 0 : 2 * size)) return false;
  for (std::size_t i = 0; 2 * i < bytes.size(); ++i) {
    const std::uint32_t high = detail::from_hex(bytes[2 * i]), low = detail::from_hex(bytes[2 * i + 1]);
    if (high > 15 || low > 15) return false;
    read.data[i] = static_cast<std::uint8_t>(high << 4 | low);
  }
  frame = read;
  return true;
}

}  // namespace fxdyn::hal::slcan

namespace fxdyn::hal {

/// A CAN bus whose other end is a host's SLCAN driver: this side answers like an adapter. The channel is open from the
/// start, so that a node that was reset in mid-stream is heard again without the host's doing; C closes it, O opens it.
/// Frames from the host are not acknowledged one by one (Linux' driver does not wait for it). There is no bus, so no
/// error counters; a line that is no frame and no command counts as lost.
template <SerialPort Port>
class SlcanBus {
 public:
  using Frame = ClassicFrame;

  explicit constexpr SlcanBus(Port& port) : port_(port) {}

  /// Queues the frame as it is, like a controller; its text is made when the line takes it, in receive() and idle().
  Status send(const Frame& frame) {
    if (!slcan::is_valid(frame)) return Status::failed;
    if (!open_ || queued_ == queue_.size()) return Status::busy;
    queue_[(first_ + queued_++) % queue_.size()] = frame;
    return Status::ok;
  }

  Status receive(Frame& frame) {
    flush();
    for (;;) {
      at_ = static_cast<std::size_t>(std::find(in_.begin() + at_, in_.begin() + end_, slcan::carriage_return) -
                                     in_.begin());
      if (at_ == end_) {
        if (read_more()) continue;
        flush();  // answers to commands
        return Status::busy;
      }
      const std::span<const std::uint8_t> line = std::span{in_}.subspan(begin_, at_ - begin_);
      begin_ = ++at_;
      if (skipping_ || line.size() >= slcan::longest_line) {
        skipping_ = false;
        ++lost_;
      } else if (slcan::decode(line, frame)) {
        if (open_) return Status::ok;
        answer("\a");
      } else if (!line.empty()) {
        obey(line);
      }
    }
  }

  CanErrors errors() { return {CanState::active, 0, 0, lost_}; }
  Status restart() { return Status::ok; }
  /// Sends what the line takes. True: nothing waits, and the processor may sleep until a byte arrives.
  bool idle() {
    flush();
    return queued_ == 0 && out_begin_ == out_end_;
  }

 private:
  bool read_more() {
    if (end_ - begin_ >= slcan::longest_line) {
      // Beyond every frame: dropped as a whole, its rest must not pass for a line.
      skipping_ = true;
      begin_ = end_;
    }
    if (begin_ == end_ || end_ == in_.size()) {
      std::copy(in_.begin() + begin_, in_.begin() + end_, in_.begin());
      end_ -= begin_;
      begin_ = 0;
      at_ = end_;
    }
    const std::size_t count = port_.read(std::span{in_}.subspan(end_));
    end_ += count;
    return count > 0;
  }

  void obey(std::span<const std::uint8_t> line) {
    switch (line[0]) {
      case 'O':
        open_ = true;
        return answer("\r");
      case 'C':
        open_ = false;
        return answer("\r");
      case 'S':
        return answer("\r");  // there is no bit rate to set
      case 'F':
        return answer("F00\r");
      case 'V':
        return answer("V1013\r");
      case 'N':
        return answer("NFXDN\r");
      default:
        ++lost_;
        return answer("\a");
    }
  }

  /// An answer that finds no room is dropped: whoever asks that fast does not listen.
  void answer(std::string_view text) {
    if (out_.size() - out_end_ < text.size()) return;
    for (const char c : text) out_[out_end_++] = static_cast<std::uint8_t>(c);
  }

  void flush() {
    for (;;) {
      out_begin_ += port_.write(std::span{out_}.subspan(out_begin_, out_end_ - out_begin_));
      if (out_begin_ < out_end_) return;
      out_begin_ = out_end_ = 0;
      if (queued_ == 0) return;
      out_end_ = slcan::encode(queue_[first_], out_);
      first_ = (first_ + 1) % queue_.size();
      --queued_;
    }
  }

  Port& port_;
  bool open_ = true;
  bool skipping_ = false;  ///< a line too long, until its end
  std::uint32_t lost_ = 0;
  std::array<std::uint8_t, 128> in_{};
  std::size_t begin_ = 0, at_ = 0, end_ = 0;  ///< of the line that is looked for, how far, of what has been read
  std::array<Frame, 16> queue_{};             ///< a power of two: no division
  std::size_t first_ = 0, queued_ = 0;
  std::array<std::uint8_t, 64> out_{};  ///< a line and answers to commands
  std::size_t out_begin_ = 0, out_end_ = 0;
};
namespace detail {
struct NoLine {
  std::size_t read(std::span<std::uint8_t>) { return 0; }
  std::size_t write(std::span<const std::uint8_t>) { return 0; }
};
}  // namespace detail
static_assert(CanBus<SlcanBus<detail::NoLine>>);

}  // namespace fxdyn::hal
