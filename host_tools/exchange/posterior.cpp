#include "host_tools/exchange/posterior.hpp"

#include <algorithm>
#include <cmath>

#include "host_tools/identify/identify.hpp"
#include "host_tools/train/kept_effects.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

/// Torque against the motion. The catalogue counts an offset to friction too: it pushes one way.
bool brakes(const EffectFit& fit) {
  const EffectInfo* info = find_effect(fit.effect);
  return info->friction && !info->has_constant;
}

/// The coefficient of the model's joint that is number `own` of its design's; null: it is not one of friction.
double* friction_coefficient(JointFit& joint, const JointFit& design, Index own) {
  std::vector<bool> taken(joint.effects.size(), false);
  for (const EffectFit& wanted : design.effects) {
    std::size_t e = 0;
    while (e < taken.size() &&
           (taken[e] || joint.effects[e].effect != wanted.effect || joint.effects[e].shape != wanted.shape))
      ++e;
    const auto count = static_cast<Index>(wanted.linear.size());
    if (own < count) {
      const bool is_friction = e < taken.size() && brakes(wanted);
      return is_friction ? &joint.effects[e].linear.at(static_cast<std::size_t>(own)) : nullptr;
    }
    if (e < taken.size()) taken[e] = true;
    own -= count;
  }
  return nullptr;  // of a BLS
}

/// Number of the rotor's coefficient among the design's; -1: it has none.
Index rotor_number(const JointFit& design) {
  Index at = 0;
  for (const EffectFit& fit : design.effects) {
    if (fit.effect == "rotor_inertia") return at;
    at += static_cast<Index>(fit.linear.size());
  }
  return -1;
}

/// Numbers that the friction of the model alone comes to, and its rotor.
std::vector<SimpleJoint> means(const IdentifiedModel& model, const std::vector<ProcessedLog>& train) {
  IdentifiedModel without = model;
  for (JointFit& joint : without.joints) std::erase_if(joint.effects, brakes);
  const std::vector<FrictionPair> friction = fit_friction(
      model, train, [&](const ProcessedLog& log) { return MatrixXd(predict(model, log) - predict(without, log)); });
  std::vector<SimpleJoint> out;
  for (std::size_t j = 0; j < friction.size(); ++j) {
    const EffectFit* rotor = model.joints[j].find("rotor_inertia");
    out.push_back(
        {friction[j].damping, friction[j].friction, rotor == nullptr ? 0 : std::max(rotor->linear.at(0), 0.0)});
  }
  return out;
}

/// d(damping, friction, armature) / d(theta) of each joint.
/// @param steps the coefficients' standard deviations: what the logs leave open
std::vector<MatrixXd> slopes(const IdentifiedModel& model, const std::vector<SimpleJoint>& mean,
                             const std::vector<JointFit>& design, const std::vector<Eigen::VectorXd>& steps,
                             const std::vector<ProcessedLog>& train) {
  std::vector<MatrixXd> out;
  Index most = 0;
  for (std::size_t j = 0; j < design.size(); ++j) {
    out.emplace_back(MatrixXd::Zero(3, steps[j].size()));
    const Index rotor = rotor_number(design[j]);
    if (rotor >= 0 && mean[j].armature > 0) out[j](2, rotor) = 1;
    most = std::max(most, steps[j].size());
  }
  for (Index c = 0; c < most; ++c) {
    IdentifiedModel moved = model;
    std::vector<std::size_t> moves;
    for (std::size_t j = 0; j < design.size(); ++j) {
      if (c >= steps[j].size() || !(steps[j][c] > 0)) continue;
      double* value = friction_coefficient(moved.joints[j], design[j], c);
      if (value == nullptr) continue;
      *value += steps[j][c];
      moves.push_back(j);
    }
    if (moves.empty()) continue;
    const std::vector<FrictionPair> change = fit_friction(
        model, train, [&](const ProcessedLog& log) { return MatrixXd(predict(moved, log) - predict(model, log)); },
        mean);
    for (const std::size_t j : moves)
      out[j].col(c).head(2) << change[j].damping / steps[j][c], change[j].friction / steps[j][c];
  }
  return out;
}

/// The model's own structure, fitted once more.
Solution refit(const Project& project, const IdentifiedModel& model, const KeptEffects& kept,
               const std::vector<ProcessedLog>& train) {
  std::vector<JointFit> design = kept.design();
  Fitter fitter(project.robot, train, design);
  set_prior(fitter, project);
  fitter.set_structural(structural_torque(model, train));  // a BLS may have it among its inputs
  for (std::size_t j = 0; j < design.size(); ++j) design[j].bls = model.joints[j].bls;
  fitter.set_designs(design);
  fitter.set_torque_lead(model.filter.torque_lead_s, kept.torque(model, train));
  weigh(fitter, project.identify);
  return fitter.fit();
}

}  // namespace

std::vector<JointRange> joint_ranges(const Project& project, const IdentifiedModel& model,
                                     std::vector<ProcessedLog> train) {
  const KeptEffects kept(model, train);
  kept.mark_hidden(train);
  const Solution solution = refit(project, model, kept, train);
  IdentifiedModel at_once = model;
  at_once.filter.torque_lead_s = 0;  // friction belongs to the velocity of its own sample
  const std::vector<SimpleJoint> mean = means(at_once, train);
  const std::vector<MatrixXd> slope = slopes(at_once, mean, kept.design(), solution.theta_std, train);
  std::vector<JointRange> out;
  Index at = solution.beta.size();
  for (std::size_t j = 0; j < mean.size(); ++j) {
    const Index own = solution.theta[j].size();
    out.push_back({Eigen::Vector3d(mean[j].damping, mean[j].friction, mean[j].armature),
                   slope[j] * solution.covariance.block(at, at, own, own) * slope[j].transpose(), solution.freedom[j]});
    at += own;
  }
  return out;
}

double squared_radius_90(std::size_t numbers, double freedom) {
  // u = tan(phi)^2 nu / k has Fisher's density: the share within phi is the integral of sin^(k-1) cos^(nu-1), from 0 to
  // pi/2 half a beta function (Abramowitz and Stegun 1964, 26.6 and 6.2.1).
  constexpr int pieces = 200;  // Simpson's rule: the radius to 1e-6
  if (numbers == 0) return 0;
  const auto k = static_cast<double>(numbers);
  const double nu = std::max(freedom, 1.0);
  const auto density = [&](double phi) { return std::pow(std::sin(phi), k - 1) * std::pow(std::cos(phi), nu - 1); };
  const auto within = [&](double phi) {
    const double step = phi / pieces;
    double sum = density(0) + density(phi);
    for (int i = 1; i < pieces; ++i) sum += (i % 2 == 1 ? 4 : 2) * density(i * step);
    return sum * step / 3;
  };
  const double wanted = 0.9 * 0.5 * std::beta(k / 2, nu / 2);
  double low = 0, high = std::atan(40 / std::sqrt(nu));  // the largest radius, of k = 3 and nu = 1, is 12.7
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (low + high);
    (within(middle) < wanted ? low : high) = middle;
  }
  return nu * std::pow(std::tan(low), 2);
}

}  // namespace fxdyn
