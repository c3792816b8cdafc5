#pragma once

#include <array>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "host_tools/robot/robot.hpp"

namespace fxdyn {

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
PayloadResult payload_result(const LoadFit& fit, const Robot& robot);
nlohmann::json to_json(const PayloadResult& result);
PayloadResult payload_of(const nlohmann::json& file);

}  // namespace fxdyn
