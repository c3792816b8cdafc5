#include <fmt/format.h>

#include <optional>
#include <utility>

#include "host_tools/page/page.hpp"
#include "host_tools/regression/metrics_result.hpp"
#include "host_tools/report/joint_answer.hpp"
#include "host_tools/report/section.hpp"

namespace fxdyn {

using namespace page;

namespace {

/// What the search of each joint's BLS settled on, kept or not.
std::string choice_table(const std::vector<TrainedJoint>& training) {
  Table table({{"joint"},
               {"by"},
               {"nodes", "n"},
               {"windows", "n"},
               {"activation"},
               {"inputs"},
               {"ridge", "n"},
               {"scale", "n"},
               {"distances"},
               {"reference velocity", "n"},
               {"J of rated", "n"},
               {"generations", "n"},
               {"evaluations", "n"}});
  bool any = false;
  for (const TrainedJoint& joint : training) {
    if (!joint.choice) continue;
    const TrainedJoint::Choice& choice = *joint.choice;
    any = true;
    const std::string length = joint.unit == "N" ? "m" : "rad";
    std::string distances = "none";
    if (choice.distances) {
      const std::vector<double>& d = *choice.distances;
      distances = fmt::format("{:.2g}, {:.2g}, {:.2g} {}", d[0], d[1], d[2], length);
    }
    table.add({{joint.joint},
               {choice.by},
               {fmt::format("{}", choice.nodes), "n"},
               {fmt::format("{}", choice.windows), "n"},
               {choice.activation},
               {choice.inputs},
               number(choice.ridge, 2),
               number(choice.scale, 2),
               {distances},
               {fmt::format("{:.2g} {}/s", choice.reference_velocity, length), "n"},
               {fmt::format("{:.4g} %", 100 * choice.value), "n"},
               {choice.generations ? fmt::format("{}", *choice.generations) : "-", "n"},
               {fmt::format("{}", joint.evaluations), "n"}});
  }
  if (!any) return {};
  return subsection("What the search settled on") + table.html("Search, joint by joint") +
         paragraph(
             "By the particle swarm (pso) or the grid, whether it was kept or not. Distances are how far the joint "
             "moves "
             "until the presliding states follow. J: held-out RMSE, rounding of fixed point and a price for "
             "multiplications.");
}

}  // namespace

namespace {

/// Errors of a joint on the logs that are shown, before training and after it [N*m | N]; none: no such stages.
std::optional<std::pair<double, double>> shown_errors(const std::vector<StageErrors>& stages, Role role,
                                                      std::size_t joint) {
  std::optional<double> before, after;
  for (const StageErrors& stage : stages) {
    if (stage.stage == "diagnosed") before = pooled_error(stage.logs, role, joint).rmse;
    if (stage.stage == "bls") after = pooled_error(stage.logs, role, joint).rmse;
  }
  return before && after ? std::optional(std::pair(*before, *after)) : std::nullopt;
}

}  // namespace

std::string bls_section(const ReportInput& input, const nlohmann::json& file) {
  const MetricsResult result = metrics_of(file);
  std::string out = section("Broad Learning System");
  if (!result.training) return out + paragraph("Not trained.");
  const std::vector<TrainedJoint>& training = *result.training;
  if (training.empty()) return out + paragraph("Switched off in the project file.");
  const std::string& role = input.results.role;
  Table table({{"joint"},
               {"unit"},
               {"held out without", "n"},
               {"held out with", "n"},
               {"change", "n"},
               {"decision"},
               {role + " logs diagnosed", "n"},
               {role + " logs as exported", "n"}});
  for (std::size_t j = 0; j < training.size(); ++j) {
    const TrainedJoint& joint = training[j];
    const auto shown = shown_errors(result.stages, role_of(role), j);
    const bool disagree = shown && shown->second > shown->first && !is_good_enough(input, j, shown->second);
    const double without = joint.held_out_without, with = joint.held_out_with;
    const bool kept = joint.kept, found = joint.choice.has_value();
    table.add({{joint.joint},
               {joint.unit},
               number(without),
               found ? number(with) : Cell{"-", "n"},
               found ? Cell{fmt::format("{:+.1f} %", 100 * (with / without - 1)), "n"} : Cell{"-", "n"},
               {kept    ? "kept"
                : found ? "not kept"
                        : "none that fixed point could hold",
                !kept      ? ""
                : disagree ? "amber"
                           : "good"},
               shown ? number(shown->first) : Cell{"-", "n"},
               shown ? number(shown->second) : Cell{"-", "n"}});
  }
  return out + table.html("With and without the BLS") +
         paragraph(
             "Held-out RMSE on the gate data (see Data), not on the test logs. It is kept where that falls by at least "
             "5 % (20 % where blocks of one log judge), for the model as it is exported, too. Amber: kept, worse "
             "on the logs beside it, and what is left is not good enough. Where it is not kept the joint stays as "
             "diagnosed. Physical inputs are velocity and three "
             "presliding states; "
             "extended ones add load, angle and acceleration; the state has no memory.") +
         choice_table(training);
}

}  // namespace fxdyn
