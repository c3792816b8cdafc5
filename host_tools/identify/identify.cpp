#include "host_tools/identify/identify.hpp"

#include <fmt/format.h>

#include <cmath>
#include <limits>

#include "host_tools/effects/effects.hpp"
#include "host_tools/effects/identified_model.hpp"
#include "host_tools/identify/flexible.hpp"
#include "host_tools/identify/plausible.hpp"
#include "host_tools/regression/essential.hpp"
#include "host_tools/simulate/recordings.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/files.hpp"
#include "host_tools/support/parallel.hpp"

namespace fxdyn {
namespace {

/// An effect must lower the joint's held-out error by this share to be kept.
constexpr double worth_keeping = 0.02;
/// A standard deviation that stands for this share of rated torque is worth a note.
constexpr double worrying_error = 0.1;
/// Of the rows at the drive's limit there is nothing to learn from.
constexpr double most_saturated = 0.5;
/// Of all logs together.
constexpr double most_rows = 60'000;
/// Samples from which on memory counts more than time.
constexpr Eigen::Index long_logs = 1'500'000;

std::vector<double> geometric(double from, double to, int count) {
  std::vector<double> values;
  for (int i = 0; i < count; ++i) values.push_back(from * std::pow(to / from, static_cast<double>(i) / (count - 1)));
  return values;
}

struct Candidate {
  JointFit design;
  Judgement judgement;
};

/// The best of one shape parameter: a geometric grid, then two refinements around its best point.
template <class Set>
Candidate search(const Fitter& fitter, std::size_t joint, const JointFit& start, double from, double to, Set&& set) {
  Candidate best{start, {}};
  double best_value = from;
  const auto attempt = [&](double value) {
    JointFit design = start;
    set(design, value);
    const Judgement judgement = fitter.held_out_with(joint, design, {0.0})[0];
    if (judgement.rmse < best.judgement.rmse) {
      best = {design, judgement};
      best_value = value;
    }
  };
  constexpr int points = 12;
  for (const double value : geometric(from, to, points)) attempt(value);
  double step = std::pow(to / from, 0.5 / (points - 1));
  for (int round = 0; round < 2; ++round, step = std::sqrt(step)) {
    const double centre = best_value;
    attempt(std::max(from, centre / step));
    attempt(std::min(to, centre * step));
  }
  return best;
}

struct Scales {
  double velocity, range;
};

MotionScales motion_scales(const Scales& scales) {
  MotionScales out;
  out.speed = scales.velocity;
  out.range = scales.range;
  return out;
}

/// Of a coupling: the shape parameters after the other joint's index, a width as wide as the joint's sign.
std::vector<std::vector<double>> further_shapes(const EffectInfo& info, double sign_width) {
  std::vector<std::vector<double>> values;
  for (const ParameterInfo& shape : info.shape.subspan(1)) {
    const ValueList listed = shape.values.search == ShapeSearch::list ? shape.values.judged({}) : ValueList{sign_width};
    values.emplace_back(listed.begin(), listed.end());
  }
  return combinations(values);
}

/// The joint's design with the motor that it shares with a neighbour, at the best of neighbours, directions and widths.
Candidate search_coupling(const Fitter& fitter, std::size_t joint, std::string_view effect, const Scales& scales) {
  if (fitter.joints() < 2) throw InputError(fmt::format("effect '{}' needs a second joint", effect));
  const EffectInfo& info = *find_effect(effect);
  const int refined = info.refined_shape();
  const double now = fitter.held_out()[joint].rmse;
  Candidate best{fitter.design(joint), {}};
  for (const std::size_t k : {joint - 1, joint + 1}) {
    if (k >= fitter.joints()) continue;
    for (const std::vector<double>& more : further_shapes(info, fitter.design(joint).sign_width)) {
      JointFit design = fitter.design(joint);
      EffectFit fit;
      fit.effect = effect;
      fit.shape = {static_cast<double>(k + 1)};
      fit.shape.insert(fit.shape.end(), more.begin(), more.end());
      design.effects.push_back(fit);
      const Judgement judgement = fitter.held_out_with(joint, design, {0.0})[0];
      if (judgement.rmse < best.judgement.rmse) best = {design, judgement};
    }
  }
  if (refined < 0 || best.design.effects.empty() || best.design.effects.back().effect != effect) return best;
  // only what comes near being kept is worth a search
  if (best.judgement.rmse > (1 - 0.5 * worth_keeping) * now) return best;
  const auto index = static_cast<std::size_t>(refined);
  const ShapeRange range = info.shape[index].values.fitted(motion_scales(scales));
  Candidate better = search(fitter, joint, best.design, range.from, range.to,
                            [index](JointFit& d, double value) { d.effects.back().shape[index] = value; });
  return better.judgement.rmse < best.judgement.rmse ? better : best;
}

Candidate search_width(const Fitter& fitter, std::size_t joint, const Scales& scales) {
  return search(fitter, joint, fitter.design(joint), 1e-4 * scales.velocity, 0.3 * scales.velocity,
                [](JointFit& design, double value) { design.sign_width = value; });
}

/// The joint's design with the effect added, at its best shape.
Candidate search_effect(const Fitter& fitter, std::size_t joint, std::string_view effect, const Scales& scales) {
  JointFit design = fitter.design(joint);
  const EffectInfo& info = *find_effect(effect);
  if (info.needs_peers) return search_coupling(fitter, joint, effect, scales);
  EffectFit fit;
  fit.effect = effect;
  fit.shape.resize(info.shape.size());
  design.effects.push_back(fit);
  if (info.shape.empty()) return {design, fitter.held_out_with(joint, design, {0.0})[0]};
  // One shape: why_not_identified() lets no other effects through.
  const ShapeRange range = info.shape[0].values.fitted(motion_scales(scales));
  const double to = std::min(info.shape[0].upper, range.to);
  return search(fitter, joint, design, range.from, to,
                [](JointFit& d, double value) { d.effects.back().shape[0] = value; });
}

/// Logarithm of each joint's held-out error.
Eigen::VectorXd logarithms(const std::vector<Judgement>& judgements) {
  Eigen::VectorXd out(static_cast<Eigen::Index>(judgements.size()));
  for (std::size_t j = 0; j < judgements.size(); ++j)
    out[static_cast<Eigen::Index>(j)] = std::log(std::max(judgements[j].rmse, 1e-300));
  return out;
}

/// How far the torque column is ahead of the motion, one number for all joints: a grid within a fifth of a period of
/// the torque cut-off on either side, at most 10 ms, then parabolas through the best three, by the mean logarithm of
/// the held-out error. Hysteresis and other missing physics look like a lag too, but like another one on every joint,
/// so a lead is kept only where, against none, the mean falls by the share that an effect has to bring, the best point
/// is not at the end of the grid, and at least four joints in five gain that much and would choose nearly the same lead
/// (within a fifth) for themselves. One number for all joints does not overfit, so blocks of one log ask for no more.
void find_torque_lead(Fitter& fitter, double cutoff_hz) {
  constexpr int half = 6;
  const std::vector<Eigen::MatrixXd> torque = fitter.filtered_torque();
  const auto judge = [&](double lead) {
    fitter.set_torque_lead(lead, torque);
    return logarithms(fitter.held_out());
  };
  const Eigen::VectorXd none = judge(0);
  const double grid = std::min(0.2 / cutoff_hz, 0.010) / half;
  Eigen::VectorXd best = none, own = none, own_lead = Eigen::VectorXd::Zero(none.size());
  double best_lead = 0;
  const auto attempt = [&](double lead) {
    const Eigen::VectorXd value = judge(lead);
    for (Eigen::Index j = 0; j < value.size(); ++j) {
      if (value[j] >= own[j]) continue;
      own[j] = value[j];
      own_lead[j] = lead;
    }
    if (value.mean() < best.mean()) {
      best = value;
      best_lead = lead;
    }
    return value.mean();
  };
  for (int k = -half; k <= half; ++k) {
    if (k != 0) attempt(k * grid);
  }
  const bool at_end = std::fabs(best_lead) > (half - 0.5) * grid;
  double step = grid;
  for (int round = 0; round < 4 && !at_end; ++round, step /= 3) {
    const double centre = best_lead, middle = best.mean();
    const double below = attempt(centre - step), above = attempt(centre + step), bend = below - 2 * middle + above;
    if (bend > 0) attempt(centre + std::clamp(0.5 * (below - above) / bend, -1.0, 1.0) * step);
  }
  const double worth = -std::log(1 - worth_keeping);
  Eigen::Index agree = 0;
  for (Eigen::Index j = 0; j < none.size(); ++j)
    agree += none[j] - best[j] > worth && std::fabs(own_lead[j] - best_lead) < 0.2 * std::fabs(best_lead) + 0.1 * grid;
  const bool keep = !at_end && (none - best).mean() > worth && 5 * agree >= 4 * none.size();
  fitter.set_torque_lead(keep ? best_lead : 0, torque);
}

}  // namespace

GateData read_gate_data(const Project& project, const std::filesystem::path& directory) {
  if (!project.has_role(Role::train)) {
    throw InputError(project.file.string() + ": no log to learn from; add a [[log]] with role = \"train\"");
  }
  std::vector<Log> logs;
  for (const Role role : {Role::train, Role::validate}) {
    for (Log& log : read_logs(project, role, directory)) logs.push_back(std::move(log));
  }
  GateData data;
  data.filter = choose_filter(logs, project.signals);
  const auto n = static_cast<Eigen::Index>(project.robot.size());
  data.largest_torque = data.dq = data.ddq = Eigen::VectorXd::Zero(n);
  data.q_lower = Eigen::VectorXd::Constant(n, 1e300);
  data.q_upper = -data.q_lower;
  if (project.limits.position.empty() || project.limits.velocity.empty() || project.limits.acceleration.empty()) {
    data.notes.push_back(
        "limits not in the project: 1.2 times the largest in the logs (URDF limits where they are within a factor of "
        "ten)");
  }
  if (logs.size() == 1) {
    data.notes.push_back(
        "one trajectory fits and judges: five blocks of it are judged by fits of the others, and they resemble each "
        "other, "
        "so that errors come out too small and effects that do not carry over can stay; record another trajectory with "
        "role "
        "= \"validate\"");
  }
  if (project.rated_torque.empty())
    data.notes.push_back("robot.rated_torque not in the project: the largest measured torque stands for it");
  ProcessSettings settings;
  settings.torque_limits = project.limits.torque;
  // Enough rows for any fit of a few hundred unknowns; a long log is decimated more.
  // At one interval for all logs, so that their noise is alike from row to row.
  double seconds = 0;
  for (const Log& log : logs) seconds += log.step_s * static_cast<double>(log.samples());
  settings.shortest_interval_s = seconds / most_rows;
  Eigen::Index samples = 0;
  for (const Log& log : logs) samples += log.samples();
  most_threads = samples > long_logs ? 1 : threads_allowed();
  for (Log& log : logs) {
    if (log.resampled) {
      data.notes.push_back(
          fmt::format("{}: irregular time stamps, resampled to {:.6g} s", log.file.filename().string(), log.step_s));
    }
    check_torque(log, project.robot);
    data.references.push_back(
        {log.file.filename().string(), to_string(log.role), hash_of_file(log.file), log.from_s, log.to_s});
    data.logs.push_back(process(std::move(log), data.filter, settings));
    const ProcessedLog& processed = data.logs.back();
    for (Eigen::Index j = 0; j < n; ++j) {
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
                        processed.name, j + 1, project.robot.joints[static_cast<std::size_t>(j)].name, saturated));
      }
    }
  }
  return data;
}

void check_torque(const Log& log, const Robot& robot) {
  constexpr double parked = 1e-3;  // rad or m; a brake may hold the joint, its drive off
  for (Eigen::Index j = 0; j < log.tau.cols(); ++j) {
    if (log.tau.col(j).maxCoeff() > log.tau.col(j).minCoeff()) continue;
    if (log.q.col(j).maxCoeff() - log.q.col(j).minCoeff() < parked) continue;
    throw DataError(fmt::format("{}: torque of joint {} ({}) never changes: check the column and its gain",
                                log.file.string(), j + 1, robot.joints[static_cast<std::size_t>(j)].name));
  }
}

std::vector<JointFit> initial_joints(const Project& project, const GateData& data) {
  constexpr double margin = 1.2;
  std::vector<JointFit> joints(project.robot.size());
  const LimitSettings& given = project.limits;
  for (std::size_t j = 0; j < joints.size(); ++j) {
    const auto k = static_cast<Eigen::Index>(j);
    JointFit& joint = joints[j];
    const std::optional<Limits>& urdf = project.robot.joints[j].limits;
    // A URDF's placeholder limits (1e6 N) would cost resolution for ranges that never occur.
    const auto choose = [&](const std::vector<double>& set, double from_urdf, double measured) {
      if (!set.empty()) return set[j];
      return urdf && from_urdf > 0 && from_urdf <= 10 * measured ? std::max(from_urdf, measured) : margin * measured;
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
      if (urdf && urdf->upper > urdf->lower && urdf->upper - urdf->lower <= 20 * half) {
        joint.q_lower = std::min(urdf->lower, data.q_lower[k]);
        joint.q_upper = std::max(urdf->upper, data.q_upper[k]);
      }
    }
    joint.sign_width = std::max(0.01 * data.dq[k], 1e-6);  // of a joint at rest
  }
  return joints;
}

void weigh(Fitter& fitter, const IdentifySettings& settings) {
  if (settings.method == "ls") return;
  if (settings.method == "irls") {
    fitter.reweight_rows();
  } else {
    fitter.reweight();
  }
  if (settings.method == "rls" && settings.forgetting < 1) fitter.forget(settings.forgetting);
}

std::unique_ptr<Fitter> identify(const Project& project, GateData& data, Progress& progress) {
  const std::vector<std::string> nominal = project.identify.effects.value_or(nominal_effects());
  const std::vector<std::string_view> optional =
      project.identify.effects ? std::vector<std::string_view>{} : identified_effects();

  for (const std::string& effect : nominal) {
    if (const std::string reason = why_not_identified(*find_effect(effect)); !reason.empty())
      throw InputError(fmt::format("{}: identify.effects: {}", project.file.string(), reason));
  }

  const std::size_t n = project.robot.size();
  const DhChain chain = to_dh(project.robot);
  const BaseSet base = find_base(chain);
  std::vector<JointFit> design = initial_joints(project, data);
  std::vector<Scales> scales;
  for (std::size_t j = 0; j < n; ++j) {
    const auto k = static_cast<Eigen::Index>(j);
    scales.push_back({data.dq[k], data.q_upper[k] - data.q_lower[k]});
    if (data.logs.front().is_left_out(k)) continue;
    for (const std::string& effect : nominal) {
      if (in_base(effect) && rotor_inertia_is_absorbed(chain, base, k)) continue;
      if (find_effect(effect)->shape.empty()) {
        EffectFit fit;
        fit.effect = effect;
        design[j].effects.push_back(fit);
      }
    }
  }
  progress.stage("building the regressor", 1);
  auto fitter = std::make_unique<Fitter>(project.robot, data.logs, design);
  const std::vector<Eigen::Index> saturated = fitter->saturated_rows();
  for (std::size_t j = 0; j < n; ++j) {
    const double share = static_cast<double>(saturated[j]) / static_cast<double>(fitter->rows());
    if (share < most_saturated || data.logs.front().is_left_out(static_cast<Eigen::Index>(j))) continue;
    throw DataError(fmt::format(
        "torque of joint {} ({}) is at its limit for {:.0f} % of the logs: record with less load or speed, or "
        "check torque_gain",
        j + 1, project.robot.joints[j].name, 100 * share));
  }
  for (const Suspicion& suspicion : check_plausible(project.robot, data.logs, design)) {
    if (suspicion.severity == Severity::error) throw DataError(suspicion.text);
    data.notes.push_back(suspicion.text);
  }
  const auto dependent = fitter->dependent_effects();
  for (auto d = dependent.rbegin(); d != dependent.rend(); ++d) {
    JointFit joint = fitter->design(d->joint);
    data.notes.push_back(
        fmt::format("{}: {} left out, these logs can't tell it from the base parameters and the other effects",
                    project.robot.joints[d->joint].name, joint.effects[d->effect].effect));
    joint.effects.erase(joint.effects.begin() + static_cast<std::ptrdiff_t>(d->effect));
    fitter->set_design(d->joint, joint);
  }
  const bool weighted = project.identify.method != "ls";
  if (weighted) fitter->reweight();

  // All joints at once from the same state, then accepted together: the outcome does not depend on the thread count.
  const auto improve = [&](const std::string& stage, bool always, auto&& propose) {
    progress.stage(stage, n);
    const std::vector<Judgement> before = fitter->held_out();
    std::vector<Candidate> best(n);
    const auto left_out = [&](std::size_t j) { return data.logs.front().is_left_out(static_cast<Eigen::Index>(j)); };
    parallel_for(n, [&](std::size_t j) {
      if (!left_out(j)) best[j] = propose(j);
      progress.step();
    });
    for (std::size_t j = 0; j < n; ++j) {
      if (left_out(j)) continue;
      if (always || best[j].judgement.beats(before[j], worth_keeping)) fitter->set_design(j, best[j].design);
    }
    if (weighted) fitter->reweight();
  };
  improve("width of the Coulomb sign", true, [&](std::size_t j) { return search_width(*fitter, j, scales[j]); });
  // A width that is off by the grid's step looks like another effect.
  fitter->polish();
  if (weighted) fitter->reweight();
  for (const std::string& effect : nominal) {
    if (find_effect(effect)->shape.empty()) continue;
    improve("shape of " + effect, true, [&](std::size_t j) { return search_effect(*fitter, j, effect, scales[j]); });
  }
  // A torque that is not aligned hides effects, and missing effects look like one that is not: effects first, then
  // again where that changed something.
  const auto align = [&] {
    if (project.signals.torque_lead_s) return;
    progress.stage("is the torque ahead of the motion?", 1);
    find_torque_lead(*fitter, data.filter.torque_cutoff_hz);
    if (weighted) fitter->reweight();
    progress.step();
  };
  const auto applies = [&](std::string_view effect) { return n > 1 || !find_effect(effect)->needs_peers; };
  const auto effects = [&] {
    std::size_t count = 0;
    for (std::size_t j = 0; j < n; ++j) count += fitter->design(j).effects.size();
    return count;
  };
  for (int round = 0; round < 2; ++round) {
    const std::size_t before = effects();
    for (const std::string_view effect : optional) {
      if (!applies(effect)) continue;
      improve("is there " + std::string(effect) + "?", false, [&](std::size_t j) {
        return fitter->design(j).find(effect) != nullptr ? Candidate{fitter->design(j), {}}
                                                         : search_effect(*fitter, j, effect, scales[j]);
      });
    }
    fitter->polish();
    if (weighted) fitter->reweight();
    const bool was_aligned = fitter->torque_lead_s() != 0;
    align();
    if (effects() == before && was_aligned == (fitter->torque_lead_s() != 0)) break;
  }
  progress.stage("widths and distances", 1);
  fitter->polish();
  weigh(*fitter, project.identify);
  progress.step();
  progress.done();
  for (std::size_t j = 0; j < n; ++j) {
    std::string found;
    for (const std::string_view effect : optional) {
      if (fitter->design(j).find(effect) != nullptr) found += (found.empty() ? "" : ", ") + std::string(effect);
    }
    if (!found.empty())
      data.notes.push_back(fmt::format("joint {} ({}): found {}", j + 1, project.robot.joints[j].name, found));
  }
  if (fitter->torque_lead_s() != 0) {
    data.notes.push_back(fmt::format(
        "the torque column is {:.2f} ms {} the motion: taken into account ([signals] torque_lead_s overrides)",
        1e3 * std::fabs(fitter->torque_lead_s()), fitter->torque_lead_s() > 0 ? "ahead of" : "behind"));
  }
  return fitter;
}

std::string project_hash(const Project& project) { return hash_of(read_file(project.file) + read_file(project.urdf)); }

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

}  // namespace

Estimate finish_model(const Fitter& fitter, const Project& project, const GateData& data) {
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
  out.weak = weak_in_logs(fitter, solution, worrying_error);
  std::string untold;
  Eigen::Index to_move = 0;
  for (const WeakParameter& one : out.weak) {
    // With a joint at rest the bodies on either side of it can't be told apart; that is asked for.
    if (one.identifiable || !data.logs.front().left_out.empty()) continue;
    untold += (untold.empty() ? "" : ", ") + one.name;
    to_move = one.joint;
  }
  if (!untold.empty()) {
    throw DataError(fmt::format("the train logs can't tell {}: record a log in which joint {} ({}) moves more", untold,
                                to_move + 1, project.robot.joints[static_cast<std::size_t>(to_move)].name));
  }
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
  // "": what a log that the project does not name is read with, if its own logs agree.
  bool agree = true;
  for (const LogEntry& entry : project.logs) {
    const LogFormat& first = project.logs.front().format;
    agree = agree && entry.format.columns == first.columns && entry.format.torque_gain == first.torque_gain;
    model.log_formats[entry.scenario ? entry.scenario_log + ".csv" : entry.file.filename().string()] = entry.format;
  }
  if (agree) model.log_formats = {{"", project.logs.front().format}};
  model.tick_s = project.target.tick_s;
  model.seed = project.train.seed;
  model.project = project.file.filename().string();
  model.project_hash = fxdyn::project_hash(project);
  model.logs = data.references;
  model.notes = data.notes;
  // on the logs that fit
  std::vector<ProcessedLog> train;
  for (const ProcessedLog& log : data.logs) {
    if (log.role == Role::train && log.qlink.size() > 0) train.push_back(log);
  }
  for (const FlexibleJoint& joint : identify_flexible({model, train})) {
    model.joints[joint.joint].flexible = joint;
    const Joint& place = project.robot.joints[joint.joint];
    model.notes.push_back(joint.found ? fmt::format("joint {} ({}): stiffness {:.4g} +- {:.2g} {}/{}", joint.joint + 1,
                                                    place.name, joint.stiffness, joint.stiffness_std,
                                                    place.torque_unit(), place.position_unit())
                                      : fmt::format("joint {} ({}): {}", joint.joint + 1, place.name, joint.note));
    if (joint.found) model.joints[joint.joint].effects.push_back(elasticity_effect(joint));
  }
  return out;
}

}  // namespace fxdyn
