#include <fmt/format.h>

#include <optional>

#include "host_tools/page/page.hpp"
#include "host_tools/report/section.hpp"

namespace fxdyn {

using namespace page;
using nlohmann::json;

namespace {

/// times the least error; a stage that is so near is as good; as what a name may raise a joint's error by
/// (GateOptions::worse)
constexpr double as_good = 1.02;

/// Errors of the stages at one joint.
struct StageFigures {
  std::vector<PooledError> shown;             ///< on the logs that are shown
  std::vector<std::optional<double>> judged;  ///< on what judges; none: not known
  std::size_t exported = 0;                   ///< the stage that the joint has in model.json
};

StageFigures figures_of(const std::vector<StageErrors>& stages, const json& gate_errors, Role role, std::size_t joint) {
  StageFigures out;
  const json judged = joint < gate_errors.size() ? gate_errors.at(joint) : json::object();
  out.exported = stages.size() - 1;
  for (std::size_t s = 0; s < stages.size(); ++s) {
    const std::string& name = stages[s].stage;
    out.shown.push_back(pooled_error(stages[s].logs, role, joint));
    const json error = judged.value(name, json());
    out.judged.push_back(error.is_number() ? std::optional(error.get<double>()) : std::nullopt);
    if (judged.value("exported", "") == name) out.exported = s;
  }
  return out;
}

/// Green where no other stage is better than the exported one, on the logs that are shown and on what judges.
const char* colour_of(const StageFigures& figures) {
  const std::size_t own = figures.exported;
  for (std::size_t s = 0; s < figures.shown.size(); ++s) {
    if (figures.shown[own].rmse > as_good * figures.shown[s].rmse) return "n amber";
    if (figures.judged[own] && figures.judged[s] && *figures.judged[own] > as_good * *figures.judged[s])
      return "n amber";
  }
  return "n good";
}

}  // namespace

std::string error_section(const ReportInput& input, const json& result) {
  const std::vector<StageErrors> stages = stages_of(result);
  const Role role = role_of(input.results.role);
  std::vector<Cell> head{{"joint"},           {"unit"},      {"rated", "n"},         {"model"},
                         {"gate", "n"},       {"RMSE", "n"}, {"of RMS torque", "n"}, {"of rated", "n"},
                         {"white noise", "n"}};
  Table table(head);
  const json gate_errors = result.value("gate_errors", json::array());
  const json& joints = input.model.at("joints");
  for (std::size_t j = 0; j < joints.size(); ++j) {
    const double rated = joints.at(j).at("rated_torque");
    const StageFigures figures = figures_of(stages, gate_errors, role, j);
    for (std::size_t s = 0; s < stages.size(); ++s) {
      const bool first = s == 0, last = s + 1 == stages.size();
      const PooledError& error = figures.shown[s];
      table.add({{first ? text(joints.at(j).at("joint")) : ""},
                 {first ? text(joints.at(j).at("unit")) : ""},
                 first ? number(rated) : Cell{},
                 {stage_title(stages[s]) + (s == figures.exported ? ": exported" : "")},
                 figures.judged[s] ? number(*figures.judged[s]) : Cell{"-", "n"},
                 {fmt::format("{:.4g}", error.rmse), s == figures.exported ? colour_of(figures) : "n"},
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
  out += paragraph(
      "Gate: the same on the data that judge (see Data), which decide what is exported. Green: the exported stage, "
      "where "
      "no other is better by 2 %, there and on these logs. Amber: one is. Where a joint keeps no BLS its last stage is "
      "the diagnosed one.");
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
