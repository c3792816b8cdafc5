#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <ostream>
#include <string>
#include <vector>

#include "firmware/protocol/object_dictionary.hpp"
#include "firmware/protocol/setpoint_codec.hpp"
#include "model/numbers.hpp"
#include "model/rigid_body.hpp"
#include "model/version.hpp"

// The drive node's object dictionary as files: EDS (CiA 306-1) for CANopen masters, DBC for bus analysers.

namespace fxdyn {

/// What the files say of one robot and one node.
struct BusDescription {
  struct Joint {
    double q_step = 1;                   ///< [rad | m] of one raw unit
    double dq_limit = 0, ddq_limit = 0;  ///< what 32768 means [rad/s | m/s], [rad/s^2 | m/s^2]
    double rated_torque = 0;             ///< [N*m | N]
    bool prismatic = false;
  };
  std::vector<Joint> joints;
  std::uint32_t outputs = 0;  ///< bit i: the node puts out the torque of joint i+1
  std::string software;       ///< version
  std::uint32_t revision = version_number;
  std::uint32_t tick_us = 0;  ///< of the tables

  dictionary::Extent extent() const { return {joints.size(), outputs}; }
};

template <class Model>
BusDescription describe(const typename Model::Parameters& parameters,
                        const std::array<std::int32_t, Model::joints>& rated_torque, const std::string& software) {
  using N = typename Model::Numbers;
  BusDescription description;
  description.outputs = Model::outputs_mask;
  description.software = software;
  description.tick_us =
      static_cast<std::uint32_t>(1e6 / std::ldexp(parameters.ticks_per_second.raw, -count_bits));  // as the node does
  for (std::size_t j = 0; j < Model::joints; ++j) {
    const auto& limits = parameters.constants[j].limits;
    description.joints.push_back(
        {std::ldexp(1.0, -Position<N>::bits),
         std::ldexp(whole_share(limits.dq_lower.raw, limits.dq_upper.raw), -Velocity<N>::bits),
         std::ldexp(whole_share(limits.ddq_lower.raw, limits.ddq_upper.raw), -Acceleration<N>::bits),
         1e-3 * rated_torque[j], parameters.geometry[j].type == JointType::prismatic});
  }
  return description;
}

void write_eds(const BusDescription& description, const std::string& file_name, std::ostream& out);

/// Setpoints, torques, SYNC, NMT, emergencies and heartbeats of a robot's bus. The node of the host is called HOST.
void write_dbc(const BusDescription& description, std::ostream& out);

}  // namespace fxdyn
