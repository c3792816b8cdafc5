#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

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
constexpr std::uint8_t to_hex(std::uint32_t nibble) {
  return static_cast<std::uint8_t>(nibble < 10 ? '0' + nibble : 'A' + (nibble - 10));
}
/// The digit's value; 16 where it is none.
constexpr std::uint32_t from_hex(std::uint8_t c) {
  if (c >= '0' && c <= '9') return c - std::uint32_t{'0'};
  if (c >= 'A' && c <= 'F') return c - std::uint32_t{'A'} + 10;
  if (c >= 'a' && c <= 'f') return c - std::uint32_t{'a'} + 10;
  return 16;
}
}  // namespace detail

/// Writes the frame's line with its CR to `out`, which must hold longest_line bytes; returns the length, 0 where the
/// frame is none that SLCAN can carry (CAN FD, too long, identifier too large).
constexpr std::size_t encode(const ClassicFrame& frame, std::span<std::uint8_t> out) {
  if (frame.fd || frame.size > 8 || frame.id > (frame.extended ? 0x1fff'ffffU : 0x7ffU)) return 0;
  std::size_t at = 0;
  const char type = frame.remote ? (frame.extended ? 'R' : 'r') : (frame.extended ? 'T' : 't');
  out[at++] = static_cast<std::uint8_t>(type);
  for (int digit = frame.extended ? 8 : 3; digit-- > 0;) out[at++] = detail::to_hex(frame.id >> (4 * digit) & 0xf);
  out[at++] = detail::to_hex(frame.size);
  for (std::size_t i = 0; !frame.remote && i < frame.size; ++i) {
    out[at++] = detail::to_hex(frame.data[i] >> 4);
    out[at++] = detail::to_hex(frame.data[i] & 0xfU);
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

  Status send(const Frame& frame) {
    flush();
    std::array<std::uint8_t, slcan::longest_line> line;
    const std::size_t size = slcan::encode(frame, line);
    if (size == 0) return Status::failed;
    if (!open_ || !put(std::span{line}.first(size))) return Status::busy;
    flush();
    return Status::ok;
  }

  Status receive(Frame& frame) {
    flush();
    for (;;) {
      for (; begin_ < end_;) {
        const std::uint8_t byte = chunk_[begin_++];
        if (byte != slcan::carriage_return) {
          // A line that grows beyond every frame is dropped as a whole: its rest must not pass for a frame.
          if (size_ <= line_.size()) {
            if (size_ < line_.size()) line_[size_] = byte;
            ++size_;
          }
          continue;
        }
        const bool whole = size_ <= line_.size();
        const std::span<const std::uint8_t> line = std::span{line_}.first(whole ? size_ : 0);
        const bool empty = size_ == 0;
        size_ = 0;
        if (empty) continue;
        if (!whole) {
          ++lost_;
        } else if (slcan::decode(line, frame)) {
          if (open_) return Status::ok;
          put(std::span{&slcan::bell, 1});
        } else {
          obey(line);
        }
      }
      begin_ = 0;
      end_ = port_.read(chunk_);
      if (end_ > 0) continue;
      flush();  // answers to commands
      return Status::busy;
    }
  }

  CanErrors errors() { return {CanState::active, 0, 0, lost_}; }
  Status restart() { return Status::ok; }
  /// Nothing waits to be sent: the processor may sleep until a byte arrives.
  bool idle() {
    flush();
    return used_ == 0;
  }

 private:
  void obey(std::span<const std::uint8_t> line) {
    const auto answer = [&](const char* text) {
      std::size_t size = 0;
      while (text[size] != 0) ++size;
      std::array<std::uint8_t, 8> bytes{};
      for (std::size_t i = 0; i < size; ++i) bytes[i] = static_cast<std::uint8_t>(text[i]);
      put(std::span{bytes}.first(size));
    };
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

  /// Queues the bytes to be sent, all or none.
  bool put(std::span<const std::uint8_t> bytes) {
    if (bytes.size() > out_.size() - used_) return false;
    for (const std::uint8_t byte : bytes) out_[(first_ + used_++) % out_.size()] = byte;
    return true;
  }

  void flush() {
    while (used_ > 0) {
      const std::size_t until_wrap = out_.size() - first_;
      const std::size_t count = port_.write(std::span{out_}.subspan(first_, used_ < until_wrap ? used_ : until_wrap));
      if (count == 0) return;
      first_ = (first_ + count) % out_.size();
      used_ -= count;
    }
  }

  Port& port_;
  bool open_ = true;
  std::uint32_t lost_ = 0;
  std::array<std::uint8_t, slcan::longest_line - 1> line_{};
  std::size_t size_ = 0;  ///< of the line so far; beyond line_.size(): too long
  std::array<std::uint8_t, 32> chunk_{};
  std::size_t begin_ = 0, end_ = 0;
  std::array<std::uint8_t, 512> out_{};  ///< a power of two: no division; 18 frames
  std::size_t first_ = 0, used_ = 0;
};

}  // namespace fxdyn::hal
