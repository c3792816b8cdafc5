#pragma once

#include <filesystem>

#include "host_tools/logs/log.hpp"
#include "host_tools/readers/log_reader.hpp"
#include "host_tools/readers/truth.hpp"
#include "host_tools/robot/robot.hpp"

namespace fxdyn::campaign {

/// A log of `fxdyn simulate` with exact motion.
inline Log read_exact(const std::filesystem::path& file, const Robot& robot) {
  std::vector<bool> turns;
  for (const Joint& joint : robot.joints) turns.push_back(joint.type == JointType::revolute);
  return read_log(file, robot.size(), turns, {}, {}, {});
}

}  // namespace fxdyn::campaign
