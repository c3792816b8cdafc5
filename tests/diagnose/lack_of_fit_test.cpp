// Structure in what a fit leaves of a joint, whatever its name.

#include "host_tools/diagnose/lack_of_fit.hpp"

#include <gtest/gtest.h>

#include <numbers>

#include "tests/diagnose/small_problem.hpp"

namespace fxdyn::diagnosis {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

constexpr std::size_t joint = 1;

class StructureInAResidual : public testing::Test {
 protected:
  /// Looks at two joints of a log whose torque has f(q, t) more at one.
  /// @param noise of the positions [rad], as far as the diagnosis knows
  template <class F>
  void look(F f, double noise = 0) {
    const IdentifiedModel model = test::fitted_puma();
    SessionLog entry = test::small_session_log(model, Role::train, 1);
    for (Index k = 0; k < entry.log.samples(); ++k)
      entry.log.tau(k, joint) += f(entry.log.q(k, static_cast<Index>(joint)), entry.log.t[k]);
    if (noise > 0) entry.log.filter.position_noise.assign(6, noise);
    const std::vector<SessionLog> logs{entry};
    const Linearised problem(test::around(model), logs, test::no_whitening());
    const LinearFit fit = problem.solver().solve(problem.nuisance());
    for (const std::size_t j : {joint, joint + 1}) {
      const MatrixXd functions = features(problem, j);
      (j == joint ? here_ : elsewhere_) = lack_of_fit(problem, j, fit, nullptr, functions);
      (j == joint ? share_ : share_elsewhere_) = structured_share(problem, j, fit, functions, problem.blocks().fit);
    }
  }

  LackOfFit here_, elsewhere_;
  double share_ = 0, share_elsewhere_ = 0;
};

TEST_F(StructureInAResidual, IsNoneInNoise) {
  look([](double, double) { return 0.0; });
  EXPECT_FALSE(here_.structured({})) << here_.state_p << " " << here_.time_p;
  EXPECT_FALSE(elsewhere_.structured({}));
  EXPECT_LT(share_, 0.3);
}

TEST_F(StructureInAResidual, AFunctionOfThePositionIsFoundAtItsJoint) {
  look([](double q, double) { return 0.5 * std::cos(12 * q); });
  EXPECT_LT(here_.state_p, 1e-8);
  EXPECT_FALSE(elsewhere_.structured({}));
  EXPECT_GT(share_, 0.7);
  EXPECT_LT(share_elsewhere_, 0.3);
  EXPECT_LT(here_.elsewhere_p, 1e-8) << "the position is another variable than the own motion";
}

TEST_F(StructureInAResidual, AFunctionOfTheOwnMotionIsNotElsewhere) {
  const auto dq = test::small_session_log(test::fitted_puma(), Role::train, 1).log.joint_velocity(joint);
  look([&](double, double t) { return 0.5 * std::tanh(dq[std::lround(t / test::small_log_step_s)] / 0.3); });
  EXPECT_LT(here_.state_p, 1e-8);
  EXPECT_GT(here_.elsewhere_p, 1e-8);
}

TEST_F(StructureInAResidual, AHumIsAMatterOfTime) {
  look([](double, double t) { return 0.2 * std::sin(2 * std::numbers::pi * 6.3 * t); });
  EXPECT_LT(here_.time_p, 1e-6);
  EXPECT_GT(here_.state_p, 1e-8);
  EXPECT_FALSE(elsewhere_.structured({}));
}

// Friction repeats with the motion. Where its sign is not known, so does the error that this makes.
TEST_F(StructureInAResidual, AHumIsNoneWhereTheEncoderShowsNoDirection) {
  look([](double, double t) { return 0.2 * std::sin(2 * std::numbers::pi * 6.3 * t); }, 0.1);
  EXPECT_EQ(here_.time_p, 1);
}

TEST(FamiliesOfFeatures, FollowOneAnother) {
  const std::vector<Family> all = families(6);
  Index next = 0;
  for (const Family& family : all) {
    EXPECT_GE(family.first, next);
    next = family.first + family.count;
  }
  EXPECT_EQ(all.size(), 5U + 5);  // other positions; velocities, own position, own motion, friction, time
  EXPECT_EQ(all.back().count, time_features);
  EXPECT_EQ(families(1).size(), 4U);  // a joint alone has no others
}

TEST(Structure, IsWhatNoiseHardlyResembles) {
  const LackOfFit of_state{1e-9, 1}, of_time{1, 1e-7};
  EXPECT_TRUE(of_state.structured({}));
  EXPECT_TRUE(of_time.structured({}));
  EXPECT_FALSE(of_state.structured({.state = 1e-10}));
  EXPECT_FALSE(of_time.structured({.time = 1e-8}));
}

}  // namespace
}  // namespace fxdyn::diagnosis
