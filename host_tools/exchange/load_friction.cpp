#include "host_tools/exchange/load_friction.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "host_tools/effects/evaluator.hpp"
#include "host_tools/effects/identified_model.hpp"

namespace fxdyn {
namespace {

using Eigen::ArrayXd;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

double bell_of(const SimpleJoint& said, double dq) {
  return said.stribeck_velocity > 0 ? std::exp(-std::pow(dq / said.stribeck_velocity, 2)) : 0;
}

double loss_of(const GearFriction& load, double motor, double external, double bell) {
  // one coefficient for both torques; a negative one, of another writer, lessens friction
  if (load.model < 5) return (load.external + bell * load.external_stribeck) * std::fabs(external - motor);
  double out = std::fabs(load.external * external - load.motor * motor) +
               bell * std::fabs(load.external_stribeck * external - load.motor_stribeck * motor);
  if (motor * external >= 0) return out;
  if (std::fabs(external) < std::fabs(motor)) out += bell * load.external_quad * external * external;
  if (std::fabs(external) > std::fabs(motor)) out += bell * load.motor_quad * motor * motor;
  return out;
}

/// The motor also drives this friction: motor = torque + sign(dq) loss(motor). By iteration where the loss grows by
/// less than the motor's torque, else by bisection: it jumps where the motor's and the external torque are equal.
double with_load(const SimpleJoint& said, double torque, double external, double dq) {
  const double bell = bell_of(said, dq), sign = dq > 0 ? 1 : dq < 0 ? -1 : 0;
  const auto loss = [&](double more) { return loss_of(said.load, torque + sign * more, external, bell); };
  double more = 0;
  for (int i = 0; i < 30 && sign != 0; ++i) {
    const double next = loss(more);
    if (std::fabs(next - more) <= 1e-12 * (1 + std::fabs(torque))) return torque + sign * next;
    more = next;
  }
  double low = 0, high = 1 + std::fabs(torque);
  for (int i = 0; i < 60 && loss(high) > high; ++i) high *= 2;
  for (int i = 0; i < 100; ++i) (loss(0.5 * (low + high)) > 0.5 * (low + high) ? low : high) = 0.5 * (low + high);
  return torque + sign * high;
}

/// What bodies get from gravity and velocity: minus the joints' torque without acceleration and friction.
MatrixXd external_torque(SimpleRobot simple, const IdentifiedModel& model, const MotionRows& motion, double step_s) {
  simple.joints.assign(simple.joints.size(), {});
  const MatrixXd still = MatrixXd::Zero(motion.q.rows(), motion.q.cols());
  return -predict(as_model(simple, model), motion.q, motion.dq, still, step_s);
}

bool any_load(const SimpleRobot& simple) {
  return std::any_of(simple.joints.begin(), simple.joints.end(),
                     [](const SimpleJoint& joint) { return joint.load.model > 0; });
}

/// Rows of one joint in which it slides.
struct Sliding {
  ArrayXd dq, motor, external, friction, own_load, bell;  ///< friction, and of it the model's load friction: against
                                                          ///< the motion

  Index rows() const { return dq.size(); }
};

/// Number of each coefficient among the unknowns; `low`: at low speed.
struct At {
  static constexpr Index base = 0, viscous = 1, stribeck = 2, external = 3, motor = 4, external_low = 5, motor_low = 6,
                         external_quad = 7, motor_quad = 8, all = 9;
};

bool is_in(int model, Index unknown) {
  if (unknown == At::base || unknown == At::viscous) return true;
  if (unknown == At::stribeck) return model == 2 || model >= 4;
  if (unknown == At::external || unknown == At::motor) return model >= 3;
  if (unknown == At::external_low || unknown == At::motor_low) return model >= 4;
  return model == 6;
}

/// Columns of the unknowns where |external e - motor m| has the sign that `last` gives it. m3 and m4: one coefficient
/// for both torques, in the external's place.
MatrixXd columns_of(const Sliding& at, int model, const VectorXd& last) {
  MatrixXd out = MatrixXd::Zero(at.rows(), At::all);
  out.col(At::base).setOnes();
  out.col(At::viscous) = at.dq.abs();
  const bool directional = model >= 5;
  const auto pair = [&](Index of_external, Index of_motor, const ArrayXd& weight) {
    if (!directional) {
      out.col(of_external) = weight * (at.external - at.motor).abs();
      return;
    }
    const ArrayXd inner = last[of_external] * at.external - last[of_motor] * at.motor;
    const ArrayXd sign = (inner >= 0).select(ArrayXd::Ones(at.rows()), -1.0);
    out.col(of_external) = weight * sign * at.external;
    out.col(of_motor) = -weight * sign * at.motor;
  };
  pair(At::external, At::motor, ArrayXd::Ones(at.rows()));
  if (is_in(model, At::stribeck)) out.col(At::stribeck) = at.bell;
  if (model >= 4) {
    pair(At::external_low, At::motor_low, at.bell);
  }
  if (model != 6) return out;
  const ArrayXd opposite = (at.external * at.motor < 0).cast<double>() * at.bell;
  out.col(At::external_quad) = opposite * (at.external.abs() < at.motor.abs()).cast<double>() * at.external.square();
  out.col(At::motor_quad) = opposite * (at.external.abs() > at.motor.abs()).cast<double>() * at.motor.square();
  return out;
}

/// x and its normal equations: gram x = projection.
struct LeastSquares {
  MatrixXd gram;
  VectorXd projection;
  double size = 0;  ///< norm of the right side
};

/// Least squares with 0 <= x <= most, one unknown after another (Hildreth 1957).
VectorXd bounded(const LeastSquares& squares, const VectorXd& most) {
  const auto& [gram, projection, size] = squares;
  VectorXd x = VectorXd::Zero(gram.cols());
  for (int round = 0; round < 20000; ++round) {
    double moved = 0;
    for (Index i = 0; i < x.size(); ++i) {
      if (!(gram(i, i) > 0)) continue;
      const double to = std::clamp(x[i] + (projection[i] - gram.row(i).dot(x)) / gram(i, i), 0.0, most[i]);
      moved = std::max(moved, std::fabs(to - x[i]) * std::sqrt(gram(i, i)));
      x[i] = to;
    }
    if (moved <= 1e-12 * size) break;
  }
  return x;
}

/// The same with share x <= sum as well: what the shares have to cost for that (the constraint's multiplier), by
/// bisection.
VectorXd bounded(const LeastSquares& squares, const VectorXd& most, const VectorXd& share, double sum) {
  const auto at_price = [&](double price) {
    return bounded({squares.gram, squares.projection - price * share, squares.size}, most);
  };
  VectorXd x = at_price(0);
  if (share.dot(x) <= sum) return x;
  double low = 0, high = squares.projection.cwiseAbs().maxCoeff();
  for (x = at_price(high); share.dot(x) > sum; x = at_price(high)) high *= 2;
  for (int i = 0; i < 40; ++i) {  // 1e-12 of it
    const double price = 0.5 * (low + high);
    const VectorXd other = at_price(price);
    const bool enough = share.dot(other) <= sum;
    (enough ? high : low) = price;
    if (enough) x = other;
  }
  return x;
}

struct BamFit {
  int model = 0;
  VectorXd x;
  double left = 0;  ///< squares
};

BamFit fit_bam(const Sliding& at, int model, const LoadFrictionOptions& options) {
  VectorXd most = VectorXd::Constant(At::all, HUGE_VAL);
  most[At::motor] = most[At::motor_low] = options.most;
  if (model < 5) most[At::external] = most[At::external_low] = options.most;
  // The square of a torque is no more of it either, up to the largest one: few samples tell these two.
  most[At::external_quad] = options.most / at.external.abs().maxCoeff();
  const double largest = at.motor.abs().maxCoeff();
  most[At::motor_quad] = options.most / largest;
  for (Index i = 0; i < At::all; ++i) {
    if (!is_in(model, i)) most[i] = 0;
  }
  VectorXd share = VectorXd::Zero(At::all);  // of the motor's torque where it is largest
  share[At::motor] = share[At::motor_low] = 1;
  share[At::motor_quad] = largest;
  BamFit out{model, VectorXd::Constant(At::all, options.most), 0};
  for (int round = 0; round < 20; ++round) {  // the signs within |..| settle
    const MatrixXd columns = columns_of(at, model, out.x);
    const VectorXd before = out.x;
    const VectorXd right = at.friction.matrix();
    out.x = bounded({columns.transpose() * columns, columns.transpose() * right, right.norm()}, most, share,
                    2 * options.most);
    out.left = (right - columns * out.x).squaredNorm();
    if (model < 5 || (out.x - before).norm() <= 1e-9 * out.x.norm()) break;
  }
  return out;
}

void say(const BamFit& fit, const EffectFit* effect, SimpleJoint& said) {
  const VectorXd& x = fit.x;
  said.friction = x[At::base];
  said.damping = x[At::viscous];
  said.stribeck = x[At::stribeck];
  said.stribeck_velocity = effect == nullptr ? 0 : effect->shape.at(0);
  if (fit.model < 3) return;
  const bool one = fit.model < 5;  // coefficient for both
  said.load = {fit.model,           x[one ? At::external : At::motor],
               x[At::external],     x[one ? At::external_low : At::motor_low],
               x[At::external_low], x[At::motor_quad],
               x[At::external_quad]};
}

Sliding sliding_rows(const SimpleRobot& simple, const IdentifiedModel& model, const std::vector<ProcessedLog>& train,
                     std::size_t joint, double least) {
  SimpleRobot frictionless = simple;
  for (SimpleJoint& said : frictionless.joints) said = {0, 0, said.armature, 0};
  const ModelValue plain = without_load_friction(model);
  std::vector<std::array<double, 5>> rows;
  const auto j = static_cast<Index>(joint);
  for (const ProcessedLog& log : train) {
    const MotionRows motion = log.motion();
    // Without the log's known load: bodies and external torque have none.
    const MatrixXd full = predict(model, motion.q, motion.dq, motion.ddq, log.step_s),
                   bodies = torque_of(frictionless, model, motion, log.step_s),
                   external = external_torque(simple, model, motion, log.step_s),
                   rest = predict(plain, motion.q, motion.dq, motion.ddq, log.step_s);
    for (Index k = log.first; k < log.last; ++k) {
      const double dq = motion.dq(k, j), sign = dq > 0 ? 1 : -1;
      if (std::fabs(dq) <= least) continue;
      rows.push_back(
          {dq, full(k, j), external(k, j), (full(k, j) - bodies(k, j)) * sign, (full(k, j) - rest(k, j)) * sign});
    }
  }
  const auto column = [&](std::size_t c) {
    ArrayXd out(static_cast<Index>(rows.size()));
    for (std::size_t r = 0; r < rows.size(); ++r) out[static_cast<Index>(r)] = rows[r][c];
    return out;
  };
  return {column(0), column(1), column(2), column(3), column(4), {}};
}

}  // namespace

ModelValue without_load_friction(ModelValue model) {
  for (JointFit& joint : model->joints)
    std::erase_if(joint.effects, [](const EffectFit& fit) { return fit.effect == "load_friction"; });
  return model;
}

MatrixXd torque_of(const SimpleRobot& simple, const IdentifiedModel& model, const MotionRows& motion, double step_s) {
  MatrixXd out = predict(as_model(simple, model), motion.q, motion.dq, motion.ddq, step_s);
  if (!any_load(simple)) return out;
  const MatrixXd external = external_torque(simple, model, motion, step_s);
  for (Index j = 0; j < out.cols(); ++j) {
    const SimpleJoint& said = simple.joints[static_cast<std::size_t>(j)];
    if (said.load.model == 0) continue;
    for (Index k = 0; k < out.rows(); ++k) out(k, j) = with_load(said, out(k, j), external(k, j), motion.dq(k, j));
  }
  return out;
}

void fit_load_friction(SimpleRobot& simple, const IdentifiedModel& model, const std::vector<ProcessedLog>& train,
                       const ProjectionOptions& projection, const LoadFrictionOptions& options) {
  for (std::size_t j = 0; j < simple.joints.size(); ++j) {
    if (model.joints[j].find("load_friction") == nullptr) continue;
    const double least = projection.sliding_widths * model.joints[j].sign_width;
    Sliding rows = sliding_rows(simple, model, train, j, least);
    if (rows.rows() < At::all) continue;  // m1 or m2, as it is
    const EffectFit* effect = model.joints[j].find("stribeck");
    SimpleJoint& said = simple.joints[j];
    if (simple.beside_load.empty()) simple.beside_load = simple.joints;
    said.stribeck_velocity = effect == nullptr ? 0 : effect->shape.at(0);
    rows.bell = rows.dq.unaryExpr([&](double dq) { return bell_of(said, dq); });
    BamFit best = fit_bam(rows, effect == nullptr ? 3 : 4, options);
    // m6 has more than m5 only at low speed, where the model knows of a Stribeck velocity
    for (int larger = 5; larger <= (effect == nullptr ? 5 : 6); ++larger) {
      BamFit other = fit_bam(rows, larger, options);
      if (std::sqrt(other.left) < options.worth * std::sqrt(best.left)) best = std::move(other);
    }
    say(best, effect, said);
    rows.friction -= rows.own_load;
    say(fit_bam(rows, effect == nullptr ? 1 : 2, options), effect, simple.beside_load[j]);
  }
}

}  // namespace fxdyn
