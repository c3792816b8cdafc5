#include "host_tools/identify/payload.hpp"

#include <fmt/format.h>

#include <cmath>
#include <numbers>

#include "host_tools/effects/effect_roles.hpp"
#include "host_tools/effects/evaluator.hpp"
#include "host_tools/effects/link_parameters.hpp"
#include "host_tools/effects/model_parts.hpp"
#include "host_tools/regression/joint_weight.hpp"
#include "host_tools/regression/physical.hpp"
#include "host_tools/regression/sandwich.hpp"
#include "host_tools/regression/solver.hpp"
#include "host_tools/signals/filter.hpp"
#include "host_tools/support/error.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr auto ten = static_cast<Index>(parameters_per_link);
constexpr Index nuisances = 2;  ///< Coulomb, offset of each joint
/// Ten parameters in the URDF frame -> ten in the DH frame.
MatrixXd to_dh_frame(const Eigen::Isometry3d& pose) {
  MatrixXd map(ten, ten);
  for (Index k = 0; k < ten; ++k) {
    std::array<double, parameters_per_link> unit{};
    unit[static_cast<std::size_t>(k)] = 1;
    // [r; 1] = pose [r'; 1], so P = pose P' pose^T
    const Eigen::Matrix4d p = pose.matrix() * pseudo_inertia(to_inertia(unit)) * pose.matrix().transpose();
    const auto values = to_array(from_pseudo_inertia(p));
    map.col(k) = Eigen::Map<const VectorXd>(values.data(), ten);
  }
  return map;
}

struct Rows {
  std::vector<MatrixXd> columns;  ///< a joint: rows x (10 + 2)
  std::vector<VectorXd> missing;  ///< a joint: torque that the model does not explain
  VectorXd gravity;               ///< a joint: largest gravity torque of 1 kg within 1 m of the last link's frame
  double lifted = 0;              ///< the same of 1 kg in that frame's origin, over all joints
};

Rows build_rows(const IdentifiedModel& model, const DhChain& chain, const ProcessedLog& log) {
  const auto n = static_cast<Index>(robot_of(model).size());
  const MatrixXd missing = log.decimate(log.filter_columns(log.tau - predict(model, log)));
  const MotionRows motion = log.motion();
  const MatrixXd map = to_dh_frame(chain.urdf_in_dh.back());
  std::vector<MatrixXd> full(static_cast<std::size_t>(n), MatrixXd(log.q.rows(), ten + nuisances));
  Regressor regressor(chain);
  Rows rows;
  rows.gravity = VectorXd::Zero(n);
  for (Index k = 0; k < log.q.rows(); ++k) {
    const MatrixXd moving = regressor(motion.q.row(k), motion.dq.row(k), motion.ddq.row(k)).rightCols(ten) * map;
    const VectorXd rest = VectorXd::Zero(n);
    const bool sampled = k % 20 == 0;
    const MatrixXd still = sampled ? MatrixXd(regressor(motion.q.row(k), rest, rest).rightCols(ten) * map) : MatrixXd();
    for (Index j = 0; j < n; ++j) {
      full[static_cast<std::size_t>(j)].row(k).head(ten) = moving.row(j);
      if (!sampled) continue;
      rows.gravity[j] = std::max(rows.gravity[j], still.row(j).head(4).cwiseAbs().maxCoeff());
      rows.lifted = std::max(rows.lifted, std::fabs(still(j, 0)));
    }
  }
  for (Index j = 0; j < n; ++j) {
    const auto at = static_cast<std::size_t>(j);
    const JointSeries series{motion.q.col(j), motion.dq.col(j), motion.ddq.col(j), {}, log.step_s};
    full[at].col(ten) = effect_columns(dry_friction_effect().name, {}, joints_of(model)[at].sign_width, series);
    full[at].col(ten + 1) = effect_columns(constant_effect().name, {}, joints_of(model)[at].sign_width, series);
    rows.columns.push_back(
        log.decimate(log.filter_columns(at_other_times(full[at], filter_of(model).torque_lead_s / log.step_s))));
    full[at].resize(0, 0);
    rows.missing.emplace_back(missing.col(j));
  }
  return rows;
}

struct Fit {
  MatrixXd information;
  VectorXd projection, solution;
  MatrixXd covariance;  ///< of the ten parameters
  MatrixXd own;         ///< information of the ten, nuisances taken out
  VectorXd nuisance_std;
  double correlated = 1;  ///< rows for an independent one, mean
};

Fit solve(const Rows& rows, double faded) {
  const auto n = static_cast<Index>(rows.columns.size());
  const Index p = ten + nuisances * n;
  Fit fit;
  VectorXd weights(n);
  const auto residual = [&](Index j) {
    const auto at = static_cast<std::size_t>(j);
    VectorXd own(ten + nuisances);
    own << fit.solution.head(ten), fit.solution.segment(ten + nuisances * j, nuisances);
    return VectorXd(rows.missing[at] - rows.columns[at] * own);
  };
  const auto place = [&](MatrixXd& sum, Index j, const MatrixXd& gram) {
    const Index at = ten + nuisances * j;
    sum.topLeftCorner(ten, ten) += gram.topLeftCorner(ten, ten);
    sum.block(0, at, ten, nuisances) += gram.topRightCorner(ten, nuisances);
    sum.block(at, 0, nuisances, ten) += gram.bottomLeftCorner(nuisances, ten);
    sum.block(at, at, nuisances, nuisances) += gram.bottomRightCorner(nuisances, nuisances);
  };
  fit.solution = VectorXd::Zero(p);
  for (int round = 0; round < 4; ++round) {
    fit.information = MatrixXd::Zero(p, p);
    fit.projection = VectorXd::Zero(p);
    for (Index j = 0; j < n; ++j) {
      const auto at = static_cast<std::size_t>(j);
      weights[j] = joint_weight(static_cast<double>(rows.missing[at].size()), residual(j).squaredNorm(),
                                rows.missing[at].squaredNorm());
      place(fit.information, j, weights[j] * rows.columns[at].transpose() * rows.columns[at]);
      const VectorXd b = weights[j] * rows.columns[at].transpose() * rows.missing[at];
      fit.projection.head(ten) += b.head(ten);
      fit.projection.segment(ten + nuisances * j, nuisances) += b.tail(nuisances);
    }
    fit.solution = SymmetricSolver(fit.information).solve(fit.projection);
  }
  MatrixXd middle = MatrixXd::Zero(p, p);
  fit.correlated = 0;
  for (Index j = 0; j < n; ++j) {
    const MatrixXd& x = rows.columns[static_cast<std::size_t>(j)];
    const VectorXd gamma = autocovariance(residual(j), faded);
    place(middle, j, weights[j] * weights[j] * middle_of_lags(x, gamma));
    fit.correlated += (2 * gamma.sum() / gamma[0] - 1) / static_cast<double>(n);
  }
  const MatrixXd covariance = sandwich(SymmetricSolver(fit.information).inverse(), middle);
  fit.covariance = covariance.topLeftCorner(ten, ten);
  fit.nuisance_std = covariance.diagonal().tail(p - ten).cwiseMax(0).cwiseSqrt();
  const SymmetricSolver nuisance(fit.information.bottomRightCorner(p - ten, p - ten));
  fit.own = fit.information.topLeftCorner(ten, ten);
  for (Index k = 0; k < ten; ++k) {
    fit.own.col(k) -=
        fit.information.topRightCorner(ten, p - ten) * nuisance.solve(fit.information.col(k).tail(p - ten));
  }
  return fit;
}

/// Which of the ten no sum of the others and of friction imitates.
std::array<bool, 10> identifiable(const Fit& fit, const LoadOptions& options) {
  VectorXd scale = fit.information.diagonal().head(ten).cwiseMax(0).cwiseSqrt();
  std::array<bool, 10> out{};
  for (Index k = 0; k < ten; ++k) {
    out[static_cast<std::size_t>(k)] = scale[k] > options.no_column * scale.maxCoeff();
    scale[k] = out[static_cast<std::size_t>(k)] ? 1 / scale[k] : 0;
  }
  const MatrixXd scaled = scale.asDiagonal() * (fit.own + fit.own.transpose()) / 2 * scale.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<MatrixXd> solver(scaled);
  for (Index i = 0; i < ten; ++i) {
    if (solver.eigenvalues()[i] > options.least_share_left) continue;
    for (Index k = 0; k < ten; ++k) {
      if (std::fabs(solver.eigenvectors()(k, i)) > options.part) out[static_cast<std::size_t>(k)] = false;
    }
  }
  return out;
}

/// The joint to move for a better view of the load.
std::string what_to_move(const Robot& robot, const ProcessedLog& log, const Rows& rows, double least_lift) {
  const VectorXd& gravity = rows.gravity;
  Index best = -1;
  double smallest = 0;
  for (Index j = 0; j < gravity.size(); ++j) {
    const auto& joint = robot.joints[static_cast<std::size_t>(j)];
    if (gravity[j] < least_lift || joint.type != JointType::revolute) continue;
    if (best < 0 || log.q_range[j] < smallest) {
      best = j;
      smallest = log.q_range[j];
    }
  }
  if (best < 0)
    return "no joint of this robot lifts the load, so only its acceleration shows it: accelerate more, or weigh it";
  if (rows.lifted < least_lift)
    return "no joint of this robot lifts the axis of the last one, so gravity shows mass times distance only: weigh it";
  return fmt::format("move joint {} ({}, {:.2g} rad here) and the others that lift the load over a wider range",
                     best + 1, robot.joints[static_cast<std::size_t>(best)].name, smallest);
}

/// A ball where the data sees the centre.
Eigen::Matrix4d ball(double mass, const Vector3d& centre, double density) {
  const double radius = std::cbrt(3 * mass / (4 * std::numbers::pi * density));
  Inertial body;
  body.mass = mass;
  body.centre = centre;
  body.tensor = 0.4 * mass * radius * radius * Matrix3d::Identity();
  return pseudo_inertia(to_link_inertia(body, Eigen::Isometry3d::Identity()));
}

/// d(mass, centre, tensor about the centre) / d(ten parameters).
MatrixXd jacobian(const Inertial& body) {
  MatrixXd out = MatrixXd::Zero(ten, ten);
  const Vector3d& c = body.centre;
  for (Index k = 0; k < ten; ++k) {
    std::array<double, parameters_per_link> unit{};
    unit[static_cast<std::size_t>(k)] = 1;
    const Eigen::Matrix4d d = pseudo_inertia(to_inertia(unit));
    const Vector3d h = d.topRightCorner<3, 1>();
    const Matrix3d second =
        d.topLeftCorner<3, 3>() - h * c.transpose() - c * h.transpose() + d(3, 3) * c * c.transpose();
    const Matrix3d tensor = second.trace() * Matrix3d::Identity() - second;
    out(0, k) = d(3, 3);
    out.col(k).segment(1, 3) = (h - d(3, 3) * c) / body.mass;
    out.col(k).tail(6) << tensor(0, 0), tensor(1, 1), tensor(2, 2), tensor(0, 1), tensor(0, 2), tensor(1, 2);
  }
  return out;
}

/// Mass, centre and tensor with their standard deviations. `apart`: which of the ten standard parameters the motion
/// determines.
std::array<LoadParameter, 10> parameters_of(const Inertial& body, const VectorXd& std,
                                            const std::array<bool, 10>& apart) {
  std::array<LoadParameter, 10> out;
  const Matrix3d& t = body.tensor;
  const double values[] = {body.mass, body.centre.x(), body.centre.y(), body.centre.z(), t(0, 0),
                           t(1, 1),   t(2, 2),         t(0, 1),         t(0, 2),         t(1, 2)};
  static constexpr std::array names{"mass", "x", "y", "z", "ixx", "iyy", "izz", "ixy", "ixz", "iyz"};
  // an entry of the tensor is a sum of the second moments across it
  const bool xx = apart[4], yy = apart[5], zz = apart[6];
  const bool identifiable[] = {apart[0], apart[1], apart[2], apart[3], yy && zz,
                               xx && zz, xx && yy, apart[7], apart[8], apart[9]};
  for (std::size_t k = 0; k < 10; ++k) {
    out[k] = {names[k], k == 0 ? "kg" : k < 4 ? "m" : "kg m^2", values[k], std[static_cast<Index>(k)], identifiable[k]};
  }
  return out;
}

/// Changes of friction, and what the model misses before and after.
void add_residuals(const Rows& rows, const Fit& fit, const VectorXd& theta, LoadFit& out) {
  const auto n = static_cast<Index>(rows.columns.size());
  Inertial point = out.body;
  point.tensor.setZero();
  const auto in_urdf = [](const Inertial& body) {
    const auto v = to_array(to_link_inertia(body, Eigen::Isometry3d::Identity()));
    return VectorXd(Eigen::Map<const VectorXd>(v.data(), ten));
  };
  const VectorXd whole = in_urdf(out.body), point_only = in_urdf(point);
  out.coulomb = out.coulomb_std = out.offset = out.before = out.after = out.with_effect = VectorXd::Zero(n);
  for (Index j = 0; j < n; ++j) {
    const auto at = static_cast<std::size_t>(j);
    const auto nuisance = theta.segment(nuisances * j, nuisances);
    out.coulomb[j] = nuisance[0];
    out.coulomb_std[j] = fit.nuisance_std[nuisances * j];
    out.offset[j] = nuisance[1];
    const MatrixXd& x = rows.columns[at];
    const VectorXd& y = rows.missing[at];
    const double root = std::sqrt(static_cast<double>(y.size()));
    out.before[j] = y.norm() / root;
    out.after[j] = (y - x.leftCols(ten) * whole - x.rightCols(nuisances) * nuisance).norm() / root;
    out.with_effect[j] = (y - x.leftCols(ten) * point_only).norm() / root;
  }
}

/// The possible body that fits best, the prior's centre where the motion shows it.
ConsistentFit possible_load(const Fit& fit, const std::array<bool, 10>& apart, Index joints, double density) {
  const double mass = fit.solution[0];
  Vector3d centre = Vector3d::Zero();
  for (int k = 0; k < 3; ++k) {
    if (apart[static_cast<std::size_t>(1 + k)]) centre[k] = fit.solution[1 + k] / mass;
  }
  const VectorXd free = VectorXd::Constant(nuisances * joints, unbounded);
  std::vector<Index> columns(static_cast<std::size_t>(ten));
  for (Index k = 0; k < ten; ++k) columns[static_cast<std::size_t>(k)] = k;
  return fit_consistent({fit.information,
                         fit.projection,
                         -free,
                         free,
                         MatrixXd::Identity(ten, ten),
                         columns,
                         {ball(mass, centre, density)},
                         fit.correlated});
}

}  // namespace

void check_weighable(const IdentifiedModel& model, const ProcessedLog& log) {
  for (const EffectFit& effect : body_of(model)) {
    if (is_load(effect.effect))
      throw InputError("the model has a payload already: take the model that was identified without load");
  }
  if (log.tau.size() == 0) throw InputError(fmt::format("{}: no torque; a load shows in the torque only", log.name));
}

LoadFit identify_load(const IdentifiedModel& model, const ProcessedLog& log, const LoadOptions& options) {
  check_weighable(model, log);
  const DhChain chain = to_dh(robot_of(model));
  const auto n = static_cast<Index>(robot_of(model).size());
  const Rows rows = build_rows(model, chain, log);
  const Fit fit = solve(rows, options.faded);
  const std::array<bool, 10> apart = identifiable(fit, options);
  const double mass = fit.solution[0], mass_std = std::sqrt(std::max(0.0, fit.covariance(0, 0)));
  if (!apart[0]) {
    throw DataError(fmt::format("{}: the mass of the load cannot be identified from this motion: {}", log.name,
                                what_to_move(robot_of(model), log, rows, options.least_lift)));
  }
  if (!(mass > 0) || mass_std > options.largest_uncertainty * mass) {
    throw DataError(fmt::format("{}: no load to be seen: mass {:.3g} kg, standard deviation {:.3g} kg; {}", log.name,
                                mass, mass_std, what_to_move(robot_of(model), log, rows, options.least_lift)));
  }

  const ConsistentFit possible = possible_load(fit, apart, n, options.density);
  LoadFit out;
  out.constrained = possible.constrained;
  out.body = to_inertial(from_pseudo_inertia(possible.bodies[0]), Eigen::Isometry3d::Identity());
  const MatrixXd to_output = jacobian(out.body);
  const VectorXd std = (to_output * fit.covariance * to_output.transpose()).diagonal().cwiseMax(0).cwiseSqrt();
  out.parameters = parameters_of(out.body, std, apart);
  out.effect.effect = load_effect().name;
  out.effect.named = true;
  const Vector3d& com = out.body.centre;
  out.effect.linear = {out.body.mass, com.x(), com.y(), com.z()};
  out.effect.linear_std = {std[0]};
  for (Index k = 1; k < 4; ++k) out.effect.linear_std.push_back(std[k]);

  add_residuals(rows, fit, possible.theta, out);
  return out;
}

}  // namespace fxdyn
