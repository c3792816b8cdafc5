// payload.json, written and read by one codec.

#include "host_tools/identify/payload_result.hpp"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

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

}  // namespace
}  // namespace fxdyn
