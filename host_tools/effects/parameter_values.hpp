#pragma once

#include <optional>
#include <string_view>
#include <vector>

#include "host_tools/effects/joint_fit.hpp"

namespace fxdyn {

/// The side of the gearbox that every effect's torque is on.
inline constexpr std::string_view effects_side = "joint";

/// A parameter of a fitted effect as model.json and the report have it.
struct ParameterValue {
  std::string_view name, unit;
  double value = 0;
  std::optional<double> std;  ///< none: not estimated
};

/// All of an effect: shape parameters, coefficients, and the joint's sign width where the effect reads it.
std::vector<ParameterValue> parameter_values(const EffectFit& fit, const JointFit& joint, bool prismatic);

}  // namespace fxdyn
