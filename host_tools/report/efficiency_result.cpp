#include "host_tools/report/efficiency_result.hpp"

#include "host_tools/support/json_number.hpp"

namespace fxdyn {
namespace {

using nlohmann::json;

json to_json(const EfficiencyPoint& point) {
  json errors;
  for (const auto& [method, error] : point.percent_rated) errors[method] = or_null(error);
  json out{{"seconds", point.seconds}, {"slow_share", point.slow_share}, {"percent_rated", errors}};
  if (!point.failed.empty()) out["failed"] = point.failed;
  return out;
}

EfficiencyPoint point_of(const json& file) {
  EfficiencyPoint out{.seconds = file.at("seconds"), .slow_share = file.at("slow_share")};
  for (const auto& [method, error] : file.at("percent_rated").items()) out.percent_rated[method] = optional_of(error);
  out.failed = file.value("failed", "");
  return out;
}

json to_json(const std::vector<EfficiencyPoint>& points) {
  json out = json::array();
  for (const EfficiencyPoint& point : points) out.push_back(to_json(point));
  return out;
}

std::vector<EfficiencyPoint> points_of(const json& file) {
  std::vector<EfficiencyPoint> out;
  for (const json& point : file) out.push_back(point_of(point));
  return out;
}

}  // namespace

json to_json(const EfficiencyResult& result) {
  return {{"schema", "fxdyn.efficiency/1"},
          {"project_hash", result.project_hash},
          {"made_from", result.made_from},
          {"curve", to_json(result.curve)},
          {"mix", to_json(result.mix)}};
}

EfficiencyResult efficiency_of(const json& file) {
  return {file.value("project_hash", ""), file.value("made_from", json()), points_of(file.at("curve")),
          points_of(file.at("mix"))};
}

}  // namespace fxdyn
