#include "host_tools/diagnose/sessions.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <utility>

#include "host_tools/diagnose/models.hpp"
#include "host_tools/diagnose/thinning.hpp"
#include "host_tools/diagnose/windows.hpp"
#include "host_tools/effects/effects.hpp"
#include "host_tools/effects/model_parts.hpp"
#include "host_tools/regression/encoder_noise.hpp"
#include "host_tools/regression/row_ranges.hpp"
#include "host_tools/signals/filter.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/random.hpp"

namespace fxdyn::diagnosis {
namespace {

using Eigen::ArrayXd;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Another cut-off for the positions of a log.
struct Smoothing {
  double cutoff_hz = 0;
  FilterFit lost;  ///< with the cut-offs between which it takes motion away
};

/// Positions without what is faster than the motion by far: noise in regressors is taken for structure, and what a
/// coarse encoder makes of the acceleration may be more than the torque's own noise.
std::optional<Smoothing> plan_smoothing(SessionLog& entry, bool measured_velocity, const SessionOptions& options) {
  ProcessedLog& log = entry.log;
  entry.bending_hz = bending_hz(log);
  double& cutoff = log.filter.position_cutoff_hz;
  const double wanted = std::max(options.position_band * log.filter.excited_hz, options.lowest_position_hz);
  if (measured_velocity || wanted >= std::min(cutoff, 0.4 / log.step_s)) return {};
  const auto edge = whole_up(options.edge_periods / (wanted * log.step_s));
  const Index first = std::max(log.first, edge), last = std::min(log.last, log.samples() - edge);
  if (last - first < (log.last - log.first) / 2) return {};
  Smoothing out{wanted, log.filter};  // up to the filter of before
  out.lost.crossing_hz = std::min(out.lost.crossing_hz, cutoff);
  out.lost.position_cutoff_hz = cutoff = wanted;
  log.first = first;
  log.last = last;
  return out;
}

/// @param log of that joint alone
void smooth(ProcessedLog& log, Index joint, const Smoothing& by) {
  const MatrixXd before = std::exchange(log.q, ZeroPhaseFilter(by.cutoff_hz, log.step_s).apply(log.q));
  log.lose(0, 1, lost_velocity(before.col(0), log.q.col(0), by.lost, static_cast<std::size_t>(joint), log.step_s));
}

/// How many of its samples go into one.
Index thinning(const ProcessedLog& log, const SessionOptions& options) {
  const double needed = std::max({options.thinned_hz, options.torque_samples * log.filter.torque_cutoff_hz,
                                  options.position_samples * log.filter.position_cutoff_hz});
  return std::max<Index>(1, static_cast<Index>(1 / (log.step_s * needed) + 1e-9));
}

/// Rows of all logs at one interval, as near as their samples allow: the noise's colour is learned from some and
/// applied to others. It is a multiple of the slowest log's, and no shorter than an eighth of what a log asks for.
void keep_alike_rows(std::vector<SessionLog>& logs, const SessionOptions& options) {
  double slowest_s = 0, cutoff = 0, asked_s = 0;
  for (const SessionLog& entry : logs) {
    slowest_s = std::max(slowest_s, entry.log.step_s);
    cutoff = std::max(cutoff, entry.log.filter.torque_cutoff_hz);
    const Index eighth = entry.log.decimation / 8;
    asked_s = std::max(asked_s, entry.log.step_s * static_cast<double>(eighth));
  }
  const Index of_band = whole(1 / (slowest_s * options.rows_per_period * cutoff));
  const Index samples = std::max({Index{1}, of_band, whole_up(asked_s / slowest_s)});
  const double interval_s = static_cast<double>(samples) * slowest_s;
  for (SessionLog& entry : logs) entry.log.decimation = std::max<Index>(1, std::lround(interval_s / entry.log.step_s));
}

constexpr std::array columns_of_log{&ProcessedLog::q,   &ProcessedLog::measured_dq,   &ProcessedLog::measured_ddq,
                                    &ProcessedLog::tau, &ProcessedLog::lost_velocity, &ProcessedLog::qlink};

/// All that is no column, but the time; as many samples.
ProcessedLog without_columns(const ProcessedLog& log) {
  ProcessedLog out = part_of(log, 0, 1, log.first, log.last);
  for (const auto columns : columns_of_log) (out.*columns).resize(0, 0);
  out.q.resize(log.samples(), 0);
  out.t = log.t;
  out.from_s = log.from_s;
  out.to_s = log.to_s;
  out.saturated = log.saturated;
  return out;
}

/// A log on its way into a session. Long ones fill the memory: what becomes of one is settled before its columns are
/// touched, and those are taken joint by joint.
class Recording {
 public:
  Recording(const ProcessedLog& log, bool healthy, double start, const SessionOptions& options)
      : frame{without_columns(log), healthy, healthy || log.role == Role::train, std::max(0.0, log.t[0] - start)},
        recorded_(log) {
    double& cutoff = frame.log.filter.torque_cutoff_hz;
    cutoff = std::min({cutoff, options.highest_cutoff_hz, frame.log.filter.position_cutoff_hz});
    smoothing_ = plan_smoothing(frame, log.measured_dq.size() > 0, options);
    every_ = thinning(frame.log, options);
    frame.log = thinned(std::move(frame.log), every_);
  }

  /// The columns of one joint, smooth and thinned.
  ProcessedLog of_joint(Index joint) const {
    ProcessedLog out;
    out.step_s = recorded_.step_s;
    for (const auto columns : columns_of_log) {
      if (columns != &ProcessedLog::tau && (recorded_.*columns).size() > 0)
        out.*columns = (recorded_.*columns).col(joint);
    }
    if (smoothing_) smooth(out, joint, *smoothing_);
    if (recorded_.tau.size() > 0) out.tau = recorded_.tau.col(joint);  // beside what smooths, it is one more
    return thinned(std::move(out), every_);
  }

  SessionLog frame;  ///< without columns

 private:
  const ProcessedLog& recorded_;
  std::optional<Smoothing> smoothing_;
  Index every_ = 1;
};

/// The windows of all recordings with their columns; how far these move, and the recordings.
struct Filled {
  std::vector<SessionLog> logs;
  Ranges of_windows, of_whole;
};

Filled fill(const std::vector<Recording>& recordings, const std::vector<std::vector<Window>>& windows, Index joints) {
  Filled out{{}, Ranges(joints), Ranges(joints)};
  for (std::size_t r = 0; r < recordings.size(); ++r) {
    std::vector<SessionLog> parts = in_windows(recordings[r].frame, windows[r]);
    for (Index j = 0; j < joints; ++j) {
      const ProcessedLog joint = recordings[r].of_joint(j);
      out.of_whole.add(recordings[r].frame, j, joint.q.col(0));
      for (std::size_t w = 0; w < parts.size(); ++w) {
        const auto [from, to, first, last] = windows[r][w];
        for (const auto columns : columns_of_log) {
          if ((joint.*columns).size() == 0) continue;
          MatrixXd& of_part = parts[w].log.*columns;
          if (of_part.size() == 0) of_part.setZero(to - from, joints);
          of_part.col(j) = (joint.*columns).col(0).segment(from, to - from);
        }
        out.of_windows.add(parts[w], j, parts[w].log.q.col(j));
      }
    }
    std::move(parts.begin(), parts.end(), std::back_inserter(out.logs));
  }
  return out;
}

bool any(const std::vector<bool>& joints) { return std::find(joints.begin(), joints.end(), true) != joints.end(); }

}  // namespace

std::vector<SessionLog> sessions(const std::vector<ProcessedLog>& now, const std::vector<ProcessedLog>& before,
                                 std::optional<Session>& session, const SessionOptions& options) {
  std::vector<std::array<double, 2>> windows;
  windows.reserve(now.size());
  for (const ProcessedLog& log : now) windows.push_back({log.t[0], log.t[log.t.size() - 1]});
  std::sort(windows.begin(), windows.end());
  bool one = true;
  for (std::size_t i = 1; i < windows.size(); ++i) {
    const double pause = windows[i][0] - windows[i - 1][1];
    one &= pause > -1e-9 && pause < options.longest_pause_s;
  }
  if (one) session = {windows.front()[0], windows.back()[1]};
  std::vector<Recording> recordings;
  recordings.reserve(now.size() + before.size());
  for (const ProcessedLog& log : now) recordings.emplace_back(log, false, one ? windows.front()[0] : log.t[0], options);
  for (const ProcessedLog& log : before) recordings.emplace_back(log, true, log.t[0], options);
  std::vector<SessionLog> frames;
  frames.reserve(recordings.size());
  for (const Recording& recording : recordings) {
    frames.push_back(recording.frame);
    frames.back().log.t.resize(0);  // it is planned by numbers of samples
  }
  keep_alike_rows(frames, options);
  for (std::size_t r = 0; r < frames.size(); ++r) recordings[r].frame.log.decimation = frames[r].log.decimation;
  const Index joints = now.front().q.cols();
  Filled out = fill(recordings, plan_windows(frames, joints, options), joints);
  if (!out.of_windows.reach(options.least_in_windows, out.of_whole)) out = fill(recordings, whole_logs(frames), joints);
  return std::move(out.logs);
}

std::vector<std::string> note_of_windows(const std::vector<SessionLog>& logs, const SessionOptions& options) {
  const auto windows = std::count_if(logs.begin(), logs.end(), [](const SessionLog& entry) { return entry.window; });
  if (windows == 0) return {};
  return {
      fmt::format("the logs are longer than the search for effects needs: it looks at {} windows of {:g} s, spread "
                  "evenly over them; figures are of the whole logs",
                  windows, options.window_s)};
}

void check_lengths(const std::vector<SessionLog>& logs, const SessionOptions& options) {
  double seconds[2] = {0, 0};
  std::size_t count[2] = {0, 0}, judging = 0;
  for (const SessionLog& entry : logs) {
    if (!entry.fits) ++judging;
    if (!entry.fits) continue;
    seconds[entry.healthy] += static_cast<double>(entry.log.last - entry.log.first) * entry.log.step_s;
    ++count[entry.healthy];
  }
  for (const bool healthy : {false, true}) {
    if (count[healthy] == 0 || seconds[healthy] >= options.shortest_s) continue;
    throw DataError(fmt::format(
        "role = \"{}\": {:.1f} s (after filtering) are too short to tell anything from; record 40 s, {:g} s at "
        "least",
        healthy ? "baseline" : "train", seconds[healthy], options.shortest_s));
  }
  if (count[0] + judging > 1 || seconds[0] >= blocks_of_one_log * options.shortest_block_s) return;
  throw DataError(fmt::format(
      "{}: {:.1f} s (after filtering) are too short to split into {} blocks that judge one another: record "
      "{:.0f} s or more, or add a log with role = \"validate\"",
      logs.front().log.name, seconds[0], blocks_of_one_log, 4 * blocks_of_one_log * options.shortest_block_s));
}

void check_baseline_moves(const Robot& robot, const GateData& data, const std::vector<ProcessedLog>& baseline) {
  if (baseline.empty()) return;
  const std::vector<bool> now = moving_joints(data.logs), before = moving_joints(baseline);
  for (std::size_t j = 0; j < now.size(); ++j) {
    if (!now[j] || before[j]) continue;
    throw DataError(
        fmt::format("role = \"baseline\": joint {} ({}) rests there and moves in the train logs: record a baseline in "
                    "which it moves, or leave the baseline out",
                    j + 1, robot.joints[j].name));
  }
}

std::vector<bool> still_joints(const GateData& data, const SessionOptions& options) {
  std::vector<bool> out = moving_joints(data.logs);
  const ProcessedLog& log = data.logs.front();
  for (std::size_t j = 0; j < out.size(); ++j) {
    const double noise = velocity_noise(data.filter, j, log.step_s);
    out[j] = !out[j] || !(data.dq[static_cast<Index>(j)] > options.still * noise);
  }
  return out;
}

void leave_out(std::vector<ProcessedLog>& logs, const std::vector<bool>& joints) {
  if (!any(joints)) return;
  for (ProcessedLog& log : logs) {
    log.left_out = joints;
    ProcessedLog alone = log;
    alone.role = Role::train;
    const std::vector<bool> moving = moving_joints({alone});
    for (std::size_t j = 0; j < joints.size(); ++j) {
      if (!joints[j] || moving[j]) continue;
      const auto k = static_cast<Index>(j);
      log.q.col(k).setConstant(log.q.col(k).mean());
      if (log.measured_dq.size() > 0) log.measured_dq.col(k).setZero();
      if (log.measured_ddq.size() > 0) log.measured_ddq.col(k).setZero();
    }
  }
}

void mute(std::vector<SessionLog>& logs, const IdentifiedModel& model, const std::vector<bool>& joints,
          const SessionOptions& options) {
  if (!any(joints)) return;
  for (std::size_t l = 0; l < logs.size(); ++l) {
    ProcessedLog& log = logs[l].log;
    const MatrixXd torque = predict(model, log);
    Random random(l + 1);
    for (std::size_t j = 0; j < joints.size(); ++j) {
      if (!joints[j]) continue;
      const auto k = static_cast<Index>(j);
      for (Index i = 0; i < log.samples(); ++i)
        log.tau(i, k) = torque(i, k) + options.mute_noise * joints_of(model)[j].rated_torque * random.normal();
    }
  }
}

std::vector<double> largest_loads(const Models& models, const std::vector<SessionLog>& logs) {
  std::vector<double> out(joints_of(models.current).size(), 0);
  const LogColumns columns(models, logs);
  for (std::size_t l = 0; l < logs.size(); ++l) {
    const ProcessedLog& log = logs[l].log;
    const MatrixXd load = columns.robot(l).structural().middleRows(log.first, log.last - log.first);
    for (std::size_t j = 0; j < out.size(); ++j)
      out[j] = std::max(out[j], load.col(static_cast<Index>(j)).cwiseAbs().maxCoeff());
  }
  return out;
}

std::vector<double> least_widths(const std::vector<SessionLog>& logs) {
  const std::size_t n = logs.empty() ? 0 : static_cast<std::size_t>(logs.front().log.q.cols());
  std::vector<double> noise(n, 1e300), speed(n, 0.0), out;
  for (const SessionLog& entry : logs) {
    const ProcessedLog& log = entry.log;
    const double recorded_s = log.step_s / static_cast<double>(log.kept_each);
    for (std::size_t j = 0; j < n; ++j) {
      const bool known = log.measured_dq.size() == 0 && j < log.filter.position_noise.size();
      noise[j] = std::min(noise[j], known ? velocity_noise(log.filter, j, recorded_s) : 0.0);
      const VectorXd dq = log.joint_velocity(static_cast<Index>(j)).segment(log.first, log.last - log.first);
      speed[j] = std::max(speed[j], dq.cwiseAbs().maxCoeff());
    }
  }
  for (std::size_t j = 0; j < n; ++j) out.push_back(std::max(noise[j], narrowest_sign * speed[j]));
  return out;
}

std::vector<std::string> check_same_robot(Models models, const std::vector<SessionLog>& logs,
                                          const std::vector<bool>& still) {
  const SessionOptions options = models.options.session;
  models.background.clear();  // explains anything
  Linearised problem(models, logs, std::vector<VectorXd>(joints_of(models.current).size(), VectorXd::Zero(1)));
  const auto first = static_cast<Index>(problem.nuisance().size());
  for (const EffectInfo& info : effect_infos()) {
    if (info.acts_on != ActsOn::body) continue;
    Group group;
    group.candidate = {std::string(info.name), 0, {}};
    group.on_body = true;
    problem.add(group, problem.make(group));
  }
  std::vector<Index> columns = problem.nuisance();
  for (Index c = first; c < problem.solver().columns(); ++c) columns.push_back(c);
  const LinearFit fit = problem.solver().solve(columns);
  std::vector<bool> strange(problem.joints(), false);
  for (const bool healthy : {false, true}) {
    const VectorXd left = problem.solver().square(fit, problem.blocks().fit_of(healthy));
    for (std::size_t j = 0; j < problem.joints(); ++j) {
      const auto k = static_cast<Index>(j);
      double whole = 0, noise = 0;
      for (const SessionLog& entry : logs) {
        if (entry.healthy != healthy || !entry.fits) continue;
        const MatrixXd rows = entry.log.decimate(entry.log.filter_columns(entry.log.tau.col(k)));
        whole += rows.squaredNorm();
        noise += static_cast<double>(rows.rows()) * entry.log.torque_noise[k] * entry.log.torque_noise[k];
      }
      if (left[k] > std::max(options.other_robot * whole, options.other_robot_noise * noise)) strange[j] = true;
    }
  }
  std::size_t count = 0, judged = 0;
  std::vector<std::string> notes, names;
  for (std::size_t j = 0; j < problem.joints(); ++j) {
    if (still[j]) continue;
    ++judged;
    if (!strange[j]) continue;
    ++count;
    names.push_back(robot_of(models.current).joints[j].name);
    notes.push_back(
        fmt::format("{}: nothing explains the baseline and these logs together: another unit, gain or column in one of "
                    "them? What is found there may be that",
                    robot_of(models.current).joints[j].name));
  }
  if (2 * count >= judged && count > 0) {
    throw DataError(fmt::format(
        "the baseline and these logs can't be of one robot: nothing explains both at {} of {} joints ({}); other "
        "units, columns or gains? Correct the baseline or remove it (role = \"baseline\")",
        count, judged, fmt::join(names, ", ")));
  }
  return notes;
}

std::vector<std::string> check_judges(const IdentifiedModel& model, const std::vector<ProcessedLog>& logs,
                                      const std::vector<bool>& still, const SessionOptions& options) {
  const double factor = options.other_units_factor;
  std::vector<std::string> notes;
  ArrayXd xy, xx, yy;  // of a recording: model with measurement, model, measurement
  for (std::size_t l = 0; l < logs.size(); ++l) {
    const ProcessedLog& log = logs[l];
    if (log.role != Role::validate && log.role != Role::test) continue;
    const MatrixXd ours = log.filter_columns(predict(model, log)), theirs = log.filter_columns(log.tau);
    if (!log.continues) xy = xx = yy = ArrayXd::Zero(ours.cols());
    const auto x = ours.middleRows(log.first, log.last - log.first).array();
    const auto y = theirs.middleRows(log.first, log.last - log.first).array();
    xy += (x * y).colwise().sum().transpose();
    xx += x.square().colwise().sum().transpose();
    yy += y.square().colwise().sum().transpose();
    if (l + 1 < logs.size() && logs[l + 1].continues) continue;
    std::size_t judged = 0, odd = 0;
    double last = 1;
    for (std::size_t j = 0; j < still.size(); ++j) {
      if (still[j]) continue;
      ++judged;
      const auto k = static_cast<Index>(j);
      const double times = xy[k] / std::max(xx[k], 1e-300);
      const bool scaled = times < 1 / factor || times > factor;
      if (!scaled || xy[k] * xy[k] < options.other_units * xx[k] * yy[k]) continue;
      ++odd;
      last = times;
      notes.push_back(
          fmt::format("{}: its torque of {} is {:.3g} times that of the train logs' motion: other units, "
                      "gain or sign?",
                      log.name, robot_of(model).joints[j].name, times));
    }
    if (judged == 0 || odd < judged) continue;
    throw DataError(fmt::format(
        "{}: its torques are {:.3g} times those of the train logs' motion, at every joint: other units, gains or sign? "
        "Correct it or remove it (role = \"{}\")",
        log.name, last, log.role == Role::test ? "test" : "validate"));
  }
  return notes;
}

}  // namespace fxdyn::diagnosis
