#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "host_tools/bags/bag.hpp"
#include "host_tools/bags/cdr.hpp"

namespace fxdyn {

/// One number a joint that a message carries.
enum class JointField : std::uint8_t { position, velocity, acceleration, effort };
/// Where it comes from: measured (JointState, feedback, actual), asked for (reference, desired), or the controller's
/// own output.
enum class JointPart : std::uint8_t { measured, reference, command };
inline constexpr std::size_t joint_fields = 4, joint_parts = 3, joint_slots = joint_fields * joint_parts;

/// Of a part's field: the columns are called "JOINT.position", "JOINT.reference.velocity", "JOINT.command.effort".
std::string slot_name(std::size_t slot);

/// What one message says; kept from message to message, so that nothing is allocated anew.
struct JointMessage {
  std::int64_t stamp_ns = 0;  ///< of its header [ns]; 0: none was set
  std::vector<std::string_view> joints;
  std::array<std::vector<double>, joint_slots> values;  ///< empty: not in the message; else one a joint
};

/// Reads the messages of a topic: sensor_msgs/msg/JointState, or control_msgs/msg/JointTrajectoryControllerState in its
/// old form (desired, actual, error) and its new one (reference, feedback, error, output), as the definition in the bag
/// has them. Without a definition only what both have in common is read.
/// Source: the .msg files of ros2/common_interfaces and ros-controls/control_msgs.
class JointMessageReader {
 public:
  static bool knows(const std::string& type);
  /// @throws MessageError: another encoding than CDR, or a definition with other fields
  explicit JointMessageReader(const BagTopic& topic);
  /// @throws MessageError
  void read(std::string_view bytes, JointMessage& out) const;

 private:
  enum class Layout : std::uint8_t { joint_state, points };
  Layout layout_ = Layout::joint_state;
  std::vector<int> points_;  ///< of the controller's points, in their order: the JointPart, or -1 for none
};

}  // namespace fxdyn
