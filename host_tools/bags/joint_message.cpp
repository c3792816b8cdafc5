#include "host_tools/bags/joint_message.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

namespace fxdyn {
namespace {

constexpr std::array<const char*, joint_fields> field_names{"position", "velocity", "acceleration", "effort"};
constexpr std::array<const char*, joint_parts> part_names{"", "reference.", "command."};

std::size_t slot_of(JointPart part, JointField field) {
  return static_cast<std::size_t>(part) * joint_fields + static_cast<std::size_t>(field);
}

/// "sensor_msgs/msg/JointState" and "sensor_msgs/JointState" are one type.
std::string plain_type(std::string type) {
  if (const std::size_t at = type.find("/msg/"); at != std::string::npos) type.erase(at, 4);
  return type;
}
constexpr const char* joint_state = "sensor_msgs/JointState";
constexpr const char* controller_state = "control_msgs/JointTrajectoryControllerState";
constexpr const char* point = "trajectory_msgs/JointTrajectoryPoint";

struct Member {
  std::string type, name;
  bool operator==(const Member&) const = default;
};

/// Type and name of the fields of the first message in a definition, without comments and constants. What follows the
/// line of "=" are the types in it.
std::vector<Member> members_of(std::string_view definition) {
  std::vector<Member> out;
  while (!definition.empty()) {
    const std::size_t end = std::min(definition.find('\n'), definition.size());
    std::string_view line = definition.substr(0, end);
    definition.remove_prefix(std::min(end + 1, definition.size()));
    if (line.starts_with("===")) break;
    line = line.substr(0, line.find('#'));
    std::vector<std::string> words;
    for (std::size_t at = 0; (at = line.find_first_not_of(" \t\r", at)) != std::string_view::npos;) {
      const std::size_t stop = std::min(line.find_first_of(" \t\r", at), line.size());
      words.emplace_back(line.substr(at, stop - at));
      at = stop;
    }
    if (words.size() < 2 || words[1].find('=') != std::string::npos || (words.size() > 2 && words[2] == "=")) continue;
    out.push_back({plain_type(words[0]), words[1]});
  }
  return out;
}

void expect(const std::vector<Member>& members, const std::vector<Member>& wanted, const std::string& type) {
  for (std::size_t k = 0; k < wanted.size(); ++k) {
    const Member found = k < members.size() ? members[k] : Member{"nothing", ""};
    const bool same_type = found.type == wanted[k].type || wanted[k].type.ends_with('/' + found.type);
    if (same_type && found.name == wanted[k].name) continue;
    throw MessageError(fmt::format("is called {}, but its definition in the bag has '{} {}' where that has '{} {}'",
                                   type, found.type, found.name, wanted[k].type, wanted[k].name));
  }
}

int part_of(const std::string& name) {
  if (name == "actual" || name == "feedback") return static_cast<int>(JointPart::measured);
  if (name == "desired" || name == "reference") return static_cast<int>(JointPart::reference);
  if (name == "output") return static_cast<int>(JointPart::command);
  return -1;
}

void read_header(CdrReader& cdr, JointMessage& out) {
  const std::int64_t seconds = cdr.signed_32();
  out.stamp_ns = seconds * 1'000'000'000 + cdr.unsigned_32();
  cdr.string();  // frame_id
  cdr.strings(out.joints);
}

void check_size(const JointMessage& message, std::size_t slot) {
  const std::size_t size = message.values[slot].size();
  if (size != 0 && size != message.joints.size())
    throw MessageError(fmt::format("has {} names and {} values of {}", message.joints.size(), size, slot_name(slot)));
}

}  // namespace

std::string slot_name(std::size_t slot) {
  return std::string(part_names[slot / joint_fields]) + field_names[slot % joint_fields];
}

bool JointMessageReader::knows(const std::string& type) {
  return plain_type(type) == joint_state || plain_type(type) == controller_state;
}

JointMessageReader::JointMessageReader(const BagTopic& topic) {
  if (topic.encoding != "cdr")
    throw MessageError(
        fmt::format("is in encoding '{}'; CDR of ROS 2 is read: convert it with `rosbags-convert`", topic.encoding));
  const std::vector<Member> members = members_of(topic.definition);
  if (plain_type(topic.type) == joint_state) {
    if (!members.empty())
      expect(members,
             {{"std_msgs/Header", "header"},
              {"string[]", "name"},
              {"float64[]", "position"},
              {"float64[]", "velocity"},
              {"float64[]", "effort"}},
             topic.type);
    return;
  }
  layout_ = Layout::points;
  points_ = {static_cast<int>(JointPart::reference), static_cast<int>(JointPart::measured)};
  if (members.empty()) return;
  expect(members, {{"std_msgs/Header", "header"}, {"string[]", "joint_names"}}, topic.type);
  points_.clear();
  for (std::size_t k = 2; k < members.size(); ++k) {
    if (members[k].type != point && members[k].type != "JointTrajectoryPoint") break;
    points_.push_back(part_of(members[k].name));
  }
  if (std::find(points_.begin(), points_.end(), static_cast<int>(JointPart::measured)) == points_.end())
    throw MessageError(
        fmt::format("is called {}, but has neither 'actual' nor 'feedback' in its definition in the bag", topic.type));
}

void JointMessageReader::read(std::string_view bytes, JointMessage& out) const {
  CdrReader cdr(bytes);
  for (std::vector<double>& values : out.values) values.clear();
  read_header(cdr, out);
  if (layout_ == Layout::joint_state) {
    for (const JointField field : {JointField::position, JointField::velocity, JointField::effort}) {
      const std::size_t slot = slot_of(JointPart::measured, field);
      cdr.reals(out.values[slot]);
      check_size(out, slot);
    }
    return;
  }
  std::vector<double> unused;
  for (const int part : points_) {
    for (const JointField field :
         {JointField::position, JointField::velocity, JointField::acceleration, JointField::effort}) {
      const std::size_t slot = part < 0 ? 0 : slot_of(static_cast<JointPart>(part), field);
      cdr.reals(part < 0 ? unused : out.values[slot]);
      if (part >= 0) check_size(out, slot);
    }
    cdr.signed_32();  // time_from_start: sec, nanosec
    cdr.unsigned_32();
  }
}

}  // namespace fxdyn
