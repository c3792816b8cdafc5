#include "host_tools/simulate/mujoco_forces.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>

#include "host_tools/effects/model_parts.hpp"
#include "host_tools/simulate/mujoco_model.hpp"
#include "host_tools/support/error.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

/// Sign of a velocity with a soft zero.
double soft_sign(double v, double width) { return v / std::sqrt(v * v + width * width); }

/// Effects that are no torque of force(): MuJoCo's own, those of the body, of the gears and of the sensors.
constexpr std::array<std::string_view, 14> elsewhere{
    "lugre",      "maxwell_slip", "viscous", "coulomb",      "rotor_inertia", "elasticity", "backlash",
    "presliding", "eccentricity", "payload", "gravity_tilt", "torque_gain",   "saturation", "delay"};

/// Cox's and de Boor's recursion: spline i of this degree over knots at the whole numbers, from i to i + degree + 1.
double spline(int i, int degree, double x) {
  if (degree == 0) return x >= i && x < i + 1 ? 1 : 0;
  return ((x - i) * spline(i, degree - 1, x) + (i + degree + 1 - x) * spline(i + 1, degree - 1, x)) / degree;
}

/// A free curve of the fit's heights, of which equal ones of 1 make 3/2. Its knots' place comes last of the shape.
double free_curve(const EffectFit& fit, double x) {
  const double from = fit.shape[fit.shape.size() - 2], span = fit.shape.back();
  const double pieces = static_cast<double>(fit.linear.size()) - 3;
  const double place = std::clamp((x - from) / span * pieces, 0.0, pieces);
  double sum = 0;
  for (std::size_t i = 0; i < fit.linear.size(); ++i)
    sum += 1.5 * fit.linear[i] * spline(static_cast<int>(i) - 3, 3, place);
  return sum;
}

/// Torque of an effect with no memory on joint j [N*m | N].
/// @throws InputError: an effect that this plant has no formula for
double force(const EffectFit& fit, const JointFit& joint, Index j, const DriveState& now,
             const IdentifiedModel& plant) {
  const std::string& name = fit.effect;
  const auto& p = fit.linear;
  const double q = now.q[j], v = now.dq[j], sign = soft_sign(v, joint.sign_width);
  const auto peer = [&] { return static_cast<Index>(fit.shape[0]) - 1; };
  if (name == "offset") return p[0];
  if (name == "stribeck") return p[0] * sign * std::exp(-std::pow(v / fit.shape[0], 2));
  if (name == "soft_knee") return p[0] * soft_sign(v, fit.shape[0]);
  if (name == "asymmetric_friction") return p[0] * std::fabs(sign) + p[1] * std::fabs(v);
  if (name == "viscous_quadratic") return p[0] * v * std::fabs(v);
  if (name == "viscous_cubic") return p[0] * v * v * v;
  if (name == "load_friction") return p[0] * std::fabs(now.load[j]) * sign;
  if (name == "ripple") return p[0] * std::cos(fit.shape[0] * q) + p[1] * std::sin(fit.shape[0] * q);
  if (name == "spring") return p[0] > 0 ? 0 : p[0] * q + p[1];  // MuJoCo's where it pulls back
  if (name == "gravity_compensator") return p[0] * std::cos(q) + p[1] * std::sin(q);
  if (name == "friction_drift") return (1 - std::exp(-now.time_s / fit.shape[0])) * (p[0] * sign + p[1] * v);
  if (name == "position_curve") return free_curve(fit, q);
  if (name == "velocity_curve") return free_curve(fit, v);
  if (name == "load_curve") return free_curve(fit, now.load[j]);
  if (name == "friction_over_position") return free_curve(fit, q) * sign;
  if (name == "cross_position") return free_curve(fit, now.q[peer()]);
  if (name == "joint_coupling") {
    const double other = now.dq[peer()];
    return p[0] * soft_sign(other, joints_of(plant)[static_cast<std::size_t>(peer())].sign_width) + p[1] * other;
  }
  if (name == "motor_coupling") {
    const double ratio = fit.shape[1], geared = ratio * now.dq[peer()];
    return p[0] * soft_sign(v + geared, fit.shape[2]) + p[1] * geared + p[2] * ratio * now.ddq[peer()];
  }
  if (std::find(elsewhere.begin(), elsewhere.end(), name) != elsewhere.end()) return 0;
  throw InputError(fmt::format("effect '{}' has no formula in MuJoCo's plant; use the internal plant", name));
}

/// Value between the samples of a column; before the first it has always been the same.
double at(const Eigen::Ref<const VectorXd>& column, double sample) {
  if (sample <= 0) return column[0];
  const auto from = std::min(static_cast<Index>(sample), column.size() - 1);
  const Index to = std::min(from + 1, column.size() - 1);
  const double share = sample - static_cast<double>(from);
  return column[from] + share * (column[to] - column[from]);
}

/// Load behind a damper: load + r d(load)/dt = torque, exact for a torque that is linear between samples.
VectorXd relaxed(const Eigen::Ref<const VectorXd>& torque, double r, double step_s) {
  VectorXd load = torque;
  if (r <= 0) return load;
  const double x = step_s / r, decay = std::exp(-x);
  for (Index k = 1; k < load.size(); ++k) {
    const double slope = (torque[k] - torque[k - 1]) / x;
    // particular solution: torque - slope; the rest decays
    load[k] = (load[k - 1] - torque[k - 1] + slope) * decay + torque[k] - slope;
  }
  return load;
}

}  // namespace

double SlippingContacts::advance(const EffectFit& fit, double way) {
  bent_.resize(fit.linear.size(), 0.0);
  double sum = 0, room = fit.shape[0];  // of a spring: how far it bends before it slips
  for (std::size_t i = 0; i < bent_.size(); ++i, room /= 2) {
    bent_[i] = std::min(room, std::max(-room, bent_[i] + way));
    sum += fit.linear[i] * bent_[i] / room;
  }
  return sum;
}

DriveForces::DriveForces(const IdentifiedModel& plant)
    : plant_(plant),
      bristle_(joints_of(plant).size(), 0.0),
      bristle_q_(joints_of(plant).size(), 0.0),
      slips_(joints_of(plant).size()) {
  for (const JointFit& joint : joints_of(plant)) {
    const EffectFit* fit = joint.find("lugre");
    lugre_.push_back(fit != nullptr ? std::optional<LuGreBristles>(*fit) : std::nullopt);
  }
}

VectorXd DriveForces::operator()(const DriveState& now) {
  VectorXd sum = VectorXd::Zero(now.q.size());
  for (Index j = 0; j < sum.size(); ++j) {
    const auto i = static_cast<std::size_t>(j);
    const JointFit& joint = joints_of(plant_)[i];
    sum[j] += coulomb_share(joint).applied * soft_sign(now.dq[j], joint.sign_width);
    if (lugre_[i]) {
      const double v0 = started_ ? last_dq_[j] : now.dq[j], seconds = started_ ? now.time_s - last_s_ : 0;
      sum[j] += lugre_[i]->advance(v0, now.dq[j], seconds);
    }
    const double stretch = started_ ? now.q[j] - bristle_q_[i] : 0;
    bristle_q_[i] = now.q[j];
    for (const EffectFit& fit : joint.effects) {
      if (fit.effect == "maxwell_slip") {
        sum[j] += slips_[i].advance(fit, stretch);
        continue;
      }
      if (fit.effect != "presliding") {
        sum[j] += force(fit, joint, j, now, plant_);
        continue;
      }
      // Dahl, dz/dq = (1 - sign z) / distance: over a stretch z decays to the direction's sign
      const double end = stretch < 0 ? -1 : 1;
      bristle_[i] = end + (bristle_[i] - end) * std::exp(-std::fabs(stretch) / fit.shape[0]);
      sum[j] += fit.linear[0] * bristle_[i];
    }
  }
  started_ = true;
  last_dq_ = now.dq;
  last_s_ = now.time_s;
  return sum;
}

void measure_torque(const IdentifiedModel& plant, double step_s, Eigen::MatrixXd& tau) {
  for (Index j = 0; j < tau.cols(); ++j) {
    for (const EffectFit& fit : joints_of(plant)[static_cast<std::size_t>(j)].effects) {
      const VectorXd before = tau.col(j);
      if (fit.effect == "torque_gain") tau.col(j) *= 1 + fit.linear[0];
      if (fit.effect == "saturation") {
        const double limit = fit.shape[0];
        tau.col(j) += fit.linear[0] * (before.cwiseMin(limit).cwiseMax(-limit) - before);
      }
      if (fit.effect == "delay") {
        for (Index k = 0; k < tau.rows(); ++k) {
          const double late = at(before, static_cast<double>(k) - fit.shape[0] / step_s);
          tau(k, j) += fit.linear[0] * (late - before[k]);
        }
      }
    }
  }
}

Eigen::MatrixXd gear_deflections(const IdentifiedModel& plant, double step_s, const Eigen::MatrixXd& load) {
  Eigen::MatrixXd delta = Eigen::MatrixXd::Zero(load.rows(), load.cols());
  for (Index j = 0; j < load.cols(); ++j) {
    const JointFit& joint = joints_of(plant)[static_cast<std::size_t>(j)];
    for (const EffectFit& fit : joint.effects) {
      if (fit.effect == "elasticity") delta.col(j) += fit.linear[0] * relaxed(load.col(j), fit.shape[0], step_s);
      if (fit.effect == "backlash")
        delta.col(j) += fit.linear[0] * (load.col(j) / fit.shape[0]).array().tanh().matrix();
    }
  }
  return delta;
}

Eccentric eccentric(const JointFit& joint, double q) {
  const EffectFit* fit = joint.find("eccentricity");
  if (fit == nullptr) return {};
  const double a = fit->linear[0], b = fit->linear[1], s = std::sin(q), c = std::cos(q);
  return {a * s + b * c, a * c - b * s, -(a * s + b * c)};
}

}  // namespace fxdyn
