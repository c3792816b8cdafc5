#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "model/table_page.hpp"

// How a host and a drive node talk over a serial line. A frame is a run of little-endian 32-bit words:
//   header (bytes: two sync bytes, type, number of payload words), payload, CRC-32 over header and payload.
//
//   host -> node                             node -> host
//   hello   -                                identity  Identity's members in their order
//   tick    sequence, (q, dq, ddq) x joints  torque    sequence, tau x outputs, saturations, cycles
//   reset   -                                reset     -
//                                            refused   sequence (0 if none), Refusal
// Numbers are the model's raw fixed-point integers. A frame that fails its CRC is dropped and counted, never answered.

namespace fxdyn::serial {

inline constexpr std::uint32_t protocol_version = 2;
inline constexpr std::array<std::uint8_t, 2> sync{0xA5, 0x5F};
inline constexpr std::size_t largest_payload = 255;  ///< words: one byte tells how many

enum class Type : std::uint8_t {
  hello = 0x01,
  tick = 0x02,
  reset = 0x03,
  identity = 0x81,
  torque = 0x82,
  reset_done = 0x83,
  refused = 0x84,
};

enum class Refusal : std::uint32_t { tables_invalid = 1, wrong_length = 2, unknown_type = 3 };

enum class NodeState : std::uint32_t { ready = 0, tables_invalid = 1 };

struct Identity {
  std::uint32_t protocol = protocol_version;
  std::uint32_t joints = 0;
  std::uint32_t layout_hash = 0;
  std::uint32_t tables_crc = 0;
  NodeState state = NodeState::ready;
  std::uint32_t corrupt_frames = 0;  ///< since start-up
  std::uint32_t outputs = 0;         ///< bit i: the node puts out the torque of joint i+1
};
inline constexpr std::size_t identity_words = 7;

/// Payload words of a tick and of its reply.
constexpr std::size_t tick_words(std::size_t joints) { return 1 + 3 * joints; }
constexpr std::size_t torque_words(std::size_t outputs) { return 3 + outputs; }
constexpr std::size_t frame_bytes(std::size_t payload_words) { return 4 * (payload_words + 2); }

namespace detail {
constexpr void store(std::span<std::uint8_t> bytes, std::uint32_t word) {
  for (std::size_t i = 0; i < 4; ++i) bytes[i] = static_cast<std::uint8_t>(word >> (8 * i));
}
constexpr std::uint32_t load(std::span<const std::uint8_t> bytes) {
  std::uint32_t word = 0;
  for (std::size_t i = 0; i < 4; ++i) word |= static_cast<std::uint32_t>(bytes[i]) << (8 * i);
  return word;
}
}  // namespace detail

/// Writes a frame to `out`, which must hold frame_bytes(payload.size()); returns that number.
constexpr std::size_t encode(Type type, std::span<const std::uint32_t> payload, std::span<std::uint8_t> out) {
  const std::array<std::uint8_t, 4> header{sync[0], sync[1], static_cast<std::uint8_t>(type),
                                           static_cast<std::uint8_t>(payload.size())};
  Crc32 crc;
  std::size_t at = 0;
  const auto put = [&](std::uint32_t word) {
    detail::store(out.subspan(at, 4), word);
    at += 4;
  };
  put(detail::load(header));
  crc.add(detail::load(header));
  for (const std::uint32_t word : payload) {
    put(word);
    crc.add(word);
  }
  put(crc.value());
  return at;
}

template <std::size_t max_words>
struct Frame {
  Type type{};
  std::size_t size = 0;
  std::array<std::uint32_t, max_words> words{};
  std::span<const std::uint32_t> payload() const { return {words.data(), size}; }
};

/// Finds the valid frames in a byte stream. After a damaged one it looks again from the byte behind the false start, so
/// that no complete frame that follows is lost.
template <std::size_t max_words>
class FrameReader {
 public:
  static_assert(max_words <= largest_payload);

  /// How many bytes push() takes now; at least one after next() has returned false.
  std::size_t space() const { return buffer_.size() - (end_ - begin_); }

  void push(std::span<const std::uint8_t> bytes) {
    std::copy(buffer_.begin() + begin_, buffer_.begin() + end_, buffer_.begin());
    end_ -= begin_;
    begin_ = 0;
    std::copy(bytes.begin(), bytes.end(), buffer_.begin() + end_);
    end_ += bytes.size();
  }

  /// The next valid frame; false: more bytes are needed.
  bool next(Frame<max_words>& frame) {
    for (;; lose_byte()) {
      const std::size_t available = end_ - begin_;
      if (available > 0 && buffer_[begin_] != sync[0]) continue;
      if (available > 1 && buffer_[begin_ + 1] != sync[1]) continue;
      if (available < 4) return false;
      const std::size_t size = buffer_[begin_ + 3];
      if (size > max_words) continue;
      if (available < frame_bytes(size)) return false;
      if (!decode(size, frame)) continue;
      begin_ += frame_bytes(size);
      in_sync_ = true;
      return true;
    }
  }

  /// How often the stream was damaged: each loss of synchronisation counts once.
  std::uint32_t corrupt_frames() const { return corrupt_frames_; }

 private:
  std::uint32_t word(std::size_t i) const { return detail::load(std::span{buffer_}.subspan(begin_ + 4 * i, 4)); }

  bool decode(std::size_t size, Frame<max_words>& frame) const {
    Crc32 crc;
    crc.add(word(0));
    for (std::size_t i = 0; i < size; ++i) crc.add(frame.words[i] = word(1 + i));
    frame.type = static_cast<Type>(buffer_[begin_ + 2]);
    frame.size = size;
    return crc.value() == word(1 + size);
  }

  void lose_byte() {
    ++begin_;
    corrupt_frames_ += in_sync_ ? 1 : 0;
    in_sync_ = false;
  }

  std::array<std::uint8_t, frame_bytes(max_words)> buffer_{};
  std::size_t begin_ = 0, end_ = 0;
  std::uint32_t corrupt_frames_ = 0;
  bool in_sync_ = true;
};

}  // namespace fxdyn::serial
