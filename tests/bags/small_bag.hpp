#pragma once

#include <zlib.h>

#include <cstdint>
#include <cstring>
#include <map>
#include <string>
#include <vector>

namespace fxdyn::test {

/// Little endian bytes, one number after another.
class Bytes {
 public:
  template <class Number>
  Bytes& add(Number number) {
    text_.append(reinterpret_cast<const char*>(&number), sizeof number);
    return *this;
  }
  Bytes& raw(const std::string& bytes) {
    text_ += bytes;
    return *this;
  }
  /// With its size in front.
  Bytes& text(const std::string& bytes) { return add(static_cast<std::uint32_t>(bytes.size())).raw(bytes); }
  Bytes& align(std::size_t to, std::size_t from = 0) {
    while ((text_.size() - from) % to != 0) text_ += '\0';
    return *this;
  }
  const std::string& get() const { return text_; }

 private:
  std::string text_;
};

using Reals = std::vector<double>;

/// sensor_msgs/msg/JointState in little endian CDR.
inline std::string joint_state(std::int64_t stamp_ns, const std::vector<std::string>& names, const Reals& position,
                               const Reals& velocity, const Reals& effort) {
  Bytes out;
  out.raw(std::string("\0\1\0\0", 4));
  out.add(static_cast<std::int32_t>(stamp_ns / 1'000'000'000))
      .add(static_cast<std::uint32_t>(stamp_ns % 1'000'000'000));
  out.text(std::string("world", 6)).align(4, 4).add(static_cast<std::uint32_t>(names.size()));
  for (const std::string& name : names) out.align(4, 4).text(name + '\0');
  for (const Reals& values : {position, velocity, effort}) {
    out.align(4, 4).add(static_cast<std::uint32_t>(values.size()));
    if (!values.empty()) out.align(8, 4);
    for (const double value : values) out.add(value);
  }
  return out.get();
}

/// An MCAP file: two messages a chunk, uncompressed, with the summary of https://mcap.dev/spec.
class SmallBag {
 public:
  /// @returns the channel's id
  std::uint16_t channel(const std::string& topic, const std::string& type, const std::string& definition = "",
                        const std::string& encoding = "cdr") {
    const auto id = static_cast<std::uint16_t>(++channels_);
    declared_ += record(3, Bytes().add(id).text(type).text("ros2msg").text(definition).get());
    declared_ += record(4, Bytes().add(id).add(id).text(topic).text(encoding).add(std::uint32_t{0}).get());
    return id;
  }
  void message(std::uint16_t channel, std::int64_t log_time_ns, const std::string& data) {
    chunk_ += record(5, Bytes().add(channel).add(std::uint32_t{0}).add(log_time_ns).add(log_time_ns).raw(data).get());
    ++counts_[channel];
    in_chunk_[channel] = 0;
    if (++waiting_ == 2) flush();
  }
  /// In an encoding that the chunk names but does not have.
  void name_compression(const std::string& name) { compression_ = name; }
  /// A number of messages that the statistics claim in addition.
  void claim_more(std::uint16_t channel, std::uint64_t more) { counts_[channel] += more; }

  std::string bytes() {
    flush();
    std::string out(magic);
    out += record(1, Bytes().text("ros2").text("small_bag").get());
    std::string index;
    for (const auto& [body, channels] : done_) {
      Bytes offsets;
      for (const auto& [id, at] : channels) offsets.add(id).add(static_cast<std::uint64_t>(at));
      index += record(8, Bytes()
                             .add(std::uint64_t{0})
                             .add(std::uint64_t{0})
                             .add(static_cast<std::uint64_t>(out.size()))
                             .add(static_cast<std::uint64_t>(body.size()))
                             .text(offsets.get())
                             .add(std::uint64_t{0})
                             .text(compression_)
                             .add(std::uint64_t{0})
                             .add(std::uint64_t{0})
                             .get());
      out += body;
    }
    out += record(15, Bytes().add(std::uint32_t{0}).get());
    const auto summary = static_cast<std::uint64_t>(out.size());
    Bytes counts;
    for (const auto& [id, count] : counts_) counts.add(id).add(count);
    out += declared_;
    out += record(11, Bytes().raw(std::string(42, '\0')).text(counts.get()).get());
    out += index;
    out += record(2, Bytes().add(summary).add(std::uint64_t{0}).add(std::uint32_t{0}).get());
    return out + std::string(magic);
  }

 private:
  static constexpr std::string_view magic{"\x89MCAP0\r\n", 8};

  static std::string record(unsigned char op, const std::string& content) {
    return Bytes().add(op).add(static_cast<std::uint64_t>(content.size())).raw(content).get();
  }

  void flush() {
    if (chunk_.empty()) return;
    const std::string all = (done_.empty() ? declared_ : std::string()) + chunk_;
    const auto crc = static_cast<std::uint32_t>(
        ::crc32(0, reinterpret_cast<const Bytef*>(all.data()), static_cast<uInt>(all.size())));
    const std::string body = record(6, Bytes()
                                           .add(std::uint64_t{0})
                                           .add(std::uint64_t{0})
                                           .add(static_cast<std::uint64_t>(all.size()))
                                           .add(crc)
                                           .text(compression_)
                                           .add(static_cast<std::uint64_t>(all.size()))
                                           .raw(all)
                                           .get());
    done_.emplace_back(body, in_chunk_);
    chunk_.clear();
    in_chunk_.clear();
    waiting_ = 0;
  }

  int channels_ = 0, waiting_ = 0;
  std::string declared_, chunk_, compression_;
  std::map<std::uint16_t, std::uint64_t> counts_;
  std::map<std::uint16_t, int> in_chunk_;
  std::vector<std::pair<std::string, std::map<std::uint16_t, int>>> done_;
};

}  // namespace fxdyn::test
