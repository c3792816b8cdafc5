#include "host_tools/update/update_result.hpp"

#include <nlohmann/json.hpp>

namespace fxdyn {
namespace {

using nlohmann::json;

json to_json(const UpdateResult::Change& change) { return {{"old", change.before}, {"new", change.after}}; }
json to_json(const UpdateResult::Page& page) {
  return {{"old", page.before}, {"new", page.after ? json(*page.after) : json(nullptr)}};
}

}  // namespace

json to_json(const UpdateResult& result) {
  json joints = json::array();
  for (std::size_t j = 0; j < result.joints.size(); ++j) {
    const UpdateResult::Joint& joint = result.joints[j];
    joints.push_back(
        {{"joint", joint.name},
         {"index", j + 1},
         {"unit", joint.unit},
         {"rated_torque", joint.rated_torque},
         {"rmse",
          {{"held_out", to_json(joint.held_out)}, {"test", joint.test ? to_json(*joint.test) : json(nullptr)}}}});
  }
  return {{"schema", "fxdyn.update/1"},
          {"log", result.log},
          {"hash", result.hash},
          {"refit_seconds", result.refit_s},
          {"held_out_seconds", result.held_out_s},
          {"forgetting", result.forgetting},
          {"joints", joints},
          {"mean_log_ratio", result.mean_log_ratio},
          {"tables_crc", to_json(result.tables_crc)},
          {"sequence", to_json(result.sequence)},
          {"accepted", result.accepted}};
}

}  // namespace fxdyn
