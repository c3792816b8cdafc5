#pragma once

#include <array>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "host_tools/robot/robot.hpp"

namespace fxdyn {

struct JointGain;
struct Load;
struct LoadFit;

/// Content of payload.json: a load on the last link.
struct PayloadResult {
  struct Parameter {
    std::string name, unit;
    double value = 0, std = 0;
    bool identifiable = false;
  };
  /// What the model misses [N*m | N], see LoadFit, and how friction changed with the load.
  struct Joint {
    std::string name, unit;
    double residual_before = 0, residual_after = 0, residual_with_model = 0;
    double coulomb_change = 0, coulomb_change_std = 0, offset_change = 0;
  };
  std::string link;
  std::array<Parameter, 10> parameters;  ///< mass, centre, tensor about the centre, in the link's URDF frame
  bool constrained = false;
  std::vector<Joint> joints;
};

/// Content of payload.json where the load was known: the gains of the joints' torques.
struct GainResult {
  struct Joint {
    std::string name, unit;
    bool felt = false;           ///< else its gain is unknown and stays as it is
    double factor = 1, std = 0;  ///< see JointGain [-]
    double load_rms = 0;         ///< torque of the load [N*m | N]
    double torque_gain = 1;      ///< for the project: what the log was read with, times the factor where it is known
  };
  std::string link;
  double mass = 0;              ///< [kg]
  std::array<double, 3> com{};  ///< in the link's URDF frame [m]
  std::vector<Joint> joints;
};
/// @param gain what the logs were read with; empty: 1
GainResult gain_result(const std::vector<JointGain>& gains, const Load& load, const Robot& robot,
                       const std::vector<double>& gain);
nlohmann::json to_json(const GainResult& result);
GainResult gains_of(const nlohmann::json& file);

PayloadResult payload_result(const LoadFit& fit, const Robot& robot);
nlohmann::json to_json(const PayloadResult& result);
PayloadResult payload_of(const nlohmann::json& file);

}  // namespace fxdyn
