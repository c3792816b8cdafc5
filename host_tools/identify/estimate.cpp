#include "host_tools/identify/estimate.hpp"

#include <fmt/format.h>

#include <cmath>
#include <limits>

#include "host_tools/identify/flexible.hpp"
#include "host_tools/project/provenance.hpp"
#include "host_tools/regression/essential.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/files.hpp"

namespace fxdyn {
namespace {

/// Of X with columns of length one, from X^T X.
double condition_number(const Eigen::MatrixXd& information) {
  const Eigen::VectorXd scale = information.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(scale.asDiagonal() * information * scale.asDiagonal(),
                                                              Eigen::EigenvaluesOnly);
  return solver.eigenvalues().minCoeff() > 1e-15
             ? std::sqrt(solver.eigenvalues().maxCoeff() / solver.eigenvalues().minCoeff())
             : std::numeric_limits<double>::infinity();
}

/// The weighted squared residual of a row: 1 for weights of one over the variance.
double variance_of_row(const Fitter& fitter, const Solution& solution) {
  return fitter.weighted_square(solution) / fitter.train_rows();
}

/// @throws DataError where the train logs do not identify some base parameters
void check_identifiable(const std::vector<WeakParameter>& weak, const Robot& robot) {
  std::string names;
  Eigen::Index to_move = 0;
  for (const WeakParameter& one : weak) {
    if (one.identifiable) continue;
    names += (names.empty() ? "" : ", ") + one.name;
    to_move = one.joint;
  }
  if (!names.empty()) {
    throw DataError(fmt::format("the train logs can't tell {}: record a log in which joint {} ({}) moves more", names,
                                to_move + 1, robot.joints[static_cast<std::size_t>(to_move)].name));
  }
}

/// By file name. "": what a log that the project does not name is read with, if its own logs agree.
auto log_formats(const std::vector<LogEntry>& logs) {
  decltype(IdentifiedModel::log_formats) formats;
  bool agree = true;
  for (const LogEntry& entry : logs) {
    const LogFormat& first = logs.front().format;
    agree = agree && entry.format == first;
    formats[entry.scenario ? entry.scenario_log + ".csv" : entry.file.filename().string()] = entry.format;
  }
  if (agree) formats = {{"", logs.front().format}};
  return formats;
}

/// Stiffness of joints with a link encoder, of the logs that fit.
void add_flexible_joints(IdentifiedModel& model, const std::vector<ProcessedLog>& logs,
                         const FlexibleOptions& options) {
  std::vector<ProcessedLog> train;
  for (const ProcessedLog& log : logs) {
    if (log.role == Role::train && log.qlink.size() > 0) train.push_back(log);
  }
  for (const FlexibleJoint& joint : identify_flexible({model, train}, options)) {
    model.joints[joint.joint].flexible = joint;
    const Joint& place = model.robot.joints[joint.joint];
    model.notes.push_back(joint.found ? fmt::format("joint {} ({}): stiffness {:.4g} +- {:.2g} {}/{}", joint.joint + 1,
                                                    place.name, joint.stiffness, joint.stiffness_std,
                                                    place.torque_unit(), place.position_unit())
                                      : fmt::format("joint {} ({}): {}", joint.joint + 1, place.name, joint.note));
    if (joint.found) model.joints[joint.joint].effects.push_back(elasticity_effect(joint, options));
  }
}

}  // namespace

Estimate finish_model(const Fitter& fitter, const Project& project, const GateData& data,
                      const IdentifyOptions& options) {
  const IdentifySettings& settings = project.identify;
  Estimate out;
  Solution solution = fitter.fit();
  const NormalEquations equations = fitter.normal_equations();
  out.condition = condition_number(equations.information);
  // With a BLS beside it the recursion ends where the fit does too, after many times the work.
  bool trained = false;
  for (std::size_t j = 0; j < fitter.joints(); ++j) trained |= fitter.design(j).bls.has_value();
  if (settings.method == "rls" && !trained) {
    out.recursion = fitter.recursive(settings.forgetting, 200);
    solution.beta = out.recursion->solution.beta;
    solution.theta = out.recursion->solution.theta;
  }
  out.weak = weak_in_logs(fitter, solution, options.structure);
  // With a joint at rest the bodies on either side of it can't be separated; that is asked for.
  if (data.logs.front().left_out.empty()) check_identifiable(out.weak, project.robot);
  const Solution essential = essential_parameters(solution, equations);
  if (settings.physical) {
    out.physical = fit_physical(fitter, project.robot, variance_of_row(fitter, solution));
    if (out.physical->constrained && !settings.essential) solution = physical_solution(solution, *out.physical);
  }
  solution.essential = essential.essential;
  out.model = fitter.to_model(settings.essential ? essential : solution);
  IdentifiedModel& model = out.model;
  model.filter = data.filter;
  model.filter.torque_lead_s = fitter.torque_lead_s();
  model.log_formats = log_formats(project.logs);
  model.tick_s = project.target.tick_s;
  model.seed = project.train.seed;
  model.project = project.file.filename().string();
  model.project_hash = fxdyn::project_hash(project);
  model.logs = data.references;
  model.notes = data.notes;
  add_flexible_joints(model, data.logs, options.flexible);
  return out;
}

}  // namespace fxdyn
