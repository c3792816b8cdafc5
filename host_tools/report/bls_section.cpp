#include <fmt/format.h>

#include <optional>
#include <utility>

#include "host_tools/page/page.hpp"
#include "host_tools/report/section.hpp"

namespace fxdyn {

using namespace page;
using nlohmann::json;

namespace {

/// What the search of each joint's BLS settled on, kept or not.
std::string choice_table(const json& training) {
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
  for (const json& joint : training) {
    const json choice = joint.value("choice", json());
    if (choice.is_null()) continue;
    any = true;
    const std::string length = text(joint.at("unit")) == "N" ? "m" : "rad";
    std::string distances = "none";
    if (choice.contains("distances")) {
      const auto d = choice.at("distances").get<std::vector<double>>();
      distances = fmt::format("{:.2g}, {:.2g}, {:.2g} {}", d[0], d[1], d[2], length);
    }
    table.add({{text(joint.at("joint"))},
               {text(choice.at("by"))},
               {fmt::format("{}", choice.at("nodes").get<int>()), "n"},
               {fmt::format("{}", choice.at("windows").get<int>()), "n"},
               {text(choice.at("activation"))},
               {text(choice.at("inputs"))},
               number(choice.at("ridge"), 2),
               number(choice.at("scale"), 2),
               {distances},
               {fmt::format("{:.2g} {}/s", choice.at("reference_velocity").get<double>(), length), "n"},
               {fmt::format("{:.4g} %", 100 * choice.at("J").get<double>()), "n"},
               choice.contains("generations") ? Cell{fmt::format("{}", choice.at("generations").get<int>()), "n"}
                                              : Cell{"-", "n"},
               {fmt::format("{}", joint.at("evaluations").get<int>()), "n"}});
  }
  if (!any) return {};
  return subsection("What the search settled on") + table.html() +
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

std::string bls_section(const ReportInput& input, const json& result) {
  std::string out = section("Broad Learning System");
  if (!result.contains("training")) return out + paragraph("Not trained.");
  const json& training = result.at("training");
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
  const std::vector<StageErrors> stages = stages_of(result);
  for (std::size_t j = 0; j < training.size(); ++j) {
    const json& joint = training.at(j);
    const auto shown = shown_errors(stages, role_of(role), j);
    const bool disagree = shown && shown->second > shown->first;
    const double without = joint.at("held_out_without"), with = joint.at("held_out_with");
    const bool kept = joint.at("kept"), found = !joint.contains("choice") || !joint.at("choice").is_null();
    table.add({{text(joint.at("joint"))},
               {text(joint.at("unit"))},
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
  return out + table.html() +
         paragraph(
             "Held-out RMSE on the gate data (see Data), not on the test logs. It is kept where that falls by at least "
             "5 % (20 % where blocks of one log judge), for the model as it is exported, too. Amber: kept, and worse "
             "on the logs "
             "beside it. Where it is not kept the joint stays as diagnosed. Physical inputs are velocity and three "
             "presliding states; "
             "extended ones add load, angle and acceleration; the state has no memory.") +
         choice_table(training);
}

}  // namespace fxdyn
