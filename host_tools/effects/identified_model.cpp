#include "host_tools/effects/identified_model.hpp"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "host_tools/effects/braking.hpp"
#include "host_tools/effects/broad_learning_types.hpp"
#include "host_tools/effects/effects.hpp"
#include "host_tools/effects/link_parameters.hpp"
#include "host_tools/effects/model_identity.hpp"
#include "host_tools/effects/parameter_values.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/files.hpp"
#include "model/version.hpp"

namespace fxdyn {
namespace {

using nlohmann::json;

json vector_json(const Eigen::VectorXd& v) { return std::vector<double>(v.data(), v.data() + v.size()); }
Eigen::VectorXd to_vector(const json& j) {
  const auto values = j.get<std::vector<double>>();
  return Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
}
json matrix_json(const Eigen::MatrixXd& m) {
  json rows = json::array();
  for (Eigen::Index i = 0; i < m.rows(); ++i) rows.push_back(vector_json(m.row(i)));
  return rows;
}

json pose_json(const Eigen::Isometry3d& pose) { return matrix_json(pose.matrix().topRows<3>()); }
Eigen::Isometry3d to_pose(const json& j) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  for (int i = 0; i < 3; ++i) pose.matrix().row(i) = to_vector(j.at(static_cast<std::size_t>(i))).transpose();
  return pose;
}

json robot_json(const Robot& robot) {
  json joints = json::array();
  for (std::size_t i = 0; i < robot.size(); ++i) {
    const Joint& joint = robot.joints[i];
    joints.push_back(
        {{"joint", joint.name},
         {"index", i + 1},
         {"link", joint.link},
         {"type", joint.type == JointType::prismatic ? "prismatic" : (joint.continuous ? "continuous" : "revolute")},
         {"origin", pose_json(joint.origin)},
         {"axis", vector_json(joint.axis)}});
  }
  return {{"name", robot.name}, {"gravity", vector_json(robot.gravity)}, {"joints", joints}};
}

Robot to_robot(const json& j) {
  Robot robot;
  robot.name = j.at("name");
  robot.gravity = to_vector(j.at("gravity"));
  for (const json& entry : j.at("joints")) {
    Joint joint;
    joint.name = entry.at("joint");
    joint.link = entry.at("link");
    const std::string type = entry.at("type");
    joint.type = type == "prismatic" ? JointType::prismatic : JointType::revolute;
    joint.continuous = type == "continuous";
    joint.origin = to_pose(entry.at("origin"));
    joint.axis = to_vector(entry.at("axis"));
    robot.joints.push_back(joint);
  }
  return robot;
}

json effect_json(const EffectFit& fit, const JointFit& joint, bool prismatic) {
  json parameters = json::array();
  for (const ParameterValue& p : parameter_values(fit, joint, prismatic)) {
    parameters.push_back({{"name", p.name}, {"value", p.value}, {"unit", p.unit}});
    if (p.std) parameters.back()["std"] = *p.std;
  }
  const EffectInfo& info = *find_effect(fit.effect);
  return {{"effect", fit.effect},
          {"origin", fit.named    ? "named"
                     : info.curve ? "curve"
                                  : "nominal"},
          {"side", effects_side},
          {"equation", info.equation},
          {"parameters", parameters}};
}

EffectFit to_effect(const json& j) {
  EffectFit fit;
  fit.effect = j.at("effect");
  fit.named = j.at("origin") == "named";
  const EffectInfo* info = find_effect(fit.effect);
  if (info == nullptr) throw InputError(fmt::format("unknown effect '{}': made by another version?", fit.effect));
  std::size_t i = 0;
  for (const json& p : j.at("parameters")) {
    if (i < info->shape.size()) {
      fit.shape.push_back(p.at("value"));
      fit.shape_std.push_back(p.value("std", 0.0));
    } else if (i < info->shape.size() + info->linear.size()) {
      fit.linear.push_back(p.at("value"));
      fit.linear_std.push_back(p.value("std", 0.0));
    }
    ++i;
  }
  if (fit.shape.size() != info->shape.size() || fit.linear.size() != info->linear.size()) {
    throw InputError(fmt::format("effect '{}' has {} parameters, expected {}", fit.effect, i,
                                 info->shape.size() + info->linear.size()));
  }
  return fit;
}

json logs_json(const std::vector<LogReference>& logs) {
  json out = json::array();
  for (const LogReference& log : logs) {
    out.push_back(
        {{"file", log.file}, {"role", log.role}, {"from_s", log.from_s}, {"to_s", log.to_s}, {"hash", log.hash}});
  }
  return out;
}

std::vector<LogReference> to_logs(const json& list) {
  std::vector<LogReference> out;
  for (const json& log : list)
    out.push_back({log.at("file"), log.at("role"), log.at("hash"), log.at("from_s"), log.at("to_s")});
  return out;
}

json quantity_json(double value, double std, std::string_view unit) {
  return {{"value", value}, {"std", std}, {"unit", unit}};
}

/// Calls visit(name, value) for the scales that the fit's inputs read.
template <class Fit, class Visit>
void for_each_scale(Fit& fit, Visit&& visit) {
  const bool state = fit.inputs == StateInputs::name, extended = fit.inputs == ExtendedInputs::name;
  const bool bristles = fit.inputs == BristlesInputs::name;
  visit("reference_velocity", fit.reference_velocity);
  visit("span", fit.span);
  if (!state) visit("distances", fit.distances);
  if (extended) {
    visit("torque", fit.torque);
    visit("wavenumber", fit.wavenumber);
  }
  if (bristles) {
    visit("stribeck", fit.stribeck);
    visit("share", fit.share);
  }
  if (state || bristles) visit("velocity", fit.velocity);
  if (state) {
    visit("middle", fit.middle);
    visit("half_range", fit.half_range);
  }
  if (state || extended) visit("acceleration", fit.acceleration);
}

BroadLearningFit to_bls(const json& j) {
  BroadLearningFit fit;
  // Before there was a choice the files did not say.
  fit.inputs = j.value("inputs", fit.inputs);
  fit.activation = j.value("activation", fit.activation);
  const Eigen::Index inputs = bls_inputs(fit);
  for_each_scale(fit, [&](const char* name, auto& value) { j.at(name).get_to(value); });
  fit.ridge = j.at("ridge");
  fit.weights.resize(static_cast<Eigen::Index>(j.at("weights").size()), inputs + 1);
  for (Eigen::Index k = 0; k < fit.weights.rows(); ++k) {
    const Eigen::VectorXd row = to_vector(j.at("weights").at(static_cast<std::size_t>(k)));
    if (row.size() != inputs + 1)
      throw InputError(fmt::format("a BLS with {} weights a node, expected {}", row.size(), inputs + 1));
    fit.weights.row(k) = row.transpose();
  }
  fit.coefficients = to_vector(j.at("coefficients"));
  if (fit.coefficients.size() != fit.coefficient_count())
    throw InputError(
        fmt::format("a BLS with {} coefficients, expected {}", fit.coefficients.size(), fit.coefficient_count()));
  return fit;
}

json joint_json(const Robot& robot, std::size_t index, const JointFit& fit) {
  const Joint& joint = robot.joints[index];
  const bool prismatic = joint.type == JointType::prismatic;
  json effects = json::array();
  for (const EffectFit& effect : fit.effects) effects.push_back(effect_json(effect, fit, prismatic));
  json out = {{"joint", joint.name},
              {"index", index + 1},
              {"unit", joint.torque_unit()},
              {"rated_torque", fit.rated_torque},
              {"sign_width", fit.sign_width},
              {"sign_width_std", fit.sign_width_std},
              {"limits",
               {{"position", {fit.q_lower, fit.q_upper}},
                {"velocity", fit.dq_limit},
                {"acceleration", fit.ddq_limit},
                {"torque", fit.tau_limit}}},
              {"effects", effects}};
  if (fit.flexible) out["flexible"] = flexible_json(*fit.flexible, robot);
  if (fit.bls) {
    json bls = {{"inputs", fit.bls->inputs},
                {"activation", fit.bls->activation},
                {"nodes", fit.bls->nodes()},
                {"ridge", fit.bls->ridge},
                {"weights", matrix_json(fit.bls->weights)},
                {"coefficients", vector_json(fit.bls->coefficients)}};
    for_each_scale(*fit.bls, [&](const char* name, const auto& value) { bls[name] = value; });
    out["bls"] = bls;
  }
  return out;
}

FlexibleJoint to_flexible(const json& j) {
  FlexibleJoint out;
  out.joint = j.at("index").get<std::size_t>() - 1;
  out.found = j.at("found");
  out.deflection_rms = j.at("deflection_rms").at("value");
  out.explained = j.at("explained");
  out.note = j.at("note");
  const auto read = [&](const char* name, double& value, double& std) {
    if (!j.contains(name)) return;
    value = j.at(name).at("value");
    std = j.at(name).at("std");
  };
  read("stiffness", out.stiffness, out.stiffness_std);
  read("damping", out.damping, out.damping_std);
  read("effective_inertia", out.effective_inertia, out.inertia_std);
  return out;
}

JointFit to_joint(const json& j) {
  JointFit fit;
  fit.rated_torque = j.at("rated_torque");
  fit.sign_width = j.at("sign_width");
  fit.sign_width_std = j.value("sign_width_std", 0.0);
  const json& limits = j.at("limits");
  fit.q_lower = limits.at("position").at(0);
  fit.q_upper = limits.at("position").at(1);
  fit.dq_limit = limits.at("velocity");
  fit.ddq_limit = limits.at("acceleration");
  fit.tau_limit = limits.at("torque");
  for (const json& effect : j.at("effects")) fit.effects.push_back(to_effect(effect));
  if (j.contains("flexible")) fit.flexible = to_flexible(j.at("flexible"));
  if (j.contains("bls")) fit.bls = to_bls(j.at("bls"));
  return fit;
}

InputError not_a_model(const std::filesystem::path& file, const json::exception& error) {
  return InputError(
      fmt::format("{}: not a valid model: {}; make it anew with `fxdyn identify`", file.string(), error.what()));
}

void check_friction(const IdentifiedModel& model) {
  for (std::size_t j = 0; j < model.joints.size(); ++j) {
    if (const auto why = why_it_does_not_brake(model.joints[j], model.joints[j].dq_limit))
      throw InputError(fmt::format("joint {} ({}): {}", j + 1, model.robot.joints[j].name, *why));
  }
}

}  // namespace

const EffectFit* JointFit::find(std::string_view effect) const {
  for (const EffectFit& fit : effects) {
    if (fit.effect == effect) return &fit;
  }
  return nullptr;
}

json flexible_json(const FlexibleJoint& flexible, const Robot& robot) {
  const Joint& joint = robot.joints[flexible.joint];
  const bool revolute = joint.type == JointType::revolute;
  json out = {{"joint", joint.name},
              {"index", flexible.joint + 1},
              {"found", flexible.found},
              {"deflection_rms", {{"value", flexible.deflection_rms}, {"unit", joint.position_unit()}}},
              {"explained", flexible.explained},
              {"note", flexible.note}};
  if (!flexible.found) return out;
  out["stiffness"] = quantity_json(flexible.stiffness, flexible.stiffness_std, revolute ? "N*m/rad" : "N/m");
  out["damping"] = quantity_json(flexible.damping, flexible.damping_std, revolute ? "N*m*s/rad" : "N*s/m");
  if (flexible.effective_inertia != 0)
    out["effective_inertia"] =
        quantity_json(flexible.effective_inertia, flexible.inertia_std, revolute ? "kg*m^2" : "kg");
  return out;
}

Formats formats_of(const json& j) {
  Formats formats;
  for (std::size_t i = 0; i < quantity_count; ++i) formats.quantity[i] = j.at(std::string(quantity_names[i]));
  formats.force_sum = j.at("force_sum");
  formats.torque_sum = j.at("torque_sum");
  formats.deflection_sum = j.at("deflection_sum");
  return formats;
}

json formats_json(const Formats& formats) {
  json out;
  for (std::size_t i = 0; i < quantity_count; ++i) out[std::string(quantity_names[i])] = formats.quantity[i];
  out["force_sum"] = formats.force_sum;
  out["torque_sum"] = formats.torque_sum;
  out["deflection_sum"] = formats.deflection_sum;
  return out;
}

json to_json(const IdentifiedModel& model) {
  json base = json::array();
  for (const BaseParameter& p : model.base) {
    base.push_back({{"name", p.name},
                    {"column", p.column},
                    {"expression", p.expression},
                    {"value", p.value},
                    {"std", p.std},
                    {"essential", p.essential},
                    {"relative_std", p.relative_std()}});
  }
  json inertia = json::array();
  for (const auto& link : model.inertia) inertia.push_back(to_array(link));
  json joints = json::array();
  for (std::size_t i = 0; i < model.joints.size(); ++i) joints.push_back(joint_json(model.robot, i, model.joints[i]));
  json body = json::array();
  for (const EffectFit& fit : model.body) body.push_back(effect_json(fit, {}, false));
  json log_formats = json::object();
  for (const auto& [file, format] : model.log_formats) {
    json& out = log_formats[file] = {{"columns", format.columns}, {"torque_gain", format.torque_gain}};
    if (!format.position_gain.empty()) out["position_gain"] = format.position_gain;
    if (!format.position_offset.empty()) out["position_offset"] = format.position_offset;
    if (!format.joint_columns.empty()) out["joint_columns"] = format.joint_columns;
    if (format.time_unit_s > 0) out["time_unit_s"] = format.time_unit_s;
  }
  json out = {{"schema", "fxdyn.model/1"},
              {"stage", model.stage},
              {"tool_version", version},
              {"project", model.project},
              {"project_hash", model.project_hash},
              {"seed", model.seed},
              {"tick_s", model.tick_s},
              {"robot", robot_json(model.robot)},
              {"base_parameters", base},
              {"inertia", inertia},
              {"joints", joints},
              {"robot_effects", body},
              {"filter",
               {{"position_cutoff_hz", model.filter.position_cutoff_hz},
                {"torque_cutoff_hz", model.filter.torque_cutoff_hz},
                {"edge_s", model.filter.edge_s},
                {"torque_lead_s", model.filter.torque_lead_s},
                {"excited_hz", model.filter.excited_hz},
                {"motion_ends_hz", model.filter.crossing_hz},
                {"encoder_step", model.filter.encoder_step},
                {"position_noise", model.filter.position_noise}}},
              {"log_formats", log_formats},
              {"logs", logs_json(model.logs)},
              {"notes", model.notes}};
  if (model.session) out["session"] = {{"start_s", model.session->start_s}, {"end_s", model.session->end_s}};
  if (model.formats) {
    out["formats"] = formats_json(*model.formats);
    out["tables_crc"] = model.tables_crc;
  }
  if (model.lineage.sequence != 0) {
    out["origin"] = model.lineage.origin;
    out["sequence"] = model.lineage.sequence;
  }
  if (model.layout) out["layout"] = {{"parameters", model.layout->parameters}, {"node_bits", model.layout->node_bits}};
  if (!model.updates.empty()) out["updates"] = logs_json(model.updates);
  return out;
}

const Robot& robot_of(const IdentifiedModel& model) { return model.robot; }
const std::vector<JointFit>& joints_of(const IdentifiedModel& model) { return model.joints; }
const std::vector<EffectFit>& body_of(const IdentifiedModel& model) { return model.body; }
const std::vector<BaseParameter>& base_of(const IdentifiedModel& model) { return model.base; }
const std::vector<LinkInertia<Real>>& inertia_of(const IdentifiedModel& model) { return model.inertia; }
const FilterFit& filter_of(const IdentifiedModel& model) { return model.filter; }
const Formats& formats_of(const IdentifiedModel& model) { return model.formats.value(); }
const std::string& project_of(const IdentifiedModel& model) { return model.project; }
double tick_of(const IdentifiedModel& model) { return model.tick_s; }
std::vector<JointFit>& joints_of(IdentifiedModel& model) { return model.joints; }
std::vector<EffectFit>& body_of(IdentifiedModel& model) { return model.body; }
std::vector<BaseParameter>& base_of(IdentifiedModel& model) { return model.base; }
FilterFit& filter_of(IdentifiedModel& model) { return model.filter; }
std::vector<LinkInertia<Real>>& inertia_of(IdentifiedModel& model) { return model.inertia; }

std::optional<ModelIdentity> read_identity(const std::filesystem::path& file) {
  if (!std::filesystem::exists(file)) return {};
  try {
    const json j = json::parse(read_file(file));
    ModelIdentity out{j.at("project_hash"), to_logs(j.at("logs")), {}};
    if (j.contains("tables_crc")) out.tables_crc = j.at("tables_crc").get<std::uint32_t>();
    return out;
  } catch (const json::exception& error) {
    throw not_a_model(file, error);
  }
}

std::string hash_without_tables(const std::filesystem::path& file) {
  if (!std::filesystem::exists(file)) return {};
  json model = json::parse(read_file(file));
  for (const char* key : {"formats", "layout", "tables_crc", "origin", "sequence"}) model.erase(key);
  return hash_of(model.dump());
}

IdentifiedModel read_model(const std::filesystem::path& file) {
  const std::string text = read_file(file);
  try {
    const json j = json::parse(text);
    if (j.value("schema", "") != "fxdyn.model/1") throw InputError("not a model file (schema fxdyn.model/1)");
    IdentifiedModel model;
    model.robot = to_robot(j.at("robot"));
    model.project = j.at("project");
    model.project_hash = j.at("project_hash");
    model.seed = j.at("seed");
    model.tick_s = j.at("tick_s");
    for (const json& link : j.at("inertia"))
      model.inertia.push_back(to_inertia(link.get<std::array<double, parameters_per_link>>()));
    for (const json& joint : j.at("joints")) model.joints.push_back(to_joint(joint));
    if (j.contains("robot_effects")) {
      for (const json& effect : j.at("robot_effects")) model.body.push_back(to_effect(effect));
    }
    if (model.inertia.size() != model.robot.size() || model.joints.size() != model.robot.size()) {
      throw InputError("robot, inertia and joints differ in length");
    }
    check_friction(model);
    for (const json& p : j.at("base_parameters")) {
      model.base.push_back(
          {p.at("column"), p.at("name"), p.at("value"), p.at("std"), p.value("essential", true), p.at("expression")});
    }
    const json& filter = j.at("filter");
    model.filter = {filter.at("position_cutoff_hz"),
                    filter.at("torque_cutoff_hz"),
                    filter.at("edge_s"),
                    filter.value("torque_lead_s", 0.0),
                    filter.value("excited_hz", 0.0),
                    filter.value("motion_ends_hz", 0.0),
                    filter.value("encoder_step", std::vector<double>{}),
                    filter.value("position_noise", std::vector<double>{})};
    for (const auto& [name, format] : j.at("log_formats").items()) {
      using Numbers = std::vector<double>;
      model.log_formats[name] = {format.at("columns"),
                                 format.at("torque_gain"),
                                 format.value("position_gain", Numbers{}),
                                 format.value("position_offset", Numbers{}),
                                 format.value("joint_columns", decltype(LogFormat::joint_columns){}),
                                 format.value("time_unit_s", 0.0)};
    }
    model.stage = j.at("stage");
    if (j.contains("session")) model.session = {j.at("session").at("start_s"), j.at("session").at("end_s")};
    model.notes = j.value("notes", std::vector<std::string>{});
    if (j.contains("formats")) {
      model.formats = formats_of(j.at("formats"));
      model.tables_crc = j.at("tables_crc");
    }
    model.lineage = {j.value("origin", 0U), j.value("sequence", 0U)};
    if (j.contains("layout")) {
      model.layout = {j.at("layout").at("parameters").get<std::vector<unsigned>>(),
                      j.at("layout").at("node_bits").get<std::vector<int>>()};
      if (model.layout->parameters.size() != model.robot.size() || model.layout->node_bits.size() != model.robot.size())
        throw InputError("robot and layout differ in length");
    }
    model.logs = to_logs(j.at("logs"));
    if (j.contains("updates")) model.updates = to_logs(j.at("updates"));
    return model;
  } catch (const json::exception& error) {
    throw not_a_model(file, error);
  } catch (const InputError& error) {
    throw InputError(fmt::format("{}: {}", file.string(), error.what()));
  }
}

}  // namespace fxdyn
