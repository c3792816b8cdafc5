#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "host_tools/effects/model_parts.hpp"
#include "host_tools/page/live_plot.hpp"
#include "host_tools/page/page.hpp"
#include "host_tools/page/plot.hpp"
#include "host_tools/report/section.hpp"
#include "host_tools/report/shown_log.hpp"

namespace fxdyn {

using namespace page;
using nlohmann::json;

std::string torque_section(const ReportInput& input, const json&) {
  const std::vector<ShownLog>& logs = shown_logs(input);
  const std::vector<Joint>& joints = robot_of(input.fitted).joints;
  // Five numbers of 16 bits as text a sample: a page of six joints and seven logs stays below 2 MB.
  constexpr Eigen::Index bytes_a_sample = 14, most_bytes = 400'000;
  const auto count = static_cast<Eigen::Index>(std::max<std::size_t>(1, logs.size() * joints.size()));
  const Eigen::Index samples = std::clamp<Eigen::Index>(most_bytes / (bytes_a_sample * count), 200, 2000);
  std::vector<TorquePlot> plots;
  std::vector<LivePlot> live;
  std::vector<std::string> titles;
  for (const ShownLog& log : logs) {
    for (std::size_t j = 0; j < joints.size(); ++j) {
      const auto k = static_cast<Eigen::Index>(j);
      const Joint& joint = joints[j];
      const double rmse = log.residual.col(k).norm() / std::sqrt(static_cast<double>(log.t.size()));
      titles.push_back(fmt::format("{} in {}: RMSE {:.3g} {}", joint.name, log.log->name, rmse, joint.torque_unit()));
      plots.push_back({log.t, log.measured.col(k), log.predicted.col(k), joint.torque_unit()});
      live.push_back({log.t, log.measured.col(k), log.predicted.col(k), log.dq.col(k), log.q.col(k),
                      joint.torque_unit(), joint.position_unit(), samples});
    }
  }
  const std::vector<std::string> pictures = draw(plots);
  std::string out = section("Torque, measured and predicted") +
                    paragraph("Both filtered at the torque cut-off; the residual beneath.");
  std::vector<std::string> all;
  for (std::size_t i = 0; i < pictures.size(); ++i) all.push_back(live_figure(pictures[i], titles[i], live[i]));
  return out + figures(all);
}

}  // namespace fxdyn
