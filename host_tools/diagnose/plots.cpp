#include "host_tools/diagnose/plots.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "host_tools/effects/model_parts.hpp"
#include "host_tools/page/class_means.hpp"
#include "host_tools/page/diagnosis_plot.hpp"
#include "host_tools/page/plot.hpp"
#include "host_tools/report/shown_log.hpp"
#include "host_tools/support/files.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
namespace fs = std::filesystem;

// Before in blue, after in orange; the cloud of the samples is mostly transparent behind their means.
constexpr const char* before_colour = "#2e6fb7";
constexpr const char* after_colour = "#e4572e";
constexpr const char* before_cloud = "#b82e6fb7";
constexpr const char* after_cloud = "#b8e4572e";

/// One log without its edges, samples x joints.
struct Residuals {
  const ProcessedLog* log;
  VectorXd t;
  MatrixXd q, dq, before, after;
};

Residuals residuals(const ProcessedLog& log, const IdentifiedModel& nominal, const IdentifiedModel& diagnosed) {
  const Index count = log.last - log.first;
  const auto inside = [&](const MatrixXd& m) { return MatrixXd(m.middleRows(log.first, count)); };
  const MotionRows motion = log.motion(log.first, count);
  const auto left = [&](const IdentifiedModel& model) {
    return inside(log.filter_columns(log.tau - predict(model, log)));
  };
  return {&log, log.t.segment(log.first, count), motion.q, motion.dq, left(nominal), left(diagnosed)};
}

/// One column of all logs, NaN between them.
VectorXd joined_columns(const std::vector<Residuals>& logs, MatrixXd Residuals::*of, Index joint) {
  std::vector<VectorXd> columns;
  for (const Residuals& one : logs) columns.emplace_back((one.*of).col(joint));
  return joined(columns);
}

Chart against(const std::vector<Residuals>& logs, MatrixXd Residuals::*of, Index joint, const std::string& x_label,
              const std::string& y_label) {
  const VectorXd x = joined_columns(logs, of, joint);
  const VectorXd before = joined_columns(logs, &Residuals::before, joint),
                 after = joined_columns(logs, &Residuals::after, joint);
  const ClassMeans mean_before = class_means(x, before), mean_after = class_means(x, after);
  return {x_label,
          y_label,
          {{x, before, before_cloud, 0.6, {}, true},
           {x, after, after_cloud, 0.6, {}, true},
           {mean_before.x, mean_before.y, before_colour, 2.2, "mean before"},
           {mean_after.x, mean_after.y, after_colour, 2.2, "mean after"}}};
}

Chart spectra(const Residuals& log, Index joint, const std::string& unit) {
  Chart chart{fmt::format("frequency [Hz] in {}", log.log->name),
              fmt::format("residual [{}/Hz^0.5]", unit),
              {spectrum_curve(log.before.col(joint), *log.log, before_colour, "before"),
               spectrum_curve(log.after.col(joint), *log.log, after_colour, "after")},
              true};
  for (const Trace& noise : noise_curve(*log.log, joint)) chart.curves.push_back(noise);
  return chart;
}

/// On which joints there is something to see.
std::vector<std::size_t> shown_joints(const DiagnosisResult& diagnosis, std::size_t joints) {
  std::vector<bool> shown(joints, false);
  const auto mark = [&](std::size_t index) {
    if (index >= 1 && index <= joints) shown[index - 1] = true;
  };
  for (const JointDiagnosis& joint : diagnosis.joints) {
    if (joint.verdict != Verdict::nothing_missing && joint.verdict != Verdict::not_excited) mark(joint.index);
  }
  for (const NamedEffect& effect : diagnosis.robot_effects) {
    for (const std::size_t index : effect.joints.value_or(std::vector<std::size_t>{})) mark(index);
  }
  std::vector<std::size_t> out;
  for (std::size_t j = 0; j < joints; ++j) {
    if (shown[j]) out.push_back(j);
  }
  return out;
}

}  // namespace

std::vector<fs::path> write_diagnosis_plots(const IdentifiedModel& nominal, const IdentifiedModel& diagnosed,
                                            const std::vector<ProcessedLog>& held_out, const DiagnosisResult& diagnosis,
                                            const fs::path& directory) {
  for (std::size_t j = 0; j < robot_of(diagnosed).size(); ++j) fs::remove(diagnosis_plot(directory, j));
  std::vector<Residuals> logs;
  for (const ProcessedLog& log : held_out) {
    if (log.tau.size() > 0) logs.push_back(residuals(log, nominal, diagnosed));
  }
  std::vector<fs::path> files;
  if (logs.empty()) return files;
  for (const std::size_t j : shown_joints(diagnosis, robot_of(diagnosed).size())) {
    const Joint& joint = robot_of(diagnosed).joints[j];
    const auto k = static_cast<Index>(j);
    const auto gain = [&](const Residuals& log) {
      return log.log->step_s * (log.before.col(k).squaredNorm() - log.after.col(k).squaredNorm());
    };
    const Residuals& telling =
        *std::max_element(logs.begin(), logs.end(), [&](auto& a, auto& b) { return gain(a) < gain(b); });
    const std::string left = fmt::format("residual [{}]", joint.torque_unit());
    const std::vector<Chart> charts{
        {fmt::format("time [s] in {}", telling.log->name),
         left,
         {{telling.t, telling.before.col(k), before_colour, 1, "before"},
          {telling.t, telling.after.col(k), after_colour, 1, "after"}}},
        spectra(telling, k, joint.torque_unit()),
        against(logs, &Residuals::dq, k, fmt::format("velocity [{}/s]", joint.position_unit()), left),
        against(logs, &Residuals::q, k, fmt::format("position [{}]", joint.position_unit()), left)};
    files.push_back(diagnosis_plot(directory, j));
    write_file(files.back(), draw(charts, 2) + "\n");
  }
  return files;
}

}  // namespace fxdyn
