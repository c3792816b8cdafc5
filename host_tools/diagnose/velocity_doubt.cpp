#include "host_tools/diagnose/velocity_doubt.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "host_tools/effects/effect_roles.hpp"
#include "host_tools/effects/joint_fit.hpp"
#include "host_tools/regression/encoder_noise.hpp"

namespace fxdyn::diagnosis {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

/// All friction that turns with the sign, some of it in proportion to the load.
struct SignFriction {
  double amplitude = 0, of_load = 0;
};

SignFriction sign_friction(const JointFit& fit, const EffectFit& coulomb) {
  SignFriction out{std::fabs(coulomb.linear[0]), 0};
  for (const EffectInfo& info : effect_infos()) {
    const EffectFit* more = info.nominal ? nullptr : fit.find(info.name);
    if (more == nullptr || info.turns_with_sign == TurnsWithSign::no) continue;
    (info.turns_with_sign == TurnsWithSign::load ? out.of_load : out.amplitude) += std::fabs(more->linear[0]);
  }
  return out;
}

/// One joint's velocity at full rate, as the position's encoder and filter give it.
class UncertainVelocity {
 public:
  UncertainVelocity(const ProcessedLog& log, std::size_t joint, const Eigen::Ref<const VectorXd>& velocity)
      : log_(log),
        joint_(static_cast<Index>(joint)),
        velocity_(velocity),
        error_(log.filter, joint, log.step_s / static_cast<double>(log.kept_each)) {}
  static bool is_certain(const ProcessedLog& log, std::size_t joint) {
    return log.measured_dq.size() > 0 || !(position_noise(log.filter, joint) > 0);
  }
  double speed(Index k) const { return std::fabs(velocity_[k]); }
  double sigma(Index k) const {
    return std::hypot(error_(speed(k)), log_.lost_velocity.size() > 0 ? log_.lost_velocity(k, joint_) : 0);
  }
  bool is_still(Index k) const { return speed(k) < error_(speed(k)); }  // what is lost moves

 private:
  const ProcessedLog& log_;
  Index joint_;
  Eigen::Ref<const VectorXd> velocity_;
  VelocityError error_;
};

/// Half of what the sign's smooth function changes by between dq - s and dq + s.
double half_step(double dq, double s, double width) {
  return 0.5 * (std::tanh((dq + s) / width) - std::tanh((dq - s) / width));
}

}  // namespace

VectorXd velocity_doubt(const ProcessedLog& log, std::size_t joint, const JointFit& friction,
                        const Eigen::Ref<const VectorXd>& velocity, const Eigen::Ref<const VectorXd>& load,
                        double sigma) {
  const EffectFit* coulomb = dry_friction_of(friction);
  if (coulomb == nullptr || UncertainVelocity::is_certain(log, joint)) return VectorXd::Zero(log.rows());
  const UncertainVelocity uncertain_velocity(log, joint, velocity);
  const double width = friction.sign_width;
  const auto [amplitude, of_load] = sign_friction(friction, *coulomb);
  VectorXd uncertain(log.samples());
  Index still = 0;  // samples so far
  const auto come_loose = [&](Index k) {
    if (still > log.decimation)
      uncertain.segment(k - still, still) *= static_cast<double>(still) / static_cast<double>(log.decimation);
    still = 0;
  };
  for (Index k = 0; k < log.samples(); ++k) {
    const double dq = uncertain_velocity.speed(k), s = uncertain_velocity.sigma(k);
    const double slope = half_step(dq, s, width);  // the mean slope over what the velocity may be
    const double wrong = std::min(1.0, s * s / (width * width)) * 2 * std::erfc(dq / (s * std::numbers::sqrt2));
    const double torque = (amplitude + of_load * std::fabs(load[k])) / sigma;
    uncertain[k] = torque * torque * std::max(slope * slope, wrong);
    if (uncertain_velocity.is_still(k)) {
      ++still;
    } else {
      come_loose(k);
    }
  }
  come_loose(log.samples());
  return log.decimate(log.filter_columns(uncertain)).col(0).cwiseMax(0);
}

VectorXd friction_swing(const ProcessedLog& log, std::size_t joint, const JointFit& friction,
                        const Eigen::Ref<const VectorXd>& velocity, const Eigen::Ref<const VectorXd>& load,
                        double deviations) {
  const EffectFit* coulomb = dry_friction_of(friction);
  if (coulomb == nullptr || UncertainVelocity::is_certain(log, joint)) return VectorXd::Zero(log.samples());
  const UncertainVelocity uncertain(log, joint, velocity);
  const auto [amplitude, of_load] = sign_friction(friction, *coulomb);
  VectorXd out(log.samples());
  for (Index k = 0; k < out.size(); ++k)
    out[k] = 2 * (amplitude + of_load * std::fabs(load[k])) *
             half_step(uncertain.speed(k), deviations * uncertain.sigma(k), friction.sign_width);
  return out;
}

}  // namespace fxdyn::diagnosis
