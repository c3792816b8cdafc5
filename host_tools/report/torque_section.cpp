#include <fmt/format.h>

#include <cmath>

#include "host_tools/effects/evaluator.hpp"
#include "host_tools/effects/model_parts.hpp"
#include "host_tools/page/page.hpp"
#include "host_tools/page/plot.hpp"
#include "host_tools/report/section.hpp"

namespace fxdyn {

using namespace page;
using nlohmann::json;

std::string torque_section(const ReportInput& input, const json&) {
  std::vector<TorquePlot> plots;
  std::vector<std::string> titles;
  for (const ProcessedLog& log : input.logs) {
    const Eigen::MatrixXd predicted = log.filter_columns(predict(input.fitted, log));
    const Eigen::MatrixXd measured = log.filter_columns(log.tau);
    const Eigen::Index count = log.last - log.first;
    for (std::size_t j = 0; j < robot_of(input.fitted).size(); ++j) {
      const auto k = static_cast<Eigen::Index>(j);
      const Joint& joint = robot_of(input.fitted).joints[j];
      TorquePlot plot{log.t.segment(log.first, count), measured.col(k).segment(log.first, count),
                      predicted.col(k).segment(log.first, count), joint.torque_unit()};
      const double rmse = (plot.measured - plot.predicted).norm() / std::sqrt(static_cast<double>(count));
      titles.push_back(fmt::format("{} in {}: RMSE {:.3g} {}", joint.name, log.name, rmse, joint.torque_unit()));
      plots.push_back(std::move(plot));
    }
  }
  const std::vector<std::string> pictures = draw(plots);
  std::string out = section("Torque, measured and predicted") +
                    paragraph("Both filtered at the torque cut-off; the residual beneath.");
  std::vector<std::string> all;
  for (std::size_t i = 0; i < pictures.size(); ++i) all.push_back(figure(pictures[i], titles[i]));
  return out + figures(all);
}

}  // namespace fxdyn
