#include <fmt/format.h>

#include <optional>

#include "host_tools/regression/metrics_result.hpp"
#include "host_tools/report/diagnosis_table.hpp"
#include "host_tools/report/export_result.hpp"
#include "host_tools/report/replay_result.hpp"
#include "host_tools/report/report.hpp"
#include "host_tools/report/results.hpp"

namespace fxdyn {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

/// What the BLS did to a joint's error on the shown logs: "-85 %", or "not kept" where validation said no.
std::string bls_verdict(const MetricsResult& metrics, Role role, std::size_t joint) {
  const std::vector<StageErrors>& stages = metrics.stages;
  if (!metrics.training || joint >= metrics.training->size() || stages.size() < 2) return "";
  if (!(*metrics.training)[joint].kept) return "not kept";
  const double before = pooled_error(stages[stages.size() - 2].logs, role, joint).rmse;
  const double after = pooled_error(stages.back().logs, role, joint).rmse;
  return before > 0 ? fmt::format("{:+.0f} %", 100 * (after / before - 1)) : "";
}

std::string replay_line(const ReplayResult& replayed) {
  const ReplaySummary sum = summarise_replay(replayed);
  std::string line =
      fmt::format("firmware on {} (QEMU): {} ticks {}, {} instructions a tick", sum.processor, sum.ticks,
                  sum.different_ticks == 0 ? "bit-exact" : "DIFFER from the host",
                  sum.fewest == sum.most ? fmt::format("{}", sum.most) : fmt::format("{} to {}", sum.fewest, sum.most));
  if (replayed.size) {
    line += fmt::format(", {:.1f} KiB flash, {:.1f} KiB RAM", static_cast<double>(replayed.size->flash) / 1024,
                        static_cast<double>(replayed.size->ram) / 1024);
  }
  return line + "\n";
}

}  // namespace

std::string summary_table(const fs::path& directory) {
  const Results results = read_results(directory);
  const json &measured = results["metrics"], &replayed = results["replay"], &diagnosis = results["diagnosis"];
  const json& tables = results["export"];
  const std::string diagnosed =
      diagnosis.is_null() ? "" : diagnosis_table(diagnosis_of(diagnosis), terminal_of_output());
  if (measured.is_null()) return diagnosed;
  const MetricsResult metrics = metrics_of(measured);
  const auto exported = tables.is_null() ? std::nullopt : std::optional(export_of(tables));
  const Role role = role_of(results.role);
  const std::vector<LogErrors::Joint>& joints = metrics.logs.at(0).joints;
  std::size_t width = 8;
  for (const LogErrors::Joint& joint : joints) width = std::max(width, joint.name.size() + 2);

  std::string out = fmt::format("\nRMSE on the {} logs (in parentheses: share of the RMS of the torque)\n{:<{}}{:<6}",
                                results.role, "joint", width, "unit");
  for (const StageErrors& stage : metrics.stages) out += fmt::format("{:>20}", stage_title(stage));
  if (metrics.training) out += fmt::format("{:>10}", "by BLS");
  if (exported) out += fmt::format("{:>22}", "|fixed - double| max");
  out += "\n";
  for (std::size_t j = 0; j < joints.size(); ++j) {
    out += fmt::format("{:<{}}{:<6}", joints[j].name, width, joints[j].torque_unit);
    for (const StageErrors& stage : metrics.stages) {
      const PooledError error = pooled_error(stage.logs, role, j);
      out += fmt::format("{:>10.4g} ({:6.2f}%)", error.rmse, 100 * error.relative());
    }
    if (metrics.training) out += fmt::format("{:>10}", bls_verdict(metrics, role, j));
    if (exported) {
      const ExportResult::Joint& joint = exported->joints.at(j);
      out += fmt::format("{:>13.1e} of rated", joint.largest_error / joint.rated_torque);
    }
    out += "\n";
  }
  out += diagnosed;
  if (!replayed.is_null()) out += replay_line(replay_of(replayed));
  if (const fs::path report = directory / "report.html"; fs::exists(report)) {
    out += fmt::format("report: {}\n", fs::absolute(report).lexically_normal().string());
  }
  return out;
}

}  // namespace fxdyn
