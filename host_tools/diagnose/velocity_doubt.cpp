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

}  // namespace

VectorXd velocity_doubt(const ProcessedLog& log, std::size_t joint, const JointFit& friction,
                        const Eigen::Ref<const VectorXd>& velocity, const Eigen::Ref<const VectorXd>& load,
                        double sigma) {
  const EffectFit* coulomb = dry_friction_of(friction);
  if (coulomb == nullptr || log.measured_dq.size() > 0 || !(position_noise(log.filter, joint) > 0))
    return VectorXd::Zero(log.rows());
  const VelocityError error(log.filter, joint, log.step_s / static_cast<double>(log.kept_each));
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
    const double lost = log.lost_velocity.size() > 0 ? log.lost_velocity(k, static_cast<Index>(joint)) : 0;
    const double dq = std::fabs(velocity[k]), s = std::hypot(error(dq), lost);
    // the mean slope over what the velocity may be
    const double slope = 0.5 * (std::tanh((dq + s) / width) - std::tanh((dq - s) / width));
    const double wrong = std::min(1.0, s * s / (width * width)) * 2 * std::erfc(dq / (s * std::numbers::sqrt2));
    const double torque = (amplitude + of_load * std::fabs(load[k])) / sigma;
    uncertain[k] = torque * torque * std::max(slope * slope, wrong);
    if (dq < error(dq)) {  // what is lost moves
      ++still;
    } else {
      come_loose(k);
    }
  }
  come_loose(log.samples());
  return log.decimate(log.filter_columns(uncertain)).col(0).cwiseMax(0);
}

}  // namespace fxdyn::diagnosis
