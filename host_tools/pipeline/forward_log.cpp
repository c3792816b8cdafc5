#include "host_tools/pipeline/forward_log.hpp"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "host_tools/effects/identified_model.hpp"
#include "host_tools/forward/forward.hpp"
#include "host_tools/forward/forward_result.hpp"
#include "host_tools/page/plot.hpp"
#include "host_tools/pipeline/one_log.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/files.hpp"
#include "host_tools/support/progress.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
namespace fs = std::filesystem;

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
  const ProcessedLog processed = process(log, model.filter);
  require_log_of(model, log_file, processed, predict(model, processed));
  const Forward forward = simulate_forward(model, log, processed, given);
  progress.step();
  progress.done();
  const ForwardResult result = forward_result(forward, model.robot, log, given);
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
  write_file(directory / "forward.json", to_json(result).dump(1) + "\n");
  return forward_table(result);
}

}  // namespace fxdyn
