#include "host_tools/identify/plausible.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "host_tools/effects/effect_roles.hpp"
#include "host_tools/effects/link_parameters.hpp"
#include "host_tools/identify/torque_samples.hpp"
#include "host_tools/regression/physical.hpp"
#include "host_tools/regression/regressor.hpp"
#include "host_tools/regression/solver.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr Index samples_used = 400;

/// Columns of a joint beside the base parameters: the nominal effects.
const auto own = static_cast<Index>(nominal_effects().size());
Index column_of(std::string_view effect) {
  const std::vector<std::string>& all = nominal_effects();
  return std::find(all.begin(), all.end(), effect) - all.begin();
}
const Index coulomb = column_of(dry_friction_effect().name), viscous = column_of(viscous_friction_effect().name),
            rotor = column_of(rotor_effect().name);

struct OwnEstimate {
  double value = 0, std = 0;
};

Eigen::RowVectorXd own_row(double sign_width, double dq, double ddq) {
  JointSeries sample;
  sample.q = VectorXd::Zero(1);
  sample.dq = VectorXd::Constant(1, dq);
  sample.ddq = VectorXd::Constant(1, ddq);
  Eigen::RowVectorXd row(own);
  for (Index i = 0; i < own; ++i)
    row[i] = effect_columns(nominal_effects()[static_cast<std::size_t>(i)], {}, sign_width, sample)(0, 0);
  return row;
}

/// OwnRows of all joints over a few hundred samples, the columns' gravity part apart.
class OwnRows {
 public:
  OwnRows(const Robot& robot, const std::vector<ProcessedLog>& logs, const std::vector<JointFit>& joints,
          const PlausibleOptions& options)
      : options_(options), n_(static_cast<Index>(robot.size())) {
    const DhChain chain = to_dh(robot);
    base_ = find_base(chain);
    Regressor regressor(chain);
    const auto nb = static_cast<Index>(base_.columns.size());
    for (Index j = 0; j < n_; ++j) {
      has_rotor_.push_back(!rotor_inertia_is_absorbed(chain, base_, j));
      left_out_.push_back(logs.front().is_left_out(j));
    }
    TorqueSamples samples = sample_torque(logs, samples_used);
    tau_ = std::move(samples.tau);
    const Index rows = tau_.rows();
    rows_per_sample_ = std::max(1.0, static_cast<double>(rows) / samples.independent);
    for (Index j = 0; j < n_; ++j) {
      moving_.emplace_back(rows, nb);
      gravity_.emplace_back(rows, nb);
      own_.emplace_back(MatrixXd::Zero(rows, own));
      own_inertia_.emplace_back(rows, nb);
    }
    const VectorXd zero = VectorXd::Zero(n_);
    accelerations_ = zero;
    for (Index k = 0; k < rows; ++k) {
      const VectorXd q = samples.q.row(k), dq = samples.dq.row(k), ddq = samples.ddq.row(k);
      const MatrixXd still = regressor(q, zero, zero)(Eigen::all, base_.columns);
      const MatrixXd moving = regressor(q, dq, ddq)(Eigen::all, base_.columns);
      accelerations_ += ddq.cwiseAbs2();
      for (Index j = 0; j < n_; ++j) {
        const auto joint = static_cast<std::size_t>(j);
        gravity_[joint].row(k) = still.row(j);
        moving_[joint].row(k) = moving.row(j) - still.row(j);
        own_[joint].row(k) = own_row(joints[joint].sign_width, dq[j], ddq[j]);
        if (!has_rotor_[joint]) own_[joint](k, rotor) = 0;
        own_inertia_[joint].row(k) = regressor(q, zero, VectorXd::Unit(n_, j)).row(j)(base_.columns) - still.row(j);
      }
    }
    for (Index j = 0; j < n_; ++j) {
      for (const double up : {1.0, -1.0}) {
        const MatrixXd x = columns(j, up);
        grams_[up < 0].push_back(x.transpose() * x);
        projections_[up < 0].push_back(x.transpose() * tau_.col(j));
      }
      squares_.push_back(std::max(tau_.col(j).squaredNorm(), 1e-300));
    }
  }

  /// Twice as many rows as parameters: fewer prove nothing.
  bool enough() const { return tau_.size() >= 2 * (static_cast<Index>(base_.columns.size()) + own * n_); }

  /// Weighted least squares with these signs of torque (one a joint; a number other than 1 scales it) and of gravity.
  struct Fit {
    VectorXd solution;  ///< base, then `own` a joint
    MatrixXd covariance;
    double score = 0;  ///< sum over joints of log(residual square / torque square)
    double up = 1;
    VectorXd signs;
  };
  Fit fit(double up, const VectorXd& signs) const {
    const auto nb = static_cast<Index>(base_.columns.size());
    const Index p = nb + own * n_;
    const auto& grams = grams_[up < 0];
    const auto& projections = projections_[up < 0];
    Fit fit;
    fit.up = up;
    fit.signs = signs;
    VectorXd residual = Eigen::Map<const VectorXd>(squares_.data(), n_).cwiseProduct(signs.cwiseAbs2());
    MatrixXd information;
    for (int round = 0; round < 4; ++round) {
      information = MatrixXd::Zero(p, p);
      VectorXd projection = VectorXd::Zero(p);
      for (Index j = 0; j < n_; ++j) {
        const auto joint = static_cast<std::size_t>(j);
        const double w = static_cast<double>(tau_.rows()) / residual[j];
        const Index at = nb + own * j;
        if (left_out_[joint]) {
          information.block(at, at, own, own).setIdentity();
          continue;
        }
        information.topLeftCorner(nb, nb) += w * grams[joint].topLeftCorner(nb, nb);
        information.block(0, at, nb, own) = w * grams[joint].topRightCorner(nb, own);
        information.block(at, 0, own, nb) = w * grams[joint].bottomLeftCorner(own, nb);
        information.block(at, at, own, own) = w * grams[joint].bottomRightCorner(own, own);
        projection.head(nb) += w * signs[j] * projections[joint].head(nb);
        projection.segment(at, own) = w * signs[j] * projections[joint].tail(own);
      }
      fit.solution = SymmetricSolver(information).solve(projection);
      fit.score = 0;
      for (Index j = 0; j < n_; ++j) {
        const auto joint = static_cast<std::size_t>(j);
        if (left_out_[joint]) continue;
        const VectorXd x = of_joint(fit.solution, j);
        const double whole = signs[j] * signs[j] * squares_[joint];
        const double square = whole - 2 * signs[j] * x.dot(projections[joint]) + x.dot(grams[joint] * x);
        residual[j] = std::max(square, options_.perfect * options_.perfect * whole);
        fit.score += std::log(residual[j] / whole);
      }
    }
    fit.covariance = rows_per_sample_ * SymmetricSolver(information).inverse();
    return fit;
  }

  /// M_jj, mean over the poses, and the share of poses where it is negative.
  OwnEstimate inertia(const Fit& fit, Index j, double& share_negative) const {
    const auto joint = static_cast<std::size_t>(j);
    const auto nb = own_inertia_[joint].cols();
    VectorXd row = VectorXd::Zero(fit.solution.size());
    row.head(nb) = own_inertia_[joint].colwise().mean().transpose();
    row[nb + own * j + rotor] = has_rotor_[joint] ? 1 : 0;
    VectorXd all = own_inertia_[joint] * fit.solution.head(nb);
    if (has_rotor_[joint]) all.array() += fit.solution[nb + own * j + rotor];
    share_negative = static_cast<double>((all.array() < 0).count()) / static_cast<double>(all.size());
    return estimate(fit, row);
  }
  /// Coulomb and viscous friction at the RMS of the velocity.
  OwnEstimate friction(const Fit& fit, Index j) const {
    const auto joint = static_cast<std::size_t>(j);
    const Index at = fit.solution.size() - own * (n_ - j);
    VectorXd row = VectorXd::Zero(fit.solution.size());
    row[at + coulomb] = 1;
    row[at + viscous] = own_[joint].col(viscous).norm() / std::sqrt(static_cast<double>(own_[joint].rows()));
    return estimate(fit, row);
  }
  /// Largest gravity torque.
  OwnEstimate gravity(const Fit& fit, Index j) const {
    const auto joint = static_cast<std::size_t>(j);
    const Index nb = gravity_[joint].cols();
    const VectorXd all = (gravity_[joint] * fit.solution.head(nb)).cwiseAbs();
    Index where = 0;
    all.maxCoeff(&where);
    VectorXd row = VectorXd::Zero(fit.solution.size());
    row.head(nb) = gravity_[joint].row(where);
    const OwnEstimate signed_one = estimate(fit, row);
    return {std::fabs(signed_one.value), signed_one.std};
  }
  /// Largest gravity torque of bodies pi.
  double gravity_of(const VectorXd& pi, Index j) const {
    return (gravity_[static_cast<std::size_t>(j)] * (base_.grouping * pi)).cwiseAbs().maxCoeff();
  }
  /// A joint that stands still holds any torque, as does its brake: nothing of it counts.
  bool is_left_out(Index j) const { return left_out_[static_cast<std::size_t>(j)]; }
  const PlausibleOptions& options() const { return options_; }
  double acceleration_rms(Index j) const { return std::sqrt(accelerations_[j] / static_cast<double>(tau_.rows())); }
  double torque_rms(Index j) const {
    return std::sqrt(squares_[static_cast<std::size_t>(j)] / static_cast<double>(tau_.rows()));
  }

 private:
  MatrixXd columns(Index j, double up) const {
    const auto joint = static_cast<std::size_t>(j);
    MatrixXd x(tau_.rows(), moving_[joint].cols() + own);
    x << moving_[joint] + up * gravity_[joint], own_[joint];
    return x;
  }
  VectorXd of_joint(const VectorXd& solution, Index j) const {
    const Index nb = solution.size() - own * n_;
    VectorXd x(nb + own);
    x << solution.head(nb), solution.segment(nb + own * j, own);
    return x;
  }
  static OwnEstimate estimate(const Fit& fit, const VectorXd& row) {
    return {row.dot(fit.solution), std::sqrt(std::max(0.0, row.dot(fit.covariance * row)))};
  }

  const PlausibleOptions& options_;
  Index n_;
  BaseSet base_;
  double rows_per_sample_ = 1;  ///< neighbours of filtered torque are no independent samples
  std::vector<bool> has_rotor_, left_out_;
  MatrixXd tau_;
  VectorXd accelerations_;  ///< sum of squares
  std::vector<MatrixXd> moving_, gravity_, own_, own_inertia_;
  std::vector<MatrixXd> grams_[2];
  std::vector<VectorXd> projections_[2];
  std::vector<double> squares_;
};

/// Flips one joint's torque after the other while that explains all joints far better.
OwnRows::Fit best_signs(const OwnRows& rows, double up, Index joints) {
  OwnRows::Fit best = rows.fit(up, VectorXd::Ones(joints));
  for (;;) {
    OwnRows::Fit next = best;
    for (Index j = 0; j < joints; ++j) {
      if (best.signs[j] < 0) continue;
      VectorXd signs = best.signs;
      signs[j] = -1;
      OwnRows::Fit candidate = rows.fit(up, signs);
      if (candidate.score < next.score) next = std::move(candidate);
    }
    if (!(next.score < best.score - rows.options().flip)) return best;
    best = std::move(next);
  }
}

/// How far the last link reaches beyond its joint: to its farthest fixed frame (flange, tool), or to the end of a body
/// whose centre of mass is in its middle.
double last_link(const Robot& robot) {
  const Joint& last = robot.joints.back();
  double reach = last.inertial ? 2 * last.inertial->centre.norm() : 0;
  for (const Eigen::Vector3d& frame : last.fixed_frames) reach = std::max(reach, frame.norm());
  return reach;
}

/// Longest distance from a joint to the end of the last link, whatever the pose.
double reach_of(const Robot& robot, std::size_t joint) {
  double reach = last_link(robot);
  for (std::size_t i = joint + 1; i < robot.size(); ++i) {
    reach += robot.joints[i].origin.translation().norm();
    const auto& limits = robot.joints[i].limits;
    if (robot.joints[i].type == JointType::prismatic && limits)
      reach += std::max(std::fabs(limits->lower), std::fabs(limits->upper));
  }
  return reach;
}

std::string title(const Robot& robot, std::size_t joint) {
  return fmt::format("joint {} ({})", joint + 1, robot.joints[joint].name);
}

void check_units(const Robot& robot, const OwnRows& rows, const OwnRows::Fit& fit, std::vector<Suspicion>& out) {
  const PlausibleOptions& options = rows.options();
  const double reach = reach_of(robot, 0);
  const double strength = robot.gravity.norm();
  double mass = 0, mass_std = 0;
  for (std::size_t j = 0; j < robot.size(); ++j) {
    const double arm = std::max(reach_of(robot, j), options.shortest);
    if (robot.joints[j].type != JointType::revolute || reach_of(robot, j) < options.least_reach * reach) continue;
    double ignored = 0;
    const OwnEstimate inertia = rows.inertia(fit, static_cast<Index>(j), ignored);
    const OwnEstimate gravity = rows.gravity(fit, static_cast<Index>(j));
    for (const OwnEstimate& e :
         {OwnEstimate{inertia.value / (arm * arm), inertia.std / (arm * arm)},
          strength > 0 ? OwnEstimate{gravity.value / (strength * arm), gravity.std / (strength * arm)}
                       : OwnEstimate{}}) {
      if (e.value > mass) mass = e.value, mass_std = e.std;
    }
  }
  const double volume = std::pow(std::max(reach, options.shortest), 3);
  if (reach > 0 && mass - options.sure * mass_std > options.heaviest * volume) {
    out.push_back(
        {Severity::warning,
         {},
         fmt::format("torques ask for a robot of at least {:.3g} kg that reaches {:.2g} m: are they in mN*m or "
                     "motor current? Set torque_gain so that they are in N*m at the joint",
                     mass, reach)});
  } else if (reach > 0 && mass > 0 && mass + options.sure * mass_std < options.lightest * volume) {
    out.push_back(
        {Severity::warning,
         {},
         fmt::format("torques ask for no more than {:.2g} kg in a robot that reaches {:.2g} m: are they in "
                     "kN*m, or on the motor's side of the gearbox? Set torque_gain so that they are in N*m at "
                     "the joint",
                     mass, reach)});
  }
}

/// One joint's torque in other units than the others': with it scaled, all fit together.
void check_one_unit(const Robot& robot, const OwnRows& rows, const OwnRows::Fit& fit, std::vector<Suspicion>& out) {
  const double needed = fit.score - rows.options().unit;
  struct Scaled {
    std::size_t joint;
    double times;
    OwnRows::Fit fit;
  };
  std::vector<Scaled> all;
  double best = needed;
  for (std::size_t j = 0; j < robot.size(); ++j) {
    if (rows.is_left_out(static_cast<Index>(j))) continue;
    for (const double times : {1e-3, 1e-2, 0.1, 0.2, 0.5, 2.0, 5.0, 10.0, 100.0, 1e3}) {
      VectorXd signs = fit.signs;
      signs[static_cast<Index>(j)] *= times;
      all.push_back({j, times, rows.fit(fit.up, signs)});
      best = std::min(best, all.back().fit.score);
    }
  }
  std::erase_if(
      all, [&](const Scaled& one) { return one.fit.score > best + rows.options().as_good || one.fit.score >= needed; });
  if (all.empty()) return;
  // Of two joints either may be the one: rather that with which the robot weighs what it may.
  const auto possible = [&](const Scaled& one) {
    std::vector<Suspicion> heavy;
    check_units(robot, rows, one.fit, heavy);
    return heavy.empty();
  };
  const auto it = std::find_if(all.begin(), all.end(), possible);
  const Scaled& one = it == all.end() ? all.front() : *it;
  // A gain that is moderately off is no other unit: `check` reports it, and a known load gives it.
  if (std::max(one.times, 1 / one.times) < rows.options().unit_factor) return;
  out.push_back({Severity::error, one.joint,
                 fmt::format("torque of {} is about {:g} times too {} beside the others': other units, or a gear left "
                             "out? Set its torque_gain",
                             title(robot, one.joint), one.times < 1 ? 1 / one.times : one.times,
                             one.times < 1 ? "large" : "small")});
}

void check_against_urdf(const Robot& robot, const OwnRows& rows, const OwnRows::Fit& fit, std::vector<Suspicion>& out) {
  const PlausibleOptions& options = rows.options();
  const DhChain chain = to_dh(robot);
  const auto n = static_cast<Index>(robot.size());
  VectorXd pi(n * static_cast<Index>(parameters_per_link));
  for (std::size_t i = 0; i < robot.size(); ++i) {
    if (!robot.joints[i].inertial) return;
    const auto values = to_array(to_link_inertia(*robot.joints[i].inertial, chain.urdf_in_dh[i]));
    pi.segment(static_cast<Index>(i * parameters_per_link), static_cast<Index>(parameters_per_link)) =
        Eigen::Map<const VectorXd>(values.data(), static_cast<Index>(parameters_per_link));
  }
  VectorXd given(n);
  for (Index j = 0; j < n; ++j) given[j] = rows.gravity_of(pi, j);
  for (Index j = 0; j < n; ++j) {
    if (!(given[j] > options.least_gravity * given.maxCoeff()) || robot.gravity.norm() == 0) continue;
    const OwnEstimate found = rows.gravity(fit, j);
    const double ratio = found.value / given[j], spread = options.sure * found.std / given[j];
    if (ratio - spread < options.other_gravity && ratio + spread > 1 / options.other_gravity) continue;
    out.push_back(
        {Severity::warning, static_cast<std::size_t>(j),
         fmt::format("gravity on {} is {:.2g} times that of the URDF's masses: check torque_gain, or the URDF",
                     title(robot, static_cast<std::size_t>(j)), ratio)});
  }
}

}  // namespace

std::vector<Suspicion> check_plausible(const Robot& robot, const std::vector<ProcessedLog>& logs,
                                       const std::vector<JointFit>& joints, const PlausibleOptions& options) {
  const auto n = static_cast<Index>(robot.size());
  const OwnRows rows(robot, logs, joints, options);
  if (!rows.enough()) return {};
  OwnRows::Fit fit = best_signs(rows, 1, n);
  if (OwnRows::Fit other = best_signs(rows, -1, n); other.score < fit.score - options.flip) fit = std::move(other);

  // The other joints can't decide which of two opposite signs all have: inertia and friction can.
  VectorXd signs = fit.signs;
  std::vector<std::string> why(robot.size(), "the other joints' torques fit together only with the opposite sign");
  std::vector<Suspicion> out;
  for (Index j = 0; j < n; ++j) {
    if (rows.is_left_out(j)) continue;
    double share = 0;
    const OwnEstimate inertia = rows.inertia(fit, j, share);
    const OwnEstimate friction = rows.friction(fit, j);
    const auto at = static_cast<std::size_t>(j);
    const bool revolute = robot.joints[at].type == JointType::revolute;
    const bool heavy = std::fabs(inertia.value) > options.sure * inertia.std;
    const bool rubs = std::fabs(friction.value) > options.sure * friction.std &&
                      std::fabs(friction.value) > options.material_friction * rows.torque_rms(j);
    const std::string of_inertia = fmt::format("its own inertia comes out as {:.3g} +- {:.2g} {}", inertia.value,
                                               inertia.std, revolute ? "kg m^2" : "kg");
    const std::string of_friction = fmt::format("its friction comes out as {:.3g} +- {:.2g} {}", friction.value,
                                                friction.std, robot.joints[at].torque_unit());
    const bool light = heavy && inertia.value < 0 && share > options.negative_poses,
               drives = rubs && friction.value < 0;
    // A turned sign turns both: where one is negative and the other is surely not, the model is what is wrong.
    if (light && !(rubs && !drives)) {
      signs[j] = -signs[j];
      why[at] = of_inertia;
    } else if (drives && !(heavy && !light)) {
      signs[j] = -signs[j];
      why[at] = of_friction;
    } else if (light && -inertia.value * rows.acceleration_rms(j) > options.material_inertia * rows.torque_rms(j)) {
      out.push_back({Severity::warning, at,
                     fmt::format("{}: {}, though its friction has the right sign: is the kinematics that of the robot, "
                                 "or an effect missing?",
                                 title(robot, at), of_inertia)});
    } else if (drives) {
      out.push_back({Severity::warning, at,
                     fmt::format("{}: {}, which brakes no joint: is an effect missing, or is its velocity wrong?",
                                 title(robot, at), of_friction)});
    }
  }
  if (fit.up < 0) {
    out.push_back({Severity::error,
                   {},
                   "gravity acts against the masses that move: turn robot.gravity round, or check zero and sign of q"});
  }
  if ((signs.array() < 0).all() && n > 1) {
    out.push_back(
        {Severity::error,
         {},
         fmt::format("torque has the wrong sign on all joints (joint 1: {}): make each torque_gain negative", why[0])});
  } else {
    for (Index j = 0; j < n; ++j) {
      const auto at = static_cast<std::size_t>(j);
      if (signs[j] > 0) continue;
      out.push_back({Severity::error, at,
                     fmt::format("torque of {} has the wrong sign: {}; make its torque_gain negative (or its q, if "
                                 "that is what is turned)",
                                 title(robot, at), why[at])});
    }
  }
  const bool signs_differ = (signs - fit.signs).norm() > 0;
  const OwnRows::Fit final_fit = signs_differ ? rows.fit(fit.up, signs) : std::move(fit);
  if (n > 1) check_one_unit(robot, rows, final_fit, out);
  check_units(robot, rows, final_fit, out);
  check_against_urdf(robot, rows, final_fit, out);
  return out;
}

}  // namespace fxdyn
