// Short impacts in a joint's torque, beyond what the healthy session shows.

#include "host_tools/diagnose/impacts.hpp"

#include <gtest/gtest.h>

#include "host_tools/effects/identified_model.hpp"
#include "host_tools/support/random.hpp"
#include "tests/diagnose/small_log.hpp"

namespace fxdyn::diagnosis {
namespace {

using Eigen::Index;

constexpr Index joint = 2;

class ImpactsTest : public testing::Test {
 protected:
  IdentifiedModel model_ = test::plant_of(read_urdf(test::puma560));
  ImpactOptions options_;

  /// A log with an impact of `size` N*m, one sample long, on one joint every half second.
  ProcessedLog log(Role role, std::uint64_t seed, double size = 0) const {
    ProcessedLog out = test::small_log(model_, role, seed);
    for (Index k = 100; k < out.samples(); k += 125) out.tau(k, joint) += size;
    return out;
  }
  auto find(const std::vector<ProcessedLog>& now, const std::vector<ProcessedLog>& before) const {
    return find_impacts(model_, now, model_, before, options_);
  }
};

TEST_F(ImpactsTest, AreFoundOnTheirJoint) {
  const auto found = find({log(Role::train, 1, 2), log(Role::validate, 2, 2)}, {log(Role::baseline, 3)});
  ASSERT_EQ(found.size(), 6U);
  for (std::size_t j = 0; j < found.size(); ++j) EXPECT_EQ(found[j].has_value(), j == joint) << j;
  EXPECT_NEAR(found[joint]->per_second, 2, 0.1);
  EXPECT_EQ(found[joint]->healthy, 0);
  EXPECT_NEAR(found[joint]->largest, 2, 0.5);
}

// Dry friction turns between two samples, and which of them sees it first is chance.
TEST_F(ImpactsTest, AreNoneWhereTheVelocityTurns) {
  const auto turning = [this](Role role, std::uint64_t seed) {
    ProcessedLog out = log(role, seed);
    const Eigen::VectorXd dq = out.joint_velocity(joint);
    for (Index k = 1; k + 1 < out.samples(); ++k) {
      if (dq[k - 1] * dq[k + 1] <= 0) out.tau(k, joint) += 2;
    }
    return out;
  };
  const ProcessedLog train = turning(Role::train, 1);
  EXPECT_GT((train.tau - log(Role::train, 1).tau).col(joint).sum(), 2 * 18) << "as many impacts would be seen";
  EXPECT_FALSE(find({train, turning(Role::validate, 2)}, {log(Role::baseline, 3)})[joint]);
}

// Its velocity is noise, which turns all the time.
TEST_F(ImpactsTest, AreFoundOnAJointThatRests) {
  const auto resting = [this](Role role, std::uint64_t seed, double size) {
    ProcessedLog out = log(role, seed);
    Random random(seed);
    for (Index k = 0; k < out.samples(); ++k) out.q(k, joint) = 0.3 + 1e-6 * random.normal();
    out.tau = predict(model_, out);
    for (double& tau : out.tau.reshaped()) tau += 0.05 * random.normal();
    for (Index k = 100; k < out.samples(); k += 125) out.tau(k, joint) += size;
    return out;
  };
  const std::vector<ProcessedLog> now{resting(Role::train, 1, 2), resting(Role::validate, 2, 2)};
  EXPECT_TRUE(find(now, {resting(Role::baseline, 3, 0)})[joint]);
}

// At rest an encoder's noise does not say which way friction acts, so that friction may turn from sample to sample.
TEST_F(ImpactsTest, AreBeyondFrictionWhereTheVelocityIsUncertain) {
  constexpr double friction = 5;
  model_.joints[joint].effects = {test::effect("coulomb", {}, {friction})};
  model_.joints[joint].sign_width = 0.01;
  const auto resting = [&](Role role, std::uint64_t seed, double size) {
    ProcessedLog out = log(role, seed);
    out.q.col(joint).setConstant(0.3);
    out.filter.position_noise.assign(6, 1e-3);
    out.filter.encoder_step.assign(6, 0);
    out.tau = predict(model_, out);
    Random random(seed);
    for (double& tau : out.tau.reshaped()) tau += 0.01 * friction * random.normal();
    for (Index k = 100; k < out.samples(); k += 125) out.tau(k, joint) += size;
    return out;
  };
  const auto found_of = [&](double size) {
    return find({resting(Role::train, 1, size), resting(Role::validate, 2, size)},
                {resting(Role::baseline, 3, 0)})[joint];
  };
  EXPECT_FALSE(found_of(friction));
  EXPECT_TRUE(found_of(4 * friction));
  options_.of_velocity = 0;
  EXPECT_TRUE(found_of(friction));
}

TEST_F(ImpactsTest, AreNoneInNoise) {
  for (const auto& found : find({log(Role::train, 1), log(Role::validate, 2)}, {log(Role::baseline, 3)}))
    EXPECT_FALSE(found.has_value());
}

TEST_F(ImpactsTest, AreBeyondTheirThreshold) {
  options_.beyond = 100;
  EXPECT_FALSE(find({log(Role::train, 1, 2), log(Role::validate, 2, 2)}, {log(Role::baseline, 3)})[joint]);
}

TEST_F(ImpactsTest, AreNoFindingWhereTheHealthySessionHasThem) {
  EXPECT_FALSE(find({log(Role::train, 1, 2), log(Role::validate, 2, 2)}, {log(Role::baseline, 3, 2)})[joint]);
}

TEST_F(ImpactsTest, HaveToBeInEveryLogThatJudges) {
  EXPECT_FALSE(find({log(Role::train, 1, 2), log(Role::validate, 2)}, {log(Role::baseline, 3)})[joint]);
}

TEST_F(ImpactsTest, NeedAHealthySession) { EXPECT_FALSE(find({log(Role::train, 1, 2)}, {})[joint]); }

}  // namespace
}  // namespace fxdyn::diagnosis
