#include "host_tools/pipeline/log_check.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "host_tools/check/arrangement_search.hpp"
#include "host_tools/check/check.hpp"
#include "host_tools/effects/model_parts.hpp"
#include "host_tools/pipeline/one_log.hpp"
#include "host_tools/regression/metrics.hpp"
#include "host_tools/regression/pseudo_inertia.hpp"
#include "host_tools/support/error.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
namespace fs = std::filesystem;

/// The robot with the model's bodies, where they are some: a fit without `physical` may have none.
Robot with_bodies(const IdentifiedModel& model) {
  Robot robot = robot_of(model);
  const DhChain chain = to_dh(robot);
  for (std::size_t i = 0; i < robot.size(); ++i) {
    const Eigen::LLT<Eigen::Matrix4d> body(pseudo_inertia(inertia_of(model)[i]));
    if (body.info() == Eigen::Success)
      robot.joints[i].inertial = to_inertial(inertia_of(model)[i], chain.urdf_in_dh[i]);
  }
  return robot;
}

bool is_explained(const ProcessedLog& log, const Eigen::MatrixXd& torque, const LogCheckOptions& options) {
  const std::vector<JointMetrics> joints = judge(log, torque);
  return std::all_of(joints.begin(), joints.end(),
                     [&](const JointMetrics& joint) { return joint.relative < options.unexplained; });
}

/// What `fxdyn check` would say of a project with the model's robot and this one log.
void check_columns_of(const IdentifiedModel& model, const fs::path& file, const ProcessedLog& log) {
  Project project;
  project.robot = with_bodies(model);
  project.signals.torque_lead_s = filter_of(model).torque_lead_s;
  const ArrangementOptions options;
  std::vector<ProcessedLog> logs{log};
  logs.front().role = Role::train;
  const auto refuse = [&](const std::string& what) {
    return DataError(
        fmt::format("{}: {}; the model's logs had other columns: write this one's in their order, signs and units",
                    file.string(), what));
  };
  if (is_unexplained(project, logs, options) && are_exchanged(project, {read_log_for(model, file, {}, {})}, options))
    throw refuse("the columns of q and tau look exchanged");
  const std::vector<CheckFinding> findings = check_columns(project, logs, options);
  // Another axis is another robot, which the verb itself will say.
  if (std::any_of(findings.begin(), findings.end(),
                  [](const CheckFinding& finding) { return finding.kind == to_string(Mistake::axis); }))
    return;
  for (const CheckFinding& finding : findings)
    if (finding.error) throw refuse(finding.text);
}

}  // namespace

std::vector<std::string> check_log_for(const IdentifiedModel& model, const fs::path& file, const ProcessedLog& log,
                                       const Eigen::MatrixXd& torque, const LogCheckOptions& options) {
  if (log.tau.size() > 0 && !is_explained(log, torque, options)) check_columns_of(model, file, log);
  std::vector<std::string> notes;
  for (std::size_t j = 0; j < joints_of(model).size(); ++j) {
    const JointFit& fit = joints_of(model)[j];
    const Joint& joint = robot_of(model).joints[j];
    const auto q = log.q.col(static_cast<Index>(j));
    const double allowed = options.beyond * (fit.q_upper - fit.q_lower);
    if (q.minCoeff() >= fit.q_lower - allowed && q.maxCoeff() <= fit.q_upper + allowed) continue;
    notes.push_back(fmt::format(
        "{}: joint {} ({}) goes from {:.4g} to {:.4g} {}, the model was made for {:.4g} to {:.4g}: beyond, it is a "
        "guess, and the firmware holds its input at the limit",
        file.filename().string(), j + 1, joint.name, q.minCoeff(), q.maxCoeff(), joint.position_unit(), fit.q_lower,
        fit.q_upper));
  }
  return notes;
}

}  // namespace fxdyn
