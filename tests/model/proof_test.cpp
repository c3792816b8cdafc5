// Tries to break the proven bounds: every effect, mild and strong, alone and with a BLS.

#include <gtest/gtest.h>

#include "host_tools/effects/effects.hpp"
#include "host_tools/effects/identified_model.hpp"
#include "host_tools/export/export.hpp"
#include "host_tools/export/proof.hpp"
#include "host_tools/support/random.hpp"
#include "model/effects/delay.hpp"
#include "model/effects/saturation.hpp"
#include "tests/support/broad_learning.hpp"

namespace fxdyn {
namespace {

IdentifiedModel two_joints() {
  IdentifiedModel model;
  model.robot.gravity = {0, -9.81, 0};
  for (int j = 0; j < 2; ++j) {
    Joint joint;
    joint.name = "joint_" + std::to_string(j + 1);
    if (j == 1) joint.origin.translation() = Eigen::Vector3d(0.4, 0.05, 0.1);
    model.robot.joints.push_back(joint);
    model.inertia.push_back({3, {0.5, 0.1, 0.02}, 0.1, 0.12, 0.08, 0.01, -0.01, 0.005});
    JointFit fit;
    fit.sign_width = 0.02;
    fit.rated_torque = 60;
    fit.tau_limit = 1e4;
    fit.q_lower = -1.9;
    fit.q_upper = 2.1;
    fit.dq_limit = 3;
    fit.ddq_limit = 15;
    model.joints.push_back(fit);
  }
  return model;
}

/// Value of a shape parameter between its bounds, where they have a magnitude that occurs.
double shape_value(const ParameterInfo& shape, bool strong) {
  if (shape.name == "joint") return 1;
  if (shape.name == "ratio") return strong ? -3 : 1;
  if (shape.name == "time_constant") return strong ? 1e4 : 20;
  if (shape.name == "wavenumber") return strong ? 100 : 6;
  if (shape.name == "from") return strong ? -0.5 : -2;
  if (shape.name == "span") return strong ? 0.3 : 4;
  if (shape.name == "limit" || shape.name == "torque_scale") return strong ? 1 : 10;
  return std::clamp(strong ? 0.002 : 0.02, shape.lower, shape.upper);
}

void expect_within(const IdentifiedModel& model, const std::string& what) {
  const Formats formats = choose_formats(model);
  const Proof proof = prove(model, &formats);
  EXPECT_TRUE(proof.too_large.empty()) << what;
  TickStates held = within_limits(model, 6000, 5);
  held.dq.bottomRows(5500) = held.dq.row(500).replicate(5500, 1).eval();  // drifts and delays want time
  const QuantisationError error =
      quantisation_error(model, formats, {within_limits(model, 3000, 4), held, creeping(model, formats)});
  const Attained attained = attain(model);
  for (Eigen::Index j = 0; j < 2; ++j) {
    EXPECT_LE(error.uncounted[j], proof.error[j]) << what << ", joint " << j + 1;
    EXPECT_LE(attained.total[j], proof.torque[j]) << what << ", joint " << j + 1;
  }
}

TEST(Proof, HoldsForEveryEffect) {
  for (const std::string_view name : joint_effect_names()) {
    const EffectInfo& info = *find_effect(name);
    for (const bool strong : {false, true}) {
      IdentifiedModel model = two_joints();
      EffectFit fit;
      fit.effect = name;
      for (const ParameterInfo& shape : info.shape) fit.shape.push_back(shape_value(shape, strong));
      const double size = info.acts_on == ActsOn::position ? (strong ? 0.02 : 1e-4) : (strong ? 20 : 1);
      for (std::size_t i = 0; i < info.linear.size(); ++i)
        fit.linear.push_back(name == Delay::name || name == Saturation::name ? 1 : (i == 0 ? 1 : -0.7) * size);
      model.joints[1].effects.push_back(fit);
      expect_within(model, std::string(name) + (strong ? " strong" : " mild"));
    }
  }
}

TEST(Proof, HoldsForABlsAlsoWhereItsVelocityRunsOut) {
  for (const double share : {0.02, 0.003}) {  // of the velocity limit: asinh's table ends at 128
    IdentifiedModel model = two_joints();
    Random random(3);
    BroadLearningFit bls;
    bls.reference_velocity = share * model.joints[0].dq_limit;
    bls.span = std::asinh(1 / share);
    bls.weights = Eigen::MatrixXd::NullaryExpr(20, 5, [&] { return std::round(512 * random.uniform(-3, 3)) / 512; });
    bls.coefficients = Eigen::VectorXd::NullaryExpr(24, [&] { return random.uniform(-5, 5); });
    model.joints[1].bls = bls;
    expect_within(model, "bls");
  }
}

TEST(Proof, HoldsForEveryKindOfBls) {
  for (const auto& [inputs, activation] : test::bls_kinds()) {
    for (const double weight : {0.5, 4.0}) {  // arguments within +-8, and far beyond
      IdentifiedModel model = two_joints();
      model.joints[1].bls = test::random_bls(inputs, activation, model.joints[1], 20, weight, 3);
      expect_within(model, inputs + " " + activation);
    }
  }
}

TEST(Proof, HoldsForABlsOnABentJoint) {
  // The rigid-body torque that the BLS sees is then that of the link's motion.
  IdentifiedModel model = two_joints();
  EffectFit gear;
  gear.effect = "elasticity";
  for (const ParameterInfo& shape : find_effect(gear.effect)->shape) gear.shape.push_back(shape_value(shape, false));
  gear.linear.assign(find_effect(gear.effect)->linear.size(), 1e-4);
  model.joints[1].effects.push_back(gear);
  model.joints[1].bls = test::random_bls("extended", "relu", model.joints[1], 20, 1, 3);
  expect_within(model, "extended beside elasticity");
}

TEST(Proof, HoldsForALateTorqueThatDrifts) {
  IdentifiedModel model = two_joints();
  EffectFit drift, delay;
  drift.effect = "friction_drift";
  drift.shape = {100};
  drift.linear = {20, 5};
  delay.effect = "delay";
  delay.shape = {0.01};
  delay.linear = {1};
  model.joints[0].effects = {drift, delay};
  expect_within(model, "drift and delay");
}

}  // namespace
}  // namespace fxdyn
