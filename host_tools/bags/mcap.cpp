#include <fmt/format.h>
#include <zlib.h>

#include <algorithm>
#include <bit>
#include <cstring>
#include <map>
#include <memory>

#include "host_tools/bags/bag.hpp"
#include "host_tools/bytes/byte_file.hpp"
#include "host_tools/bytes/unpack.hpp"
#include "host_tools/support/error.hpp"

// MCAP, https://mcap.dev/spec: magic bytes, then records of an opcode, a length of 8 bytes and the content, all little
// endian; the last record is the footer, behind it the magic bytes again. A chunk holds records, compressed or not. The
// summary at the end repeats schemas and channels, and says which channels are in which chunk.

namespace fxdyn {
namespace {

static_assert(std::endian::native == std::endian::little);

constexpr std::string_view magic("\x89MCAP0\r\n", 8);
/// Of a chunk; a damaged length shall not ask for all memory. Writers make chunks of megabytes (rosbag2: 768 KiB).
constexpr std::uint64_t largest_chunk = std::uint64_t{1} << 30;

enum class Op : unsigned char {
  footer = 0x02,
  schema = 0x03,
  channel = 0x04,
  message = 0x05,
  chunk = 0x06,
  chunk_index = 0x08,
  statistics = 0x0B,
  data_end = 0x0F,
};
constexpr std::size_t record_head = 9;                 ///< opcode and length
constexpr std::size_t footer_size = record_head + 20;  ///< summary_start, summary_offset_start, crc
constexpr std::size_t message_head = 2 + 4 + 8 + 8;    ///< channel, sequence, log_time, publish_time

/// A field beyond the end of its record.
struct TooShort {};

/// The fields of a record, one after another.
class Fields {
 public:
  explicit Fields(std::string_view content) : rest_(content) {}
  template <class Number>
  Number number() {
    Number out;
    std::memcpy(&out, take(sizeof out).data(), sizeof out);
    return out;
  }
  std::uint16_t id() { return number<std::uint16_t>(); }
  std::uint64_t u64() { return number<std::uint64_t>(); }
  std::string_view bytes() { return take(number<std::uint32_t>()); }
  std::string text() { return std::string(bytes()); }
  std::string_view take(std::uint64_t count) {
    if (count > rest_.size()) throw TooShort();
    const std::string_view out = rest_.substr(0, count);
    rest_.remove_prefix(count);
    return out;
  }
  bool empty() const { return rest_.empty(); }
  std::string_view rest() const { return rest_; }

 private:
  std::string_view rest_;
};

struct Schema {
  std::string name, encoding, definition;
};

struct Channel {
  std::string topic;
  std::optional<std::size_t> number;  ///< the visitor's; none: it does not want it
  std::uint64_t read = 0;             ///< messages
};

class McapFile {
 public:
  McapFile(const std::filesystem::path& file, BagVisitor& visitor)
      : name_(file.string()), file_(file), visitor_(visitor) {
    const std::uint64_t size = file_.size();
    if (size < magic.size() || file_.bytes(0, magic.size()) != magic) damaged(0, "is of another version than MCAP 0");
    whole_ = size >= 2 * magic.size() && file_.bytes(size - magic.size(), magic.size()) == magic;
    end_.cut_where = file.filename().string();
  }

  BagEnd read() {
    if (whole_) read_summary();
    std::uint64_t at = magic.size();
    while (true) {
      if (!file_.holds(at, record_head)) return cut(at);
      Fields head(file_.bytes(at, record_head));
      const auto op = static_cast<Op>(head.number<unsigned char>());
      const auto length = head.u64();
      if (op == Op::data_end || op == Op::footer) break;
      const std::uint64_t content = at + record_head;
      if (!file_.holds(content, length)) return cut(at);
      if (!(op == Op::chunk && is_unwanted(at))) {
        try {
          read_record(op, content, length);
        } catch (const TooShort&) {
          damaged(at, "has a record that ends in the middle");
        }
      }
      at = content + length;
    }
    check_counts();
    return end_;
  }

 private:
  [[noreturn]] void damaged(std::uint64_t at, const std::string& what) const {
    throw InputError(
        fmt::format("{}: {} (at byte {}): copy it again, or repair it with `mcap recover`", name_, what, at));
  }

  /// A recording that was not closed: what is complete counts. With the bytes of the end in place it is damage.
  BagEnd cut(std::uint64_t at) {
    if (whole_) damaged(at, "has a record that is longer than the file");
    end_.cut = true;
    return end_;
  }

  void read_record(Op op, std::uint64_t content, std::uint64_t length) {
    switch (op) {
      case Op::schema:
        return add_schema(Fields(file_.bytes(content, length)));
      case Op::channel:
        return add_channel(Fields(file_.bytes(content, length)));
      case Op::chunk:
        return read_chunk(content, length);
      case Op::message: {
        // Of a camera's image only the first bytes are looked at.
        if (length < message_head) throw TooShort();
        Channel& channel = channel_of(Fields(file_.bytes(content, 2)).id(), content);
        if (channel.number) read_message(channel, Fields(file_.bytes(content, length)));
        return;
      }
      default:  // index, attachment, metadata, or of a later version: skipped, as the specification wants it
        return;
    }
  }

  void add_schema(Fields fields) {
    const std::uint16_t id = fields.id();
    Schema schema;
    schema.name = fields.text();
    schema.encoding = fields.text();
    schema.definition = fields.text();
    schemas_.insert_or_assign(id, std::move(schema));
  }

  void add_channel(Fields fields) {
    const std::uint16_t id = fields.id(), schema_id = fields.id();
    if (channels_.contains(id)) return;  // the summary has said so, or a chunk repeats it
    BagTopic topic;
    topic.name = fields.text();
    topic.encoding = fields.text();
    if (const auto schema = schemas_.find(schema_id); schema != schemas_.end()) {
      topic.type = schema->second.name;
      if (schema->second.encoding == "ros2msg") topic.definition = schema->second.definition;
    }
    channels_.emplace(id, Channel{topic.name, visitor_.wants(topic)});
  }

  Channel& channel_of(std::uint16_t id, std::uint64_t at) {
    const auto found = channels_.find(id);
    if (found == channels_.end())
      damaged(at, fmt::format("has a message of channel {}, which it does not declare", id));
    return found->second;
  }

  void read_message(Channel& channel, Fields fields) {
    fields.take(2 + 4);
    const auto log_time = static_cast<std::int64_t>(fields.u64());
    fields.u64();  // publish_time
    ++channel.read;
    visitor_.message(*channel.number, log_time, fields.rest());
  }

  /// message_start_time, message_end_time, uncompressed_size, uncompressed_crc, compression, records
  void read_chunk(std::uint64_t at, std::uint64_t length) {
    if (length > largest_chunk) damaged(at, "has a chunk that is too large");
    Fields fields(file_.bytes(at, length));
    fields.take(16);
    const std::uint64_t size = fields.u64();
    const auto crc = fields.number<std::uint32_t>();
    const std::string_view compression = fields.bytes();
    std::string_view records = fields.take(fields.u64());
    if (size > largest_chunk) damaged(at, "has a chunk that is too large");
    if (compression == "zstd" || compression == "lz4") {
      if (room_size_ < size) {
        room_.reset();
        room_ = std::unique_ptr<char[]>(new char[size]);  // not filled before it is used
        room_size_ = size;
      }
      const bool good = compression == "zstd" ? unpack_zstd_into(records, room_.get(), size)
                                              : unpack_lz4_into(records, room_.get(), size);
      if (!good) damaged(at, fmt::format("has a chunk that {} can't unpack", compression));
      records = {room_.get(), static_cast<std::size_t>(size)};
    } else if (!compression.empty()) {
      damaged(at, fmt::format("has a chunk compressed by '{}'; zstd, lz4 and none are read", compression));
    }
    const auto* const raw = reinterpret_cast<const Bytef*>(records.data());
    if (crc != 0 && ::crc32_z(0, raw, records.size()) != crc) damaged(at, "has a chunk whose checksum is another one");
    read_records(Fields(records), at);
  }

  void read_records(Fields records, std::uint64_t at) {
    while (!records.empty()) {
      const auto op = static_cast<Op>(records.number<unsigned char>());
      Fields content(records.take(records.u64()));
      if (op == Op::schema) add_schema(content);
      if (op == Op::channel) add_channel(content);
      if (op != Op::message) continue;
      if (content.rest().size() < message_head) throw TooShort();
      Channel& channel = channel_of(Fields(content).id(), at);
      if (channel.number) read_message(channel, content);
    }
  }

  /// From the footer: schemas, channels, and which channels are in which chunk. A summary that can't be read is as good
  /// as none: the records in front of it say the same.
  void read_summary() {
    const std::uint64_t footer = file_.size() - magic.size() - footer_size;
    if (file_.size() < 2 * magic.size() + footer_size) return;
    Fields fields(file_.bytes(footer, footer_size));
    if (static_cast<Op>(fields.number<unsigned char>()) != Op::footer || fields.u64() != 20) return;
    const std::uint64_t start = fields.u64();
    if (start == 0 || start > footer) return;
    try {
      read_summary_records(start, footer, {Op::schema});  // a channel names its schema
      read_summary_records(start, footer, {Op::channel, Op::chunk_index, Op::statistics});
    } catch (const TooShort&) {
      chunks_.clear();
    }
  }

  void read_summary_records(std::uint64_t at, std::uint64_t end, std::initializer_list<Op> wanted) {
    while (at + record_head <= end) {
      Fields head(file_.bytes(at, record_head));
      const auto op = static_cast<Op>(head.number<unsigned char>());
      const std::uint64_t length = head.u64();
      at += record_head;
      if (length > end - at) throw TooShort();
      if (std::find(wanted.begin(), wanted.end(), op) != wanted.end()) {
        if (op == Op::schema || op == Op::channel) read_record(op, at, length);
        if (op == Op::chunk_index) add_chunk_index(Fields(file_.bytes(at, length)));
        if (op == Op::statistics) add_statistics(Fields(file_.bytes(at, length)));
      }
      at += length;
    }
  }

  /// message_start_time, message_end_time, chunk_start_offset, chunk_length, message_index_offsets
  void add_chunk_index(Fields fields) {
    fields.take(16);
    const std::uint64_t start = fields.u64();
    fields.u64();
    Fields offsets(fields.bytes());
    std::vector<std::uint16_t>& ids = chunks_[start];
    while (!offsets.empty()) {
      ids.push_back(offsets.id());
      offsets.u64();
    }
  }

  /// message_count, schema_count, channel_count, attachment_count, metadata_count, chunk_count, message_start_time,
  /// message_end_time, channel_message_counts
  void add_statistics(Fields fields) {
    fields.take(8 + 2 + 4 + 4 + 4 + 4 + 8 + 8);
    Fields counts(fields.bytes());
    while (!counts.empty()) {
      const std::uint16_t id = counts.id();
      counts_[id] = counts.u64();
    }
  }

  /// Whether the summary says that nothing wanted is in the chunk. A chunk without an index of messages may hold any.
  bool is_unwanted(std::uint64_t at) const {
    const auto chunk = chunks_.find(at);
    if (chunk == chunks_.end() || chunk->second.empty()) return false;
    for (const std::uint16_t id : chunk->second) {
      const auto channel = channels_.find(id);
      if (channel == channels_.end() || channel->second.number) return false;
    }
    return true;
  }

  void check_counts() const {
    for (const auto& [id, channel] : channels_) {
      const auto count = counts_.find(id);
      if (!channel.number || count == counts_.end() || count->second == channel.read) continue;
      damaged(file_.size(), fmt::format("holds {} messages of {} where its statistics say {}", channel.read,
                                        channel.topic, count->second));
    }
  }

  std::string name_;
  ByteFile file_;
  BagVisitor& visitor_;
  BagEnd end_;
  bool whole_ = false;  ///< ends with the magic bytes
  std::map<std::uint16_t, Schema> schemas_;
  std::map<std::uint16_t, Channel> channels_;
  std::map<std::uint64_t, std::vector<std::uint16_t>> chunks_;  ///< begin -> channels that it holds
  std::map<std::uint16_t, std::uint64_t> counts_;
  std::unique_ptr<char[]> room_;
  std::size_t room_size_ = 0;
};

}  // namespace

BagEnd read_mcap(const std::filesystem::path& file, BagVisitor& visitor) { return McapFile(file, visitor).read(); }

}  // namespace fxdyn
