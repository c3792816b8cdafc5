// Pictures in fewer bytes: where each path goes is read back here by code of its own.
#include "host_tools/page/compact_svg.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <regex>
#include <string>
#include <vector>

#include "host_tools/page/plot.hpp"

namespace fxdyn::page {
namespace {

using Eigen::VectorXd;

constexpr const char* usual =
    "<g fill=\"none\" color=\"black\" stroke=\"currentColor\" stroke-width=\"1.00\" stroke-linecap=\"butt\" "
    "stroke-linejoin=\"miter\">";

struct Point {
  bool moved;
  double x, y;
};

/// Points of all paths of the picture, as SVG reads M, m, L and l: pairs that follow a move are lines.
std::vector<Point> points_of(const std::string& svg) {
  std::vector<Point> out;
  const std::regex attribute(" d='([^']*)'"), token("[MLml]|-?[0-9]*\\.?[0-9]+");
  for (std::sregex_iterator path(svg.begin(), svg.end(), attribute), end; path != end; ++path) {
    const std::string words = (*path)[1];
    double x = 0, y = 0, first = 0;
    char command = ' ';
    bool moved = false, half = false;
    for (std::sregex_iterator at(words.begin(), words.end(), token); at != end; ++at) {
      const std::string one = at->str();
      if (std::isalpha(static_cast<unsigned char>(one[0])) != 0) {
        command = one[0];
        moved = command == 'M' || command == 'm';
      } else if (!half) {
        first = std::stod(one);
        half = true;
      } else {
        const bool relative = command == 'm' || command == 'l';
        x = (relative ? x : 0) + first;
        y = (relative ? y : 0) + std::stod(one);
        out.push_back({moved, x, y});
        half = moved = false;
      }
    }
  }
  return out;
}

TEST(CompactSvg, PathsOfAPictureGoWhereTheyWent) {
  const VectorXd t = VectorXd::LinSpaced(3000, 0, 2), measured = (40 * t.array()).sin();
  const std::string svg = draw(std::vector<TorquePlot>{{t, measured, 0.9 * measured, "N*m"}}).front();
  const std::string small = compact_svg(svg);
  EXPECT_LT(2 * small.size(), svg.size() * 1.3);
  std::vector<Point> left;  // points that fall on the one before are no more
  for (const Point& point : points_of(svg)) {
    const Point rounded{point.moved, std::round(10 * point.x) / 10, std::round(10 * point.y) / 10};
    if (rounded.moved || rounded.x != left.back().x || rounded.y != left.back().y) left.push_back(rounded);
  }
  const std::vector<Point> found = points_of(small);
  ASSERT_GT(found.size(), 1000U);
  ASSERT_EQ(found.size(), left.size());
  for (std::size_t i = 0; i < found.size(); ++i) {
    ASSERT_EQ(found[i].moved, left[i].moved) << i;
    ASSERT_NEAR(found[i].x, left[i].x, 1e-6) << i;  // of the sum of steps
    ASSERT_NEAR(found[i].y, left[i].y, 1e-6) << i;
  }
}

TEST(CompactSvg, NumbersThatNeedNoBlankHaveNone) {
  EXPECT_EQ(compact_svg("<path d='M1.00,2.00 L3.50,2.00 \nL3.04,-0.50 M0.46,-0.50  '/>"),
            "<path d='m1 2 2.5 0-.5-2.5m-2.5 0'/>");
}

TEST(CompactSvg, AnotherKindOfPathStaysAsItIs) {
  for (const char* other : {"<path d='M1,2 C3,4 5,6 7,8'/>", "<path d='M1,2 L3,4 Z'/>", "<path d='L1,2'/>",
                            "<path d='M1 2 L3 4'/>", "<path d='M1,2 Lx,4'/>", "<path d='M1,2"})
    EXPECT_EQ(compact_svg(other), other);
}

TEST(CompactSvg, GroupsWithNothingInThemVanishAndUsualOnesGoOn) {
  const std::string begin = usual;
  EXPECT_EQ(compact_svg("<g >\n  </g>a"), "a");
  EXPECT_EQ(compact_svg("<g><g>\n</g></g>a"), "a");
  EXPECT_EQ(compact_svg(begin + "a</g>\n" + begin + "b</g>"), "<g class=\"k\">ab</g>");
  EXPECT_EQ(compact_svg(begin + "<g id='1'>a</g></g><g id='2'>b</g>"),
            "<g class=\"k\"><g id='1'>a</g></g><g id='2'>b</g>");
  EXPECT_EQ(compact_svg("<g id='1'>a</g>" + begin + "b</g>"), "<g id='1'>a</g><g class=\"k\">b</g>");
  EXPECT_EQ(compact_svg("</g></g>a"), "</g></g>a");  // more ends than beginnings
}

}  // namespace
}  // namespace fxdyn::page
