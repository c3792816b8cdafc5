#include "host_tools/check/arrangement.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <tuple>
#include <utility>

#include "host_tools/effects/effect_roles.hpp"
#include "host_tools/effects/effects.hpp"
#include "host_tools/regression/pseudo_inertia.hpp"
#include "host_tools/regression/regressor.hpp"

namespace fxdyn {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

constexpr auto ten = static_cast<Index>(parameters_per_link);
Index nominal_columns() { return static_cast<Index>(nominal_effects().size()); }

Index own_column(std::string_view effect) {
  const std::vector<std::string>& all = nominal_effects();
  return std::find(all.begin(), all.end(), effect) - all.begin();
}
Index viscous_column() { return own_column(viscous_friction_effect().name); }
Index rotor_column() { return own_column(rotor_effect().name); }
Index coulomb_column() { return own_column(dry_friction_effect().name); }

/// Times as sure as the prior that a column is zero, where there is none.
constexpr double none = 1e8;

/// What a spring or a gravity compensator at the joint makes of its position: the effects `spring`, whose offset is the
/// joint's, and, where it turns, `gravity_compensator`.
constexpr Index spring_columns = 3;
MatrixXd spring_of(const VectorXd& q, JointType type) {
  MatrixXd out = MatrixXd::Zero(q.size(), spring_columns);
  out.col(0) = q.array() - q.mean();
  if (type != JointType::revolute) return out;
  out.col(1) = q.array().cos();
  out.col(2) = q.array().sin();
  return out;
}

/// How far a joint may go: the URDF's range and as far again, or `widest` where it has none.
double longest_way(const Joint& joint, const ArrangementOptions& options) {
  const auto& limits = joint.limits;
  const bool known = limits && !joint.continuous && limits->upper > limits->lower;
  return known ? 2 * (limits->upper - limits->lower) : options.widest;
}

/// The URDF's body of a link, or a sphere of the mass that the torques ask for.
LinkInertia<Real> body_of(const Joint& joint, const Eigen::Isometry3d& pose, double mass, double radius) {
  if (joint.inertial) return to_link_inertia(possible_body(*joint.inertial), pose);
  Inertial sphere;
  sphere.mass = mass;
  sphere.tensor = 0.4 * mass * radius * radius * Eigen::Matrix3d::Identity();
  return to_link_inertia(sphere, pose);
}

/// Length of the chain [m].
double chain_length(const Robot& robot) {
  double length = 0;
  for (const Joint& joint : robot.joints) length += joint.origin.translation().norm();
  return std::max(length, 0.3);
}

/// Adds a joint's normal equations: of the bodies, and of its own columns, which begin at `at`.
void add_rows(const MatrixXd& gram, Index bodies, Index at, MatrixXd& information) {
  const Index own = gram.rows() - bodies;
  information.topLeftCorner(bodies, bodies) += gram.topLeftCorner(bodies, bodies);
  information.block(0, at, bodies, own) += gram.topRightCorner(bodies, own);
  information.block(at, 0, own, bodies) += gram.bottomLeftCorner(own, bodies);
  information.block(at, at, own, own) += gram.bottomRightCorner(own, own);
}

}  // namespace

Arrangement as_given(const Robot& robot) {
  const auto n = static_cast<Index>(robot.size());
  Arrangement out;
  out.motion_from.resize(robot.size());
  std::iota(out.motion_from.begin(), out.motion_from.end(), 0);
  out.torque_from = out.motion_from;
  out.motion_gain = out.torque_gain = VectorXd::Ones(n);
  out.motion_offset = VectorXd::Zero(n);
  for (const Joint& joint : robot.joints) out.axis.push_back(joint.axis);
  out.gravity = robot.gravity;
  out.sprung.resize(robot.size(), false);
  return out;
}

TorqueSamples arranged(const TorqueSamples& samples, const Arrangement& arrangement) {
  TorqueSamples out = samples;
  for (Index j = 0; j < arrangement.motion_gain.size(); ++j) {
    const Index motion = arrangement.motion_from[static_cast<std::size_t>(j)];
    const Index torque = arrangement.torque_from[static_cast<std::size_t>(j)];
    const double gain = arrangement.motion_gain[j];
    out.q.col(j) = (gain * samples.q.col(motion)).array() + arrangement.motion_offset[j];
    out.dq.col(j) = gain * samples.dq.col(motion);
    out.ddq.col(j) = gain * samples.ddq.col(motion);
    out.tau.col(j) = arrangement.torque_gain[j] * samples.tau.col(torque);
  }
  return out;
}

ArrangementEvidence::ArrangementEvidence(Robot robot, TorqueSamples samples, const ArrangementOptions& options,
                                         FrictionMemory memory)
    : robot_(std::move(robot)), samples_(std::move(samples)), options_(options), memory_(std::move(memory)) {
  torque_square_ = samples_.tau.colwise().squaredNorm().transpose() / static_cast<double>(samples_.size());
  for (Index j = 0; j < static_cast<Index>(robot_.size()); ++j) {
    const auto [lower, upper] = range(j);
    const double most = std::min(longest_way(robot_.joints[static_cast<std::size_t>(j)], options_), options_.widest);
    moves_.push_back(upper - lower > options_.standstill * most);
  }
}

ArrangementEvidence::ArrangementEvidence(Robot robot, TorqueSamples samples, const ArrangementOptions& options,
                                         KnownBodies bodies)
    : ArrangementEvidence(std::move(robot), std::move(samples), options) {
  known_ = std::move(bodies);
}

Index ArrangementEvidence::own_columns() const { return nominal_columns() + memory_columns() + spring_columns; }

/// Sum of dq times the friction of a joint's own columns; x: bodies, then those.
double ArrangementEvidence::friction_power(const MatrixXd& gram, const VectorXd& x) const {
  const Index bodies = x.size() - own_columns(), dq = bodies + viscous_column(), sign = bodies + coulomb_column();
  double power = x[dq] * gram(dq, dq) + x[sign] * gram(sign, dq);
  for (Index i = bodies + nominal_columns(); i < x.size() - spring_columns; ++i) power += x[i] * gram(i, dq);
  return power;
}

double ArrangementEvidence::excess(const Arrangement& arrangement, Index joint) const {
  const auto j = static_cast<std::size_t>(joint);
  const auto [lower, upper] = range(arrangement.motion_from[j]);
  const double way = std::fabs(arrangement.motion_gain[joint]) * (upper - lower);
  return std::log(std::max(1.0, way / longest_way(robot_.joints[j], options_)));
}

bool ArrangementEvidence::enough() const { return samples_.size() >= 2 * (ten + nominal_columns() + memory_columns()); }

ArrangementEvidence::Design ArrangementEvidence::design(const Arrangement& arrangement) const {
  const auto n = static_cast<Index>(robot_.size());
  const Index rows = samples_.size(), bodies = ten * n, own = own_columns();
  Robot robot = robot_;
  robot.gravity = arrangement.gravity;
  for (std::size_t j = 0; j < robot.size(); ++j) robot.joints[j].axis = arrangement.axis[j];
  const DhChain chain = to_dh(robot);

  const TorqueSamples as = arranged(samples_, arrangement);
  std::vector<MatrixXd> x(robot.size(), MatrixXd(rows, bodies + own));
  Regressor regressor(chain);
  for (Index k = 0; k < rows; ++k) {
    const MatrixXd& y = regressor(as.q.row(k), as.dq.row(k), as.ddq.row(k));
    for (Index j = 0; j < n; ++j) x[static_cast<std::size_t>(j)].row(k).head(bodies) = y.row(j);
  }

  Design out;
  out.information = MatrixXd::Zero(bodies, bodies);
  out.mean.resize(bodies);
  out.own_square.resize(robot.size());
  const double length = chain_length(robot);
  const double mass = std::sqrt(torque_square_.maxCoeff()) / (9.81 * length);
  for (std::size_t j = 0; j < robot.size(); ++j) {
    const auto joint = static_cast<Index>(j);
    JointSeries series;
    series.q = as.q.col(joint);
    series.dq = as.dq.col(joint);
    series.ddq = as.ddq.col(joint);
    series.step_s = 1;
    const double width = std::max(0.02 * series.dq.cwiseAbs().maxCoeff(), 1e-9);
    for (Index i = 0; i < nominal_columns(); ++i)
      x[j].col(bodies + i) = effect_columns(nominal_effects()[static_cast<std::size_t>(i)], {}, width, series).col(0);
    if (!memory_.empty()) {
      const auto from = static_cast<std::size_t>(arrangement.motion_from[j]);
      x[j].middleCols(bodies + nominal_columns(), memory_columns()) =
          std::copysign(1.0, arrangement.motion_gain[joint]) * memory_[from];
    }
    x[j].rightCols(spring_columns) = spring_of(series.q, robot.joints[j].type);
    out.own_square[j] =
        (x[j].rightCols(own).colwise().squaredNorm().transpose() / static_cast<double>(rows)).cwiseMax(1e-12);
    // Bodies before the joint do not load it: their columns are zero.
    const Index used = bodies + own - ten * joint;
    out.gram.emplace_back(MatrixXd::Zero(bodies + own, bodies + own));
    out.gram.back().bottomRightCorner(used, used).noalias() = x[j].rightCols(used).transpose() * x[j].rightCols(used);
    out.projection.push_back(x[j].transpose() * samples_.tau);

    const bool known = robot.joints[j].inertial.has_value();
    const double vague = known ? 1 : options_.vague;
    const Eigen::Matrix4d body = pseudo_inertia(body_of(robot.joints[j], chain.urdf_in_dh[j], mass, length / 4));
    out.mean.segment(ten * joint, ten) = pseudo_inertia_parameters(body);
    out.information.block(ten * joint, ten * joint, ten, ten) = barrier_hessian(body.inverse()) / (vague * vague);
  }
  return out;
}

ArrangementEvidence::Fit ArrangementEvidence::best_fit(const Design& design, const Arrangement& arrangement) const {
  if (known_) return fit(design, arrangement, 1);
  Fit best = fit(design, arrangement, options_.mass_errors.front());
  for (std::size_t i = 1; i < options_.mass_errors.size(); ++i) {
    Fit other = fit(design, arrangement, options_.mass_errors[i]);
    if (other.score.nats < best.score.nats) best = std::move(other);
  }
  return best;
}

ArrangementScore ArrangementEvidence::score(const Design& design, const Arrangement& arrangement) const {
  ArrangementScore best = best_fit(design, arrangement).score;
  for (std::size_t j = 0; j < robot_.size(); ++j)
    best.nats += options_.beyond * excess(arrangement, static_cast<Index>(j));
  return best;
}

KnownBodies ArrangementEvidence::bodies(const Arrangement& arrangement) const {
  const Fit fit = best_fit(design(arrangement), arrangement);
  const Index bodies = ten * static_cast<Index>(robot_.size()), own = fit.x.size() - bodies;
  // Whatever the joints' own columns are: those of another log differ.
  const MatrixXd across = fit.information.topRightCorner(bodies, own);
  const Eigen::LLT<MatrixXd> of_own(fit.information.bottomRightCorner(own, own));
  return {fit.x.head(bodies),
          fit.information.topLeftCorner(bodies, bodies) - across * of_own.solve(across.transpose())};
}

/// Friction brakes, builds up after a reversal and not before it, and a rotor is heavy: else there is none from here
/// on, and what it would explain is left.
/// @param taken own columns of all joints that are out @return whether one more is
bool ArrangementEvidence::take_out_impossible(Index joint, const MatrixXd& gram, const VectorXd& x,
                                              std::vector<bool>& taken, MatrixXd& prior) const {
  const Index own = own_columns(), bodies = x.size() - own, memory_end = own - spring_columns;
  bool more = false;
  const auto take_out = [&](Index i) {
    const Index at = own * joint + i;
    if (taken[static_cast<std::size_t>(at)]) return;
    taken[static_cast<std::size_t>(at)] = more = true;
    prior(bodies + at, bodies + at) *= none;
  };
  for (Index i = nominal_columns(); i < memory_end; ++i) {
    if (x[bodies + i] < 0) take_out(i);
  }
  if (friction_power(gram, x) < 0) {
    take_out(viscous_column());
    take_out(coulomb_column());
    for (Index i = nominal_columns(); i < memory_end; ++i) take_out(i);
  }
  if (x[bodies + rotor_column()] < 0) take_out(rotor_column());
  return more;
}

ArrangementEvidence::Fit ArrangementEvidence::fit(const Design& design, const Arrangement& arrangement,
                                                  double mass_error) const {
  const auto n = static_cast<Index>(robot_.size());
  const Index bodies = ten * n, own = own_columns(), all = bodies + own * n;
  const auto rows = static_cast<double>(samples_.size());
  const double count = std::min(options_.independent, rows);

  MatrixXd prior = MatrixXd::Zero(all, all);
  prior.topLeftCorner(bodies, bodies) = known_ ? known_->information : design.information / (mass_error * mass_error);
  VectorXd mean = VectorXd::Zero(all);
  mean.head(bodies) = known_ ? known_->mean : design.mean;
  VectorXd whole(n), variance(n);
  const auto& [from, gain] = std::tie(arrangement.torque_from, arrangement.torque_gain);
  for (Index j = 0; j < n; ++j) {
    const auto joint = static_cast<std::size_t>(j);
    whole[j] = std::max(gain[j] * gain[j] * torque_square_[from[joint]], 1e-300);
    prior.diagonal().segment(bodies + own * j, own) =
        design.own_square[joint] / (options_.own_share * options_.own_share * whole[j]);
    if (!arrangement.sprung[joint])
      prior.diagonal().segment(bodies + own * (j + 1) - spring_columns, spring_columns) *= none;
  }
  variance = whole;

  Fit result;
  ArrangementScore& out = result.score;
  VectorXd& solution = result.x;
  MatrixXd& information = result.information;
  std::vector<bool> taken(static_cast<std::size_t>(own * n), false);
  double log_determinant = 0;
  bool settled = false;
  for (int round = 0; round < 6 && !settled; ++round) {
    settled = round > 0;
    information = prior;
    VectorXd projection = prior * mean;
    for (Index j = 0; j < n; ++j) {
      const auto joint = static_cast<std::size_t>(j);
      if (!moves(arrangement.motion_from[joint])) continue;
      const double weight = count / (rows * variance[j]);
      const Index at = bodies + own * j;
      add_rows(weight * design.gram[joint], bodies, at, information);
      const VectorXd target = weight * gain[j] * design.projection[joint].col(from[joint]);
      projection.head(bodies) += target.head(bodies);
      projection.segment(at, own) += target.tail(own);
    }
    const VectorXd scale = information.diagonal().cwiseSqrt().cwiseInverse();
    const Eigen::LLT<MatrixXd> llt(scale.asDiagonal() * information * scale.asDiagonal());
    solution = scale.asDiagonal() * llt.solve(scale.asDiagonal() * projection);
    log_determinant = 2 * (llt.matrixLLT().diagonal().array().abs().log().sum() - scale.array().log().sum());
    for (Index j = 0; j < n; ++j) {
      const auto joint = static_cast<std::size_t>(j);
      VectorXd x(bodies + own);
      x << solution.head(bodies), solution.segment(bodies + own * j, own);
      const double square =
          whole[j] +
          (x.dot(design.gram[joint] * x) - 2 * gain[j] * x.dot(design.projection[joint].col(from[joint]))) / rows;
      const double before =
          std::exchange(variance[j], std::max(square, options_.perfect * options_.perfect * whole[j]));
      settled = settled && std::fabs(variance[j] - before) < options_.settled * before;
      settled = !take_out_impossible(j, design.gram[joint], x, taken, prior) && settled;
    }
  }
  out.rms = variance.cwiseSqrt();
  for (Index j = 0; j < n; ++j)
    if (moves(arrangement.motion_from[static_cast<std::size_t>(j)]))
      out.nats += count / 2 * std::log(variance[j] / whole[j]);
  const VectorXd change = solution - mean;
  const Eigen::LLT<MatrixXd> of_prior(prior);
  out.nats += 0.5 * change.dot(prior * change) + 0.5 * log_determinant -
              of_prior.matrixLLT().diagonal().array().abs().log().sum();
  return result;
}

ArrangementScore ArrangementEvidence::operator()(const Arrangement& arrangement) const {
  return score(design(arrangement), arrangement);
}

}  // namespace fxdyn
