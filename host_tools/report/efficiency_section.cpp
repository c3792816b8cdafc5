#include <fmt/format.h>

#include <map>

#include "host_tools/page/page.hpp"
#include "host_tools/page/plot.hpp"
#include "host_tools/report/efficiency_result.hpp"
#include "host_tools/report/section.hpp"

namespace fxdyn {

using namespace page;
using nlohmann::json;

std::string efficiency_section(const ReportInput&, const json& file) {
  const EfficiencyResult efficiency = efficiency_of(file);
  std::string out = section("Error against seconds of data");
  const auto draw_curves = [&](const std::vector<EfficiencyPoint>& points_of_all, double EfficiencyPoint::*x_of,
                               bool name_seconds, const std::string& x_label) {
    std::map<std::string, std::pair<std::vector<double>, std::vector<double>>> curves;
    for (const EfficiencyPoint& point : points_of_all) {
      for (const auto& [name, error] : point.percent_rated) {
        if (!error) continue;
        std::string title = name;
        if (name_seconds) title += fmt::format(", {:g} s", point.seconds);
        curves[title].first.push_back(point.*x_of);
        curves[title].second.push_back(*error);
      }
    }
    static constexpr const char* colours[] = {"#2e6fb7", "#e4572e", "#2a9d4a", "#8e5ea2", "#b8860b", "#444444"};
    Chart chart{x_label, "test error, % of rated", {}, true};
    for (const auto& [title, points] : curves) {
      const auto vector = [](const std::vector<double>& v) {
        return Eigen::VectorXd(Eigen::Map<const Eigen::VectorXd>(v.data(), static_cast<Eigen::Index>(v.size())));
      };
      chart.curves.push_back(
          {vector(points.first), vector(points.second), colours[chart.curves.size() % 6], 1.6, title});
    }
    return figure(draw({chart}, 1), "Test error over " + x_label);
  };
  out += paragraph("Half of the seconds fast motion, half slow.");
  out += draw_curves(efficiency.curve, &EfficiencyPoint::seconds, false, "seconds of train data");
  out += subsection("Which mix of fast and slow motion");
  out += draw_curves(efficiency.mix, &EfficiencyPoint::slow_share, true, "share of slow motion");
  return out;
}

}  // namespace fxdyn
