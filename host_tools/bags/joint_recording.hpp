#pragma once

#include <filesystem>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "host_tools/bags/bag.hpp"

namespace fxdyn {

/// Messages of one topic that name the same joints and carry the same fields: those of one publisher.
struct JointStream {
  std::vector<std::string> joints;
  std::vector<std::size_t> slots;            ///< of the fields, as slot_name() numbers them
  std::vector<std::int64_t> stamps_ns;       ///< of the headers; where those are 0, when they were recorded
  std::vector<std::vector<double>> columns;  ///< one a slot and joint, joints together
  bool by_log_time = false;
};

/// The joints of one topic.
struct JointTopic {
  std::string name, type;
  std::vector<JointStream> streams;
  std::size_t messages = 0;
  std::string trouble;  ///< why it can't be used; empty: it can
};

struct JointRecording {
  std::vector<JointTopic> topics;  ///< those of a type that is known
  std::vector<BagTopic> others;    ///< all other ones
  std::string note;                ///< what a user should know: the recording ends in the middle
};

/// What a bag has of joints. A message that can't be read is the trouble of its topic, not of the file.
/// @param topic the only one to read; empty: all
/// @throws InputError see read_bag()
JointRecording read_joint_recording(const std::filesystem::path& file, const std::string& topic = "");

/// Columns with one common time.
struct JointTable {
  std::vector<std::vector<double>> columns;  ///< t [s since the topic's first stamp], then those asked for
  std::string note;                          ///< streams that were put together
};

/// "t", then the names of all columns of a topic that hold a number anywhere.
std::vector<std::string> column_names(const JointTopic& topic);

/// Those columns ("JOINT.position") in rows of rising time. Where several publishers have them, each joint is taken
/// from the one that has most of what is asked for, and brought to the stamps of the fastest, by linear interpolation,
/// for as long as all of them were there. Empties the topic.
/// @throws InputError with `where` in front: mixed clocks, two rows of one time, a publisher that pauses
JointTable take_table(JointTopic& topic, const std::vector<std::string>& names, const std::string& where);

}  // namespace fxdyn
