#include "host_tools/pipeline/refine_model.hpp"

#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "host_tools/forward/refine.hpp"
#include "host_tools/project/project.hpp"
#include "host_tools/project/provenance.hpp"
#include "host_tools/simulate/recordings.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/files.hpp"
#include "host_tools/support/progress.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using nlohmann::json;
namespace fs = std::filesystem;

std::vector<ForwardLog> logs_of(const Project& project, Role role, const fs::path& directory, const FilterFit& filter) {
  std::vector<ForwardLog> out;
  for (Log& log : read_logs(project, role, directory)) {
    ProcessedLog processed = process(log, filter);
    out.push_back({std::move(log), std::move(processed)});
  }
  return out;
}

const char* loop_name(Loop loop) { return loop == Loop::open ? "open" : "closed"; }

json refine_json(const Refinement& refined, const fs::path& model, const std::string& gate, Index given) {
  json joints = json::array(), parameters = json::array(), tried = json::array();
  for (std::size_t j = 0; j < refined.model.joints.size(); ++j) {
    const Joint& joint = refined.model.robot.joints[j];
    joints.push_back({{"joint", joint.name},
                      {"index", j + 1},
                      {"unit", joint.position_unit()},
                      {"train_rmse_before", refined.before[static_cast<Index>(j)]},
                      {"train_rmse_after", refined.after[static_cast<Index>(j)]}});
  }
  for (const RefinedParameter& p : refined.parameters) {
    parameters.push_back({{"name", p.name}, {"before", p.before}, {"after", p.after}});
    if (!p.unit.empty()) parameters.back()["unit"] = p.unit;
  }
  for (const TriedWeight& t : refined.tried) {
    // null: the motion ran away
    tried.push_back({{"weight", t.weight}, {"held_out", std::isfinite(t.held_out) ? json(t.held_out) : json(nullptr)}});
  }
  json out = {{"schema", "fxdyn.refine/1"},
              {"model", model.filename().string()},
              {"given", given},
              {"loop", loop_name(refined.loop)},
              {"gate", gate},
              {"kept", refined.kept},
              {"weight", refined.weight},
              {"weights", tried},
              {"joints", joints},
              {"parameters", parameters}};
  if (!refined.why_closed.empty()) out["why_closed"] = refined.why_closed;
  return out;
}

std::string table(const Refinement& refined, const std::string& gate) {
  std::string out;
  if (!refined.why_closed.empty()) out += fmt::format("in closed loop, as {}\n", refined.why_closed);
  out += fmt::format("judged on {}: position's RMSE over that of the fit by torque\n{:<24} {:>10}\n", gate,
                     "weight of the torque", "held out");
  for (const TriedWeight& t : refined.tried) out += fmt::format("{:<24g} {:>10.4g}\n", t.weight, t.held_out);
  if (!refined.kept) return out + "none is better than the fit by torque, which is kept\n";
  out += fmt::format("{:<24} {:>10} {:>10}\n", "RMSE on the train logs", "before", "after");
  for (std::size_t j = 0; j < refined.model.joints.size(); ++j) {
    const auto k = static_cast<Index>(j);
    const Joint& joint = refined.model.robot.joints[j];
    out += fmt::format("{:<24} {:>10.4g} {:>10.4g} {}\n", joint.name, refined.before[k], refined.after[k],
                       joint.position_unit());
  }
  return out;
}

}  // namespace

std::string refine_model(const fs::path& project_file, const fs::path& model_file, Index given,
                         const fs::path& directory) {
  const Project project = read_project(project_file);
  const IdentifiedModel model = read_model(model_file);
  if (model.project_hash != project_hash(project)) {
    throw InputError(fmt::format("{}: is no model of {} as it is now: run `fxdyn identify` or `fxdyn run` first",
                                 model_file.string(), project_file.string()));
  }
  check_writable(directory);
  const std::vector<ForwardLog> train = logs_of(project, Role::train, directory, model.filter),
                                validate = logs_of(project, Role::validate, directory, model.filter);
  const std::string gate = validate.empty() ? "the other half of each train log" : "the validate logs";
  Progress progress;
  Refinement refined = refine(model, train, validate, given, progress);
  if (refined.kept) {
    refined.model.drop_tables();  // they are another model's now
    refined.model.notes.push_back(fmt::format(
        "base parameters and the effects' coefficients refined by simulated positions of the train logs ({} loop, the "
        "torque counts {:g}); their standard deviations are still those of the fit by torque",
        loop_name(refined.loop), refined.weight));
  }
  write_file(directory / "refined.json", to_json(refined.model).dump(1) + "\n");
  write_file(directory / "refine.json", refine_json(refined, model_file, gate, given).dump(1) + "\n");
  return table(refined, gate);
}

}  // namespace fxdyn
