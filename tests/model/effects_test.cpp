#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <numbers>

#include "host_tools/effects/effects.hpp"
#include "host_tools/effects/evaluator.hpp"
#include "host_tools/effects/identified_model.hpp"
#include "host_tools/export/export.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/random.hpp"
#include "model/effects/delay.hpp"
#include "model/effects/gravity_tilt.hpp"
#include "model/effects/joint_coupling.hpp"
#include "model/effects/payload.hpp"

namespace fxdyn {
namespace {

constexpr double step_s = 0.002;
constexpr double sign_width = 0.02;

JointSeries random_series(std::uint64_t seed, int samples = 2000) {
  Random random(seed);
  const Eigen::VectorXd zero = Eigen::VectorXd::Zero(samples);
  JointSeries s{zero, zero, zero, zero, step_s};
  s.total = zero;
  s.peers_q = s.peers_dq = s.peers_sign = s.peers_ddq = Eigen::MatrixXd::Zero(samples, 3);
  const double a = random.uniform(0.2, 1.5), b = random.uniform(1, 9), c = random.uniform(0, 6);
  for (int k = 0; k < samples; ++k) {
    const double t = step_s * k;
    s.q[k] = a * std::sin(b * t + c);
    s.dq[k] = a * b * std::cos(b * t + c);
    s.ddq[k] = -a * b * b * std::sin(b * t + c);
    s.structural[k] = 30 * std::sin(3 * t + c);
    s.total[k] = s.structural[k] + 4 * std::cos(11 * t);
    for (int i = 0; i < 3; ++i) {
      s.peers_q(k, i) = -2.0 / (i + 1) * std::cos((i + 1) * t + c);
      s.peers_dq(k, i) = 2 * std::sin((i + 1) * t + c);
      s.peers_sign(k, i) = std::tanh(s.peers_dq(k, i) / 0.1);
      s.peers_ddq(k, i) = 2 * (i + 1) * std::cos((i + 1) * t + c);
    }
  }
  return s;
}

/// Cox's and de Boor's recursion over knots at the whole numbers.
double recursion(int i, int degree, double x) {
  if (degree == 0) return x >= i && x < i + 1 ? 1 : 0;
  return ((x - i) * recursion(i, degree - 1, x) + (i + degree + 1 - x) * recursion(i + 1, degree - 1, x)) / degree;
}

/// The twelve bumps of a free curve between two knots at x.
std::vector<double> bumps(double x, double from, double to, double factor = 1) {
  std::vector<double> out;
  // the recursion's last piece is open at its end
  const double place = std::min(std::clamp((x - from) / (to - from), 0.0, 1.0) * 9, 9 - 1e-14);
  for (int i = -3; i < 9; ++i) out.push_back(1.5 * recursion(i, 3, place) * factor);
  return out;
}

/// What each effect should give, written a second time on purpose and in another way where there is one: states by
/// their closed-form solutions.
std::vector<double> expected(std::string_view effect, const JointSeries& s, int k, double& z) {
  const double q = s.q[k], dq = s.dq[k], sign = std::tanh(dq / sign_width), structural = s.structural[k];
  const double total = s.total[k];
  if (effect == "viscous") return {dq};
  if (effect == "coulomb") return {sign};
  if (effect == "offset") return {1};
  if (effect == "rotor_inertia") return {s.ddq[k]};
  if (effect == "stribeck") return {sign * std::exp(-std::pow(dq / 0.1, 2))};
  if (effect == "soft_knee") return {1 - 2 / (1 + std::exp(2 * dq / 0.1))};
  if (effect == "presliding") {
    const double direction = dq > 0 ? 1 : -1;
    z = direction - (direction - z) * std::exp(-std::fabs(dq) * step_s / 0.003);
    return {z - sign};
  }
  if (effect == "lugre") {
    // exact for the mean of both ends' velocities, n of the end
    const double n = 0.7 + 0.3 * std::exp(-std::pow(dq / 0.2, 2));
    const double mean = (dq + (k > 0 ? s.dq[k - 1] : 0)) / 2, to = std::copysign(n, mean);
    z = to - (to - z) * std::exp(-std::fabs(mean) * step_s / 0.003 / n);
    return {z - 0.7 * sign, dq - std::fabs(dq) * z / n};
  }
  if (effect == "maxwell_slip") {
    // what a spring has of the way since its last reversal, by the whole way back to the start
    std::vector<double> out;
    for (int i = 0; i < 5; ++i) {
      const double most = 0.003 / std::pow(2, i);
      double spring = 0;
      for (int m = 0; m <= k; ++m) {
        spring += step_s * (s.dq[m] + (m > 0 ? s.dq[m - 1] : 0)) / 2;
        spring = std::copysign(std::min(std::fabs(spring), most), spring);
      }
      out.push_back(spring / most - sign);
    }
    return out;
  }
  if (effect == "asymmetric_friction") return {std::fabs(sign), std::fabs(dq)};
  if (effect == "viscous_quadratic") return {std::copysign(dq * dq, dq)};
  if (effect == "viscous_cubic") return {std::pow(dq, 3)};
  if (effect == "load_friction") return {std::hypot(structural, 0) * sign};
  if (effect == "torque_gain") return {total};
  if (effect == "ripple") return {std::polar(1.0, 7 * q).real(), std::polar(1.0, 7 * q).imag()};
  if (effect == "spring") return {q, 1};
  if (effect == "gravity_compensator") return {std::polar(1.0, q).real(), std::polar(1.0, q).imag()};
  if (effect == "friction_drift") {
    const double w = 1 - std::exp(-k * step_s / 2.0);
    return {w * sign, w * dq};
  }
  if (effect == "saturation") return {std::clamp(total, -20.0, 20.0) - total};
  if (effect == "joint_coupling") return {s.peers_sign(k, 1), s.peers_dq(k, 1)};
  if (effect == "delay") {
    const double place = std::max(0.0, k - 0.0071 / step_s);
    const int before = static_cast<int>(place);
    const double slope = before < k ? s.total[before + 1] - s.total[before] : 0;
    return {s.total[before] + (place - before) * slope - total};
  }
  if (effect == "elasticity") {  // impulse response of the low-pass, summed over the last forty time constants
    // (implicit Euler: a tick divides what is left by 1 + step / relaxation)
    const double decay = 1 / (1 + step_s / 0.01);
    double load = s.structural[0] * std::pow(decay, k);
    for (int i = std::max(1, k - 200); i <= k; ++i) load += (1 - decay) * std::pow(decay, k - i) * s.structural[i];
    return {load};
  }
  if (effect == "backlash") return {1 - 2 / (1 + std::exp(2 * structural / 5))};
  if (effect == "eccentricity") return {std::polar(1.0, q).imag(), std::polar(1.0, q).real()};
  if (effect == "position_curve") return bumps(q, -0.1, 0.15);
  if (effect == "velocity_curve") return bumps(dq, -0.1, 0.2);
  if (effect == "load_curve") return bumps(structural, -0.5, 0.3);
  if (effect == "friction_over_position") return bumps(q, -0.1, 0.15, sign);
  if (effect == "cross_position") return bumps(s.peers_q(k, 1), -0.3, 0.6);
  if (effect == "motor_coupling") {
    const double other = -0.8 * s.peers_dq(k, 1);
    return {1 - 2 / (1 + std::exp(2 * (dq + other) / 0.05)), other, -0.8 * s.peers_ddq(k, 1)};
  }
  ADD_FAILURE() << "no independent formula for " << effect << ": write one into expected()";
  return {};
}

std::vector<double> shape_of(std::string_view effect) {
  if (effect == "stribeck" || effect == "soft_knee") return {0.1};
  if (effect == "presliding") return {0.003};
  if (effect == "lugre") return {0.003, 0.2, 0.7};
  if (effect == "maxwell_slip") return {0.003};
  if (effect == "ripple") return {7};
  if (effect == "friction_drift") return {2};
  if (effect == "saturation") return {20};
  if (effect == "joint_coupling") return {2};
  if (effect == "delay") return {0.0071};
  if (effect == "elasticity") return {0.01};
  if (effect == "backlash") return {5};
  if (effect == "motor_coupling") return {2, -0.8, 0.05};
  if (effect == "position_curve" || effect == "friction_over_position") return {-0.1, 0.25};
  if (effect == "velocity_curve") return {-0.1, 0.3};
  if (effect == "cross_position") return {2, -0.3, 0.9};
  if (effect == "load_curve") return {-0.5, 0.8};  // within the load of one_joint()
  const std::size_t count = find_effect(effect)->shape.size();
  if (count > 0) ADD_FAILURE() << "no values for the shape of " << effect << ": write them into shape_of()";
  return std::vector<double>(count, 0.1);
}

TEST(Effects, EveryOneFollowsItsIndependentFormula) {
  for (const std::string_view effect : joint_effect_names()) {
    const JointSeries series = random_series(11);
    const Eigen::MatrixXd columns = effect_columns(effect, shape_of(effect), sign_width, series);
    double z = 0;
    for (int k = 0; k < series.q.size(); ++k) {
      const std::vector<double> phi = expected(effect, series, k, z);
      ASSERT_EQ(columns.cols(), static_cast<Eigen::Index>(phi.size())) << effect;
      for (Eigen::Index i = 0; i < columns.cols(); ++i) {
        const double value = phi[static_cast<std::size_t>(i)];
        ASSERT_NEAR(columns(k, i), value, 1e-12 * (1 + std::fabs(value))) << effect << " " << i << " at " << k;
      }
    }
  }
}

TEST(Effects, EveryShapeParameterChangesTheColumns) {
  const JointSeries series = random_series(12);
  for (const std::string_view effect : joint_effect_names()) {
    const std::vector<double> shape = shape_of(effect);
    const Eigen::MatrixXd before = effect_columns(effect, shape, sign_width, series);
    EXPECT_GT(before.colwise().norm().minCoeff(), 0) << effect;
    for (std::size_t i = 0; i < shape.size(); ++i) {
      std::vector<double> other = shape;
      const bool index = find_effect(effect)->shape[i].name == "joint";
      other[i] = index ? shape[i] + 1 : 1.1 * shape[i];
      EXPECT_GT((effect_columns(effect, other, sign_width, series) - before).norm(), 0) << effect;
    }
  }
}

TEST(Effects, WhatASeriesLacksIsRefused) {
  JointSeries series = random_series(13, 50);
  series.structural.resize(0);
  series.total.resize(0);
  series.peers_dq.resize(0, 0);
  for (const std::string_view effect : joint_effect_names()) {
    const EffectInfo& info = *find_effect(effect);
    const auto columns = [&] { return effect_columns(effect, shape_of(effect), sign_width, series); };
    if (info.needs_structural || info.needs_total || info.needs_peers) {
      EXPECT_THROW(columns(), InputError) << effect;
    } else {
      EXPECT_NO_THROW(columns()) << effect;
    }
  }
}

TEST(Effects, AnotherNumberOfShapeParametersIsRefused) {
  const JointSeries series = random_series(13, 50);
  const std::vector<double> two{0.1, 0.1};
  EXPECT_THROW(effect_columns("stribeck", {}, sign_width, series), InputError);
  EXPECT_THROW(effect_columns("stribeck", two, sign_width, series), InputError);
  EXPECT_NO_THROW(effect_columns("stribeck", std::span(two).first(1), sign_width, series));
}

TEST(Effects, ADelayBeyondTheBufferIsRefused) {
  const JointSeries series = random_series(14, 50);
  const std::vector<double> most{Delay::largest * step_s}, more{1.01 * most[0]};
  EXPECT_NO_THROW(effect_columns("delay", most, sign_width, series));
  EXPECT_THROW(effect_columns("delay", more, sign_width, series), InputError);
}

TEST(Effects, JointCouplingIsTotal) {
  // Zero without peers; an index beyond the robot is the last joint.
  const double words[]{40 - 1};
  const std::array<JointInput<Real>, 2> peers{JointInput<Real>{0, 1}, JointInput<Real>{0, 2}};
  JointInput<Real> u;
  NoState state;
  Saturations none;
  double viscous = -1;
  const auto keep = [&](auto, std::size_t i, double phi) {
    if (i == 1) viscous = phi;
  };
  JointCoupling::basis<Real>(u, Words<Real>{words}, state, none, keep);
  EXPECT_EQ(viscous, 0);
  u.peers = peers;
  JointCoupling::basis<Real>(u, Words<Real>{words}, state, none, keep);
  EXPECT_EQ(viscous, 2);
}

TEST(Effects, AMotorOfTwoJointsDoesNoWorkOfItsOwn) {
  // Friction and rotor of a motor at v = a dq_1 + b dq_2 take the power T v; the two joints' shares of it, each an
  // instance and what viscous and rotor_inertia hold, add up to that.
  const JointSeries one = random_series(15);
  const double a = 0.9, b = -1.4, coulomb = 2, viscous = 0.3, inertia = 0.05, width = 0.04;
  JointSeries two = one;
  two.dq = one.peers_dq.col(1);
  two.ddq = one.peers_ddq.col(1);
  JointSeries first = one, second = two;
  first.peers_dq.col(1) = two.dq;
  first.peers_ddq.col(1) = two.ddq;
  second.peers_dq.col(0) = one.dq;
  second.peers_ddq.col(0) = one.ddq;
  const auto torque = [&](const JointSeries& s, double own, double other, double joint) {
    const std::vector<double> shape{joint, other / own, width / std::fabs(own)};
    const Eigen::Vector3d theta(std::fabs(own) * coulomb, own * own * viscous, own * own * inertia);
    return Eigen::VectorXd(effect_columns("motor_coupling", shape, sign_width, s) * theta +
                           own * own * (viscous * s.dq + inertia * s.ddq));
  };
  const Eigen::VectorXd tau_1 = torque(first, a, b, 2), tau_2 = torque(second, b, a, 1);
  for (Eigen::Index k = 0; k < one.q.size(); ++k) {
    const double v = a * one.dq[k] + b * two.dq[k], dv = a * one.ddq[k] + b * two.ddq[k];
    const double motor = coulomb * std::tanh(v / width) + viscous * v + inertia * dv;
    ASSERT_NEAR(tau_1[k] * one.dq[k] + tau_2[k] * two.dq[k], motor * v, 1e-11);
  }
}

TEST(Effects, CoupledJointsSeeEachOthersMotion) {
  // Two joints without mass: their torques are those of the coupling.
  const JointSeries one = random_series(16);
  IdentifiedModel model;
  model.robot.gravity.setZero();
  model.robot.joints.resize(2);
  model.inertia.resize(2);
  model.joints.resize(2);
  Eigen::MatrixXd q(one.q.size(), 2), dq = q, ddq = q;
  q << one.q, one.peers_dq.col(1);
  dq << one.dq, one.peers_dq.col(1);
  ddq << one.ddq, one.peers_ddq.col(1);
  const Eigen::Vector3d theta(2, 0.3, 0.05);
  for (std::size_t j = 0; j < 2; ++j) {
    EffectFit fit;
    fit.effect = "motor_coupling";
    fit.shape = {j == 0 ? 2.0 : 1.0, -1, 0.05};
    fit.linear = {theta[0], theta[1], theta[2]};
    model.joints[j].effects.push_back(fit);
  }
  const Eigen::MatrixXd torque = predict(model, q, dq, ddq, step_s);
  for (Eigen::Index j = 0; j < 2; ++j) {
    JointSeries series{q.col(j), dq.col(j), ddq.col(j), {}, step_s};
    series.peers_q = q;
    series.peers_dq = series.peers_sign = dq;
    series.peers_ddq = ddq;
    const auto& shape = model.joints[static_cast<std::size_t>(j)].effects[0].shape;
    const Eigen::VectorXd expected = effect_columns("motor_coupling", shape, sign_width, series) * theta;
    EXPECT_LT((torque.col(j) - expected).cwiseAbs().maxCoeff(), 1e-12) << j;
  }
  model.joints[1].effects[0].shape[0] = 2;  // with itself
  EXPECT_THROW(predict(model, q, dq, ddq, step_s), InputError);
}

TEST(Effects, ElasticityLagsByItsRelaxationAtAnyTick) {
  // Against the closed form of a steady oscillation: amplitude 1 / sqrt(1 + (w r)^2), lag atan(w r).
  const double relaxation = 0.004, w = 2 * std::numbers::pi * 3;
  for (const double step : {0.0005, 0.002}) {
    const auto samples = static_cast<Eigen::Index>(2 / step);
    const Eigen::VectorXd zero = Eigen::VectorXd::Zero(samples);
    JointSeries series{zero, zero, zero, zero, step};
    for (Eigen::Index k = 0; k < samples; ++k) series.structural[k] = std::sin(w * step * static_cast<double>(k));
    const std::vector<double> shape{relaxation};
    const Eigen::VectorXd load = effect_columns("elasticity", shape, sign_width, series);
    const double lag = std::atan(w * relaxation), amplitude = std::cos(lag);
    double most = 0;
    for (Eigen::Index k = samples / 2; k < samples; ++k) {
      most = std::max(most, std::fabs(load[k] - amplitude * std::sin(w * step * static_cast<double>(k) - lag)));
    }
    EXPECT_LT(most, 0.6 * w * w * relaxation * step) << step;  // second order; the lag itself is 0.075
  }
}

TEST(Effects, DahlStepIsStableWhereEulerIsNot) {
  Dahl<Real> dahl;
  Saturations none;
  for (int k = 0; k < 100; ++k) {
    const double z = dahl.step(k % 2 == 0 ? 50.0 : -50.0, 0.002 / 0.0005, none);  // 200 distances a tick
    ASSERT_LE(std::fabs(z), 1.0);
  }
}

TEST(Effects, DahlStepIsExactForConstantVelocity) {
  // Against the classic Runge-Kutta method at a thousandth of the tick, through a reversal.
  const double distance = 0.004;
  Dahl<Real> dahl;
  Saturations none;
  double z = 0;
  for (const double dq : {0.3, 1.7, -0.6, -0.1, 0.0, 2.5}) {
    const double h = step_s / 1000;
    const auto slope = [&](double x) { return dq / distance * (1 - sign_of(dq) * x); };
    for (int k = 0; k < 1000; ++k) {
      const double k1 = slope(z), k2 = slope(z + h / 2 * k1), k3 = slope(z + h / 2 * k2), k4 = slope(z + h * k3);
      z += h / 6 * (k1 + 2 * k2 + 2 * k3 + k4);
    }
    EXPECT_NEAR(dahl.step(dq, step_s / distance, none), z, 1e-12) << dq;
  }
}

TEST(BodyEffects, PayloadIsAPointMassOnTheLink) {
  Random random(6);
  const auto vector = [&](double size) {
    return Vector3<double>{random.uniform(-size, size), random.uniform(-size, size), random.uniform(-size, size)};
  };
  const LinkGeometry<Real> geometry{JointType::revolute, std::cos(0.3), std::sin(0.3), {0.2, -0.1, 0.4}, 0.1};
  LinkMotion<Real> base = base_motion<Real>({1, 2, 9});
  base.omega = vector(2);
  base.omega_dot = vector(5);
  const LinkMotion<Real> motion = link_motion<Real>(AnyLink{}, geometry, base, {0.7, 1.5, -3});
  const LinkInertia<Real> link{3, vector(1), 0.4, 0.5, 0.6, 0.01, 0.02, 0.03};
  const double mass = 2.5;
  const Vector3<double> com = vector(0.3);

  const Wrench<Real> before = link_wrench<Real>(AnyLink{}, link, motion);
  const Wrench<Real> after = link_wrench<Real>(AnyLink{}, Payload::add_to(link, mass, com), motion);
  const Vector3<double> force = scale(mass, motion.a + motion.k * com), moment = cross(com, force);
  EXPECT_NEAR(after.force.x, before.force.x + force.x, 1e-12);
  EXPECT_NEAR(after.force.y, before.force.y + force.y, 1e-12);
  EXPECT_NEAR(after.force.z, before.force.z + force.z, 1e-12);
  EXPECT_NEAR(after.moment.x, before.moment.x + moment.x, 1e-12);
  EXPECT_NEAR(after.moment.y, before.moment.y + moment.y, 1e-12);
  EXPECT_NEAR(after.moment.z, before.moment.z + moment.z, 1e-12);
}

TEST(BodyEffects, GravityTiltTurnsAboutXThenY) {
  const Eigen::Vector3d up(0.4, -1.2, 9.7);
  const Eigen::Vector3d turned =
      Eigen::AngleAxisd(-0.2, Eigen::Vector3d::UnitY()) * Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitX()) * up;
  const Vector3<double> result = GravityTilt::turn({up.x(), up.y(), up.z()}, 0.3, -0.2);
  EXPECT_LT((Eigen::Vector3d(result.x, result.y, result.z) - turned).norm(), 1e-14);
}

/// Such that every effect gives a few N*m.
double coefficient_of(Quantity quantity, double value) {
  switch (quantity) {
    case Quantity::acceleration:
      return 0.1;
    case Quantity::velocity:
    case Quantity::torque:
      return 0.1 * value;
    case Quantity::velocity_squared:
      return 0.01 * value;
    case Quantity::velocity_cubed:
      return 1e-3 * value;
    default:
      return value;
  }
}

/// A one-joint robot with every effect that a model can have and a BLS.
IdentifiedModel one_joint() {
  IdentifiedModel model;
  Joint joint;
  joint.name = "joint";
  model.robot.joints.push_back(joint);
  model.inertia.push_back({});
  model.inertia[0].xx = model.inertia[0].yy = 0.1;
  JointFit fit;
  fit.sign_width = sign_width;
  fit.rated_torque = 60;
  fit.tau_limit = 300;
  fit.q_lower = -2;
  fit.q_upper = 2;
  fit.dq_limit = 15;
  fit.ddq_limit = 130;
  double value = 1.3;
  for (const std::string_view effect : joint_effect_names()) {
    const EffectInfo& info = *find_effect(effect);
    if (info.acts_on != ActsOn::torque || info.needs_total || info.needs_peers) continue;
    EffectFit e;
    e.effect = effect;
    e.shape = shape_of(effect);
    for (const ParameterInfo& parameter : find_effect(effect)->linear)
      e.linear.push_back(coefficient_of(parameter.quantity, value += 0.2));
    fit.effects.push_back(e);
  }
  BroadLearningFit bls;
  bls.reference_velocity = 0.2;
  Random random(4);
  bls.span = 5;
  // on the grid, as train draws them
  bls.weights = Eigen::MatrixXd::NullaryExpr(12, 5, [&] { return std::round(512 * random.uniform(-1, 1)) / 512; });
  bls.coefficients = Eigen::VectorXd::NullaryExpr(16, [&] { return random.uniform(-2, 2); });
  fit.bls = bls;
  model.joints.push_back(fit);
  return model;
}

TickStates states_of(const JointSeries& series) {
  TickStates s{"series",
               Eigen::VectorXd::LinSpaced(series.q.size(), 0, step_s * static_cast<double>(series.q.size() - 1)),
               series.q, series.dq, series.ddq};
  return s;
}

TEST(Effects, TorqueIsThetaTimesPhi) {
  IdentifiedModel model = one_joint();
  model.joints[0].bls.reset();
  JointSeries series = random_series(21);
  const Eigen::MatrixXd torque = predict(model, series.q, series.dq, series.ddq, step_s);
  IdentifiedModel rigid = model;
  rigid.joints[0].effects.clear();
  series.structural = predict(rigid, series.q, series.dq, series.ddq, step_s).col(0);
  Eigen::VectorXd sum = series.structural;
  for (const EffectFit& fit : model.joints[0].effects) {
    sum += effect_columns(fit.effect, fit.shape, sign_width, series) *
           Eigen::Map<const Eigen::VectorXd>(fit.linear.data(), static_cast<Eigen::Index>(fit.linear.size()));
  }
  EXPECT_LT((torque.col(0) - sum).cwiseAbs().maxCoeff(), 1e-12);
}

TEST(Effects, FixedPointFollowsDouble) {
  const IdentifiedModel model = one_joint();
  std::vector<TickStates> states{states_of(random_series(31)), states_of(random_series(32))};
  const Formats formats = choose_formats(model);
  states.push_back(perturbed(states[0], model, 5));
  const QuantisationError error = quantisation_error(model, formats, states);
  EXPECT_LT(error.largest[0], 1e-5 * model.joints[0].rated_torque);
  // Signal to noise: power of the torque against power of the rounding.
  const Eigen::MatrixXd torque = predict(model, states[0].q, states[0].dq, states[0].ddq, step_s);
  const double signal = torque.norm() / std::sqrt(static_cast<double>(torque.rows()));
  EXPECT_GT(20 * std::log10(signal / error.rms[0]), 100.0);  // the BLS rounds its nodes to 16 bits
  IdentifiedModel without = model;
  without.joints[0].bls.reset();
  const QuantisationError fine = quantisation_error(without, choose_formats(without), {states[0]});
  EXPECT_GT(20 * std::log10(signal / fine.rms[0]), 125.0);
}

TEST(Effects, EveryExportedWordOfTheEffectsChangesTheTorque) {
  // Liveness: a parameter that nothing depends on is a parameter that was forgotten.
  const IdentifiedModel model = one_joint();
  const TickStates states = states_of(random_series(41, 400));
  const Formats formats = choose_formats(model);
  const Eigen::MatrixXd before = predict_fixed(model, formats, states);
  const auto changed = [&](auto&& change) {
    IdentifiedModel other = model;
    change(other.joints[0]);
    return (predict_fixed(other, formats, states) - before).norm() > 0;
  };
  for (std::size_t e = 0; e < model.joints[0].effects.size(); ++e) {
    const EffectFit& fit = model.joints[0].effects[e];
    for (std::size_t i = 0; i < fit.shape.size(); ++i)
      EXPECT_TRUE(changed([&](JointFit& j) { j.effects[e].shape[i] *= 1.1; })) << fit.effect;
    for (std::size_t i = 0; i < fit.linear.size(); ++i)
      EXPECT_TRUE(changed([&](JointFit& j) { j.effects[e].linear[i] *= 1.01; })) << fit.effect;
  }
  EXPECT_TRUE(changed([](JointFit& j) { j.sign_width *= 1.1; }));
  for (Eigen::Index k = 0; k < model.joints[0].bls->weights.size(); ++k) {
    EXPECT_TRUE(changed([&](JointFit& j) { j.bls->weights.data()[k] += 0.05; })) << "weight " << k;
  }
  for (Eigen::Index k = 0; k < model.joints[0].bls->coefficients.size(); ++k) {
    EXPECT_TRUE(changed([&](JointFit& j) { j.bls->coefficients[k] += 0.05; })) << "coefficient " << k;
  }
}

}  // namespace
}  // namespace fxdyn
