#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace fxdyn {

/// What is recorded of one topic.
struct BagTopic {
  std::string name;        ///< "/joint_states"
  std::string type;        ///< "sensor_msgs/msg/JointState"
  std::string encoding;    ///< of its messages: "cdr"
  std::string definition;  ///< of the type, as text of .msg files; empty: the bag does not say
};

/// Who reads a bag: says which topics it wants, and gets their messages in the order of the file.
class BagVisitor {
 public:
  virtual ~BagVisitor() = default;
  /// A number of its own for a topic that it wants. Asked once for every publisher or file of a bag.
  virtual std::optional<std::size_t> wants(const BagTopic& topic) = 0;
  /// @param topic the number that wants() gave @param log_time_ns when it was recorded [ns since 1970]
  virtual void message(std::size_t topic, std::int64_t log_time_ns, std::string_view bytes) = 0;
};

struct BagEnd {
  bool cut = false;       ///< the file ends in the middle: what was complete before that has been read
  std::string cut_where;  ///< the file of the bag that does
};

/// Whether that is a recording of ROS 2: MCAP or rosbag2's sqlite3, packed by zstd or not, or a folder with such files.
/// Looks at the first bytes; reads no pipe.
bool is_bag(const std::filesystem::path& file);

/// Reads a recording from its begin to its end, holding no more than a piece of it.
/// @throws InputError naming the file: it can't be read, is damaged, or its folder misses a part
BagEnd read_bag(const std::filesystem::path& file, BagVisitor& visitor);

/// The formats. MCAP: https://mcap.dev/spec; rosbag2_storage_sqlite3 of ROS 2: tables topics, messages,
/// message_definitions.
BagEnd read_mcap(const std::filesystem::path& file, BagVisitor& visitor);
BagEnd read_rosbag2(const std::filesystem::path& file, BagVisitor& visitor);

}  // namespace fxdyn
