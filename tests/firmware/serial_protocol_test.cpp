#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <random>
#include <span>
#include <vector>

#include "firmware/protocol/serial_protocol.hpp"

namespace fxdyn::serial {
namespace {

constexpr std::size_t words = 19;
using Reader = FrameReader<words>;
using Bytes = std::vector<std::uint8_t>;

Bytes frame(Type type, const std::vector<std::uint32_t>& payload) {
  Bytes bytes(frame_bytes(payload.size()));
  EXPECT_EQ(encode(type, payload, bytes), bytes.size());
  return bytes;
}

/// The standard's 32-bit generator returns a wider type.
struct Random {
  explicit Random(std::uint32_t seed) : generator(seed) {}
  std::uint32_t operator()() { return static_cast<std::uint32_t>(generator()); }
  std::mt19937 generator;
};

void append(Bytes& stream, const Bytes& more) { stream.insert(stream.end(), more.begin(), more.end()); }

/// All frames that the reader finds when the stream arrives in pieces of `piece` bytes.
std::vector<Frame<words>> read(Reader& reader, std::span<const std::uint8_t> stream, std::size_t piece = 64) {
  std::vector<Frame<words>> frames;
  Frame<words> found;
  while (!stream.empty()) {
    const std::size_t count = std::min({piece, stream.size(), reader.space()});
    EXPECT_GT(count, 0U);
    reader.push(stream.first(count));
    stream = stream.subspan(count);
    while (reader.next(found)) frames.push_back(found);
  }
  return frames;
}

std::vector<std::uint32_t> payload_of(const Frame<words>& f) { return {f.payload().begin(), f.payload().end()}; }

// The layout on the wire is the contract with other implementations.
TEST(SerialProtocol, BytesOnTheWire) {
  const Bytes bytes = frame(Type::tick, {0x04030201U});
  ASSERT_EQ(bytes.size(), 12U);
  EXPECT_EQ(Bytes(bytes.begin(), bytes.begin() + 8), (Bytes{0xA5, 0x5F, 0x02, 0x01, 0x01, 0x02, 0x03, 0x04}));
  // zlib.crc32(bytes.fromhex("a55f020101020304"))
  EXPECT_EQ(detail::load(std::span{bytes}.subspan(8, 4)), 0xB5C203B5U);
}

TEST(SerialProtocol, RoundTripInPiecesOfAnySize) {
  Bytes stream;
  std::vector<std::vector<std::uint32_t>> sent;
  for (std::uint32_t size = 0; size <= words; ++size) {
    std::vector<std::uint32_t> payload(size);
    for (std::uint32_t i = 0; i < size; ++i) payload[i] = 0x9E3779B9U * (i + size);
    append(stream, frame(Type::tick, payload));
    sent.push_back(payload);
  }
  for (const std::size_t piece : {1U, 2U, 3U, 7U, 64U, 1000U}) {
    Reader reader;
    const auto frames = read(reader, stream, piece);
    ASSERT_EQ(frames.size(), sent.size());
    for (std::size_t i = 0; i < sent.size(); ++i) EXPECT_EQ(payload_of(frames[i]), sent[i]);
    EXPECT_EQ(reader.corrupt_frames(), 0U);
  }
}

TEST(SerialProtocol, EveryBitFlipIsRejectedAndTheNextFrameFound) {
  const Bytes good = frame(Type::tick, {1, 2, 3, 4});
  const Bytes next = frame(Type::hello, {});
  for (std::size_t bit = 0; bit < 8 * good.size(); ++bit) {
    Bytes stream = good;
    stream[bit / 8] ^= static_cast<std::uint8_t>(1U << (bit % 8));
    // a longer length byte makes the reader wait for that many bytes
    for (int i = 0; i < 12; ++i) append(stream, next);
    Reader reader;
    const auto frames = read(reader, stream, 5);
    ASSERT_EQ(frames.size(), 12U) << "bit " << bit;
    for (const auto& f : frames) EXPECT_EQ(f.type, Type::hello) << "bit " << bit;
    EXPECT_EQ(reader.corrupt_frames(), 1U) << "bit " << bit;
  }
}

TEST(SerialProtocol, TruncatedFrameCostsNoOtherFrame) {
  const Bytes good = frame(Type::tick, std::vector<std::uint32_t>(words, 0x5FA55FA5U));  // sync bytes inside
  for (std::size_t kept = 1; kept < good.size(); ++kept) {
    Bytes stream(good.begin(), good.begin() + static_cast<std::ptrdiff_t>(kept));
    for (int i = 0; i < 3; ++i) append(stream, good);
    Reader reader;
    const auto frames = read(reader, stream, 11);
    EXPECT_EQ(frames.size(), 3U) << kept << " bytes kept";
    EXPECT_EQ(reader.corrupt_frames(), 1U) << kept << " bytes kept";
  }
}

// Whatever else is right: another protocol may have the same check sum.
TEST(SerialProtocol, AFrameBeginsWithBothSyncBytes) {
  for (const std::size_t at : {0U, 1U}) {
    Bytes bytes = frame(Type::tick, {0x04030201U});
    bytes[at] ^= 0x10;
    Crc32 crc;
    for (const std::size_t word : {0U, 4U}) crc.add(detail::load(std::span{bytes}.subspan(word, 4)));
    detail::store(std::span{bytes}.subspan(8, 4), crc.value());
    Reader reader;
    EXPECT_EQ(read(reader, bytes).size(), 0U) << at;
    EXPECT_EQ(reader.corrupt_frames(), 1U) << at;
  }
}

TEST(SerialProtocol, RandomBytesGiveNoFrame) {
  Random random(1);
  Reader reader;
  Bytes noise(200'000);
  for (auto& byte : noise) {
    const std::uint32_t r = random();
    byte = r % 4 == 0 ? sync[(r >> 8) % 2] : static_cast<std::uint8_t>(r >> 16);  // many false starts
  }
  EXPECT_EQ(read(reader, noise).size(), 0U);
  EXPECT_EQ(reader.corrupt_frames(), 1U);  // never in sync again
}

TEST(SerialProtocol, EveryUndamagedFrameOfANoisyStreamArrives) {
  Random random(2);
  Bytes stream;
  std::vector<std::vector<std::uint32_t>> expected;
  for (std::uint32_t k = 0; k < 3000; ++k) {
    std::vector<std::uint32_t> payload(random() % (words + 1));
    for (auto& word : payload) word = random();
    Bytes bytes = frame(Type::tick, payload);
    switch (random() % 5) {
      case 0:
        bytes[random() % bytes.size()] ^= static_cast<std::uint8_t>(1 + random() % 255);
        break;
      case 1:
        bytes.resize(random() % bytes.size());
        break;
      case 2:
        for (std::uint32_t i = random() % 20; i > 0; --i) stream.push_back(static_cast<std::uint8_t>(random()));
        [[fallthrough]];
      default:
        expected.push_back(payload);
    }
    append(stream, bytes);
  }
  stream.resize(stream.size() + frame_bytes(words));  // lets a damaged last frame end
  Reader reader;
  const auto frames = read(reader, stream, 13);
  ASSERT_EQ(frames.size(), expected.size());
  for (std::size_t i = 0; i < frames.size(); ++i) ASSERT_EQ(payload_of(frames[i]), expected[i]) << i;
  EXPECT_GT(reader.corrupt_frames(), 500U);
}

}  // namespace
}  // namespace fxdyn::serial
