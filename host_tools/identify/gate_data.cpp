#include "host_tools/identify/gate_data.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <numbers>

#include "host_tools/simulate/recordings.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/files.hpp"

namespace fxdyn {
namespace {

/// What is assumed where the project says nothing.
void add_notes(const Project& project, std::size_t logs, std::vector<std::string>& notes) {
  if (project.limits.position.empty() || project.limits.velocity.empty() || project.limits.acceleration.empty()) {
    notes.push_back(
        "limits not in the project: position from the URDF (slides: within ten times the logs'), velocity and torque "
        "from it within a factor of ten; the others 1.2 times the largest in the logs");
  }
  if (logs == 1) {
    notes.push_back(
        "one trajectory fits and judges: five blocks of it are judged by fits of the others, and they resemble each "
        "other, "
        "so that errors come out too small and effects that do not carry over can stay; record another trajectory with "
        "role "
        "= \"validate\"");
  }
  if (project.rated_torque.empty())
    notes.push_back("robot.rated_torque not in the project: the largest measured torque stands for it");
}

/// Largest motion and torque, and how long it stays at its limit.
void add_extremes(const ProcessedLog& processed, const Robot& robot, GateData& data) {
  for (Eigen::Index j = 0; j < processed.tau.cols(); ++j) {
    const MotionRows motion = processed.joint_motion(j);
    const auto inside = [&](const Eigen::MatrixXd& m) {
      return m.col(0).segment(processed.first, processed.last - processed.first);
    };
    data.q_lower[j] = std::min(data.q_lower[j], inside(motion.q).minCoeff());
    data.q_upper[j] = std::max(data.q_upper[j], inside(motion.q).maxCoeff());
    data.dq[j] = std::max(data.dq[j], inside(motion.dq).cwiseAbs().maxCoeff());
    data.ddq[j] = std::max(data.ddq[j], inside(motion.ddq).cwiseAbs().maxCoeff());
    data.largest_torque[j] = std::max(data.largest_torque[j], processed.tau.col(j).cwiseAbs().maxCoeff());
    const auto& runs = processed.saturated[static_cast<std::size_t>(j)];
    Eigen::Index saturated = 0;
    for (const auto& [from, to] : runs) saturated += to - from;
    if (saturated > 0) {
      data.notes.push_back(
          fmt::format("{}: torque of joint {} ({}) stays at its limit for {} samples: left out of the fit",
                      processed.name, j + 1, robot.joints[static_cast<std::size_t>(j)].name, saturated));
    }
  }
}

}  // namespace

GateData read_gate_data(const Project& project, const std::filesystem::path& directory, const GateOptions& options) {
  if (!project.has_role(Role::train)) {
    throw InputError(project.file.string() + ": no log to learn from; add a [[log]] with role = \"train\"");
  }
  GateData data;
  std::vector<Log> logs;
  for (const Role role : {Role::train, Role::validate}) {
    for (Log& log : read_logs(project, role, directory, &data.rows)) logs.push_back(std::move(log));
  }
  Eigen::Index samples = 0;
  for (const Log& log : logs) samples += log.samples();
  if (static_cast<double>(samples) > options.long_logs) data.threads = 1;
  const ThreadLimit limit(data.threads);
  data.filter = choose_filter(logs, project.signals);
  const auto n = static_cast<Eigen::Index>(project.robot.size());
  data.largest_torque = data.dq = data.ddq = Eigen::VectorXd::Zero(n);
  data.q_lower = Eigen::VectorXd::Constant(n, 1e300);
  data.q_upper = -data.q_lower;
  add_notes(project, logs.size(), data.notes);
  ProcessSettings settings;
  settings.torque_limits = project.limits.torque;
  // Enough rows for any fit of a few hundred unknowns; a long log is decimated more.
  // At one interval for all logs, so that their noise is alike from row to row.
  double seconds = 0;
  for (const Log& log : logs) seconds += log.step_s * static_cast<double>(log.samples());
  settings.shortest_interval_s = seconds / options.most_rows;
  for (Log& log : logs) {
    if (!log.time_note.empty()) data.notes.push_back(log.time_note);
    if (log.resampled) {
      data.notes.push_back(
          fmt::format("{}: irregular time stamps, resampled to {:.6g} s", log.file.filename().string(), log.step_s));
    }
    check_torque(log, project.robot, options);
    data.references.push_back(
        {log.file.filename().string(), to_string(log.role), hash_of_file(log.file), log.from_s, log.to_s});
    data.logs.push_back(process(std::move(log), data.filter, settings));
    add_extremes(data.logs.back(), project.robot, data);
  }
  return data;
}

void check_torque(const Log& log, const Robot& robot, const GateOptions& options) {
  for (Eigen::Index j = 0; j < log.tau.cols(); ++j) {
    if (log.tau.col(j).maxCoeff() > log.tau.col(j).minCoeff()) continue;
    if (log.q.col(j).maxCoeff() - log.q.col(j).minCoeff() < options.parked) continue;
    throw DataError(fmt::format("{}: torque of joint {} ({}) never changes: check the column and its gain",
                                log.file.string(), j + 1, robot.joints[static_cast<std::size_t>(j)].name));
  }
}

namespace {

/// Whether a URDF's position limits are the joint's and no placeholders.
bool has_range(const Joint& joint, double moved, const GateOptions& options) {
  const double widest_turn = options.widest_turns * 2 * std::numbers::pi;
  const double range = joint.limits->upper - joint.limits->lower;
  return range > 0 && range <= (joint.type == JointType::revolute ? widest_turn : options.widest_slide * moved);
}

}  // namespace

std::vector<JointFit> initial_joints(const Project& project, const GateData& data, const GateOptions& options) {
  const double margin = options.margin;
  std::vector<JointFit> joints(project.robot.size());
  const LimitSettings& given = project.limits;
  for (std::size_t j = 0; j < joints.size(); ++j) {
    const auto k = static_cast<Eigen::Index>(j);
    JointFit& joint = joints[j];
    const std::optional<Limits>& urdf = project.robot.joints[j].limits;
    // A URDF's placeholder limits (1e6 N) would cost resolution for ranges that never occur.
    const auto choose = [&](const std::vector<double>& set, double from_urdf, double measured) {
      if (!set.empty()) return set[j];
      return urdf && from_urdf > 0 && from_urdf <= options.widest_limit * measured ? std::max(from_urdf, measured)
                                                                                   : margin * measured;
    };
    joint.rated_torque = project.rated_torque.empty() ? data.largest_torque[k] : project.rated_torque[j];
    joint.dq_limit = choose(given.velocity, urdf ? urdf->velocity : 0, data.dq[k]);
    joint.ddq_limit = choose(given.acceleration, 0, data.ddq[k]);
    joint.tau_limit =
        choose(given.torque, urdf ? urdf->effort : 0, std::max(data.largest_torque[k], joint.rated_torque));
    if (!given.position.empty()) {
      joint.q_lower = given.position[j][0];
      joint.q_upper = given.position[j][1];
    } else {
      const double middle = (data.q_lower[k] + data.q_upper[k]) / 2, half = (data.q_upper[k] - data.q_lower[k]) / 2;
      joint.q_lower = middle - margin * half;
      joint.q_upper = middle + margin * half;
      if (urdf && has_range(project.robot.joints[j], 2 * half, options)) {
        joint.q_lower = std::min(urdf->lower, data.q_lower[k]);
        joint.q_upper = std::max(urdf->upper, data.q_upper[k]);
      }
    }
    joint.sign_width = std::max(options.sign_width * data.dq[k], 1e-6);  // of a joint at rest
  }
  return joints;
}

}  // namespace fxdyn
