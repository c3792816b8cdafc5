#pragma once

#include <optional>
#include <string>
#include <vector>

#include "host_tools/effects/forward.hpp"
#include "host_tools/identify/options.hpp"
#include "host_tools/regression/dataset.hpp"
#include "host_tools/robot/robot.hpp"

namespace fxdyn {

enum class Severity { error, warning };

/// Something about the data that no robot can be. `text` says what, why and what to do.
struct Suspicion {
  Severity severity = Severity::warning;
  std::optional<std::size_t> joint;  ///< from 0; none: the robot as a whole
  std::string text;
};

/// Signs and units of torque and gravity, by fits of its own over some hundred rows of the train logs (base parameters,
/// viscous, Coulomb, offset and rotor inertia of each joint):
/// - does another sign of one joint's torque, or of gravity, explain all joints together far better? A power of ten?
/// - is the joint's own inertia M_jj negative at nearly all poses, or its friction, by five standard deviations?
/// - does the mass that gravity and inertia ask for at least go with the size of the robot, and with its URDF?
/// `joints` gives the widths of the Coulomb sign. Empty where nothing is suspicious.
std::vector<Suspicion> check_plausible(const Robot& robot, const std::vector<ProcessedLog>& logs,
                                       const std::vector<JointFit>& joints, const PlausibleOptions& options = {});

}  // namespace fxdyn
