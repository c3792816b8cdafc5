#include "host_tools/effects/robot_columns.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "host_tools/effects/effect_roles.hpp"
#include "host_tools/effects/evaluator.hpp"
#include "host_tools/effects/model_parts.hpp"
#include "host_tools/effects/rigid_torques.hpp"
#include "host_tools/support/error.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

/// Deflections [rad | m] and tilts [rad] that are added: their curvature and the rounding of q - delta both stay below
/// 1e-5 of the column.
constexpr double small_angle = 1e-6;
/// Torque that is added, as a share of the model's largest.
constexpr double small_torque = 1e-6;
/// Steps of one joint's state. The torque is quadratic in velocities [rad/s | m/s] and linear in accelerations.
constexpr double small_velocity = 1e-5, unit_acceleration = 1;
/// All that ByState keeps [bytes].
constexpr double most_kept = 64e6;
/// The torque is linear in a payload's mass and first moment: any values do that are small beside a robot's.
constexpr double small_mass = 1e-3, lever = 1;

const EffectInfo& info_of(std::string_view effect) {
  const EffectInfo* info = find_effect(effect);
  if (info == nullptr) throw InputError(fmt::format("unknown effect '{}': see `fxdyn effects`", effect));
  return *info;
}

MatrixXd predict(const IdentifiedModel& model, const Motion& motion) {
  return predict(model, motion.q, motion.dq, motion.ddq, motion.step_s);
}

}  // namespace

std::vector<ColumnName> column_names(std::string_view effect, JointType type) {
  std::vector<ColumnName> names;
  for (const ParameterInfo& parameter : info_of(effect).linear) {
    names.push_back({std::string(parameter.name),
                     std::string(type == JointType::revolute ? parameter.unit : parameter.unit_prismatic)});
  }
  if (is_load(effect)) {
    for (std::size_t i = 1; i < names.size(); ++i) names[i] = {names[0].name + " " + names[i].name, "kg*m"};
  }
  return names;
}

RobotColumns::RobotColumns(const IdentifiedModel& model, const Motion& motion)
    : model_(model), motion_(&motion), torque_(motion.q.rows(), motion.q.cols()) {
  Predictor(model, motion.step_s)(motion.q, motion.dq, motion.ddq, torque_, nullptr, &structural_);
  const bool plain = std::all_of(joints_of(model).begin(), joints_of(model).end(), [](const JointFit& joint) {
    return !joint.bls && std::all_of(joint.effects.begin(), joint.effects.end(), [](const EffectFit& fit) {
      const EffectInfo& info = info_of(fit.effect);
      return info.acts_on == ActsOn::torque && !info.needs_structural && !info.needs_total;
    });
  });
  for (std::size_t j = 0; j < joints_of(model).size(); ++j) sign_.push_back(std::make_unique<Sign>());
  const auto joints = static_cast<double>(joints_of(model).size());
  if (!plain || 3 * sizeof(double) * joints * joints * static_cast<double>(motion.q.rows()) > most_kept) return;
  for (std::size_t j = 0; j < joints_of(model).size(); ++j) by_state_.push_back(std::make_unique<KeptByState>());
}

const Eigen::VectorXd& RobotColumns::sign(std::size_t joint) const {
  Sign& out = *sign_[joint];
  std::call_once(out.made, [&] {
    const double width = joints_of(model_)[joint].sign_width;
    const auto tanh = [=](double dq) { return tanh_of(dq / width); };
    out.values = motion_->dq.col(static_cast<Index>(joint)).unaryExpr(tanh);
  });
  return out.values;
}

std::shared_ptr<const RobotColumns::ByState> RobotColumns::by_state(std::size_t joint) const {
  KeptByState& kept = *by_state_[joint];
  const std::lock_guard lock(kept.mutex);
  if (kept.slopes) return kept.slopes;
  auto out = std::make_shared<ByState>();
  const Motion& m = *motion_;
  const RigidBody body = rigid_body_of(model_);
  MatrixXd moved;
  const auto slope = [&](MatrixXd& to, const MatrixXd& of, double step) {
    moved = of;
    moved.col(static_cast<Index>(joint)).array() += step;
    to.resize(of.rows(), of.cols());
    rigid_torques(body, &of == &m.q ? moved : m.q, &of == &m.dq ? moved : m.dq, &of == &m.ddq ? moved : m.ddq, to);
    to = (to - structural_) / step;
  };
  slope(out->q, m.q, small_angle);
  slope(out->dq, m.dq, small_velocity);
  slope(out->ddq, m.ddq, unit_acceleration);
  kept.slopes = std::move(out);
  return kept.slopes;
}

void RobotColumns::forget_slopes(std::size_t joint) const {
  if (by_state_.empty()) return;
  const std::lock_guard lock(by_state_[joint]->mutex);
  by_state_[joint]->slopes.reset();  // whoever uses them holds them
}

MatrixXd RobotColumns::of_deflection(std::size_t joint, const Eigen::VectorXd& delta) const {
  const std::shared_ptr<const ByState> held = by_state(joint);
  const ByState& slope = *held;
  JointLimits<Real> limits;
  limits.q_upper = limits.dq_upper = limits.ddq_upper = unbounded;
  limits.q_lower = limits.dq_lower = limits.ddq_lower = -unbounded;
  Deflection<Real> deflection;
  Saturations saturations;
  MatrixXd out(delta.size(), slope.q.cols());
  for (Index k = 0; k < delta.size(); ++k) {
    const JointState<Real> link = deflection.step({}, delta[k], 1 / motion_->step_s, limits, saturations);
    out.row(k) = link.q * slope.q.row(k) + link.dq * slope.dq.row(k) + link.ddq * slope.ddq.row(k);
  }
  return out;
}

MatrixXd RobotColumns::phi(const EffectCandidate& candidate) const {
  const EffectInfo& info = info_of(candidate.effect);
  const auto j = static_cast<Index>(candidate.joint);
  JointSeries series{motion_->q.col(j), motion_->dq.col(j), motion_->ddq.col(j), structural_.col(j), motion_->step_s};
  series.total = torque_.col(j);
  series.sign = sign(candidate.joint);
  if (info.needs_peers) {
    series.peers_q = motion_->q;
    series.peers_dq = motion_->dq;
    series.peers_ddq = motion_->ddq;
    series.peers_sign.resize(motion_->dq.rows(), motion_->dq.cols());
    for (Index i = 0; i < series.peers_sign.cols(); ++i) series.peers_sign.col(i) = sign(static_cast<std::size_t>(i));
  }
  return effect_columns(candidate.effect, candidate.shape, joints_of(model_)[candidate.joint].sign_width, series);
}

MatrixXd RobotColumns::slope(const IdentifiedModel& changed, double theta) const {
  return (predict(changed, *motion_) - torque_) / theta;
}

Eigen::VectorXd RobotColumns::own_slope(const IdentifiedModel& changed, std::size_t joint, double theta) const {
  const Motion& m = *motion_;
  return (predict_joint(changed, joint, m.q, m.dq, m.ddq, structural_, m.step_s) -
          torque_.col(static_cast<Index>(joint))) /
         theta;
}

EffectColumns RobotColumns::operator()(const EffectCandidate& candidate) const {
  const EffectInfo& info = info_of(candidate.effect);
  const bool on_body = info.acts_on == ActsOn::body;
  if (!on_body && candidate.joint >= joints_of(model_).size()) {
    throw InputError(fmt::format("effect '{}' at joint {}: the robot has {}", info.name, candidate.joint + 1,
                                 joints_of(model_).size()));
  }
  if (candidate.shape.size() != info.shape.size()) {
    throw InputError(fmt::format("effect '{}' has {} shape parameters, not {}", info.name, info.shape.size(),
                                 candidate.shape.size()));
  }
  EffectColumns out;
  out.joints.resize(joints_of(model_).size());
  const bool of_total_follow =
      !on_body && !info.needs_total && !in_order(joints_of(model_)[candidate.joint], true).empty();
  if (info.acts_on == ActsOn::torque && !of_total_follow) {
    out.joints[candidate.joint] = phi(candidate);
    return out;
  }

  std::vector<MatrixXd> slopes;  // one a column, samples x joints
  const auto with = [&](std::vector<double> linear) {
    ModelValue changed = model_;
    EffectFit fit;
    fit.effect = candidate.effect;
    fit.shape = candidate.shape;
    fit.linear = std::move(linear);
    (on_body ? body_of(changed) : joints_of(changed)[candidate.joint].effects).push_back(std::move(fit));
    return changed;
  };
  if (is_load(candidate.effect)) {
    slopes.push_back(slope(with({small_mass, 0, 0, 0}), small_mass));
    for (std::size_t axis = 1; axis < info.linear.size(); ++axis) {
      // Central: the second moments, the same at both sides, drop out.
      std::vector<double> there{small_mass, 0, 0, 0}, back = there;
      there[axis] = lever;
      back[axis] = -lever;
      slopes.push_back((slope(with(there), small_mass) - slope(with(back), small_mass)) / (2 * lever));
    }
  } else {
    const MatrixXd size = on_body ? MatrixXd::Ones(1, static_cast<Index>(info.linear.size())) : phi(candidate);
    const bool shared = info.acts_on == ActsOn::position && !by_state_.empty();
    for (std::size_t i = 0; i < info.linear.size(); ++i) {
      const double largest = size.col(static_cast<Index>(i)).cwiseAbs().maxCoeff();
      double step = info.acts_on == ActsOn::torque ? small_torque * torque_.cwiseAbs().maxCoeff() : small_angle;
      if (largest > 0) step /= largest;
      std::vector<double> linear(info.linear.size());
      linear[i] = step;
      slopes.emplace_back(MatrixXd::Zero(torque_.rows(), torque_.cols()));
      if (largest > 0 && info.acts_on == ActsOn::torque) {
        slopes.back().col(static_cast<Index>(candidate.joint)) = own_slope(with(linear), candidate.joint, step);
      } else if (largest > 0 && shared) {
        slopes.back() = of_deflection(candidate.joint, size.col(static_cast<Index>(i)));
      } else if (largest > 0) {
        slopes.back() = slope(with(linear), step);
      }
    }
  }
  for (Index j = 0; j < torque_.cols(); ++j) {
    bool reached = false;
    for (const MatrixXd& column : slopes) reached |= column.col(j).cwiseAbs().maxCoeff() > 0;
    if (!reached) continue;
    MatrixXd& columns = out.joints[static_cast<std::size_t>(j)];
    columns.resize(torque_.rows(), static_cast<Index>(slopes.size()));
    for (std::size_t i = 0; i < slopes.size(); ++i) columns.col(static_cast<Index>(i)) = slopes[i].col(j);
  }
  return out;
}

}  // namespace fxdyn
