#include "host_tools/simulate/lugre_plant.hpp"

#include <algorithm>
#include <cmath>

#include "host_tools/effects/model_parts.hpp"

namespace fxdyn {

using Eigen::Index;
using Eigen::MatrixXd;

namespace {

constexpr const char* effect_name = "lugre";

}  // namespace

LuGreBristles::LuGreBristles(const EffectFit& effect)
    : sigma0_(effect.linear[0] / effect.shape[0]),
      sigma1_(effect.linear[1]),
      coulomb_(effect.linear[0] * effect.shape[2]),
      static_(effect.linear[0]),
      stribeck_(effect.shape[1]) {}

double LuGreBristles::sliding(double v) const {
  return coulomb_ + (static_ - coulomb_) * std::exp(-v * v / (stribeck_ * stribeck_));
}

double LuGreBristles::rate(double z, double v) const { return v - sigma0_ * std::fabs(v) * z / sliding(v); }

void LuGreBristles::integrate(double v0, double v1, double seconds) {
  constexpr double longest = 20e-6;  // s
  const int steps = std::max(1, static_cast<int>(std::ceil(seconds / longest)));
  const double h = seconds / steps, slope = (v1 - v0) / steps;
  for (int i = 0; i < steps; ++i) {
    const double from = v0 + slope * i, middle = from + slope / 2, to = from + slope;
    const double fastest = sigma0_ * std::max(std::fabs(from), std::fabs(to)) / coulomb_;  // 1/s
    if (h * fastest > 1) {
      const double steady = std::copysign(sliding(middle), middle) / sigma0_;
      z_ = steady + (z_ - steady) * std::exp(-h * sigma0_ * std::fabs(middle) / sliding(middle));
      continue;
    }
    const double k1 = rate(z_, from), k2 = rate(z_ + h / 2 * k1, middle), k3 = rate(z_ + h / 2 * k2, middle),
                 k4 = rate(z_ + h * k3, to);
    z_ += h / 6 * (k1 + 2 * k2 + 2 * k3 + k4);
  }
}

double LuGreBristles::advance(double v0, double v1, double seconds) {
  if (v0 * v1 < 0) {
    const double turn = seconds * v0 / (v0 - v1);
    integrate(v0, 0, turn);
    integrate(0, v1, seconds - turn);
  } else {
    integrate(v0, v1, seconds);
  }
  return sigma0_ * z_ + sigma1_ * rate(z_, v1);
}

bool has_lugre(const IdentifiedModel& plant) {
  return std::any_of(joints_of(plant).begin(), joints_of(plant).end(),
                     [](const JointFit& joint) { return joint.find(effect_name) != nullptr; });
}

void take_out_lugre(std::vector<JointFit>& joints) {
  for (JointFit& joint : joints)
    std::erase_if(joint.effects, [](const EffectFit& fit) { return fit.effect == effect_name; });
}

MatrixXd lugre_torque(const IdentifiedModel& plant, const MatrixXd& dq, double step_s) {
  MatrixXd tau = MatrixXd::Zero(dq.rows(), dq.cols());
  for (Index j = 0; j < dq.cols(); ++j) {
    const JointFit& joint = joints_of(plant)[static_cast<std::size_t>(j)];
    const EffectFit* fit = joint.find(effect_name);
    if (fit == nullptr) continue;
    LuGreBristles bristles(*fit);
    for (Index k = 0; k < dq.rows(); ++k) {
      const double force =
          k > 0 ? bristles.advance(dq(k - 1, j), dq(k, j), step_s) : bristles.advance(dq(0, j), dq(0, j), 0);
      tau(k, j) = force - bristles.coulomb() * std::tanh(dq(k, j) / joint.sign_width);
    }
  }
  return tau;
}

}  // namespace fxdyn
