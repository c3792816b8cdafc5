#include <fmt/format.h>

#include "host_tools/page/page.hpp"
#include "host_tools/report/section.hpp"

namespace fxdyn {

using namespace page;
using nlohmann::json;

std::string error_section(const ReportInput& input, const json& result) {
  const std::vector<StageErrors> stages = stages_of(result);
  const Role role = role_of(input.results.role);
  std::vector<Cell> head{{"joint"},         {"unit"},
                         {"rated", "n"},    {"model"},
                         {"RMSE", "n"},     {"of RMS torque", "n"},
                         {"of rated", "n"}, {"white noise", "n"}};
  Table table(head);
  const json& joints = input.model.at("joints");
  for (std::size_t j = 0; j < joints.size(); ++j) {
    const double rated = joints.at(j).at("rated_torque");
    for (const StageErrors& stage : stages) {
      const bool first = &stage == &stages.front(), last = &stage == &stages.back();
      const PooledError error = pooled_error(stage.logs, role, j);
      table.add({{first ? text(joints.at(j).at("joint")) : ""},
                 {first ? text(joints.at(j).at("unit")) : ""},
                 first ? number(rated) : Cell{},
                 {stage_title(stage)},
                 {fmt::format("{:.4g}", error.rmse), last ? "n good" : "n"},
                 percent(error.relative()),
                 percent(error.rmse / rated),
                 last ? number(error.noise_floor, 3) : Cell{}});
    }
  }
  std::string out = section(fmt::format("Error on the {} logs", input.results.role)) + table.html();
  out += paragraph(
      "RMSE between measured and predicted torque, both filtered alike, over all logs of the role. Of RMS torque: 100 "
      "% "
      "is what predicting zero would give. White noise: what white noise of the torque signal leaves after the filter, "
      "from what lies above the cut-off. An error close to it leaves little to learn; noise that is not white is not "
      "in it (see the noise floor under Diagnosis).");
  Table per_log(
      {{"log"}, {"joint"}, {"unit"}, {"RMSE", "n"}, {"of RMS torque", "n"}, {"unfiltered RMSE", "n"}, {"bias", "n"}});
  for (const json& log : result.at("logs")) {
    if (log.at("role") != input.results.role) continue;
    for (const json& joint : log.at("joints")) {
      per_log.add({{text(log.at("file"))},
                   {text(joint.at("joint"))},
                   {text(joint.at("unit"))},
                   number(joint.at("rmse")),
                   percent(joint.at("relative")),
                   number(joint.at("rmse_raw")),
                   number(joint.at("bias"), 2)});
    }
  }
  return out + "<h3>The final model, log by log</h3>\n" + per_log.html() +
         paragraph(
             "Unfiltered RMSE: the same against the measured torque as it was recorded, with the noise that the filter "
             "takes away: it can't fall below that noise. Bias: mean of measured minus predicted torque, which a wrong "
             "offset or gravity leaves.");
}

}  // namespace fxdyn
