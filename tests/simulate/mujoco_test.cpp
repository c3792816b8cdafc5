#include <gtest/gtest.h>

#include "host_tools/effects/effects.hpp"
#include "host_tools/effects/evaluator.hpp"
#include "host_tools/effects/identified_model.hpp"
#include "host_tools/signals/filter.hpp"
#include "host_tools/simulate/mujoco_forces.hpp"
#include "host_tools/simulate/mujoco_plant.hpp"
#include "host_tools/support/error.hpp"
#include "tests/simulate/support.hpp"

namespace fxdyn {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

MatrixXd model_torque(const IdentifiedModel& plant, const Reference& motion, double age_s = 0) {
  return predict(plant, motion.q, motion.dq, motion.ddq, motion.step_s, nullptr, age_s);
}

TEST(Mujoco, RigidBodyIsTheModels) {
  std::vector<Robot> robots{read_urdf(test::puma560)};
  for (unsigned seed = 1; robots.size() < 4; ++seed) {
    Robot robot = test::Chains(seed).robot(5);
    if (test::slides(robot)) robots.push_back(robot);
  }
  for (const Robot& robot : robots) {
    IdentifiedModel plant = test::plant_of(robot);
    for (JointFit& joint : plant.joints) joint.effects.push_back(test::effect("rotor_inertia", {}, {0.5}));
    plant.body = {test::effect("payload", {}, {3.0, 0.1, -0.05, 0.2}), test::effect("gravity_tilt", {}, {0.02, -0.05})};
    const Reference motion = test::motion_of(robot, 0.002, 2);
    const MatrixXd expected = model_torque(plant, motion);
    const PlantRun run = prescribed_on_mujoco(plant, motion, 0);
    EXPECT_LT((run.tau - expected).cwiseAbs().maxCoeff(), 1e-6 * expected.cwiseAbs().maxCoeff());
    EXPECT_EQ(run.q, motion.q);
  }
}

/// Effects and how far MuJoCo's plant may be from the catalogue's formulas, of their own RMS.
struct Hidden {
  std::vector<EffectFit> effects;
  double tolerance;
};
void PrintTo(const Hidden& hidden, std::ostream* out) { *out << hidden.effects.back().effect; }

class HiddenEffect : public testing::TestWithParam<Hidden> {};

TEST_P(HiddenEffect, ChangesTheTorqueAsTheCatalogueSays) {
  const auto& [effects, tolerance] = GetParam();
  IdentifiedModel healthy = test::puma_with_friction();
  constexpr std::size_t j = 1;
  for (JointFit& joint : healthy.joints) joint.effects.pop_back();  // Coulomb's: its reversal has a test of its own
  IdentifiedModel plant = healthy;
  const bool on_body = find_effect(effects[0].effect)->acts_on == ActsOn::body;
  for (const EffectFit& effect : effects) (on_body ? plant.body : plant.joints[j].effects).push_back(effect);
  const Reference motion = test::motion_of(plant.robot, 0.0005, 5);
  const double age_s = 7;
  const MatrixXd expected = model_torque(plant, motion, age_s) - model_torque(healthy, motion, age_s);
  const MatrixXd found =
      prescribed_on_mujoco(plant, motion, age_s).tau - prescribed_on_mujoco(healthy, motion, age_s).tau;
  EXPECT_GT(test::rms(expected.col(j)), 0.1);
  EXPECT_LT(test::rms(found.col(j) - expected.col(j)), tolerance * test::rms(expected.col(j)));
  if (on_body) return;
  for (Eigen::Index other = 0; other < 6; ++other) {
    if (other == j) continue;
    EXPECT_LT(test::rms(found.col(other)), 1e-9) << "joint " << other + 1;
  }
}

// Where there is a sign, it is another function of the velocity, most of all MuJoCo's own of dry friction, which turns
// within less than a mrad/s; else the numbers are the same.
INSTANTIATE_TEST_SUITE_P(
    Mujoco, HiddenEffect,
    testing::Values(
        Hidden{{test::effect("offset", {}, {3})}, 1e-6}, Hidden{{test::effect("stribeck", {0.3}, {6})}, 0.03},
        Hidden{{test::effect("coulomb", {}, {8})}, 0.1},
        // Two functions of v / velocity that differ by up to 0.074, at speeds of that size: 0.056 of this motion's RMS.
        Hidden{{test::effect("coulomb", {}, {8}), test::effect("soft_knee", {0.3}, {6})}, 0.06},
        Hidden{{test::effect("coulomb", {}, {8}), test::effect("presliding", {0.01}, {8})}, 0.03},
        Hidden{{test::effect("coulomb", {}, {6}), test::effect("lugre", {0.01, 0.3, 0.75}, {8, 20})}, 0.03},
        Hidden{{test::effect("coulomb", {}, {8}), test::effect("maxwell_slip", {0.02}, {2, 1, 3, 1, 1})}, 0.03},
        Hidden{{test::effect("asymmetric_friction", {}, {2, 1})}, 0.03},
        Hidden{{test::effect("viscous_quadratic", {}, {3})}, 1e-6},
        Hidden{{test::effect("viscous_cubic", {}, {-1})}, 1e-6},
        Hidden{{test::effect("load_friction", {}, {0.1})}, 0.03},
        Hidden{{test::effect("torque_gain", {}, {0.05})}, 0.03}, Hidden{{test::effect("ripple", {40}, {1, -2})}, 1e-6},
        Hidden{{test::effect("spring", {}, {20, 3})}, 1e-6}, Hidden{{test::effect("spring", {}, {-20, 3})}, 1e-6},
        Hidden{{test::effect("gravity_compensator", {}, {10, -5})}, 1e-6},
        Hidden{{test::effect("friction_drift", {30}, {4, 3})}, 0.03},
        Hidden{{test::effect("saturation", {30}, {1})}, 0.05},
        Hidden{{test::effect("position_curve", {-0.5, 1.5}, {1, 2, -1, 0, 3, 2, 2, -2, 1, 0, 1, 2})}, 1e-6},
        Hidden{{test::effect("velocity_curve", {-1, 2}, {1, 2, -1, 0, 3, 2, 2, -2, 1, 0, 1, 2})}, 1e-6},
        Hidden{{test::effect("load_curve", {-50, 100}, {1, 2, -1, 0, 3, 2, 2, -2, 1, 0, 1, 2})}, 1e-3},
        Hidden{{test::effect("cross_position", {3, -0.5, 1.5}, {1, 2, -1, 0, 3, 2, 2, -2, 1, 0, 1, 2})}, 1e-6},
        Hidden{{test::effect("friction_over_position", {-0.5, 1.5}, {1, 2, 1, 0, 3, 2, 2, 2, 1, 0, 1, 2})}, 0.03},
        Hidden{{test::effect("joint_coupling", {3}, {2, 1})}, 0.03},
        Hidden{{test::effect("motor_coupling", {3, 1.0, 0.002}, {2, 1, 0.5})}, 0.03},
        Hidden{{test::effect("delay", {0.004}, {1})}, 0.01},
        Hidden{{test::effect("payload", {}, {4, 0.05, 0, 0.1})}, 1e-6},
        Hidden{{test::effect("gravity_tilt", {}, {0.05, 0.1})}, 1e-6}));

TEST(Mujoco, GearsThatGiveAreTheModelsWhereThisIsSlow) {
  // Links are prescribed here and motors there, so the motors' motion is compared with what the model makes of it.
  for (const EffectFit& effect : {test::effect("elasticity", {0.004}, {3e-5}), test::effect("backlash", {10}, {1e-3}),
                                  test::effect("eccentricity", {}, {2e-3, -1e-3})}) {
    IdentifiedModel plant = test::puma_with_friction();
    plant.joints[1].effects.push_back(effect);
    const Reference motion = test::motion_of(plant.robot, 0.0005, 10, 10);
    const PlantRun run = prescribed_on_mujoco(plant, motion, 0);
    const auto inner = Eigen::seq(200, run.q.rows() - 200);
    EXPECT_LT(((run.q - run.deflections) - motion.q).cwiseAbs().maxCoeff(), 1e-12);
    MatrixXd deflections;
    const MatrixXd tau = predict(plant, run.q, run.dq, run.ddq, run.step_s, &deflections);
    const auto error = [&](const MatrixXd& a, const MatrixXd& b) {
      return test::rms(a(inner, 1) - b(inner, 1)) / test::rms(b(inner, 1));
    };
    EXPECT_LT(error(run.deflections, deflections), 0.02) << effect.effect;
    EXPECT_LT(error(run.tau, tau), 0.02) << effect.effect;
  }
}

/// Forces of joint 2's drive with one effect more.
VectorXd drive_forces(const EffectFit& effect) {
  IdentifiedModel plant = test::puma_with_friction();
  plant.joints[1].effects.push_back(effect);
  const VectorXd some = VectorXd::Constant(6, 0.3);
  return DriveForces(plant)({some, some, some, some, 1});
}

TEST(Mujoco, KnowsEveryEffectOfTheCatalogue) {
  for (const EffectInfo& info : effect_infos()) {
    const std::vector<double> shape(info.shape.size(), 1), linear(info.linear.size(), 0.1);
    EXPECT_NO_THROW(drive_forces(test::effect(std::string(info.name), shape, linear))) << info.name;
  }
}

TEST(Mujoco, RefusesAnEffectThatItDoesNotKnow) {
  EXPECT_THROW(drive_forces(test::effect("new_friction", {}, {1})), InputError);
}

/// Dry friction creeps otherwise than a tanh does, and is most of the wrist's torque: only joint 2 has it.
IdentifiedModel with_dry_friction_at_joint_2() {
  IdentifiedModel plant = test::puma_with_friction();
  for (std::size_t j : {0U, 2U, 3U, 4U, 5U})
    std::erase_if(plant.joints[j].effects, [](const EffectFit& fit) { return fit.effect == "coulomb"; });
  return plant;
}

/// A controlled motion of the plant has the torque that the model makes of it, as slow as its gear has to be.
PlantRun expect_torque_of_the_model(const IdentifiedModel& plant) {
  Reference reference = test::motion_of(plant.robot, 0.0005, 10);
  reference.feedforward = model_torque(test::plant_of(plant.robot), reference);
  ClosedLoopSettings settings;
  settings.hold = 4;
  PlantRun run = closed_loop_on_mujoco(plant, reference, settings);
  EXPECT_LT(test::rms(run.q - reference.q), 0.03);
  const ZeroPhaseFilter filter(8, run.step_s);
  const MatrixXd expected =
      filter.apply(predict(plant, filter.apply(run.q), filter.apply(run.dq), filter.apply(run.ddq), run.step_s));
  const MatrixXd measured = filter.apply(run.tau);
  for (Eigen::Index j = 0; j < 6; ++j) {
    const double error = test::rms(measured.col(j) - expected.col(j)) / test::rms(expected.col(j));
    EXPECT_LT(error, 0.02) << "joint " << j + 1;  // 0.1 to 1.7 %
  }
  return run;
}

TEST(Mujoco, ClosedLoopWithManyEffects) {
  IdentifiedModel plant = with_dry_friction_at_joint_2();
  const std::vector<EffectFit> effects{test::effect("stribeck", {0.1}, {2}),
                                       test::effect("presliding", {0.005}, {5}),
                                       test::effect("asymmetric_friction", {}, {1, 0.5}),
                                       test::effect("viscous_cubic", {}, {0.5}),
                                       test::effect("load_friction", {}, {0.05}),
                                       test::effect("ripple", {30}, {0.5, 0.5}),
                                       test::effect("spring", {}, {5, 1}),
                                       test::effect("friction_drift", {30}, {1, 1}),
                                       test::effect("joint_coupling", {3}, {1, 0.5}),
                                       test::effect("elasticity", {0.004}, {3e-5}),
                                       test::effect("eccentricity", {}, {1e-3, 0})};
  for (const EffectFit& effect : effects) plant.joints[1].effects.push_back(effect);
  plant.body = {test::effect("payload", {}, {2, 0, 0, 0.1})};
  const PlantRun run = expect_torque_of_the_model(plant);
  EXPECT_GT(test::rms(run.deflections.col(1)), 5e-4);
  EXPECT_EQ(run.deflections.col(2).cwiseAbs().maxCoeff(), 0);
}

TEST(Mujoco, ClosedLoopWithLuGre) {
  IdentifiedModel plant = with_dry_friction_at_joint_2();
  JointFit& joint = plant.joints[1];
  std::erase_if(joint.effects, [](const EffectFit& fit) { return fit.effect == "coulomb"; });
  joint.effects.push_back(test::effect("coulomb", {}, {0.7 * 10}));
  joint.effects.push_back(test::effect("lugre", {0.003, 0.1, 0.7}, {10, 40}));
  expect_torque_of_the_model(plant);
}

}  // namespace
}  // namespace fxdyn
