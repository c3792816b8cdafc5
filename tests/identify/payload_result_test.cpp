// payload.json, written and read by one codec.

#include "host_tools/identify/payload_result.hpp"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "host_tools/identify/known_load.hpp"
#include "host_tools/identify/payload.hpp"
#include "tests/support/pendulum.hpp"

namespace fxdyn {
namespace {

using nlohmann::json;

TEST(PayloadResult, ComesBackFromItsFile) {
  LoadFit fit;
  for (std::size_t k = 0; k < 10; ++k)
    fit.parameters[k] = {k == 0 ? "mass" : "", "kg", static_cast<double>(k + 1), 0.1, k % 2 == 0};
  fit.constrained = true;
  for (auto* column : {&fit.coulomb, &fit.coulomb_std, &fit.offset, &fit.before, &fit.after, &fit.with_effect})
    *column = Eigen::VectorXd::Constant(1, 0.25);
  fit.after[0] = 0.125;
  const Robot robot = test::pendulum();
  const json file = to_json(payload_result(fit, robot));
  EXPECT_EQ(to_json(payload_of(json::parse(file.dump()))), file);
  EXPECT_EQ(file.at("mass").at("value"), 1);
  EXPECT_EQ(file.at("com").at("z").at("value"), 4);
  EXPECT_EQ(file.at("inertia_about_com").at("iyz").at("value"), 10);
  const PayloadResult read = payload_of(file);
  EXPECT_EQ(read.link, robot.joints.back().link);
  EXPECT_TRUE(read.constrained);
  EXPECT_TRUE(read.parameters[2].identifiable);
  EXPECT_FALSE(read.parameters[3].identifiable);
  EXPECT_EQ(read.joints.at(0).residual_after, 0.125);
}

TEST(GainResult, ComesBackFromItsFileAndKeepsUnknownGains) {
  const Robot robot = test::pendulum(2);
  const std::vector<JointGain> gains{{true, 1.5, 0.01, 3}, {false, 0.7, 0.2, 1}};
  const json file = to_json(gain_result(gains, {2, {0.1, 0.2, 0.3}}, robot, {10, 20}));
  EXPECT_EQ(to_json(gains_of(json::parse(file.dump()))), file);
  const GainResult read = gains_of(file);
  EXPECT_EQ(read.link, robot.joints.back().link);
  EXPECT_EQ(read.mass, 2);
  EXPECT_EQ(read.com[2], 0.3);
  EXPECT_EQ(read.joints.at(0).torque_gain, 15);
  EXPECT_EQ(read.joints.at(1).torque_gain, 20);
  EXPECT_FALSE(read.joints.at(1).felt);
  EXPECT_EQ(gain_result(gains, {2, {0, 0, 0}}, robot, {}).joints.at(0).torque_gain, 1.5);
}

}  // namespace
}  // namespace fxdyn
