#include "host_tools/regression/metrics_result.hpp"

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "host_tools/regression/physical.hpp"
#include "host_tools/support/json_number.hpp"

namespace fxdyn {
namespace {

using nlohmann::json;

json figure_json(const BodyFigure& figure, const char* unit) {
  return {{"value", figure.value},
          {"unit", unit},
          {"data_share", figure.data_share},
          {"determined", figure.data_share >= determined_share}};
}
BodyFigure figure_of(const json& file) { return {number_of(file.at("value")), number_of(file.at("data_share"))}; }

json figures_json(const std::array<BodyFigure, 3>& figures, const char* unit) {
  return {figure_json(figures[0], unit), figure_json(figures[1], unit), figure_json(figures[2], unit)};
}
std::array<BodyFigure, 3> figures_of(const json& file) {
  return {figure_of(file.at(0)), figure_of(file.at(1)), figure_of(file.at(2))};
}

json physical_json(const PhysicalResult& result) {
  json links = json::array();
  for (const LinkResult& link : result.links) {
    links.push_back({{"link", link.link},
                     {"index", links.size() + 1},
                     {"mass", figure_json(link.mass, "kg")},
                     {"centre", figures_json(link.centre, "m")},
                     {"first_moment", figures_json(link.first_moment, "kg m")},
                     {"smallest_eigenvalue", link.smallest_eigenvalue}});
    if (link.urdf)
      links.back()["urdf"] = {
          {"mass", link.urdf->mass}, {"centre", link.urdf->centre}, {"first_moment", link.urdf->first_moment}};
  }
  json out = {{"constrained", result.constrained},
              {"prior", result.prior},
              {"mass", figure_json(result.mass, "kg")},
              {"links", links}};
  if (result.urdf_mass) out["urdf_mass"] = *result.urdf_mass;
  return out;
}

PhysicalResult physical_of(const json& file) {
  PhysicalResult out{file.at("constrained"), file.at("prior"), figure_of(file.at("mass")), {}, {}};
  if (file.contains("urdf_mass")) out.urdf_mass = file.at("urdf_mass").get<double>();
  for (const json& link : file.at("links")) {
    out.links.push_back({link.at("link"),
                         figure_of(link.at("mass")),
                         figures_of(link.at("centre")),
                         figures_of(link.at("first_moment")),
                         number_of(link.at("smallest_eigenvalue")),
                         {}});
    if (!link.contains("urdf")) continue;
    const json& urdf = link.at("urdf");
    out.links.back().urdf = {urdf.at("mass"), urdf.at("centre"), urdf.at("first_moment")};
  }
  return out;
}

void add_fit(const FitResult& fit, json& out) {
  out["method"] = fit.method;
  out["condition_number"] = std::isfinite(fit.condition_number) ? json(fit.condition_number) : json(nullptr);
  json& weak = out["weak_parameters"] = json::array();
  for (const FitResult::Weak& one : fit.weak)
    weak.push_back(
        {{"parameter", one.parameter}, {"share_of_rated", one.share_of_rated}, {"joint_to_move", one.joint_to_move}});
  out["saturated_rows"] = fit.saturated_rows;
  if (fit.physical) out["physical"] = physical_json(*fit.physical);
  if (fit.recursion)
    out["recursive"] = {
        {"forgetting", fit.recursion->forgetting}, {"t", fit.recursion->t}, {"estimates", fit.recursion->estimates}};
}

FitResult fit_of(const json& file) {
  FitResult out{file.at("method"), number_of(file.at("condition_number")), {}, {}, {}, {}};
  for (const json& one : file.at("weak_parameters"))
    out.weak.push_back({one.at("parameter"), number_of(one.at("share_of_rated")), one.at("joint_to_move")});
  out.saturated_rows = file.at("saturated_rows").get<std::vector<std::int64_t>>();
  if (file.contains("physical")) out.physical = physical_of(file.at("physical"));
  if (!file.contains("recursive")) return out;
  const json& recursive = file.at("recursive");
  out.recursion = {recursive.at("forgetting"), recursive.at("t").get<std::vector<double>>(),
                   recursive.at("estimates").get<std::vector<std::vector<double>>>()};
  return out;
}

json choice_json(const TrainedJoint::Choice& choice) {
  json out = {{"by", choice.by},           {"nodes", choice.nodes},
              {"windows", choice.windows}, {"activation", choice.activation},
              {"inputs", choice.inputs},   {"ridge", choice.ridge},
              {"scale", choice.scale},     {"reference_velocity", choice.reference_velocity},
              {"J", choice.value}};
  if (choice.distances) out["distances"] = *choice.distances;
  if (choice.stribeck_velocity) out["stribeck_velocity"] = *choice.stribeck_velocity;
  if (choice.share) out["share"] = *choice.share;
  if (choice.generations) out["generations"] = *choice.generations;
  return out;
}

template <class T>
std::optional<T> if_there(const json& file, const char* key) {
  return file.contains(key) ? std::optional(file.at(key).get<T>()) : std::nullopt;
}

std::optional<TrainedJoint::Choice> choice_of(const json& file) {
  if (file.is_null()) return {};
  TrainedJoint::Choice out;
  out.by = file.at("by");
  out.nodes = file.at("nodes");
  out.windows = file.at("windows");
  out.activation = file.at("activation");
  out.inputs = file.at("inputs");
  out.ridge = number_of(file.at("ridge"));
  out.scale = number_of(file.at("scale"));
  out.reference_velocity = number_of(file.at("reference_velocity"));
  out.value = number_of(file.at("J"));
  out.distances = if_there<std::vector<double>>(file, "distances");
  out.stribeck_velocity = if_there<double>(file, "stribeck_velocity");
  out.share = if_there<double>(file, "share");
  out.generations = if_there<int>(file, "generations");
  return out;
}

json training_json(const std::vector<TrainedJoint>& joints) {
  json out = json::array();
  for (const TrainedJoint& joint : joints) {
    out.push_back({{"joint", joint.joint},
                   {"index", out.size() + 1},
                   {"unit", joint.unit},
                   {"held_out_without", joint.held_out_without},
                   {"held_out_with", joint.held_out_with},
                   {"kept", joint.kept},
                   {"evaluations", joint.evaluations},
                   {"choice", joint.choice ? choice_json(*joint.choice) : json(nullptr)}});
  }
  return out;
}

std::vector<TrainedJoint> training_of(const json& file) {
  std::vector<TrainedJoint> out;
  for (const json& joint : file) {
    out.push_back({joint.at("joint"), joint.at("unit"), number_of(joint.at("held_out_without")),
                   number_of(joint.at("held_out_with")), joint.at("kept"), joint.at("evaluations"),
                   choice_of(joint.at("choice"))});
  }
  return out;
}

}  // namespace

namespace {

json gate_errors_json(const std::vector<GateErrors>& joints) {
  json out = json::array();
  for (const GateErrors& joint : joints) {
    out.push_back({{"joint", joint.joint},
                   {"index", out.size() + 1},
                   {"unit", joint.unit},
                   {"friction", joint.friction ? json(*joint.friction) : json(nullptr)},
                   {"diagnosed", joint.diagnosed},
                   {"bls", joint.bls},
                   {"exported", joint.exported}});
  }
  return out;
}

std::vector<GateErrors> gate_errors_of(const json& file) {
  std::vector<GateErrors> out;
  for (const json& joint : file) {
    const json& friction = joint.at("friction");
    out.push_back({joint.at("joint"), joint.at("unit"), optional_of(friction), number_of(joint.at("diagnosed")),
                   number_of(joint.at("bls")), joint.at("exported")});
  }
  return out;
}

}  // namespace

PhysicalResult physical_result(const Robot& robot, const DhChain& chain, const PhysicalFit& fit) {
  const MassCheck check = mass_check(robot, chain, fit);
  PhysicalResult out{fit.constrained, fit.prior, {check.mass, check.mass_share}, check.urdf_mass, {}};
  for (std::size_t i = 0; i < check.links.size(); ++i) {
    const LinkMass& link = check.links[i];
    LinkResult one{link.link, {link.identified.mass, link.share.mass}, {}, {}, fit.smallest_eigenvalue[i], {}};
    const Eigen::Vector3d moment = link.identified.mass * link.identified.centre;
    for (Eigen::Index k = 0; k < 3; ++k) {
      one.centre[static_cast<std::size_t>(k)] = {link.identified.centre[k], link.share.centre[k]};
      one.first_moment[static_cast<std::size_t>(k)] = {moment[k], link.share.first_moment[k]};
    }
    if (link.urdf) {
      const Eigen::Vector3d &centre = link.urdf->centre, given = link.urdf->mass * centre;
      one.urdf = {link.urdf->mass, {centre[0], centre[1], centre[2]}, {given[0], given[1], given[2]}};
    }
    out.links.push_back(std::move(one));
  }
  return out;
}

json to_json(const MetricsResult& result) {
  json out = {{"schema", "fxdyn.metrics/1"}, {"logs", to_json(result.logs)}};
  if (!result.numbers.empty()) {
    out["numbers"] = result.numbers;
    return out;
  }
  out["gate"] = result.gate;
  out["base_parameters"] = result.base_parameters;
  out["notes"] = result.notes;
  out["stages"] = to_json(result.stages);
  if (result.fit) add_fit(*result.fit, out);
  if (result.training) out["training"] = training_json(*result.training);
  if (!result.gate_errors.empty()) out["gate_errors"] = gate_errors_json(result.gate_errors);
  return out;
}

MetricsResult metrics_of(const json& file) {
  MetricsResult out;
  out.logs = log_errors_of(file.at("logs"));
  if (file.contains("numbers")) {
    out.numbers = file.at("numbers");
    return out;
  }
  out.gate = file.at("gate");
  out.base_parameters = file.at("base_parameters");
  out.notes = file.at("notes").get<std::vector<std::string>>();
  out.stages = stages_of(file);
  if (file.contains("method")) out.fit = fit_of(file);
  if (file.contains("training")) out.training = training_of(file.at("training"));
  if (file.contains("gate_errors")) out.gate_errors = gate_errors_of(file.at("gate_errors"));
  return out;
}

}  // namespace fxdyn
