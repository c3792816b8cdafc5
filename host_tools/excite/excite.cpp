#include "host_tools/excite/excite.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "host_tools/effects/identified_model.hpp"
#include "host_tools/excite/nominal.hpp"
#include "host_tools/excite/sight.hpp"
#include "host_tools/logs/log.hpp"
#include "host_tools/page/plot.hpp"
#include "host_tools/signals/planned_series.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/files.hpp"

namespace fxdyn {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

constexpr const char* definition =
    "condition numbers are of the column-normalised regressor over all samples of the plan, rows divided by the "
    "joint's "
    "torque noise; base: base parameters only; all: with viscous and Coulomb friction, offset and rotor inertia";

json number(double value) { return std::isfinite(value) ? json(value) : json(nullptr); }

json list(const Eigen::VectorXd& values) { return std::vector<double>(values.begin(), values.end()); }

json conditioning_json(const Conditioning& c) {
  return {{"base", number(c.base)}, {"all", number(c.all)}, {"log_det", number(c.log_determinant)}};
}

json settings_json(const ExciteSettings& settings) {
  return {{"period_s", settings.period_s}, {"order", settings.order},   {"trajectories", settings.trajectories},
          {"step_s", settings.step_s},     {"starts", settings.starts}, {"margin", settings.margin},
          {"noise", settings.noise}};
}

json usage_json(const Usage& usage) {
  return {{"limit", usage.limit},     {"where", usage.where}, {"unit", usage.unit},   {"lowest", usage.lowest},
          {"highest", usage.highest}, {"lower", usage.lower}, {"upper", usage.upper}, {"margin", usage.margin}};
}

json parameter_json(const WeakParameter& parameter, const Robot& robot) {
  json out{{"parameter", parameter.name}, {"error", parameter.error}, {"weak", parameter.error >= weak_error}};
  if (parameter.error >= weak_error) {
    out["joint_to_move"] = robot.joints[static_cast<std::size_t>(parameter.joint)].name;
  }
  return out;
}

/// All of excite.json but for "sight".
json to_json(const Plan& plan, const Project& project) {
  json out{{"schema", "fxdyn.excite/1"},
           {"project", project.file.filename().string()},
           {"robot", project.robot.name},
           {"seed", project.excite.seed},
           {"settings", settings_json(project.excite)},
           {"torque_noise", list(plan.noise)},
           {"rated_torque", list(plan.rated)},
           {"random_plans", random_plans},
           {"condition_number",
            {{"definition", definition},
             {"before", conditioning_json(plan.before)},
             {"after", conditioning_json(plan.after)},
             {"first_trajectory",
              {{"before", conditioning_json(plan.trajectory_before)},
               {"after", conditioning_json(plan.trajectory_after)}}}}},
           {"parameters", json::array()},
           {"trajectories", json::array()},
           {"limits", json::array()},
           {"notes", plan.notes}};
  for (const PlannedTrajectory& one : plan.trajectories)
    out["trajectories"].push_back(trajectory_json(one, project.robot));
  for (const Usage& usage : plan.usage) out["limits"].push_back(usage_json(usage));
  for (const WeakParameter& one : plan.parameters) out["parameters"].push_back(parameter_json(one, project.robot));
  return out;
}

std::string table(const Plan& plan, const Project& project) {
  std::string out = "\ntrajectory            duration   starts and ends at rest at\n";
  for (const PlannedTrajectory& one : plan.trajectories) {
    out += fmt::format("{:<20}{:>8.1f} s  ", one.name, one.t[one.t.size() - 1]);
    for (const double q : one.q.row(0)) out += fmt::format(" {:7.3f}", q);
    out += "\n";
  }
  out += fmt::format("\nscaled condition number   optimised   best of {} random\n", random_plans);
  const auto row = [&](const char* name, double after, double before) {
    out += fmt::format("{:<24}{:>11.1f}{:>12.1f}   ({:.2f} x)\n", name, after, before, after / before);
  };
  row("plan, base parameters", plan.after.base, plan.before.base);
  row("plan, with friction", plan.after.all, plan.before.all);
  row("first trajectory, base", plan.trajectory_after.base, plan.trajectory_before.base);
  out += fmt::format("\n{:<14}{:<18}{:>10}{:>10}{:>10}{:>10}  {:<8}{:>8}\n", "limit", "at", "lowest", "highest",
                     "lower", "upper", "unit", "margin");
  for (const Usage& u : plan.usage) {
    out += fmt::format("{:<14}{:<18}{:>10.4g}{:>10.4g}{:>10.4g}{:>10.4g}  {:<8}{:>6.1f} %\n", u.limit, u.where,
                       u.lowest, u.highest, u.lower, u.upper, u.unit, 100 * u.margin);
  }
  std::vector<WeakParameter> weakest = plan.parameters;
  std::stable_sort(weakest.begin(), weakest.end(), [](const auto& a, const auto& b) { return a.error > b.error; });
  out += "\nweakest parameters: standard deviation as a share of what would take the rated torque\n";
  for (std::size_t i = 0; i < weakest.size() && (i < 3 || weakest[i].error >= weak_error); ++i) {
    out += fmt::format("{:<18}{:>8.3f} %", weakest[i].name, 100 * weakest[i].error);
    if (weakest[i].error >= weak_error) {
      out += fmt::format("  weak: let joint '{}' move more",
                         project.robot.joints[static_cast<std::size_t>(weakest[i].joint)].name);
    }
    out += "\n";
  }
  for (const std::string& note : plan.notes) out += fmt::format("note: {}\n", note);
  return out + "note: collisions of the robot with itself are not checked; play the motions slowly first\n";
}

std::vector<std::string> joint_names(const Robot& robot) {
  std::vector<std::string> names;
  for (const Joint& joint : robot.joints) names.push_back(joint.name);
  return names;
}

std::string position_unit(const Robot& robot) {
  std::string unit = robot.joints[0].position_unit();
  for (const Joint& joint : robot.joints) {
    if (unit != joint.position_unit()) unit = "rad | m";
  }
  return unit;
}

}  // namespace

json trajectory_json(const PlannedTrajectory& trajectory, const Robot& robot) {
  json out{{"name", trajectory.name},
           {"kind", trajectory.kind},
           {"file", trajectory.name + ".csv"},
           {"plot", trajectory.name + ".svg"},
           {"duration_s", trajectory.t[trajectory.t.size() - 1]},
           {"samples", trajectory.t.size()},
           {"start", list(trajectory.q.row(0).transpose())}};
  if (trajectory.series.empty()) {
    out["dwell_s"] = trajectory.dwell_s;
    out["moves_s"] = trajectory.moves_s;
    out["poses"] = json::array();
    for (const auto& pose : trajectory.poses.rowwise()) out["poses"].push_back(list(pose.transpose()));
    return out;
  }
  out["period_s"] = trajectory.period_s;
  out["periods"] = trajectory.periods;
  out["series"] = json::array();
  for (std::size_t j = 0; j < robot.size(); ++j) {
    json series = series_json(trajectory.series[j]);
    series["joint"] = robot.joints[j].name;
    out["series"].push_back(std::move(series));
  }
  return out;
}

void write_motion(const fs::path& directory, const Motion& motion, const Robot& robot) {
  write_motion(directory, motion, joint_names(robot), position_unit(robot));
}

void write_motion(const fs::path& directory, const Motion& motion, const std::vector<std::string>& names,
                  const std::string& unit) {
  Log log;
  log.t = motion.t;
  log.q = motion.q;
  log.dq = motion.dq;
  log.ddq = motion.ddq;
  write_log(directory / (motion.name + ".csv"), log);
  write_file(directory / (motion.name + ".svg"),
             draw(std::vector<Panel>{{fmt::format("q [{}]", unit), motion.t, motion.q},
                                     {fmt::format("dq [{}/s]", unit), motion.t, motion.dq},
                                     {fmt::format("ddq [{}/s^2]", unit), motion.t, motion.ddq}},
                  names) +
                 "\n");
}

std::string excite(const Project& project, const fs::path& directory, Progress& progress) {
  std::error_code failed;
  fs::create_directories(directory, failed);  // fails now rather than after the work
  if (failed) throw InputError(fmt::format("{}: can't be made: {}", directory.string(), failed.message()));
  const Plan plan = make_plan(project, directory, progress);

  // What the plan would see, by the model of an earlier log where there is one.
  NominalModel nominal;
  if (fs::exists(directory / "model.json")) {
    nominal.model = read_model(directory / "model.json");
  } else {
    std::vector<double> fastest;
    for (std::size_t j = 0; j < project.robot.size(); ++j) {
      double most = 0;
      for (const PlannedTrajectory& one : plan.trajectories)
        most = std::max(most, one.dq.col(static_cast<Eigen::Index>(j)).cwiseAbs().maxCoeff());
      fastest.push_back(most);
    }
    nominal = nominal_from_urdf(project.robot, {plan.rated.begin(), plan.rated.end()}, fastest);
  }
  SightSettings settings;
  settings.noise = plan.noise;
  settings.torque_cutoff_hz = project.signals.torque_cutoff_hz;
  const Sight sight = see(nominal.model, {plan.trajectories.begin(), plan.trajectories.end()}, settings, progress);
  json document = to_json(plan, project);
  document["sight"] = sight_json(sight, nominal.assumptions);
  progress.stage("writing", plan.trajectories.size());
  for (const PlannedTrajectory& one : plan.trajectories) {
    write_motion(directory, one, project.robot);
    progress.step();
  }
  progress.done();
  write_file(directory / "excite.json", document.dump(1) + "\n");
  return table(plan, project) + "\n" + sight_table(sight, nominal.assumptions) +
         fmt::format("plan: {}\n", (directory / "excite.json").string());
}

}  // namespace fxdyn
