#include <gtest/gtest.h>

#include <cmath>

#include "host_tools/export/export.hpp"
#include "host_tools/model/effects.hpp"
#include "host_tools/model/evaluator.hpp"
#include "host_tools/random.hpp"

namespace fxdyn {
namespace {

constexpr double step_s = 0.002;
constexpr double sign_width = 0.02;

JointSeries random_series(std::uint64_t seed, int samples = 2000) {
  Random random(seed);
  JointSeries s{Eigen::VectorXd(samples), Eigen::VectorXd(samples), Eigen::VectorXd(samples), {}, step_s};
  const double a = random.uniform(0.2, 1.5), b = random.uniform(1, 9), c = random.uniform(0, 6);
  for (int k = 0; k < samples; ++k) {
    const double t = step_s * k;
    s.q[k] = a * std::sin(b * t + c);
    s.dq[k] = a * b * std::cos(b * t + c);
    s.ddq[k] = -a * b * b * std::sin(b * t + c);
  }
  return s;
}

/// What each effect should give, written a second time on purpose and in another way where there is one: the Dahl state
/// by its closed-form solution over travelled distance.
double expected(std::string_view effect, const JointSeries& s, int k, double& z) {
  const double sign = std::tanh(s.dq[k] / sign_width);
  if (effect == "viscous") return s.dq[k];
  if (effect == "coulomb") return sign;
  if (effect == "offset") return 1;
  if (effect == "rotor_inertia") return s.ddq[k];
  if (effect == "stribeck") return sign * std::exp(-std::pow(s.dq[k] / 0.1, 2));
  if (effect == "presliding") {
    const double direction = s.dq[k] > 0 ? 1 : -1;
    z = direction - (direction - z) * std::exp(-std::fabs(s.dq[k]) * step_s / 0.003);
    return z - sign;
  }
  ADD_FAILURE() << "no independent formula for " << effect << ": write one";
  return 0;
}

std::vector<double> shape_of(std::string_view effect) {
  if (effect == "stribeck") return {0.1};
  if (effect == "presliding") return {0.003};
  return {};
}

TEST(Effects, EveryOneFollowsItsIndependentFormula) {
  for (const std::string_view effect : effect_names()) {
    const JointSeries series = random_series(11);
    const Eigen::MatrixXd columns = effect_columns(effect, shape_of(effect), sign_width, series);
    double z = 0;
    for (int k = 0; k < series.q.size(); ++k)
      ASSERT_NEAR(columns(k, 0), expected(effect, series, k, z), 1e-12) << effect;
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

/// A one-joint robot with every effect of the catalogue and a BLS.
IdentifiedModel one_joint() {
  IdentifiedModel model;
  Joint joint;
  joint.name = "joint";
  model.robot.joints.push_back(joint);
  model.inertia.push_back({});
  JointFit fit;
  fit.sign_width = sign_width;
  fit.rated_torque = fit.tau_limit = 60;
  fit.q_lower = -2;
  fit.q_upper = 2;
  fit.dq_limit = 15;
  fit.ddq_limit = 130;
  double value = 1.3;
  for (const std::string_view effect : effect_names()) {
    EffectFit e;
    e.effect = effect;
    e.shape = shape_of(effect);
    for (std::size_t i = 0; i < find_effect(effect)->linear.size(); ++i)
      e.linear.push_back(effect == "rotor_inertia" ? 0.1 : value += 0.4);
    fit.effects.push_back(e);
  }
  BroadLearningFit bls;
  bls.reference_velocity = 0.2;
  Random random(4);
  bls.weights = Eigen::MatrixXd::NullaryExpr(12, 5, [&] { return random.uniform(-1, 1); });
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
  const JointSeries series = random_series(21);
  const Eigen::MatrixXd torque = predict(model, series.q, series.dq, series.ddq, step_s);
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(series.q.size());
  for (const EffectFit& fit : model.joints[0].effects) {
    sum += effect_columns(fit.effect, fit.shape, sign_width, series) *
           Eigen::Map<const Eigen::VectorXd>(fit.linear.data(), static_cast<Eigen::Index>(fit.linear.size()));
  }
  EXPECT_LT((torque.col(0) - sum).cwiseAbs().maxCoeff(), 1e-12);
}

TEST(Effects, FixedPointFollowsDouble) {
  const IdentifiedModel model = one_joint();
  std::vector<TickStates> states{states_of(random_series(31)), states_of(random_series(32))};
  const Formats formats = choose_formats(model, states);
  states.push_back(perturbed(states[0], model, 5));
  const QuantisationError error = quantisation_error(model, formats, states);
  EXPECT_LT(error.largest[0], 1e-5 * model.joints[0].rated_torque);
  // Signal to noise: power of the torque against power of the rounding.
  const Eigen::MatrixXd torque = predict(model, states[0].q, states[0].dq, states[0].ddq, step_s);
  const double signal = torque.norm() / std::sqrt(static_cast<double>(torque.rows()));
  EXPECT_GT(20 * std::log10(signal / error.rms[0]), 110.0);
}

TEST(Effects, EveryExportedWordOfTheEffectsChangesTheTorque) {
  // Liveness: a parameter that nothing depends on is a parameter that was forgotten.
  const IdentifiedModel model = one_joint();
  const TickStates states = states_of(random_series(41, 400));
  const Formats formats = choose_formats(model, {states});
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
