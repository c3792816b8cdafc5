#pragma once

#include <string>
#include <vector>

#include "host_tools/effects/identified_model.hpp"

namespace fxdyn {

/// A model for planning, and what had to be assumed for it.
struct NominalModel {
  IdentifiedModel model;
  std::vector<std::string> assumptions;  ///< sentences for people
};

/// A robot before it was measured: inertias of the URDF; Coulomb friction of 3 % of rated torque and viscous friction
/// of 3 % at the velocity limit (geared drives: 1 .. 10 %); no offset, no rotor inertia; width of the Coulomb sign 0.5
/// % of the velocity limit. Where no link of the URDF has an inertia, generic ones: slender rods from joint to joint
/// (0.1 m long at the end), of one mass per length, such that gravity takes up to 30 % of the rated torque of the joint
/// that it loads most (10 kg/m where gravity loads none).
/// @param rated_torque [N*m | N] @param velocity limit [rad/s | m/s], one a joint
/// @throws InputError: another number of values than joints, or one that is not positive
NominalModel nominal_from_urdf(const Robot& robot, const std::vector<double>& rated_torque,
                               const std::vector<double>& velocity);

}  // namespace fxdyn
