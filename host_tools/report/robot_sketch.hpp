#pragma once

#include <string>
#include <vector>

#include "host_tools/report/joint_answer.hpp"
#include "host_tools/robot/robot.hpp"

namespace fxdyn {

/// The chain as an <svg> of lines between the joints' frames, seen from the side and above, in a pose in which the
/// joints lie apart. A joint is a numbered disc (prismatic: a square) of its mood's colour, with a stroke along its
/// axis. Nothing of the links' shape is known.
std::string robot_sketch(const Robot& robot, const std::vector<JointAnswer>& answers);

}  // namespace fxdyn
