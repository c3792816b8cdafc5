#include "host_tools/diagnose/recording_faults.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "host_tools/diagnose/features.hpp"
#include "host_tools/effects/effect_roles.hpp"
#include "host_tools/effects/evaluator.hpp"
#include "host_tools/effects/model_parts.hpp"
#include "host_tools/regression/solver.hpp"

namespace fxdyn::diagnosis {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// 2 ln likelihood of a fit.
double likelihood(const Linearised& problem, const LinearFit& fit) {
  double out = 0;
  for (Index j = 0; j < fit.square.size(); ++j) {
    out -= fit.rows[j] * std::log(std::max(fit.square[j], 1e-300) / std::max(fit.rows[j], 1.0));
    out += 2 * problem.noise().log_scale(static_cast<std::size_t>(j));
  }
  return out;
}

/// Fits each fault in turn, around one linearisation.
class FaultFits {
 public:
  FaultFits(const Models& nominal, const std::vector<SessionLog>& logs, const std::vector<VectorXd>& whitening)
      : nominal_(nominal),
        problem_(nominal, logs, whitening),
        options_(nominal.options.recording),
        sound_(problem_.solver().solve(problem_.columns_of({}))),
        sound_likelihood_(likelihood(problem_, sound_)),
        price_(std::log(std::max(problem_.solver().row_count(problem_.blocks().fit_of(false)).maxCoeff(), 2.0))) {
    torque_.resize(logs.size());
    for (const Windows& windows : by_recording(logs)) {
      if (logs[windows.front()].healthy || !logs[windows.front()].fits) continue;
      today_.push_back(windows);
      for (const std::size_t l : windows) torque_[l] = torque(l, 0, 0);
    }
    explainable_ = explainable();
  }

  std::vector<RecordingFault> all() {
    if (nominal_.has_baseline) {
      for (const EffectInfo& effect : effect_infos()) {
        if (effect.acts_on == ActsOn::body) on_robot_ = std::max(on_robot_, score_on_robot(effect));
      }
      for (std::size_t j = 0; j < problem_.joints(); ++j) fit_zero(j);
    }
    fit_clocks();
    // Of two logs without a baseline either may be the odd one: the last is asked.
    const bool either = today_.size() == 2 && !nominal_.has_baseline;
    for (std::size_t i = either ? 1 : 0; i < today_.size() && today_.size() > 1; ++i) {
      fit_load(i);
      for (std::size_t j = 0; j < problem_.joints(); ++j) fit_gain(i, j);
    }
    std::sort(faults_.begin(), faults_.end(), [](const auto& a, const auto& b) { return a.score > b.score; });
    return std::move(faults_);
  }
  double sound_likelihood() const { return sound_likelihood_; }
  /// What a parameter costs: of the rows of one joint today, as in the search.
  double price() const { return price_; }

 private:
  /// Logs of one recording.
  using Windows = std::vector<std::size_t>;

  const IdentifiedModel& model() const { return nominal_.current; }
  const SessionLog& entry(std::size_t log) const { return problem_.logs()[log]; }
  const std::string& name(const Windows& recording) const { return entry(recording.front()).log.name; }
  Windows all_of_today() const {
    Windows out;
    for (const Windows& windows : today_) out.insert(out.end(), windows.begin(), windows.end());
    return out;
  }

  /// Torque along a motion whose joint is moved by a constant.
  MatrixXd torque(std::size_t log, std::size_t joint, double shift) const {
    const Motion& motion = problem_.motion(log);
    MatrixXd q = motion.q;
    q.col(static_cast<Index>(joint)).array() += shift;
    return predict(with_load_of(entry(log).log, model()), q, motion.dq, motion.ddq, motion.step_s);
  }

  /// A joint's column of one log, at full rate, among the rows of all blocks.
  void put(std::size_t log, std::size_t joint, const VectorXd& full, Index column, std::vector<MatrixXd>& rows) const {
    const Block& block = problem_.blocks().of_log[log];
    const MatrixXd decimated = entry(log).log.decimate(entry(log).log.filter_columns(full));
    rows[joint].col(column).segment(block.first, block.count) = problem_.noise().apply(log, joint, decimated);
  }
  void put(std::size_t log, const MatrixXd& full, Index column, std::vector<MatrixXd>& rows) const {
    for (std::size_t j = 0; j < rows.size(); ++j) put(log, j, full.col(static_cast<Index>(j)), column, rows);
  }
  std::vector<MatrixXd> no_rows(Index columns) const {
    return std::vector<MatrixXd>(problem_.joints(), MatrixXd::Zero(problem_.blocks().rows(), columns));
  }

  /// Columns as a group of the problem, which keeps them: that does no harm.
  std::size_t add(std::vector<MatrixXd> rows) {
    for (std::size_t j = 0; j < rows.size(); ++j) {
      if (rows[j].size() == 0) continue;
      if (const Background* background = problem_.background(j)) rows[j] = background->eliminate(rows[j]);
    }
    Group group;
    group.candidate = {std::string(load_effect().name), 0, {}};
    group.on_body = true;
    return problem_.add(group, rows);
  }
  LinearFit fit_with(std::vector<MatrixXd> rows) {
    return problem_.solver().solve(problem_.columns_of({add(std::move(rows))}));
  }
  /// Standard deviation of a fit's coefficient.
  static double deviation(const LinearFit& fit, Index at) {
    return std::sqrt(std::max(SymmetricSolver(fit.information).inverse()(at, at), 0.0));
  }
  double gain_of(const LinearFit& fit) const {
    return (problem_.solver().weights().array() * (sound_.square - fit.square).array()).sum();
  }

  /// What the nominal model and any function of the state, the motion and time explain more than the model alone, in
  /// noise variances beyond those that noise gives.
  double explainable() {
    std::vector<std::size_t> groups;
    double free = 0;
    for (std::size_t j = 0; j < problem_.joints(); ++j) {
      std::vector<MatrixXd> rows(problem_.joints());
      rows[j] = features(problem_, j);
      free += static_cast<double>(rows[j].cols());
      groups.push_back(add(std::move(rows)));
    }
    return gain_of(problem_.solver().solve(problem_.columns_of(groups))) - free;
  }

  double score_of(const LinearFit& fit, Index parameters) const {
    return likelihood(problem_, fit) - sound_likelihood_ - static_cast<double>(parameters) * price_;
  }

  /// @param already a fit that the fault has to be better than, with so many parameters of its own
  void weigh(const LinearFit& fit, Index parameters, std::string complaint, const LinearFit* already = nullptr) {
    RecordingFault fault;
    fault.complaint = std::move(complaint);
    fault.score = score_of(fit, parameters);
    const double before = already == nullptr ? 0 : gain_of(*already);
    const double left = std::max(explainable_, gain_of(fit)) - before;
    fault.closure = left > 0 ? (gain_of(fit) - before - static_cast<double>(parameters)) / left : 0;
    faults_.push_back(std::move(fault));
  }

  /// A secant through the shift that was found last, so that large shifts count as well. Only one that explains
  /// something is worth further rounds.
  void fit_zero(std::size_t joint) {
    constexpr int most_rounds = 10;
    const JointFit& limits = joints_of(model())[joint];
    double shift = options_.first_shift;
    for (int round = 0; round < most_rounds; ++round) {
      std::vector<MatrixXd> rows = no_rows(1);
      for (const std::size_t l : all_of_today()) put(l, (torque(l, joint, shift) - torque_[l]) / shift, 0, rows);
      const LinearFit fit = fit_with(std::move(rows));
      const Index at = fit.x.size() - 1;
      const double before = shift;
      shift = fit.x[at];
      if (!(std::fabs(shift) > options_.least_shift) || std::fabs(shift) > limits.q_upper - limits.q_lower) return;
      if (likelihood(problem_, fit) - sound_likelihood_ < options_.least_score) return;
      if (std::fabs(shift - before) > 0.05 * std::fabs(shift)) continue;
      if (std::fabs(shift) < options_.deviations * deviation(fit, at)) return;
      const Joint& j = robot_of(model()).joints[joint];
      weigh(fit, 1,
            fmt::format("{}: its encoder slipped since the baseline: these logs fit best with {:+.4g} {} added to its "
                        "position; correct that, or record the baseline again",
                        j.name, shift, j.position_unit()));
      // A first joint that lies shows a tilt as a slip of its own.
      faults_.back().sound_score = on_robot_;
      return;
    }
  }

  double begins_s(const Windows& recording) const { return problem_.motion(recording.front()).t[0]; }
  double ends_s(const Windows& recording) const {
    const VectorXd& t = problem_.motion(recording.back()).t;
    return t[t.size() - 1];
  }
  double middle_s(const Windows& recording) const { return (begins_s(recording) + ends_s(recording)) / 2; }

  /// Lags of all of today's recordings, with or without their growth: they have one recorder.
  std::vector<MatrixXd> lag_rows(bool growing) const {
    std::vector<MatrixXd> rows = no_rows((growing ? 2 : 1) * static_cast<Index>(today_.size()));
    const auto count = static_cast<Index>(today_.size());
    for (Index i = 0; i < count; ++i) {
      const Windows& windows = today_[static_cast<std::size_t>(i)];
      const double middle = middle_s(windows);
      for (const std::size_t l : windows) {
        const Motion& motion = problem_.motion(l);
        const MatrixXd& tau = torque_[l];
        const Index n = tau.rows();
        MatrixXd rate = MatrixXd::Zero(n, tau.cols());
        rate.middleRows(1, n - 2) = (tau.bottomRows(n - 2) - tau.topRows(n - 2)) / (2 * motion.step_s);
        put(l, rate, i, rows);
        if (growing) put(l, (motion.t.array() - middle).matrix().asDiagonal() * rate, count + i, rows);
      }
    }
    return rows;
  }

  /// A constant lag is an effect or how signals are sampled; one that grows is two clocks.
  void fit_clocks() {
    const LinearFit constant = fit_with(lag_rows(false)), growing = fit_with(lag_rows(true));
    const auto count = static_cast<Index>(today_.size());
    const double better =
        likelihood(problem_, growing) - likelihood(problem_, constant) - static_cast<double>(count) * price_;
    if (better < options_.least_score) return;
    double most = 0;
    std::string complaint;
    for (Index i = 0; i < count; ++i) {
      const Windows& recording = today_[static_cast<std::size_t>(i)];
      const Index at = growing.x.size() - 2 * count + i;
      const double slope = growing.x[at + count], grown = slope * (ends_s(recording) - begins_s(recording));
      if (std::fabs(slope) < options_.deviations * deviation(growing, at + count)) continue;
      if (std::fabs(grown) <= most || std::fabs(grown) < options_.least_drift * entry(recording.front()).log.step_s)
        continue;
      most = std::fabs(grown);
      complaint = fmt::format(
          "{}: position and torque have two clocks: the lag between them changes by {:.3g} ms from start to end; "
          "record "
          "both with one clock",
          name(recording), 1e3 * most);
    }
    if (!complaint.empty()) weigh(growing, 2 * count, complaint, &constant);
  }

  /// Columns of an effect on the robot in some of today's logs.
  std::vector<MatrixXd> robot_rows(const EffectInfo& effect, const Windows& logs) const {
    Group group;
    group.candidate = {std::string(effect.name), 0, {}};
    group.on_body = true;
    std::vector<MatrixXd> rows = no_rows(static_cast<Index>(effect.linear.size()));
    for (const std::size_t log : logs) {
      const EffectColumns columns = problem_.log_columns().of(log, group);
      for (std::size_t j = 0; j < rows.size(); ++j) {
        for (Index c = 0; c < columns.joints[j].cols(); ++c) put(log, j, columns.joints[j].col(c), c, rows);
      }
    }
    return rows;
  }

  double score_on_robot(const EffectInfo& effect) {
    return score_of(fit_with(robot_rows(effect, all_of_today())), static_cast<Index>(effect.linear.size()));
  }

  void fit_load(std::size_t i) {
    const auto parameters = static_cast<Index>(load_effect().linear.size());
    const LinearFit fit = fit_with(robot_rows(load_effect(), today_[i]));
    const Index at = fit.x.size() - parameters;
    if (std::fabs(fit.x[at]) < options_.deviations * deviation(fit, at)) return;
    weigh(fit, parameters,
          fmt::format("{}: recorded with another load than the other logs ({:+.3g} kg): say so by `payload` of its "
                      "[[log]], or leave it out",
                      name(today_[i]), fit.x[at]));
    faults_.back().sound_score = score_on_robot(load_effect());
  }

  /// Columns of a joint's torque in some of today's logs.
  std::vector<MatrixXd> gain_rows(const Windows& logs, std::size_t joint) const {
    std::vector<MatrixXd> rows = no_rows(1);
    for (const std::size_t l : logs) put(l, joint, torque_[l].col(static_cast<Index>(joint)), 0, rows);
    return rows;
  }
  /// .. of its friction in one: all that the joint's effects do, what is viscous of it, and an offset.
  std::vector<MatrixXd> friction_rows(const Windows& recording, std::size_t joint) const {
    const auto j = static_cast<Index>(joint);
    std::vector<MatrixXd> rows = no_rows(3);
    for (const std::size_t l : recording) {
      const VectorXd dq = problem_.motion(l).dq.col(j);
      put(l, joint, torque_[l].col(j) - problem_.robot_columns(l).structural().col(j), 0, rows);
      put(l, joint, dq, 1, rows);
      put(l, joint, VectorXd::Ones(dq.size()), 2, rows);
    }
    return rows;
  }

  /// What one joint's torque has in one log alone may look like a load.
  void fit_gain(std::size_t i, std::size_t joint) {
    const LinearFit fit = fit_with(gain_rows(today_[i], joint));
    const Index at = fit.x.size() - 1;
    if (std::fabs(fit.x[at]) < options_.deviations * deviation(fit, at)) return;
    weigh(
        fit, 1,
        fmt::format("{}: its torque of {} is {:.3g} times that of the other logs: another unit or gain? Correct it or "
                    "leave the log out",
                    name(today_[i]), robot_of(model()).joints[joint].name, 1 + fit.x[at]));
    faults_.back().sound_score = std::max(score_of(fit_with(gain_rows(all_of_today(), joint)), 1),
                                          score_of(fit_with(friction_rows(today_[i], joint)), 3));
  }

  const Models& nominal_;
  Linearised problem_;
  const RecordingOptions& options_;
  LinearFit sound_;
  double sound_likelihood_, price_;
  double explainable_ = 0;
  double on_robot_ = 0;           ///< the best score of an effect on the robot
  std::vector<Windows> today_;    ///< recordings that fit
  std::vector<MatrixXd> torque_;  ///< of the nominal model, by log; empty but for today's
  std::vector<RecordingFault> faults_;
};

}  // namespace

std::vector<RecordingFault> recording_faults(const Models& nominal, const std::vector<SessionLog>& logs,
                                             const std::vector<VectorXd>& whitening) {
  return FaultFits(nominal, logs, whitening).all();
}

std::optional<RecordingFault> likely_recording_fault(const Models& nominal, const std::vector<SessionLog>& logs,
                                                     const Outcome& outcome) {
  const RecordingOptions& options = nominal.options.recording;
  FaultFits fits(nominal, logs, outcome.whitening);
  const Linearised& found = *outcome.problem;
  const std::vector<std::size_t> named = in_model(found);
  double score = likelihood(found, found.solver().solve(found.columns_of(named))) - fits.sound_likelihood();
  for (const std::size_t g : named) {
    const Group& group = found.groups()[g];
    score -= static_cast<double>(group.count - find_effect(group.candidate.effect)->share) * fits.price();
  }
  for (RecordingFault& fault : fits.all()) {
    const double needed = std::max({score, fault.sound_score, 0.0}) + options.least_score;
    if (fault.score >= needed && fault.closure >= options.least_closure) return std::move(fault);
  }
  return std::nullopt;
}

}  // namespace fxdyn::diagnosis
