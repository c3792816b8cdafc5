#include "host_tools/diagnose/recording_faults.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "host_tools/diagnose/features.hpp"
#include "host_tools/effects/effect_roles.hpp"
#include "host_tools/effects/evaluator.hpp"
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

/// Asks each fault in turn, around one linearisation.
class Court {
 public:
  Court(const Models& nominal, const std::vector<SessionLog>& logs, const std::vector<VectorXd>& whitening)
      : nominal_(nominal),
        problem_(nominal, logs, whitening),
        options_(nominal.options.recording),
        healthy_(problem_.solver().solve(problem_.nuisance())),
        nothing_(likelihood(problem_, healthy_)) {
    for (std::size_t l = 0; l < logs.size(); ++l) {
      if (!logs[l].healthy && logs[l].fits) today_.push_back(l);
    }
    for (const std::size_t l : today_) torque_.push_back(torque(l, 0, 0));
    explainable_ = explainable();
  }

  std::vector<RecordingFault> all() {
    if (nominal_.has_baseline) {
      for (std::size_t j = 0; j < problem_.joints(); ++j) ask_zero(j);
    }
    ask_clocks();
    for (const std::size_t l : today_) {
      if (today_.size() > 1) ask_load(l);
    }
    std::sort(faults_.begin(), faults_.end(), [](const auto& a, const auto& b) { return a.score > b.score; });
    return std::move(faults_);
  }
  double nothing() const { return nothing_; }

 private:
  const IdentifiedModel& model() const { return nominal_.current; }
  const SessionLog& entry(std::size_t log) const { return problem_.logs()[log]; }
  const std::string& name(std::size_t log) const { return entry(log).log.name; }

  /// Torque along a motion whose joint is moved by a constant.
  MatrixXd torque(std::size_t log, std::size_t joint, double shift) const {
    const Motion& motion = problem_.motion(log);
    MatrixXd q = motion.q;
    q.col(static_cast<Index>(joint)).array() += shift;
    return predict(with_load_of(entry(log).log, model()), q, motion.dq, motion.ddq, motion.step_s);
  }

  /// Columns of one log at full rate as rows of all blocks, by joint.
  void put(std::size_t log, const MatrixXd& full, Index column, std::vector<MatrixXd>& rows) const {
    const Block& block = problem_.blocks().of_log[log];
    const MatrixXd decimated = entry(log).log.decimate(entry(log).log.filter_columns(full));
    for (std::size_t j = 0; j < rows.size(); ++j) {
      rows[j].col(column).segment(block.first, block.count) =
          problem_.noise().apply(log, j, decimated.col(static_cast<Index>(j)));
    }
  }
  std::vector<MatrixXd> no_rows(Index columns) const {
    return std::vector<MatrixXd>(problem_.joints(), MatrixXd::Zero(problem_.blocks().rows(), columns));
  }

  /// A fit with the columns; they stay in the problem, which does no harm.
  LinearFit fit_with(std::vector<MatrixXd> rows) {
    for (std::size_t j = 0; j < rows.size(); ++j) {
      if (const Background* background = problem_.background(j)) rows[j] = background->eliminate(rows[j]);
    }
    Group group;
    group.candidate = {std::string(load_effect().name), 0, {}};
    group.on_body = true;
    const std::size_t g = problem_.add(group, rows);
    return problem_.solver().solve(problem_.columns_of({g}));
  }

  /// What any function of the state, the motion and time explains of today's residual, in noise variances.
  double explainable() const {
    double out = 0;
    for (std::size_t j = 0; j < problem_.joints(); ++j) {
      const MatrixXd functions = features(problem_, j);
      const VectorXd residual = problem_.solver().residual(j, healthy_);
      MatrixXd gram = MatrixXd::Zero(functions.cols(), functions.cols());
      VectorXd projection = VectorXd::Zero(functions.cols());
      for (const std::size_t b : problem_.blocks().fit_of(false)) {
        const Block& block = problem_.blocks().all[b];
        const auto f = functions.middleRows(block.first, block.count);
        gram.noalias() += f.transpose() * f;
        projection.noalias() += f.transpose() * residual.segment(block.first, block.count);
      }
      gram.diagonal().array() += 1e-9 * std::max(gram.trace(), 1e-300);
      out +=
          problem_.solver().weights()[static_cast<Index>(j)] * projection.dot(SymmetricSolver(gram).solve(projection));
      out -= static_cast<double>(functions.cols());
    }
    return out;
  }

  void judge(const LinearFit& fit, Index parameters, std::string complaint) {
    RecordingFault fault;
    fault.complaint = std::move(complaint);
    fault.score = likelihood(problem_, fit) - nothing_ - static_cast<double>(parameters) * std::log(fit.rows.sum());
    const double gain = (problem_.solver().weights().array() * (healthy_.square - fit.square).array()).sum();
    fault.closure = (gain - static_cast<double>(parameters)) / std::max(explainable_, 1.0);
    faults_.push_back(std::move(fault));
  }

  /// A secant through the shift that was found last, so that large shifts count as well. Only one that explains
  /// something is worth further rounds.
  void ask_zero(std::size_t joint) {
    constexpr int most_rounds = 4;
    double shift = options_.first_shift;
    LinearFit fit;
    for (int round = 0; round < most_rounds; ++round) {
      std::vector<MatrixXd> rows = no_rows(1);
      for (std::size_t i = 0; i < today_.size(); ++i)
        put(today_[i], (torque(today_[i], joint, shift) - torque_[i]) / shift, 0, rows);
      fit = fit_with(std::move(rows));
      shift = fit.x[fit.x.size() - 1];
      if (!(std::fabs(shift) > options_.least_shift) || std::fabs(shift) > std::numbers::pi) return;
      if (likelihood(problem_, fit) - nothing_ < options_.least_score) return;
    }
    const Joint& j = model().robot.joints[joint];
    judge(fit, 1,
          fmt::format("{}: its encoder slipped since the baseline: these logs fit best with {:+.4g} {} added to its "
                      "position; correct that, or record the baseline again",
                      j.name, shift, j.position_unit()));
  }

  /// Of all of today's logs together: they have one recorder.
  void ask_clocks() {
    std::vector<MatrixXd> rows = no_rows(2 * static_cast<Index>(today_.size()));
    for (std::size_t i = 0; i < today_.size(); ++i) {
      const Motion& motion = problem_.motion(today_[i]);
      const MatrixXd& tau = torque_[i];
      const Index n = tau.rows();
      MatrixXd rate = MatrixXd::Zero(n, tau.cols());
      rate.middleRows(1, n - 2) = (tau.bottomRows(n - 2) - tau.topRows(n - 2)) / (2 * motion.step_s);
      const VectorXd since = (motion.t.array() - motion.t.mean()).matrix();
      put(today_[i], rate, 2 * static_cast<Index>(i), rows);
      put(today_[i], since.asDiagonal() * rate, 2 * static_cast<Index>(i) + 1, rows);
    }
    const Index columns = rows[0].cols();
    const LinearFit fit = fit_with(std::move(rows));
    double most = 0;
    std::string complaint;
    for (std::size_t i = 0; i < today_.size(); ++i) {
      const Motion& motion = problem_.motion(today_[i]);
      const Index at = fit.x.size() - columns + 2 * static_cast<Index>(i);
      const double half = fit.x[at + 1] * (motion.t[motion.t.size() - 1] - motion.t[0]) / 2;
      if (std::fabs(half) <= most || 2 * std::fabs(half) < options_.least_drift * motion.step_s) continue;
      most = std::fabs(half);
      complaint = fmt::format(
          "{}: position and torque have two clocks: the torque is {:.3g} ms early at the start and {:.3g} ms at the "
          "end; "
          "record both with one clock",
          name(today_[i]), 1e3 * (fit.x[at] - half), 1e3 * (fit.x[at] + half));
    }
    if (!complaint.empty()) judge(fit, columns, complaint);
  }

  void ask_load(std::size_t log) {
    Group load;
    load.candidate = {std::string(load_effect().name), 0, {}};
    load.on_body = true;
    std::vector<MatrixXd> rows = problem_.make(load);
    const Block& block = problem_.blocks().of_log[log];
    const Index total = problem_.blocks().rows();
    for (MatrixXd& of_joint : rows) {
      if (of_joint.size() == 0) of_joint = MatrixXd::Zero(total, 4);
      MatrixXd alone = MatrixXd::Zero(total, of_joint.cols());
      alone.middleRows(block.first, block.count) = of_joint.middleRows(block.first, block.count);
      of_joint = std::move(alone);
    }
    const LinearFit fit = fit_with(std::move(rows));
    const double mass = fit.x[fit.x.size() - 4];
    judge(fit, 4,
          fmt::format("{}: recorded with another load than the other logs ({:+.3g} kg): say so by `payload` of its "
                      "[[log]], or leave it out",
                      name(log), mass));
  }

  const Models& nominal_;
  Linearised problem_;
  const RecordingOptions& options_;
  LinearFit healthy_;
  double nothing_;
  double explainable_ = 0;
  std::vector<std::size_t> today_;  ///< logs that fit
  std::vector<MatrixXd> torque_;    ///< of the nominal model, by log of today
  std::vector<RecordingFault> faults_;
};

}  // namespace

std::vector<RecordingFault> recording_faults(const Models& nominal, const std::vector<SessionLog>& logs,
                                             const std::vector<VectorXd>& whitening) {
  return Court(nominal, logs, whitening).all();
}

std::optional<RecordingFault> likely_recording_fault(const Models& nominal, const std::vector<SessionLog>& logs,
                                                     const Outcome& outcome) {
  const RecordingOptions& options = nominal.options.recording;
  Court court(nominal, logs, outcome.whitening);
  const Linearised& found = *outcome.problem;
  const std::vector<std::size_t> named = in_model(found);
  const LinearFit fit = found.solver().solve(found.columns_of(named));
  double score = likelihood(found, fit) - court.nothing();
  for (const std::size_t g : named) {
    const Group& group = found.groups()[g];
    score -= static_cast<double>(group.count) * std::log(fit.rows.sum());
  }
  const double needed = std::max(score, 0.0) + options.least_score;
  for (RecordingFault& fault : court.all()) {
    if (fault.score >= needed && fault.closure >= options.least_closure) return std::move(fault);
  }
  return std::nullopt;
}

}  // namespace fxdyn::diagnosis
