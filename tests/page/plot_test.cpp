// Plots over time whose stamps are seconds since 1970, as recorders write them.
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

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

/// Height of a text's base line in a picture, from its top [px].
double base_line(const std::string& svg, const std::string& words) {
  const std::size_t at = svg.find(words + "</text>"), moved = svg.rfind("translate(", at);
  if (at == std::string::npos || moved == std::string::npos) return NAN;
  return std::stod(svg.substr(svg.find(',', moved) + 1));
}

TEST(Plot, TheKeyStandsAboveTheCurvesHoweverManyRowsItHas) {
  const std::vector<std::string> names{"joint_of_the_base", "shoulder", "elbow",  "wrist_1",
                                       "wrist_2",           "wrist_3",  "gripper"};
  const Eigen::MatrixXd columns = torque().replicate(1, static_cast<Eigen::Index>(names.size()));
  Chart chart{"time [s]", "tau [N*m]", {}};
  for (const std::string& name : names) chart.curves.push_back({stamps(0), torque(), "#222222", 1, name});
  chart.y_from = -2;  // a tick of the axis stands at either end
  chart.y_to = 2;
  const std::string beside = draw(std::vector<Chart>{chart, chart}, 2);
  constexpr double half_a_line = 6;  // px
  for (const std::string& name : names)
    EXPECT_LT(base_line(beside, name) + half_a_line, base_line(beside, "> 2")) << name;
  const std::string panels = draw(std::vector<Panel>{{"tau [N*m]", stamps(0), columns}}, names);
  for (const std::string& name : names)
    EXPECT_LT(base_line(panels, name) + half_a_line, base_line(panels, "> 1")) << name;
}

}  // namespace
}  // namespace fxdyn
