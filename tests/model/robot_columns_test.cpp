#include "host_tools/effects/robot_columns.hpp"
#include "host_tools/effects/identified_model.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "host_tools/effects/effects.hpp"
#include "host_tools/effects/evaluator.hpp"
#include "host_tools/excite/nominal.hpp"
#include "host_tools/support/error.hpp"
#include "model/effects/payload.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

const std::vector<double> rated{97.6, 186.4, 89.4, 24.2, 20.1, 21.3}, velocity{1.6, 1.5, 2.2, 4, 3.6, 4};

IdentifiedModel puma() {
  return nominal_from_urdf(read_urdf(FXDYN_SOURCE_DIR "/host_tools/demo/puma560.urdf"), rated, velocity).model;
}

Motion swing() {
  constexpr Index samples = 1000;
  Motion motion{"swing", 0.002, Eigen::VectorXd::LinSpaced(samples, 0, 0.002 * (samples - 1)), {}, {}, {}};
  motion.q = motion.dq = motion.ddq = MatrixXd(samples, 6);
  for (Index j = 0; j < 6; ++j) {
    const double w = 2 + 0.7 * static_cast<double>(j);
    for (Index k = 0; k < samples; ++k) {
      motion.q(k, j) = 0.3 + 0.5 * std::sin(w * motion.t[k] + static_cast<double>(j));
      motion.dq(k, j) = 0.5 * w * std::cos(w * motion.t[k] + static_cast<double>(j));
      motion.ddq(k, j) = -0.5 * w * w * std::sin(w * motion.t[k] + static_cast<double>(j));
    }
  }
  return motion;
}

std::vector<double> shape_of(std::string_view effect, std::size_t joint) {
  if (effect == "stribeck") return {0.1};
  if (effect == "presliding") return {0.003};
  if (effect == "lugre") return {0.003, 0.1, 0.7};
  if (effect == "ripple") return {7};
  if (effect == "friction_drift") return {2};
  if (effect == "saturation") return {0.1 * rated[joint]};
  if (effect == "joint_coupling") return {joint == 0 ? 2.0 : 1.0};
  if (effect == "delay") return {0.0071};
  if (effect == "elasticity") return {0.01};
  if (effect == "backlash") return {5};
  if (effect == "position_curve" || effect == "friction_over_position") return {-0.2, 1};
  if (effect == "velocity_curve") return {-1, 2};
  if (effect == "cross_position") return {joint == 0 ? 2.0 : 1.0, -0.07, 0.85};  // where joint 1 comes by
  return std::vector<double>(find_effect(effect)->shape.size(), 1);
}

EffectFit fit_of(std::string_view effect, std::vector<double> shape, std::vector<double> linear) {
  EffectFit fit;
  fit.effect = effect;
  fit.shape = std::move(shape);
  fit.linear = std::move(linear);
  return fit;
}

MatrixXd torque_of(const IdentifiedModel& model, const Motion& m) { return predict(model, m.q, m.dq, m.ddq, m.step_s); }

/// The torque change by a finite effect, central: the error of the column is that of the difference, not its own.
MatrixXd central(const IdentifiedModel& model, std::string_view effect, const std::vector<double>& shape,
                 std::size_t joint, std::size_t parameter, double theta, const Motion& motion) {
  const auto changed = [&](double value) {
    IdentifiedModel m = model;
    std::vector<double> linear(find_effect(effect)->linear.size());
    linear[parameter] = value;
    const bool on_body = find_effect(effect)->acts_on == ActsOn::body;
    (on_body ? m.body : m.joints[joint].effects).push_back(fit_of(effect, shape, linear));
    return torque_of(m, motion);
  };
  return (changed(theta) - changed(-theta)) / (2 * theta);
}

void expect_slopes(const IdentifiedModel& model) {
  const Motion motion = swing();
  const RobotColumns columns(model, motion);
  for (const EffectInfo& info : effect_infos()) {
    if (info.name == Payload::name) continue;  // not linear in its parameters: below
    const std::size_t joint = 1;
    std::vector<double> shape = shape_of(info.name, joint);
    if (info.name == "load_curve") {  // over the loads that occur: every height shows
      const Eigen::VectorXd load = columns.structural().col(static_cast<Index>(joint));
      shape = {load.minCoeff(), load.maxCoeff() - load.minCoeff()};
    }
    const EffectColumns out = columns({std::string(info.name), joint, shape});
    ASSERT_EQ(out.joints.size(), 6U);
    for (std::size_t i = 0; i < info.linear.size(); ++i) {
      // Deflections: small beside the motion, far from rounding. Torques and tilts: linear to first order anyway.
      const double theta = info.name == "elasticity" ? 1e-7 : info.acts_on == ActsOn::position ? 1e-5 : 1e-4;
      const MatrixXd slope = central(model, info.name, shape, joint, i, theta, motion);
      const double size = slope.cwiseAbs().maxCoeff();
      EXPECT_GT(size, 0) << info.name;
      for (Index j = 0; j < 6; ++j) {
        const MatrixXd& c = out.joints[static_cast<std::size_t>(j)];
        if (c.size() == 0) {
          EXPECT_EQ(slope.col(j).cwiseAbs().maxCoeff(), 0) << info.name << " joint " << j + 1;
          continue;
        }
        ASSERT_EQ(c.rows(), motion.q.rows());
        ASSERT_EQ(c.cols(), static_cast<Index>(info.linear.size()));
        EXPECT_LT((c.col(static_cast<Index>(i)) - slope.col(j)).cwiseAbs().maxCoeff(), 1e-4 * size)
            << info.name << " joint " << j + 1;
      }
    }
  }
}

TEST(RobotColumns, AreTheSlopesOfTheModelsTorque) { expect_slopes(puma()); }

TEST(RobotColumns, AreSlopesAroundAModelThatHasEffectsOfEveryKindAlready) {
  IdentifiedModel model = puma();
  JointFit& joint = model.joints[1];
  joint.effects.push_back(fit_of("torque_gain", {}, {0.3}));
  joint.effects.push_back(fit_of("delay", {0.005}, {1}));
  joint.effects.push_back(fit_of("elasticity", {0.002}, {1e-5}));
  joint.effects.push_back(fit_of("load_friction", {}, {0.05}));
  model.body.push_back(fit_of("payload", {}, {1.5, 0, 0.05, 0.1}));
  model.body.push_back(fit_of("gravity_tilt", {}, {0.1, -0.05}));
  expect_slopes(model);
}

TEST(RobotColumns, StructuralAndTotalAreThoseOfTheEvaluator) {
  IdentifiedModel model = puma();
  model.joints[2].effects.push_back(fit_of("elasticity", {0.002}, {1e-4}));
  const Motion motion = swing();
  const RobotColumns columns(model, motion);
  EXPECT_EQ(columns.torque(), torque_of(model, motion));
  for (JointFit& joint : model.joints)
    joint.q_lower = -(joint.q_upper = joint.dq_limit = joint.ddq_limit = joint.tau_limit = 1e6);
  Evaluator<Real> evaluator(model, motion.step_s);
  Saturations saturations;
  for (Index k = 0; k < motion.q.rows(); ++k) {
    std::vector<JointState<Real>> states;
    for (Index j = 0; j < 6; ++j) states.push_back({motion.q(k, j), motion.dq(k, j), motion.ddq(k, j)});
    evaluator.tick(states, saturations);
    for (Index j = 0; j < 6; ++j)
      ASSERT_EQ(columns.structural()(k, j), evaluator.structural()[static_cast<std::size_t>(j)]);
  }
}

TEST(RobotColumns, PayloadIsLinearInMassAndFirstMoment) {
  const IdentifiedModel model = puma();
  const Motion motion = swing();
  const EffectColumns columns = RobotColumns(model, motion)({"payload", 0, {}});
  // The mean of loads at +c and -c, less the one at 0, is the torque of the second moments alone: without it the change
  // is linear.
  const auto loaded = [&](double mass, double x, double y, double z) {
    IdentifiedModel m = model;
    m.body.push_back(fit_of("payload", {}, {mass, x, y, z}));
    return torque_of(m, motion);
  };
  const double mass = 2, x = 0.1, y = -0.05, z = 0.2;
  const MatrixXd second = (loaded(mass, x, y, z) + loaded(mass, -x, -y, -z)) / 2 - loaded(mass, 0, 0, 0);
  const MatrixXd change = loaded(mass, x, y, z) - torque_of(model, motion) - second;
  for (Index j = 0; j < 6; ++j) {
    const MatrixXd& c = columns.joints[static_cast<std::size_t>(j)];
    if (c.size() == 0) continue;
    const Eigen::VectorXd linear = c * Eigen::Vector4d(mass, mass * x, mass * y, mass * z);
    EXPECT_LT((linear - change.col(j)).cwiseAbs().maxCoeff(), 1e-7) << j;
  }
  const auto names = column_names("payload", JointType::revolute);
  ASSERT_EQ(names.size(), 4U);
  EXPECT_EQ(names[0].unit, "kg");
  EXPECT_EQ(names[3].name + " " + names[3].unit, "mass com_z kg*m");
}

TEST(RobotColumns, AreTheSameOnceWhatTheyShareIsForgotten) {
  const Motion motion = swing();
  const RobotColumns columns(puma(), motion);
  const EffectCandidate bend{"elasticity", 1, shape_of("elasticity", 1)};
  const EffectColumns before = columns(bend);
  columns.forget_slopes(1);
  const EffectColumns after = columns(bend);
  for (std::size_t j = 0; j < before.joints.size(); ++j) EXPECT_EQ(before.joints[j], after.joints[j]);
}

TEST(RobotColumns, RefuseWhatIsNotThere) {
  const IdentifiedModel model = puma();
  const Motion motion = swing();
  const RobotColumns columns(model, motion);
  EXPECT_THROW(columns({"stribek", 0, {0.1}}), InputError);
  EXPECT_THROW(columns({"viscous", 6, {}}), InputError);
  EXPECT_THROW(columns({"stribeck", 0, {}}), InputError);
}

}  // namespace
}  // namespace fxdyn
