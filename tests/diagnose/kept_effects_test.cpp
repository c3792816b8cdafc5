#include "host_tools/train/kept_effects.hpp"
#include "host_tools/effects/identified_model.hpp"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "host_tools/effects/evaluator.hpp"
#include "host_tools/support/files.hpp"
#include "tests/diagnose/arm.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

EffectFit named(const char* effect, std::vector<double> shape, std::vector<double> linear) {
  EffectFit fit{effect, shape, linear, shape, linear, true};
  for (auto* stds : {&fit.shape_std, &fit.linear_std}) {
    for (double& std : *stds) std *= 0.01;
  }
  return fit;
}

/// A log whose torque is the model's.
struct Exact {
  explicit Exact(const char* name) : arm(name), log(arm.log(0, Role::train)), model(arm.truth(log)) {
    JointFit &shoulder = model.joints[0], &elbow = model.joints[1];
    shoulder.effects.insert(shoulder.effects.begin(), named("elasticity", {0.002}, {1e-3}));
    shoulder.effects.push_back(named("load_friction", {}, {0.05}));
    shoulder.effects.push_back(named("delay", {0.0053}, {1}));
    elbow.effects.push_back(named("torque_gain", {}, {0.2}));
    elbow.effects.push_back(named("ripple", {20}, {0.4, 0.1}));
    elbow.effects.push_back(named("saturation", {5}, {1}));
    model.body = {named("payload", {}, {0.8, 0.1, 0.02, 0}), named("gravity_tilt", {}, {0.03, -0.02})};
    log.tau = predict(model, log);
  }
  test::Arm arm;
  ProcessedLog log;
  IdentifiedModel model;
};

TEST(KeptEffects, TheFitSeesTheTorqueThatItsColumnsCanMake) {
  Exact exact("kept");
  const KeptEffects kept(exact.model, {exact.log});
  IdentifiedModel fitted = exact.model;
  fitted.joints = kept.design();
  fitted.body.clear();
  ASSERT_NE(fitted.joints[1].find("ripple"), nullptr);
  for (const char* effect : {"elasticity", "load_friction", "delay"}) EXPECT_EQ(fitted.joints[0].find(effect), nullptr);
  for (const char* effect : {"torque_gain", "saturation"}) EXPECT_EQ(fitted.joints[1].find(effect), nullptr);

  std::vector<ProcessedLog> logs{exact.log};
  kept.mark_hidden(logs);
  const MatrixXd seen = logs[0].decimate(kept.torque(exact.model, logs)[0]);
  const MatrixXd expected = logs[0].decimate(logs[0].filter_columns(predict(fitted, logs[0])));
  Index compared = 0, hidden = 0;
  for (Index j = 0; j < 2; ++j) {
    for (Index r = 0; r < seen.rows(); ++r) {
      if (logs[0].is_saturated(j, r)) {
        ++hidden;
        continue;
      }
      ++compared;
      ASSERT_NEAR(seen(r, j), expected(r, j), 5e-3) << "joint " << j + 1 << ", row " << r;
    }
  }
  EXPECT_GT(hidden, 0);
  EXPECT_GT(compared, hidden);
}

TEST(KeptEffects, ComeBackInTheirPlacesWithTheirStandardDeviations) {
  const Exact exact("restored");
  const KeptEffects kept(exact.model, {exact.log});
  IdentifiedModel fitted = exact.model;
  fitted.joints = kept.design();
  fitted.body.clear();
  EffectFit& ripple = fitted.joints[1].effects.back();
  ASSERT_EQ(ripple.effect, "ripple");
  ripple.linear = {0.5, 0.2};
  ripple.shape_std.clear();                                                // not estimated by the fit
  fitted.joints[0].effects.push_back(named("elasticity", {0.1}, {5e-3}));  // a link encoder's
  const IdentifiedModel model = kept.restore(fitted);
  ASSERT_EQ(model.body.size(), 2U);
  for (std::size_t j = 0; j < 2; ++j) {
    ASSERT_EQ(model.joints[j].effects.size(), exact.model.joints[j].effects.size());
    for (std::size_t e = 0; e < model.joints[j].effects.size(); ++e) {
      const EffectFit &is = model.joints[j].effects[e], &was = exact.model.joints[j].effects[e];
      EXPECT_EQ(is.effect, was.effect);
      EXPECT_EQ(is.named, was.named);
      EXPECT_EQ(is.shape, was.shape);
      if (was.named) {
        EXPECT_EQ(is.shape_std, was.shape_std);
      }
      if (was.effect != "ripple") {
        EXPECT_EQ(is.linear, was.linear);
      }
    }
  }
  EXPECT_EQ(model.joints[1].find("ripple")->linear[0], 0.5);
}

TEST(Session, DriftGoesOnThroughItAndStartsColdOutside) {
  const test::Arm arm("drift");
  ProcessedLog log = arm.log(0);
  IdentifiedModel model = arm.truth(log);
  model.joints[0].effects.push_back(named("friction_drift", {10}, {3, 1}));
  const MatrixXd cold = predict(model, log);
  model.session = {0.0, 100.0};
  log.t.array() += 40;
  EXPECT_NEAR(age_of(model, log), 40, 1e-9);
  const MotionRows motion = log.motion();
  const MatrixXd warm = predict(model, motion.q, motion.dq, motion.ddq, log.step_s, nullptr, 40);
  EXPECT_LT((predict(model, log) - warm).norm(), 1e-9 * warm.norm());
  EXPECT_GT((warm - cold).norm(), 0.05 * cold.norm());
  const KeptEffects kept(model, {log});
  EXPECT_EQ(kept.design()[0].find("friction_drift"), nullptr) << "its columns would start cold";

  log.t.array() += 131 - 40;  // three time constants after the end
  EXPECT_EQ(age_of(model, log), 0);
  log.t.array() -= 132;
  EXPECT_EQ(age_of(model, log), 0);
  EXPECT_LT((predict(model, log) - cold).norm(), 1e-9 * cold.norm());
  // model.json keeps it
  write_file(test::folder() / "session.json", to_json(model).dump());
  EXPECT_EQ(read_model(test::folder() / "session.json").session->end_s, 100);
}

}  // namespace
}  // namespace fxdyn
