#include "host_tools/pipeline/forward_log.hpp"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "host_tools/effects/identified_model.hpp"
#include "host_tools/forward/forward.hpp"
#include "host_tools/page/plot.hpp"
#include "host_tools/pipeline/one_log.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/files.hpp"
#include "host_tools/support/progress.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using nlohmann::json;
namespace fs = std::filesystem;

json rmse_of(const ForwardRun& run, Index joint) {
  return run.why_failed.empty() ? json(run.rmse[joint]) : json(nullptr);
}

json forward_json(const Forward& forward, const Robot& robot, const Log& log, Index given) {
  json joints = json::array();
  for (Index j = 0; j < log.joints(); ++j) {
    const Joint& joint = robot.joints[static_cast<std::size_t>(j)];
    joints.push_back({{"joint", joint.name},
                      {"index", j + 1},
                      {"unit", joint.position_unit()},
                      {"range", log.q.col(j).maxCoeff() - log.q.col(j).minCoeff()},
                      {"open_rmse", rmse_of(forward.open, j)},
                      {"closed_rmse", rmse_of(forward.closed, j)}});
  }
  json out = {{"schema", "fxdyn.forward/1"},
              {"log", log.file.filename().string()},
              {"given", given},
              {"simulated_s", log.step_s * static_cast<double>(log.samples() - given)},
              {"joints", joints}};
  if (!forward.open.why_failed.empty()) out["failed"]["open"] = forward.open.why_failed;
  if (!forward.closed.why_failed.empty()) out["failed"]["closed"] = forward.closed.why_failed;
  return out;
}

std::string table(const json& result) {
  std::string out =
      fmt::format("{}: {:.3g} s simulated, the first {} samples given\n{:<24} {:>12} {:>12} {:>12}\n",
                  result.at("log").get<std::string>(), result.at("simulated_s").get<double>(),
                  result.at("given").get<Index>(), "RMSE of the position", "open loop", "closed loop", "range");
  const auto number = [](const json& value) {
    return value.is_null() ? std::string("failed") : fmt::format("{:.4g}", value.get<double>());
  };
  for (const json& joint : result.at("joints")) {
    out += fmt::format("{:<24} {:>12} {:>12} {:>12} {}\n", joint.at("joint").get<std::string>(),
                       number(joint.at("open_rmse")), number(joint.at("closed_rmse")), number(joint.at("range")),
                       joint.at("unit").get<std::string>());
  }
  if (const auto failed = result.find("failed"); failed != result.end()) {
    for (const auto& [loop, why] : failed->items()) out += fmt::format("{} loop: {}\n", loop, why.get<std::string>());
  }
  return out;
}

/// A panel a joint: measured and simulated positions over time.
std::string picture(const Forward& forward, const Robot& robot, const Log& log) {
  std::vector<std::string> names{"measured"};
  std::vector<const MatrixXd*> runs{&log.q};
  const auto add = [&](const ForwardRun& run, const char* name) {
    if (!run.why_failed.empty()) return;
    names.emplace_back(name);
    runs.push_back(&run.q);
  };
  add(forward.open, "open loop");
  add(forward.closed, "closed loop");
  std::vector<Panel> panels;
  for (Index j = 0; j < log.joints(); ++j) {
    const Joint& joint = robot.joints[static_cast<std::size_t>(j)];
    Panel panel{fmt::format("{} [{}]", joint.name, joint.position_unit()), log.t,
                MatrixXd(log.samples(), static_cast<Index>(runs.size()))};
    for (std::size_t r = 0; r < runs.size(); ++r) panel.columns.col(static_cast<Index>(r)) = runs[r]->col(j);
    panels.push_back(std::move(panel));
  }
  return draw(panels, names);
}

}  // namespace

std::string forward_log(const fs::path& model_file, const fs::path& log_file, Index given, const fs::path& directory) {
  const IdentifiedModel model = read_model(model_file);
  Log log = read_log_for(model, log_file, {}, {});
  log.role = Role::test;
  Progress progress;
  progress.stage("simulating the motion", 1);
  const Forward forward = simulate_forward(model, log, process(log, model.filter), given);
  progress.step();
  progress.done();
  const json result = forward_json(forward, model.robot, log, given);
  const std::string svg = picture(forward, model.robot, log);
  const auto write = [&](const ForwardRun& run, const char* name) {
    if (!run.why_failed.empty()) return;
    Log out;
    out.t = log.t;
    out.q = run.q;
    write_log(directory / name, out);
  };
  write(forward.open, "open.csv");
  write(forward.closed, "closed.csv");
  write_file(directory / "forward.svg", svg);
  write_file(directory / "forward.json", result.dump(1) + "\n");
  return table(result);
}

}  // namespace fxdyn
