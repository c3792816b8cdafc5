// How far the torque column is ahead of the motion: one number for all joints, or none.

#include "host_tools/identify/torque_lead.hpp"

#include <gtest/gtest.h>

#include "tests/support/pendulum.hpp"

namespace fxdyn {
namespace {

const IdentifiedModel plant =
    test::model_of(test::pendulum(2), {test::effect_fit("viscous", {}, {1.5}), test::effect_fit("coulomb", {}, {2})});

/// The lead that is found where each joint's torque column has its own; noise of 20 mN*m.
double found(const std::vector<double>& lead_s, const StructureOptions& options = {}) {
  std::vector<Log> logs;
  for (const std::uint64_t seed : {1, 2}) {
    logs.push_back(test::exact_log(plant, seed == 1 ? Role::train : Role::validate, seed, 20, lead_s));
    test::add_torque_noise(logs.back(), 0.02, seed);
  }
  const std::vector<ProcessedLog> processed = test::processed(std::move(logs));
  Fitter fitter(plant.robot, processed, test::design_of(plant));
  find_torque_lead(fitter, 12, options);
  return fitter.torque_lead_s();
}

TEST(TorqueLead, IsFoundEitherWay) {
  EXPECT_NEAR(found({0.0043, 0.0043}), 0.0043, 1e-4);
  EXPECT_NEAR(found({-0.0021, -0.0021}), -0.0021, 1e-4);
}

TEST(TorqueLead, ThereIsNoneWithoutOne) { EXPECT_EQ(found({}), 0); }

TEST(TorqueLead, IsOneNumberForAllJoints) {
  EXPECT_EQ(found({0.0043, 0}), 0);
  EXPECT_EQ(found({0.0043, -0.0043}), 0);
  // Nearly the same is the same, as far as the options say.
  EXPECT_NEAR(found({0.0045, 0.0036}), 0.004, 0.0005);
  StructureOptions strict;
  strict.same_lead = 0.02;
  EXPECT_EQ(found({0.0045, 0.0036}, strict), 0);
}

TEST(TorqueLead, BeyondTheGridIsAnotherThing) { EXPECT_EQ(found({0.05, 0.05}), 0); }

}  // namespace
}  // namespace fxdyn
