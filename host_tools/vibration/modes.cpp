#include "host_tools/vibration/modes.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>

#include "host_tools/effects/effect_roles.hpp"
#include "host_tools/effects/evaluator.hpp"
#include "host_tools/effects/model_parts.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// A motor whose rotor nobody knows has this share of its links' inertia: with none it could not have a mode.
constexpr double least_rotor = 1e-3;
constexpr double rounding = 1e-9;  ///< of a mode without damping

const JointFit& joint_of(const IdentifiedModel& model, Index j) {
  return joints_of(model)[static_cast<std::size_t>(j)];
}

double rotor(const IdentifiedModel& model, Index j) {
  const EffectFit* fit = rotor_of(joint_of(model, j));
  return fit == nullptr ? 0 : fit->linear[0];
}

const EffectFit* gear(const IdentifiedModel& model, Index j) {
  const EffectFit* fit = compliance_of(joint_of(model, j));
  return fit != nullptr && fit->linear[0] > 0 ? fit : nullptr;
}

/// mass x'' + damping x' + stiffness x = 0.
struct Oscillator {
  MatrixXd mass, damping, stiffness;
};

/// In the motors' angles (where they move) and the bent gears' deflections.
Oscillator oscillator(const IdentifiedModel& model, const VectorXd& q, const MotorLoop& loop) {
  const Index n = q.size(), motors = loop.stiffness.size();
  std::vector<Index> bent;
  for (Index j = 0; j < n; ++j) {
    if (gear(model, j) != nullptr) bent.push_back(j);
  }
  const Index size = motors + static_cast<Index>(bent.size());
  const MatrixXd links = link_mass(model, q);
  Oscillator o{MatrixXd::Zero(size, size), MatrixXd::Zero(size, size), MatrixXd::Zero(size, size)};
  MatrixXd link_of = MatrixXd::Zero(n, size);  // q_l = link_of x
  for (Index j = 0; j < motors; ++j) {
    link_of(j, j) = 1;
    o.mass(j, j) = std::max(rotor(model, j), least_rotor * std::fabs(links(j, j)));
    o.stiffness(j, j) = loop.stiffness[j];
    o.damping(j, j) = loop.damping[j];
  }
  for (Index i = 0; i < static_cast<Index>(bent.size()); ++i) {
    const Index j = bent[static_cast<std::size_t>(i)], at = motors + i;
    const EffectFit& fit = *gear(model, j);
    link_of(j, at) = -1;
    o.stiffness(at, at) = 1 / fit.linear[0];
    o.damping(at, at) = fit.shape[0] / fit.linear[0];
  }
  o.mass += link_of.transpose() * links * link_of;
  return o;
}

}  // namespace

MatrixXd link_mass(const IdentifiedModel& model, const VectorXd& q) {
  const Index n = q.size();
  Evaluator<Real> evaluator(unlimited(model), tick_of(model));
  std::vector<JointState<Real>> states(static_cast<std::size_t>(n));
  for (Index j = 0; j < n; ++j) states[static_cast<std::size_t>(j)] = {q[j], 0, 0};
  const auto torque = [&] { return VectorXd(Eigen::Map<const VectorXd>(evaluator.rigid_body(states).data(), n)); };
  const VectorXd gravity = torque();
  MatrixXd mass(n, n);
  for (Index j = 0; j < n; ++j) {
    states[static_cast<std::size_t>(j)] = {q[j], 0, 1};
    mass.col(j) = torque() - gravity;
    states[static_cast<std::size_t>(j)] = {q[j], 0, 0};
  }
  return 0.5 * (mass + mass.transpose());
}

MotorLoop motor_loop(const IdentifiedModel& model, const VectorXd& q, double bandwidth_hz, double damping) {
  const double w = 2 * std::numbers::pi * bandwidth_hz;
  VectorXd inertia = link_mass(model, q).diagonal();
  for (Index j = 0; j < q.size(); ++j) inertia[j] += rotor(model, j);
  return {w * w * inertia, 2 * damping * w * inertia};
}

std::vector<Mode> vibration_modes(const IdentifiedModel& model, const VectorXd& q, const MotorLoop& loop) {
  const Oscillator o = oscillator(model, q, loop);
  const Index size = o.mass.rows();
  std::vector<Mode> modes;
  if (size == 0) return modes;
  const Eigen::PartialPivLU<MatrixXd> mass(o.mass);
  MatrixXd system = MatrixXd::Zero(2 * size, 2 * size);
  system.topRightCorner(size, size).setIdentity();
  system.bottomLeftCorner(size, size) = -mass.solve(o.stiffness);
  system.bottomRightCorner(size, size) = -mass.solve(o.damping);
  if (!system.allFinite()) return modes;
  const Eigen::EigenSolver<MatrixXd> solver(system, false);
  for (Index i = 0; i < 2 * size; ++i) {
    const std::complex<double> root = solver.eigenvalues()[i];
    const double share = -root.real() / std::abs(root);
    if (root.imag() <= 0 || share < -rounding) continue;
    modes.push_back({std::abs(root) / (2 * std::numbers::pi), std::max(0.0, share)});
  }
  std::sort(modes.begin(), modes.end(), [](const Mode& a, const Mode& b) { return a.frequency_hz < b.frequency_hz; });
  return modes;
}

}  // namespace fxdyn
