// What a live plot's figure holds for its script: decoded here by code of its own.
#include "host_tools/page/live_plot.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <sstream>
#include <vector>

namespace fxdyn::page {
namespace {

using Eigen::VectorXd;

constexpr const char* picture = "<svg><path/></svg>";

std::string attribute(const std::string& html, const std::string& name) {
  const std::string open = " data-" + name + "=\"";
  const std::size_t from = html.find(open);
  if (from == std::string::npos) return "";
  return html.substr(from + open.size(), html.find('"', from + open.size()) - from - open.size());
}

std::vector<unsigned> bytes_of(const std::string& base64) {
  std::map<char, unsigned> value;
  for (unsigned k = 0; k < 26; ++k) {
    value[static_cast<char>('A' + k)] = k;
    value[static_cast<char>('a' + k)] = 26 + k;
  }
  for (unsigned k = 0; k < 10; ++k) value[static_cast<char>('0' + k)] = 52 + k;
  value['+'] = 62;
  value['/'] = 63;
  std::vector<unsigned> out;
  unsigned bits = 0, held = 0;
  for (const char c : base64) {
    if (c == '=') break;
    bits = bits << 6U | value.at(c);
    held += 6;
    if (held < 8) continue;
    held -= 8;
    out.push_back(bits >> held & 255U);
    bits &= (1U << held) - 1;
  }
  return out;
}

/// Columns t, measured, residual, velocity, position.
std::vector<std::vector<double>> columns_of(const std::string& html) {
  std::istringstream text(attribute(html, "ends"));
  std::vector<double> ends;
  for (double value = 0; text >> value;) ends.push_back(value);
  const std::vector<unsigned> bytes = bytes_of(attribute(html, "live"));
  std::vector<std::vector<double>> out(ends.size() / 2);
  const std::size_t count = bytes.size() / ends.size();
  for (std::size_t c = 0; c < out.size(); ++c) {
    for (std::size_t k = 0; k < count; ++k) {
      const std::size_t at = 2 * (c * count + k);
      const double share = (bytes[at] + 256.0 * bytes[at + 1]) / 65535;
      out[c].push_back(ends[2 * c] + share * (ends[2 * c + 1] - ends[2 * c]));
    }
  }
  return out;
}

LivePlot example(Eigen::Index samples, double first = 0) {
  LivePlot out;
  out.t = VectorXd::LinSpaced(samples, first, first + 2);
  const VectorXd since = out.t.array() - first;
  out.measured = (3 * since.array()).sin() * 7;
  out.predicted = out.measured.array() - 0.1 * (40 * since.array()).cos();
  out.velocity = since;
  out.position = VectorXd::Constant(samples, -1.5);
  out.torque_unit = "N*m";
  out.path_unit = "rad";
  return out;
}

class LivePlots : public testing::Test {
  void SetUp() override {
    if (!has_live_plots()) GTEST_SKIP() << "built without npm: pictures only";
  }
};

TEST_F(LivePlots, ColumnsComeBackAsTheyWere) {
  const LivePlot plot = example(101);
  const auto columns = columns_of(live_figure(picture, "a", plot));
  ASSERT_EQ(columns.size(), 5U);
  const std::vector<VectorXd> expected{plot.t, plot.measured, plot.measured - plot.predicted, plot.velocity,
                                       plot.position};
  for (std::size_t c = 0; c < expected.size(); ++c) {
    ASSERT_EQ(columns[c].size(), 101U);
    const double step = (expected[c].maxCoeff() - expected[c].minCoeff()) / 65535;
    for (std::size_t k = 0; k < 101; ++k)
      EXPECT_NEAR(columns[c][k], expected[c][static_cast<Eigen::Index>(k)], 0.51 * step + 1e-8) << c << " " << k;
  }
}

TEST_F(LivePlots, OfManySamplesThePeaksOfTheResidualAreKept) {
  LivePlot plot = example(50'000);
  plot.most_samples = 400;
  plot.predicted[12'345] += 3;  // one sample alone, down
  plot.predicted[30'001] -= 2;  // and up
  const auto columns = columns_of(live_figure(picture, "a", plot));
  ASSERT_LE(columns[0].size(), 400U);
  ASSERT_GE(columns[0].size(), 390U);
  const double low = *std::min_element(columns[2].begin(), columns[2].end());
  EXPECT_NEAR(low, plot.measured[12'345] - plot.predicted[12'345], 1e-3);
  EXPECT_NEAR(*std::max_element(columns[2].begin(), columns[2].end()), plot.measured[30'001] - plot.predicted[30'001],
              1e-3);
  EXPECT_TRUE(std::is_sorted(columns[0].begin(), columns[0].end()));
}

TEST_F(LivePlots, StampsSince1970CountFromTheFirst) {
  const std::string html = live_figure(picture, "a", example(100, 1.7e9));
  EXPECT_EQ(attribute(html, "time"), "time [s] after 1700000000");
  EXPECT_EQ(attribute(html, "ends").substr(0, 4), "0 2 ");
  EXPECT_EQ(attribute(live_figure(picture, "a", example(100)), "time"), "time [s]");
}

TEST_F(LivePlots, ThePictureStaysAndAValueThatIsNoNumberLeavesItAlone) {
  LivePlot plot = example(100);
  EXPECT_NE(live_figure(picture, "a", plot).find("<path/>"), std::string::npos);
  plot.velocity[3] = std::nan("");
  EXPECT_EQ(live_figure(picture, "a", plot).find("data-live"), std::string::npos);
  EXPECT_NE(live_figure(picture, "a", plot).find("<path/>"), std::string::npos);
}

TEST_F(LivePlots, AUnitWithMarkupIsText) {
  LivePlot plot = example(100);
  plot.torque_unit = "\"><script>";
  EXPECT_EQ(live_figure(picture, "a", plot).find("<script>"), std::string::npos);
}

}  // namespace
}  // namespace fxdyn::page
