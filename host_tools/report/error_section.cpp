#include <fmt/format.h>

#include "host_tools/effects/model_parts.hpp"
#include "host_tools/page/page.hpp"
#include "host_tools/regression/metrics_result.hpp"
#include "host_tools/report/joint_answer.hpp"
#include "host_tools/report/section.hpp"
#include "host_tools/report/stage_figures.hpp"

namespace fxdyn {

using namespace page;

namespace {

/// Green where what is left is good enough, or no other stage is better than the exported one: on the logs that are
/// shown and on what judges.
const char* colour_of(const ReportInput& input, std::size_t joint, const StageFigures& figures) {
  if (!figures.another_is_better_on_shown() && !figures.another_is_better_on_judging()) return "n good";
  return is_good_enough(input, joint, figures.shown[figures.exported].rmse) ? "n good" : "n amber";
}

}  // namespace

std::string error_section(const ReportInput& input, const nlohmann::json& file) {
  const MetricsResult result = metrics_of(file);
  const std::vector<StageErrors>& stages = result.stages;
  const Role role = role_of(input.results.role);
  std::vector<Cell> head{{"joint"},           {"unit"},      {"rated", "n"},         {"model"},
                         {"gate", "n"},       {"RMSE", "n"}, {"of RMS torque", "n"}, {"of rated", "n"},
                         {"white noise", "n"}};
  Table table(head);
  const std::vector<Joint>& joints = robot_of(input.fitted).joints;
  for (std::size_t j = 0; j < joints.size(); ++j) {
    const double rated = joints_of(input.fitted)[j].rated_torque;
    const StageFigures figures = stage_figures(result, role, j);
    for (std::size_t s = 0; s < stages.size(); ++s) {
      const bool first = s == 0, last = s + 1 == stages.size();
      const PooledError& error = figures.shown[s];
      table.add({{first ? joints[j].name : ""},
                 {first ? joints[j].torque_unit() : ""},
                 first ? number(rated) : Cell{},
                 {stage_title(stages[s]) + (s == figures.exported ? ": exported" : "")},
                 figures.judged[s] ? number(*figures.judged[s]) : Cell{"-", "n"},
                 {fmt::format("{:.4g}", error.rmse), s == figures.exported ? colour_of(input, j, figures) : "n"},
                 percent(error.relative()),
                 percent(error.rmse / rated),
                 last ? number(error.noise_floor, 3) : Cell{}});
    }
  }
  std::string out =
      section(fmt::format("Error on the {} logs", input.results.role)) + table.html("Errors of the stages");
  out += paragraph(
      "RMSE between measured and predicted torque, both filtered alike, over all logs of the role. Of RMS torque: 100 "
      "% "
      "is what predicting zero would give. White noise: what white noise of the torque signal leaves after the filter, "
      "from what lies above the cut-off. An error close to it leaves little to learn; noise that is not white is not "
      "in it (see the noise floor under Diagnosis).");
  out += paragraph(
      "Gate: the same on the data that judge (see Data), which decide what is exported. Green: the exported stage, "
      "where no other is better by 2 %, there and on these logs, or where what is left is good enough. Amber: neither. "
      "Where a joint keeps no BLS its last stage is "
      "the diagnosed one.");
  Table per_log(
      {{"log"}, {"joint"}, {"unit"}, {"RMSE", "n"}, {"of RMS torque", "n"}, {"unfiltered RMSE", "n"}, {"bias", "n"}});
  for (const LogErrors& log : result.logs) {
    if (log.role != role) continue;
    for (const LogErrors::Joint& joint : log.joints) {
      const JointMetrics& errors = joint.metrics;
      per_log.add({{log.file},
                   {joint.name},
                   {joint.torque_unit},
                   number(errors.rmse),
                   percent(errors.relative),
                   number(errors.rmse_raw),
                   number(errors.bias, 2)});
    }
  }
  return out + "<h3>The final model, log by log</h3>\n" + per_log.html("Errors, log by log") +
         paragraph(
             "Unfiltered RMSE: the same against the measured torque as it was recorded, with the noise that the filter "
             "takes away: it can't fall below that noise. Bias: mean of measured minus predicted torque, which a wrong "
             "offset or gravity leaves.");
}

}  // namespace fxdyn
