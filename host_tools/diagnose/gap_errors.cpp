#include "host_tools/diagnose/gap_errors.hpp"

#include <algorithm>
#include <cmath>

#include "host_tools/effects/evaluator.hpp"
#include "host_tools/support/parallel.hpp"

namespace fxdyn::diagnosis {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

bool is_validate(const ProcessedLog& log) { return log.role == Role::validate; }

}  // namespace

VectorXd error_of(const ProcessedLog& log, const Eigen::Ref<const VectorXd>& torque, std::size_t joint) {
  return log.filter_columns(log.tau.col(static_cast<Index>(joint)) - torque).col(0);
}

GapErrors::GapErrors(const Conclusion& conclusion) : conclusion_(conclusion) {
  for (const ProcessedLog& log : conclusion_.now) {
    if (is_validate(log)) judges_.logs.push_back(&log);
  }
  blocks_judge_ = judges_.logs.empty();
  if (blocks_judge_) {
    for (const ProcessedLog& log : conclusion_.now) judges_.logs.push_back(&log);
  }
  // Figures are on logs that decided nothing, where there are any.
  for (const ProcessedLog& log : conclusion_.test) shown_.logs.push_back(&log);
  figures_on_ = "test logs";
  if (shown_.logs.empty()) {
    std::swap(shown_.logs, judges_.logs);
    figures_on_ = blocks_judge_ ? gate_of(conclusion_.now) : "validate logs, which also decided which names stay";
  }
  sum_up(shown_);
  sum_up(judges_);
  first_after_ = predict(conclusion_.model, first_shown());
}

void GapErrors::sum_up(Set& set) const {
  set.before.resize(set.logs.size());
  set.after.resize(set.logs.size());
  parallel_for(set.logs.size(), [&](std::size_t l) {
    const ProcessedLog& log = *set.logs[l];
    const auto squares = [&](const IdentifiedModel& model) {
      const MatrixXd torque = predict(model, log);
      VectorXd out(torque.cols());
      for (Index j = 0; j < out.size(); ++j)
        out[j] = error_of(log, torque.col(j), static_cast<std::size_t>(j))
                     .segment(log.first, log.last - log.first)
                     .squaredNorm();
      return out;
    };
    set.before[l] = squares(conclusion_.nominal);
    set.after[l] = squares(conclusion_.model);
  });
}

double GapErrors::error(const Set& set, const std::vector<VectorXd>& squares, std::size_t joint) const {
  double square = 0, count = 0;
  for (std::size_t l = 0; l < set.logs.size(); ++l) {
    square += squares[l][static_cast<Index>(joint)];
    count += static_cast<double>(set.logs[l]->last - set.logs[l]->first);
  }
  return std::sqrt(square / std::max(count, 1.0));
}

double GapErrors::judged_over_fitted(const VectorXd& judged, const VectorXd& fitted, std::size_t joint) const {
  const auto j = static_cast<Index>(joint);
  const HeldOut& held = conclusion_.gate.held;
  return held.fitted_rows[j] / std::max(held.rows[j], 1.0) * judged[j] / std::max(fitted[j], 1e-300);
}

GapFigures GapErrors::operator()(std::size_t joint) const {
  const auto j = static_cast<Index>(joint);
  const HeldOut& held = conclusion_.gate.held;
  GapFigures out;
  const Set& judges = judges_.logs.empty() ? shown_ : judges_;
  out.gate_before = error(judges, judges.before, joint);
  out.gate_after = error(judges, judges.after, joint);
  if (blocks_judge_) {
    out.gate_before *= std::sqrt(judged_over_fitted(held.before, held.fitted_before, joint));
    out.gate_after *= std::sqrt(judged_over_fitted(held.after, held.fitted_after, joint));
  }
  out.before = judges_.logs.empty() ? out.gate_before : error(shown_, shown_.before, joint);
  out.after = judges_.logs.empty() ? out.gate_after : error(shown_, shown_.after, joint);
  // Of the logs that judged: what another motion shows on top is no noise.
  out.floor = out.gate_after * std::sqrt(std::max(0.0, 1 - held.leftover[j] / std::max(held.after[j], 1e-300)));
  return out;
}

}  // namespace fxdyn::diagnosis
