#include "host_tools/exchange/simple_robot.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "host_tools/effects/identified_model.hpp"
#include "host_tools/support/error.hpp"

namespace fxdyn {
namespace {

/// Of the model that stands for a simulator's sign(dq) [rad/s | m/s]: below what any log shows as motion.
constexpr double sharp_sign_width = 1e-9;

double linear_of(const JointFit& joint, std::string_view effect) {
  const EffectFit* fit = joint.find(effect);
  return fit == nullptr ? 0 : fit->linear.at(0);
}

EffectFit effect_of(const char* name, double value) {
  EffectFit fit;
  fit.effect = name;
  fit.linear = {value};
  return fit;
}

/// The links' inertias in DH frames.
std::vector<LinkInertia<Real>> inertia_of(const Robot& robot) {
  const DhChain chain = to_dh(robot);
  std::vector<LinkInertia<Real>> out;
  for (std::size_t j = 0; j < robot.size(); ++j) {
    const auto& body = robot.joints[j].inertial;
    out.push_back(body ? to_link_inertia(*body, chain.urdf_in_dh[j]) : LinkInertia<Real>{});
  }
  return out;
}

/// The model's load becomes part of the last link.
void add_payload(Robot& robot, const IdentifiedModel& model) {
  const DhChain chain = to_dh(robot);
  LinkInertia<Real> last = inertia_of(robot).back();
  bool loaded = false;
  for (const EffectFit& fit : model.body) {
    if (fit.effect != "payload") continue;
    last = with_load(last, fit.linear.at(0), {fit.linear.at(1), fit.linear.at(2), fit.linear.at(3)}, chain);
    loaded = true;
  }
  if (loaded && last.m > 0) robot.joints.back().inertial = to_inertial(last, chain.urdf_in_dh.back());
  if (loaded && !(last.m > 0)) robot.joints.back().inertial.reset();
}

/// Sums of x x' and x r over the samples of one joint, x = (dq, sign dq).
struct Sums {
  double vv = 0, vs = 0, ss = 0, vr = 0, sr = 0;
  void add(double v, double rest) {
    const double s = v > 0 ? 1 : -1;
    vv += v * v;
    vs += v * s;
    ss += 1;
    vr += v * rest;
    sr += s * rest;
  }
  /// The smallest square of all d, f; nothing: dq and its sign are one column.
  std::optional<FrictionPair> both() const {
    const double det = vv * ss - vs * vs;
    if (!(det > 1e-12 * vv * ss)) return std::nullopt;
    return FrictionPair{(vr * ss - sr * vs) / det, (sr * vv - vr * vs) / det};
  }
  FrictionPair damping_alone() const { return {vv > 0 ? vr / vv : 0, 0}; }
  FrictionPair friction_alone() const { return {0, ss > 0 ? sr / ss : 0}; }
  /// d, f >= 0 that leave the smallest square: inside, or on one of the two edges.
  FrictionPair solve() const {
    const std::optional<FrictionPair> free = both();
    if (free && free->damping >= 0 && free->friction >= 0) return *free;
    const double d = std::max(damping_alone().damping, 0.0), f = std::max(friction_alone().friction, 0.0);
    const double gain_of_d = 2 * d * vr - d * d * vv, gain_of_f = 2 * f * sr - f * f * ss;
    return gain_of_d > gain_of_f ? FrictionPair{d, 0} : FrictionPair{0, f};
  }
  FrictionPair no_dry_friction() const { return {std::max(damping_alone().damping, 0.0), 0}; }
  /// Without bounds, those alone that are not 0 here.
  FrictionPair solve_like(const SimpleJoint& said) const {
    if (said.damping > 0 && said.friction > 0) return both().value_or(FrictionPair{});
    if (said.damping > 0) return damping_alone();
    return said.friction > 0 ? friction_alone() : FrictionPair{};
  }
};

/// Adds the samples in which the joint is faster than `least`.
void add_samples(Sums& sums, const ProcessedLog& log, Eigen::Index joint, const Eigen::MatrixXd& rest, double least) {
  const Eigen::VectorXd dq = log.joint_velocity(joint);
  for (Eigen::Index k = log.first; k < log.last; ++k) {
    if (std::fabs(dq[k]) > least) sums.add(dq[k], rest(k, joint));
  }
}

}  // namespace

ModelValue as_model(const SimpleRobot& simple, ModelValue model) {
  const Eigen::Vector3d gravity = model->robot.gravity;
  model->robot = simple.robot;
  model->robot.gravity = gravity;
  model->inertia = inertia_of(simple.robot);
  model->base.clear();
  model->body.clear();
  for (std::size_t j = 0; j < model->joints.size(); ++j) {
    JointFit& joint = model->joints[j];
    const SimpleJoint& said = simple.joints[j];
    joint.sign_width = sharp_sign_width;
    joint.bls.reset();
    joint.effects = {effect_of("viscous", said.damping), effect_of("coulomb", said.friction),
                     effect_of("rotor_inertia", said.armature)};
    if (said.stribeck == 0) continue;
    joint.effects.push_back(effect_of("stribeck", said.stribeck));
    joint.effects.back().shape = {said.stribeck_velocity};
  }
  return model;
}

std::vector<FrictionPair> fit_friction(const IdentifiedModel& model, const std::vector<ProcessedLog>& logs,
                                       const std::function<Eigen::MatrixXd(const ProcessedLog&)>& rest,
                                       const std::vector<SimpleJoint>& inside, const ProjectionOptions& options) {
  const std::size_t n = model.joints.size();
  std::vector<Sums> sliding(n), moving(n);
  for (const ProcessedLog& log : logs) {
    const Eigen::MatrixXd torque = rest(log);
    for (std::size_t j = 0; j < n; ++j) {
      const auto k = static_cast<Eigen::Index>(j);
      add_samples(sliding[j], log, k, torque, options.sliding_widths * model.joints[j].sign_width);
      add_samples(moving[j], log, k, torque, 0);
    }
  }
  std::vector<FrictionPair> out;
  for (std::size_t j = 0; j < n; ++j) {
    const Sums& sums = (sliding[j].ss > 0 ? sliding : moving)[j];
    if (!inside.empty())
      out.push_back(sums.solve_like(inside[j]));
    else
      out.push_back(options.dry_friction ? sums.solve() : sums.no_dry_friction());
  }
  return out;
}

SimpleRobot simple_robot(const IdentifiedModel& model, const Robot& bodies, bool has_armature,
                         const std::vector<ProcessedLog>& train, const ProjectionOptions& options, bool has_stribeck) {
  if (train.empty()) throw DataError("no train log that friction could be fitted over: give one the role \"train\"");
  SimpleRobot out{model.robot, {}, {}};
  for (std::size_t j = 0; j < out.robot.size(); ++j) out.robot.joints[j].inertial = bodies.joints.at(j).inertial;
  add_payload(out.robot, model);
  for (const Joint& joint : out.robot.joints) {
    if (!joint.inertial || !(joint.inertial->mass > 0))
      throw DataError(fmt::format(
          "link {} has no mass that a simulator could take: record it moving, with `physical = true`", joint.link));
  }
  for (const JointFit& joint : model.joints) {
    const double rotor = has_armature ? std::max(linear_of(joint, "rotor_inertia"), 0.0) : 0;
    out.joints.push_back({0, 0, rotor, joint.tau_limit});
    const EffectFit* stribeck = has_stribeck ? joint.find("stribeck") : nullptr;
    if (stribeck == nullptr || !(stribeck->linear.at(0) > 0)) continue;
    out.joints.back().stribeck = stribeck->linear[0];
    out.joints.back().stribeck_velocity = stribeck->shape.at(0);
  }
  IdentifiedModel whole = model, without = as_model(out, model);
  whole.filter.torque_lead_s = without.filter.torque_lead_s = 0;  // friction belongs to the velocity of its own sample
  const std::vector<FrictionPair> friction = fit_friction(
      model, train,
      [&](const ProcessedLog& log) { return Eigen::MatrixXd(predict(whole, log) - predict(without, log)); }, {},
      options);
  for (std::size_t j = 0; j < out.joints.size(); ++j) {
    out.joints[j].damping = friction[j].damping;
    out.joints[j].friction = friction[j].friction;
  }
  return out;
}

std::vector<std::string> left_out(const IdentifiedModel& model, std::size_t joint, bool has_armature, bool has_stribeck,
                                  bool has_load, bool has_dry_friction) {
  std::vector<std::string> out;
  const auto said = [&](const std::string& name) {
    return name == "viscous" || (has_dry_friction && name == "coulomb") || (has_armature && name == "rotor_inertia") ||
           (has_stribeck && name == "stribeck") || (has_load && name == "load_friction");
  };
  for (const EffectFit& fit : model.joints.at(joint).effects) {
    if (!said(fit.effect)) out.push_back(fit.effect);
  }
  for (const EffectFit& fit : model.body) {
    if (fit.effect != "payload") out.push_back(fit.effect);
  }
  if (model.joints[joint].bls) out.emplace_back("bls");
  return out;
}

}  // namespace fxdyn
