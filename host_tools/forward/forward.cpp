#include "host_tools/forward/forward.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "host_tools/effects/identified_model.hpp"
#include "host_tools/signals/filter.hpp"
#include "host_tools/simulate/closed_loop.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/parallel.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// A parabola has three coefficients.
constexpr Index fewest_given = 3;
constexpr double most_of_one = 2;  // share of its torque that a joint counts with at most

std::size_t effects_of(const IdentifiedModel& model) {
  std::size_t count = 0;
  for (const JointFit& joint : model.joints) count += joint.effects.size();
  return count;
}

void check_length(const Log& raw, Index given) {
  if (given < fewest_given)
    throw InputError(fmt::format("--given {}: at least {} samples say where the motion starts", given, fewest_given));
  if (raw.samples() <= given) {
    throw InputError(
        fmt::format("{}: has {} samples, and the first {} are given (--given): nothing is left to simulate",
                    raw.file.filename().string(), raw.samples(), given));
  }
}

void check_torque(const IdentifiedModel& model, const Log& raw, double stuck_share) {
  for (Index j = 0; j < raw.joints(); ++j) {
    const auto q = raw.q.col(j), tau = raw.tau.col(j);
    const double range = q.maxCoeff() - q.minCoeff();
    for (Index from = 0, to = 0; from < raw.samples(); from = to) {
      for (to = from; to < raw.samples() && tau[to] == tau[from]; ++to) continue;
      const auto stretch = q.segment(from, to - from);
      if (to - from < 2 || !(stretch.maxCoeff() - stretch.minCoeff() > stuck_share * range)) continue;
      throw InputError(
          fmt::format("{}: tau{} ({}) stays at {:.6g} from {:.3f} s to {:.3f} s, in which the joint moves: record the "
                      "torque again, or "
                      "cut that part out",
                      raw.file.filename().string(), j + 1, model.robot.joints[static_cast<std::size_t>(j)].name,
                      tau[from], raw.t[from], raw.t[to - 1]));
    }
  }
}

/// The model of another robot, or another unit: what it leaves of the torque is more than there was, as a mean of the
/// joints' shares. One joint that bears the same weight in both robots says nothing of the others.
void check_robot(const IdentifiedModel& model, const ProcessedLog& log) {
  const MatrixXd measured = log.filter_columns(log.tau);
  const MatrixXd left = measured - log.filter_columns(predict(model, log));
  const Index count = log.last - log.first;
  double share = 0;
  for (Index j = 0; j < measured.cols(); ++j) {
    const double before = measured.col(j).segment(log.first, count).squaredNorm();
    const double after = left.col(j).segment(log.first, count).squaredNorm();
    share += std::min(after / std::max(before, 1e-300), most_of_one) / static_cast<double>(measured.cols());
  }
  if (share < 1) return;
  throw InputError(
      fmt::format("{}: the model explains the torque of no joint, or of too few: is it this robot's, in the "
                  "same units?",
                  log.name));
}

/// Where the simulation starts: at sample given - 1.
struct Start {
  VectorXd q, dq, ddq;
};

Start start_of(const Eigen::Ref<const MatrixXd>& q, double step_s) {
  const Index given = q.rows();
  MatrixXd powers(given, 3);
  for (Index k = 0; k < given; ++k) {
    const double t = static_cast<double>(k - given + 1) * step_s;
    powers.row(k) << 1, t, 0.5 * t * t;
  }
  const MatrixXd fit = powers.householderQr().solve(q);
  return {fit.row(0), fit.row(1), fit.row(2)};
}

ForwardRun attempt(const IdentifiedModel& model, const Log& raw, const ProcessedLog& log, Index given, Loop loop) {
  ForwardRun run;
  try {
    run.q = simulated_positions(model, raw, log, 0, raw.samples(), given, loop);
  } catch (const DataError& error) {  // not every model is a plant, and not every motion ends
    return {{}, {}, error.what()};
  }
  const Index judged = raw.samples() - given;
  run.rmse = (run.q - raw.q).bottomRows(judged).colwise().norm().transpose() / std::sqrt(static_cast<double>(judged));
  return run;
}

}  // namespace

MatrixXd driving_torque(const IdentifiedModel& model, const ProcessedLog& log) {
  MatrixXd torque = log.tau;
  const IdentifiedModel plant = forward_plant(model);
  if (effects_of(plant) != effects_of(model)) torque -= predict(model, log) - predict(plant, log);
  // The torque column shows the torque of the motion torque_lead_s later.
  const double lead = model.filter.torque_lead_s / log.step_s;
  return lead == 0 ? torque : at_other_times(torque, -lead);
}

MatrixXd simulated_positions(const IdentifiedModel& model, const Log& raw, const ProcessedLog& log, Index from,
                             Index to, Index given, Loop loop) {
  const IdentifiedModel plant = with_load_of(log, model);
  const Index start = from + given - 1, count = to - start;
  const MatrixXd torque = driving_torque(model, log);
  ClosedLoopSettings settings;
  settings.age_s = age_of(model, log) + static_cast<double>(start) * log.step_s;
  MatrixXd q = raw.q.middleRows(from, to - from);
  if (loop == Loop::open) {
    const Start known = start_of(q.topRows(given), raw.step_s);
    const OpenLoopStart state{known.q, known.dq, known.ddq};
    q.bottomRows(count - 1) =
        run_open_loop(plant, state, log.step_s, torque.middleRows(start, count), settings.substeps, settings.age_s)
            .bottomRows(count - 1);
  } else {
    const MotionRows motion = log.motion(start, count);
    const Reference reference{log.step_s, motion.q, motion.dq, motion.ddq,
                              log.filter_columns(torque).middleRows(start, count)};
    q.bottomRows(count - 1) = run_closed_loop(plant, reference, settings).q.bottomRows(count - 1);
  }
  return q;
}

Forward simulate_forward(const IdentifiedModel& model, const Log& raw, const ProcessedLog& log, Index given,
                         const ForwardOptions& options) {
  check_length(raw, given);
  check_torque(model, raw, options.stuck_share);
  check_robot(model, log);
  Forward out;
  parallel_for(2, [&](std::size_t i) {
    (i == 0 ? out.open : out.closed) = attempt(model, raw, log, given, i == 0 ? Loop::open : Loop::closed);
  });
  return out;
}

}  // namespace fxdyn
