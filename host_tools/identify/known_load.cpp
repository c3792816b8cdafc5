#include "host_tools/identify/known_load.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "host_tools/effects/effect_roles.hpp"
#include "host_tools/effects/model_parts.hpp"
#include "host_tools/identify/payload.hpp"
#include "host_tools/regression/fit_data.hpp"
#include "host_tools/regression/sandwich.hpp"
#include "host_tools/signals/filter.hpp"
#include "host_tools/support/error.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Of a link's ten parameters, the last ones.
constexpr Index second_moments = 6;

/// What the torque columns show of a log, at the times of its motion, samples x joints [unit of the columns].
struct Measured {
  MatrixXd missing;  ///< what the model does not explain, filtered
  MatrixXd carried;  ///< without the model's friction
};

Measured measured(const IdentifiedModel& model, const ProcessedLog& log) {
  Measured out;
  out.missing =
      at_other_times(log.filter_columns(log.tau - predict(model, log)), -filter_of(model).torque_lead_s / log.step_s);
  out.carried = structural_torque(model, {log})[0] + out.missing;
  return out;
}

/// Names of the nominal friction; the first and the last change with a load.
std::vector<std::string_view> always() {
  return {dry_friction_effect().name, viscous_friction_effect().name, friction_of_load_effect().name,
          constant_effect().name};
}
constexpr Index dry = 0, offset = 3, changing = 2;

/// Linear columns of always() and of the joint's own effects, rows x columns.
MatrixXd friction_columns(const JointFit& joint, const ProcessedLog& log, Index j, const VectorXd& carried) {
  const MotionRows motion = log.joint_motion(j);
  const JointSeries series{motion.q, motion.dq, motion.ddq, carried, log.step_s};
  MatrixXd out(log.rows(), 0);
  const auto add = [&](std::string_view name, std::span<const double> shape) {
    const MatrixXd rows = log.decimate(log.filter_columns(effect_columns(name, shape, joint.sign_width, series)));
    out.conservativeResize(Eigen::NoChange, out.cols() + rows.cols());
    out.rightCols(rows.cols()) = rows;
  };
  const std::vector<std::string_view> names = always();
  for (const std::string_view name : names) add(name, {});
  for (const EffectFit& fit : joint.effects) {
    const EffectInfo& info = *find_effect(fit.effect);
    const bool own = info.acts_on == ActsOn::torque && !info.needs_total && !info.needs_peers;
    if (own && std::find(names.begin(), names.end(), info.name) == names.end()) add(fit.effect, fit.shape);
  }
  return out;
}

/// One joint's rows, those of the log without load first.
struct JointRows {
  VectorXd missing;
  VectorXd load;    ///< torque of the known load [N*m | N]
  MatrixXd others;  ///< columns of length one
  Index unloaded = 0;
};

/// In rows.
struct Repeated {
  double later = 0;   ///< the motion begins later in the log with load
  double period = 0;  ///< of a motion that comes back within the log; 0: it does not
};

JointRows rows_of(const IdentifiedModel& model, const FitData& data, const std::vector<Measured>& measured, Index j) {
  const auto at = static_cast<std::size_t>(j);
  const std::vector<ProcessedLog>& logs = *data.logs;
  const MatrixXd& base = data.base_rows[at];
  const MatrixXd without = friction_columns(joints_of(model)[at], logs[0], j, measured[0].carried.col(j)),
                 with = friction_columns(joints_of(model)[at], logs[1], j, measured[1].carried.col(j));
  const Index own = without.cols(), loaded = with.rows();
  JointRows out{VectorXd(base.rows()), data.load_rows[at], {}, without.rows()};
  out.missing << logs[0].decimate(measured[0].missing.col(j)), logs[1].decimate(measured[1].missing.col(j));
  out.others.setZero(base.rows(), base.cols() + own + second_moments + changing);
  out.others.leftCols(base.cols()) = base;
  out.others.middleCols(base.cols(), own) << without, with;
  auto changes = out.others.bottomRightCorner(loaded, second_moments + changing);
  // The last link's; which frame they are of makes no difference.
  changes.leftCols(second_moments) =
      base.bottomRows(loaded) * data.base.grouping.bottomRightCorner(base.cols(), second_moments);
  changes.rightCols(changing) << with.col(dry), with.col(offset);
  const VectorXd& usable = data.usable[at];
  out.missing.array() *= usable.array();
  out.load.array() *= usable.array();
  out.others.array().colwise() *= usable.array();
  for (Index c = 0; c < out.others.cols(); ++c) out.others.col(c).stableNormalize();
  return out;
}

/// Of the sum of what the rows contribute, those of both logs and of all repetitions at the same place of the motion
/// taken together: what comes back with it is one error, not many.
double variance_of_sum(const VectorXd& products, Index unloaded, const Repeated& repeated, double faded) {
  const Index loaded = products.size() - unloaded;
  const double first = std::max(0.0, -repeated.later),
               all = static_cast<double>(std::max(unloaded, loaded)) + std::fabs(repeated.later);
  const double period = repeated.period > 0 ? repeated.period : all + 1;
  VectorXd sum = VectorXd::Zero(static_cast<Index>(std::ceil(std::min(period, all + 1))));
  for (Index k = 0; k < products.size(); ++k) {
    const double place =
        k < unloaded ? static_cast<double>(k) + first + repeated.later : static_cast<double>(k - unloaded) + first;
    sum[static_cast<Index>(std::fmod(place, period))] += products[k];
  }
  const VectorXd gamma = autocovariance(sum, faded);
  return static_cast<double>(sum.size()) * (2 * gamma.sum() - gamma[0]);
}

JointGain gain_of(const JointRows& rows, const Repeated& repeated, const LoadOptions& options) {
  JointGain out;
  const auto all = static_cast<double>(rows.missing.size());
  out.load_rms = rows.load.norm() / std::sqrt(all - static_cast<double>(rows.unloaded));
  if (!(rows.load.norm() > options.no_column * rows.missing.norm())) return out;
  Eigen::ColPivHouseholderQR<MatrixXd> others(rows.others.rows(), rows.others.cols());
  others.setThreshold(options.no_column);
  others.compute(rows.others);
  const auto left = [&](const VectorXd& column) { return VectorXd(column - rows.others * others.solve(column)); };
  const VectorXd load = left(rows.load), missing = left(rows.missing);
  const double square = load.squaredNorm();
  if (square < options.least_share_left * rows.load.squaredNorm()) return out;
  const double inverse = load.dot(missing) / square;
  const VectorXd residual = missing - inverse * load, gamma = autocovariance(residual, options.faded);
  // A small sample hides what the columns took from the residual.
  const double independent = all / std::max(1.0, 2 * gamma.sum() / gamma[0] - 1),
               spare = independent - static_cast<double>(others.rank()) - 1;
  if (!(spare > 1) || inverse == 0) return out;
  const double variance =
      variance_of_sum(load.cwiseProduct(residual), rows.unloaded, repeated, options.faded) * independent / spare;
  const double std = std::sqrt(std::max(0.0, variance)) / square;
  out.factor = 1 / inverse;
  out.std = std / (inverse * inverse);
  out.felt = std < options.largest_gain_deviation * std::fabs(inverse);
  return out;
}

/// Joints that stand still in either log: friction may carry the load there.
std::vector<bool> at_rest(const std::vector<ProcessedLog>& logs) {
  std::vector<bool> out(static_cast<std::size_t>(logs.front().q.cols()), false);
  for (const ProcessedLog& log : logs) {
    const std::vector<bool> moves = moving_joints({log});
    for (std::size_t j = 0; j < out.size(); ++j) out[j] = out[j] || !moves[j];
  }
  return out;
}

/// Filtered velocities, as shares of each joint's RMS: rows x joints that move.
MatrixXd velocities(const ProcessedLog& log, const std::vector<bool>& rest) {
  MatrixXd out(log.rows(), 0);
  for (std::size_t j = 0; j < rest.size(); ++j) {
    if (rest[j]) continue;
    out.conservativeResize(Eigen::NoChange, out.cols() + 1);
    out.rightCols(1) = log.decimate(log.filter_columns(log.joint_velocity(static_cast<Index>(j))));
    out.rightCols(1) /= std::max(out.rightCols(1).norm() / std::sqrt(static_cast<double>(out.rows())), 1e-300);
  }
  return out;
}

/// Rows that a comparison takes, so that many lags can be tried.
constexpr Index rows_enough = 4000;
/// Mean square difference of velocities that are shares of their RMS; two that have nothing in common have 2.
constexpr double unlike = 1;

/// Mean square difference of motions, b's rows being `later` ones.
double difference(const MatrixXd& a, const MatrixXd& b, Index later) {
  const Index from_a = std::max<Index>(0, -later), from_b = std::max<Index>(0, later),
              count = std::min(a.rows() - from_a, b.rows() - from_b), stride = 1 + count / rows_enough;
  double sum = 0;
  Index rows = 0;
  for (Index k = 0; k < count; k += stride, ++rows) sum += (a.row(from_a + k) - b.row(from_b + k)).squaredNorm();
  return sum / static_cast<double>(rows * a.cols());
}

/// After how many rows the motion comes back first; 0: it does not.
double period_of(const MatrixXd& velocity, double same) {
  bool away = false;
  Index best = 0;
  double least = same;
  for (Index lag = 1; lag <= velocity.rows() / 2; ++lag) {
    const double square = difference(velocity, velocity, lag);
    away = away || square > unlike;
    if (!away) continue;
    if (square < least) {
      least = square;
      best = lag;
    } else if (best > 0 && square > same) {
      break;
    }
  }
  return static_cast<double>(best);
}

/// @throws DataError: the logs have different motions; InputError: they are sampled differently
Repeated repeated_motion(const std::vector<ProcessedLog>& logs, const std::vector<bool>& rest,
                         const LoadOptions& options) {
  const auto spacing = [](const ProcessedLog& log) { return log.step_s * static_cast<double>(log.decimation); };
  const double row_s = spacing(logs[0]);
  if (std::fabs(spacing(logs[1]) - row_s) > options.same_rate * row_s) {
    throw InputError(fmt::format("{} is sampled every {:.3g} ms, {} every {:.3g} ms: record both alike", logs[0].name,
                                 1e3 * logs[0].step_s, logs[1].name, 1e3 * logs[1].step_s));
  }
  const MatrixXd a = velocities(logs[0], rest), b = velocities(logs[1], rest);
  if (a.cols() == 0) return {};
  const Index shorter = std::min(a.rows(), b.rows()),
              most = std::min(shorter / 2, static_cast<Index>(options.longest_delay_s / row_s));
  Index best = 0;
  double least = difference(a, b, 0);
  for (Index later = -most; later <= most; ++later) {
    const double square = difference(a, b, later);
    if (square >= least) continue;
    least = square;
    best = later;
  }
  if (std::sqrt(least) > options.other_motion) {
    throw DataError(
        fmt::format("{} is another motion than {} (velocities differ by {:.0f} %): record the same motion "
                    "with and without the load, or friction is taken for the load",
                    logs[1].name, logs[0].name, 100 * std::sqrt(least)));
  }
  return {static_cast<double>(best), period_of(a, options.other_motion * options.other_motion)};
}

/// @throws DataError: no joint felt it
void check_felt(const std::vector<JointGain>& gains, const Robot& robot, const Load& load, const ProcessedLog& log,
                const LoadOptions& options) {
  if (std::any_of(gains.begin(), gains.end(), [](const JointGain& gain) { return gain.felt; })) return;
  std::string best = "its torque shows in none of them";
  double smallest = 0;
  for (std::size_t j = 0; j < gains.size(); ++j) {
    const double relative = gains[j].std / std::fabs(gains[j].factor);
    if (!(relative > 0) || (smallest > 0 && relative >= smallest)) continue;
    smallest = relative;
    best = fmt::format("joint {} ({}) feels it most, its gain would be known to {:.2g} % and not to {:.2g} %", j + 1,
                       robot.joints[j].name, 100 * relative, 100 * options.largest_gain_deviation);
  }
  throw DataError(
      fmt::format("{}: no joint feels a load of {:g} kg: {}; take a heavier one, farther from the last axes, or record "
                  "both logs longer, with the same motion",
                  log.name, load.mass, best));
}

}  // namespace

std::vector<JointGain> identify_gains(const IdentifiedModel& model, const Load& load, const ProcessedLog& unloaded,
                                      const ProcessedLog& loaded, const LoadOptions& options) {
  if (!(load.mass > 0))
    throw InputError(fmt::format("a known load of {:g} kg says nothing: its mass is above 0", load.mass));
  check_weighable(model, unloaded);
  check_weighable(model, loaded);
  std::vector<ProcessedLog> logs{unloaded, loaded};
  for (ProcessedLog& log : logs) {
    log.role = Role::train;
    log.load.reset();
  }
  const std::vector<bool> rest = at_rest(logs);
  const Repeated repeated = repeated_motion(logs, rest, options);
  const std::vector<Measured> torque{measured(model, logs[0]), measured(model, logs[1])};
  for (ProcessedLog& log : logs) log.left_out = rest;
  logs[1].load = load;
  const FitData data = make_fit_data(robot_of(model), logs, 0);
  std::vector<JointGain> out;
  for (std::size_t j = 0; j < robot_of(model).size(); ++j) {
    if (rest[j]) {
      out.emplace_back();
      continue;
    }
    out.push_back(gain_of(rows_of(model, data, torque, static_cast<Index>(j)), repeated, options));
  }
  check_felt(out, robot_of(model), load, loaded, options);
  return out;
}

}  // namespace fxdyn
