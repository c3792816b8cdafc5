#include "host_tools/forward/forward_result.hpp"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "host_tools/forward/forward.hpp"
#include "host_tools/logs/log.hpp"
#include "host_tools/support/json_number.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using nlohmann::json;

std::optional<double> rmse_of(const ForwardRun& run, Index joint) {
  return run.why_failed.empty() ? std::optional(run.rmse[joint]) : std::nullopt;
}

std::string in_table(const std::optional<double>& value) { return value ? fmt::format("{:.4g}", *value) : "failed"; }

}  // namespace

ForwardResult forward_result(const Forward& forward, const Robot& robot, const Log& log, Index given) {
  ForwardResult out{log.file.filename().string(),
                    given,
                    log.step_s * static_cast<double>(log.samples() - given),
                    {},
                    forward.open.why_failed,
                    forward.closed.why_failed};
  for (Index j = 0; j < log.joints(); ++j) {
    const Joint& joint = robot.joints[static_cast<std::size_t>(j)];
    out.joints.push_back({joint.name, joint.position_unit(), log.q.col(j).maxCoeff() - log.q.col(j).minCoeff(),
                          rmse_of(forward.open, j), rmse_of(forward.closed, j)});
  }
  return out;
}

json to_json(const ForwardResult& result) {
  json joints = json::array();
  for (const ForwardResult::Joint& joint : result.joints) {
    joints.push_back({{"joint", joint.name},
                      {"index", joints.size() + 1},
                      {"unit", joint.unit},
                      {"range", joint.range},
                      {"open_rmse", or_null(joint.open_rmse)},
                      {"closed_rmse", or_null(joint.closed_rmse)}});
  }
  json out = {{"schema", "fxdyn.forward/1"},
              {"log", result.log},
              {"given", result.given},
              {"simulated_s", result.simulated_s},
              {"joints", joints}};
  if (!result.why_open_failed.empty()) out["failed"]["open"] = result.why_open_failed;
  if (!result.why_closed_failed.empty()) out["failed"]["closed"] = result.why_closed_failed;
  return out;
}

ForwardResult forward_of(const json& file) {
  ForwardResult out{file.at("log"), file.at("given"), file.at("simulated_s"), {}, {}, {}};
  for (const json& joint : file.at("joints")) {
    out.joints.push_back({joint.at("joint"), joint.at("unit"), joint.at("range"), optional_of(joint.at("open_rmse")),
                          optional_of(joint.at("closed_rmse"))});
  }
  if (const auto failed = file.find("failed"); failed != file.end()) {
    out.why_open_failed = failed->value("open", "");
    out.why_closed_failed = failed->value("closed", "");
  }
  return out;
}

std::string forward_table(const ForwardResult& result) {
  std::string out =
      fmt::format("{}: {:.3g} s simulated, the first {} samples given\n{:<24} {:>12} {:>12} {:>12}\n", result.log,
                  result.simulated_s, result.given, "RMSE of the position", "open loop", "closed loop", "range");
  for (const ForwardResult::Joint& joint : result.joints) {
    out += fmt::format("{:<24} {:>12} {:>12} {:>12} {}\n", joint.name, in_table(joint.open_rmse),
                       in_table(joint.closed_rmse), in_table(joint.range), joint.unit);
  }
  if (!result.why_closed_failed.empty()) out += fmt::format("closed loop: {}\n", result.why_closed_failed);
  if (!result.why_open_failed.empty()) out += fmt::format("open loop: {}\n", result.why_open_failed);
  return out;
}

}  // namespace fxdyn
