#include "host_tools/identify/payload_result.hpp"

#include <nlohmann/json.hpp>

#include "host_tools/identify/known_load.hpp"
#include "host_tools/identify/payload.hpp"

namespace fxdyn {
namespace {

using nlohmann::json;

/// Where in PayloadResult::parameters the groups of payload.json begin.
constexpr std::size_t centre = 1, tensor = 4, end = 10;
constexpr std::array names{"mass", "x", "y", "z", "ixx", "iyy", "izz", "ixy", "ixz", "iyz"};

json parameter_json(const PayloadResult::Parameter& parameter) {
  return {{"value", parameter.value},
          {"std", parameter.std},
          {"unit", parameter.unit},
          {"identifiable", parameter.identifiable}};
}
PayloadResult::Parameter parameter_of(const char* name, const json& file) {
  return {name, file.at("unit"), file.at("value"), file.at("std"), file.at("identifiable")};
}

}  // namespace

PayloadResult payload_result(const LoadFit& fit, const Robot& robot) {
  PayloadResult out{robot.joints.back().link, {}, fit.constrained, {}};
  for (std::size_t k = 0; k < end; ++k) {
    const LoadParameter& one = fit.parameters[k];
    out.parameters[k] = {one.name, one.unit, one.value, one.std, one.identifiable};
  }
  for (std::size_t j = 0; j < robot.size(); ++j) {
    const auto k = static_cast<Eigen::Index>(j);
    out.joints.push_back({robot.joints[j].name, robot.joints[j].torque_unit(), fit.before[k], fit.after[k],
                          fit.with_effect[k], fit.coulomb[k], fit.coulomb_std[k], fit.offset[k]});
  }
  return out;
}

json to_json(const PayloadResult& result) {
  json com, inertia, joints = json::array();
  for (std::size_t k = centre; k < tensor; ++k) com[names[k]] = parameter_json(result.parameters[k]);
  for (std::size_t k = tensor; k < end; ++k) inertia[names[k]] = parameter_json(result.parameters[k]);
  for (const PayloadResult::Joint& joint : result.joints) {
    joints.push_back({{"joint", joint.name},
                      {"index", joints.size() + 1},
                      {"unit", joint.unit},
                      {"residual_before", joint.residual_before},
                      {"residual_after", joint.residual_after},
                      {"residual_with_model", joint.residual_with_model},
                      {"coulomb_change", joint.coulomb_change},
                      {"coulomb_change_std", joint.coulomb_change_std},
                      {"offset_change", joint.offset_change}});
  }
  return {{"schema", "fxdyn.payload/1"},
          {"link", result.link},
          {"frame", "URDF frame of the link"},
          {"mass", parameter_json(result.parameters[0])},
          {"com", com},
          {"inertia_about_com", inertia},
          {"constrained", result.constrained},
          {"joints", joints}};
}

PayloadResult payload_of(const json& file) {
  PayloadResult out{file.at("link"), {}, file.at("constrained"), {}};
  out.parameters[0] = parameter_of(names[0], file.at("mass"));
  for (std::size_t k = centre; k < tensor; ++k) out.parameters[k] = parameter_of(names[k], file.at("com").at(names[k]));
  for (std::size_t k = tensor; k < end; ++k)
    out.parameters[k] = parameter_of(names[k], file.at("inertia_about_com").at(names[k]));
  for (const json& joint : file.at("joints")) {
    out.joints.push_back({joint.at("joint"), joint.at("unit"), joint.at("residual_before"), joint.at("residual_after"),
                          joint.at("residual_with_model"), joint.at("coulomb_change"), joint.at("coulomb_change_std"),
                          joint.at("offset_change")});
  }
  return out;
}

GainResult gain_result(const std::vector<JointGain>& gains, const Load& load, const Robot& robot,
                       const std::vector<double>& gain) {
  GainResult out{robot.joints.back().link, load.mass, {load.com.x(), load.com.y(), load.com.z()}, {}};
  for (std::size_t j = 0; j < robot.size(); ++j) {
    const JointGain& one = gains[j];
    const double now = gain.empty() ? 1 : gain[j];
    out.joints.push_back({robot.joints[j].name, robot.joints[j].torque_unit(), one.felt, one.factor, one.std,
                          one.load_rms, one.felt ? now * one.factor : now});
  }
  return out;
}

json to_json(const GainResult& result) {
  json joints = json::array();
  for (const GainResult::Joint& joint : result.joints) {
    joints.push_back({{"joint", joint.name},
                      {"index", joints.size() + 1},
                      {"felt", joint.felt},
                      {"factor", joint.factor},
                      {"std", joint.std},
                      {"load_rms", joint.load_rms},
                      {"unit", joint.unit},
                      {"torque_gain", joint.torque_gain}});
  }
  return {{"schema", "fxdyn.payload/1"},
          {"link", result.link},
          {"frame", "URDF frame of the link"},
          {"gains", {{"mass", result.mass}, {"com", result.com}, {"joints", joints}}}};
}

GainResult gains_of(const json& file) {
  const json& gains = file.at("gains");
  GainResult out{file.at("link"), gains.at("mass"), gains.at("com"), {}};
  for (const json& joint : gains.at("joints")) {
    out.joints.push_back({joint.at("joint"), joint.at("unit"), joint.at("felt"), joint.at("factor"), joint.at("std"),
                          joint.at("load_rms"), joint.at("torque_gain")});
  }
  return out;
}

}  // namespace fxdyn
