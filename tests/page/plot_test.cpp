// Plots over time whose stamps are seconds since 1970, as recorders write them.
#include <gtest/gtest.h>

#include "host_tools/page/plot.hpp"

namespace fxdyn {
namespace {

using Eigen::VectorXd;

VectorXd stamps(double first) { return VectorXd::LinSpaced(200, first, first + 2); }
VectorXd torque() { return VectorXd::LinSpaced(200, 0, 6).array().sin(); }
bool has(const std::string& text, const std::string& words) { return text.find(words) != std::string::npos; }

TEST(Plot, TimeSinceTheFirstStampWhereSixDigitsDoNotResolveIt) {
  for (const double first : {0.0, 5.0, 1.7e9}) {
    const auto pictures = draw(std::vector<TorquePlot>{{stamps(first), torque(), 0.9 * torque(), "N*m"}});
    ASSERT_EQ(pictures.size(), 1U);
    EXPECT_TRUE(has(pictures[0], "time [s]")) << first;
    EXPECT_EQ(has(pictures[0], "after 1700000000"), first > 1e6) << first;
  }
}

TEST(Plot, PanelsAndChartsToo) {
  const Panel panel{"tau [N*m]", stamps(1.7e9), torque()};
  EXPECT_TRUE(has(draw(std::vector<Panel>{panel}, {"a"}), "after 1700000000"));
  Chart chart{"time [s]", "error", {{stamps(1.7e9), torque(), "#222222"}}};
  EXPECT_TRUE(has(draw(std::vector<Chart>{chart}, 1), "after 1700000000"));
  chart.curves[0].x = stamps(0);
  EXPECT_FALSE(has(draw(std::vector<Chart>{chart}, 1), "after"));
}

}  // namespace
}  // namespace fxdyn
