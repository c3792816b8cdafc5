#include "host_tools/bags/joint_recording.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <map>

#include "host_tools/bags/joint_message.hpp"

namespace fxdyn {
namespace {

/// A header's stamp may move by that much more than the clock of the recorder between two messages [ns]: a busy network
/// delays messages by less, and two clocks differ by more (hand).
constexpr std::int64_t clock_jump_ns = 1'000'000'000;

/// Year 2116 [ns]: differences of stamps stay numbers.
constexpr std::int64_t latest_ns = std::int64_t{1} << 62;

/// Puts the messages of one topic into streams.
class TopicReader {
 public:
  explicit TopicReader(const BagTopic& topic) : out_{topic.name, topic.type, {}, 0, {}} {
    try {
      reader_.emplace(topic);
    } catch (const MessageError& error) {
      out_.trouble = error.what();
    }
  }

  void add(std::int64_t log_time_ns, std::string_view bytes) {
    ++out_.messages;
    if (!out_.trouble.empty()) return;
    try {
      reader_->read(bytes, message_);
      append(log_time_ns);
    } catch (const MessageError& error) {
      out_.trouble = fmt::format("message {} {}", out_.messages, error.what());
    }
  }

  JointTopic finish() { return std::move(out_); }

 private:
  struct Clock {
    std::int64_t stamp_ns, log_ns;
  };

  bool is_of(const JointStream& stream) const {
    if (stream.joints.size() != message_.joints.size()) return false;
    std::size_t next = 0;
    for (std::size_t slot = 0; slot < joint_slots; ++slot) {
      if (message_.values[slot].empty()) continue;
      if (next == stream.slots.size() || stream.slots[next] != slot) return false;
      ++next;
    }
    return next == stream.slots.size() &&
           std::equal(stream.joints.begin(), stream.joints.end(), message_.joints.begin());
  }

  std::size_t stream_of_message() {
    for (std::size_t k = 0; k < out_.streams.size(); ++k)
      if (is_of(out_.streams[k])) return k;
    constexpr std::size_t most = 64;  // publishers on one topic; a damaged bag may name a joint anew in every message
    if (out_.streams.size() == most) throw MessageError("names other joints than all messages before it");
    JointStream& stream = out_.streams.emplace_back();
    stream.joints.assign(message_.joints.begin(), message_.joints.end());
    for (std::size_t slot = 0; slot < joint_slots; ++slot)
      if (!message_.values[slot].empty()) stream.slots.push_back(slot);
    stream.columns.resize(stream.slots.size() * stream.joints.size());
    stream.by_log_time = message_.stamp_ns == 0;
    clocks_.push_back({message_.stamp_ns, 0});
    return out_.streams.size() - 1;
  }

  void check_clock(const JointStream& stream, Clock& clock, std::int64_t log_time_ns) const {
    if (stream.by_log_time != (message_.stamp_ns == 0))
      throw MessageError(stream.by_log_time ? "has a stamp in its header, and those before it have none"
                                            : "has no stamp in its header, and those before it have one");
    if (!stream.by_log_time && !stream.stamps_ns.empty()) {
      const double moved = static_cast<double>(message_.stamp_ns) - static_cast<double>(clock.stamp_ns);
      const double waited = static_cast<double>(log_time_ns) - static_cast<double>(clock.log_ns);
      if (std::abs(moved) > std::abs(waited) + clock_jump_ns)
        throw MessageError(
            fmt::format("has a stamp {:.9g} s {} the one before it, and was recorded {:.3g} s later: mixed clocks; "
                        "record one of them",
                        std::abs(moved) / 1e9, moved < 0 ? "before" : "behind", waited / 1e9));
    }
    clock = {message_.stamp_ns, log_time_ns};
  }

  void append(std::int64_t log_time_ns) {
    if (message_.joints.empty()) throw MessageError("names no joints");
    if (log_time_ns < 0 || log_time_ns > latest_ns) throw MessageError("was recorded at a time that is none");
    const std::size_t at = stream_of_message();
    JointStream& stream = out_.streams[at];
    check_clock(stream, clocks_[at], log_time_ns);
    stream.stamps_ns.push_back(stream.by_log_time ? log_time_ns : message_.stamp_ns);
    std::size_t column = 0;
    for (const std::size_t slot : stream.slots)
      for (const double value : message_.values[slot]) stream.columns[column++].push_back(value);
  }

  JointTopic out_;
  std::optional<JointMessageReader> reader_;
  JointMessage message_;
  std::vector<Clock> clocks_;  ///< of the last message of each stream
};

class Recorder : public BagVisitor {
 public:
  explicit Recorder(std::string topic) : topic_(std::move(topic)) {}

  std::optional<std::size_t> wants(const BagTopic& topic) override {
    if (const auto found = numbers_.find(topic.name); found != numbers_.end()) return found->second;
    std::optional<std::size_t>& number = numbers_[topic.name];
    if (JointMessageReader::knows(topic.type) && (topic_.empty() || topic.name == topic_)) {
      number = readers_.size();
      readers_.emplace_back(topic);
    } else {
      others_.push_back({topic.name, topic.type, topic.encoding, {}});
    }
    return number;
  }

  void message(std::size_t topic, std::int64_t log_time_ns, std::string_view bytes) override {
    readers_[topic].add(log_time_ns, bytes);
  }

  JointRecording finish() {
    JointRecording out;
    for (TopicReader& reader : readers_) out.topics.push_back(reader.finish());
    out.others = std::move(others_);
    return out;
  }

 private:
  std::string topic_;
  std::map<std::string, std::optional<std::size_t>> numbers_;
  std::vector<TopicReader> readers_;
  std::vector<BagTopic> others_;
};

}  // namespace

JointRecording read_joint_recording(const std::filesystem::path& file, const std::string& topic) {
  Recorder recorder(topic);
  const BagEnd end = read_bag(file, recorder);
  JointRecording out = recorder.finish();
  if (end.cut)
    out.note = fmt::format("{} ends in the middle, as a recording that was not closed: what is complete in it is used",
                           end.cut_where);
  return out;
}

}  // namespace fxdyn
