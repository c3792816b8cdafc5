#include "host_tools/diagnose/curveless.hpp"

#include <algorithm>

#include "host_tools/diagnose/bumps.hpp"
#include "host_tools/diagnose/curve_squares.hpp"
#include "host_tools/diagnose/features.hpp"
#include "host_tools/signals/filter.hpp"

namespace fxdyn::diagnosis {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// A variable over the logs, at full rate: by log, none for those of the healthy session.
using Values = std::vector<VectorXd>;

template <class Of>
Values values(const Linearised& problem, Of&& of) {
  Values out(problem.logs().size());
  for (std::size_t l = 0; l < out.size(); ++l) {
    if (!problem.logs()[l].healthy) out[l] = of(problem.motion(l));
  }
  return out;
}

/// Knots over all values of the logs that fit.
Knots knots_over(const Linearised& problem, const Values& values) {
  double low = 1e300, high = -1e300;
  for (std::size_t l = 0; l < values.size(); ++l) {
    const SessionLog& entry = problem.logs()[l];
    if (entry.healthy || !entry.fits) continue;
    const auto inside = values[l].segment(entry.log.first, entry.log.last - entry.log.first);
    low = std::min(low, inside.minCoeff());
    high = std::max(high, inside.maxCoeff());
  }
  return {low, high - low};
}

/// A curve's columns of a variable, where the joint moves.
MatrixXd columns_over(const Linearised& problem, std::size_t joint, const Values& values,
                      const std::vector<VectorXd>& moving) {
  const Knots knots = knots_over(problem, values);
  MatrixXd out = MatrixXd::Zero(problem.blocks().rows(), static_cast<Index>(curve_heights));
  if (!(knots.span > 0)) return out;
  for (std::size_t l = 0; l < values.size(); ++l) {
    const ProcessedLog& log = problem.logs()[l].log;
    if (problem.logs()[l].healthy) continue;
    const MatrixXd full = moving[l].asDiagonal() * problem.log_columns().follow(l, joint, bumps(knots, values[l]));
    const Block& block = problem.blocks().of_log[l];
    out.middleRows(block.first, block.count) = problem.noise().apply(l, joint, log.decimate(log.filter_columns(full)));
  }
  return out;
}

/// .. of the other joints' velocities.
MatrixXd velocities_of_others(const Linearised& problem, std::size_t joint) {
  const Family family = families(problem.joints())[problem.joints() - 1];  // after each other joint's position
  return features(problem, joint).middleCols(family.first, family.count);
}

}  // namespace

LeftBy left_without_curve(const Linearised& problem, std::size_t joint, const std::vector<Index>& columns, double prior,
                          const std::vector<Fold>& folds, const std::vector<VectorXd>& moving) {
  LeftBy best;
  const auto judge = [&](const char* variable, MatrixXd functions) {
    if (const Background* background = problem.background(joint)) functions = background->eliminate(functions);
    double left = 0;
    for (const Fold& fold : folds) left += judged_with_curves(problem, joint, columns, functions, prior, fold);
    if (left < best.left) best = {left, variable};
  };
  const auto j = static_cast<Index>(joint);
  if (problem.joints() > 1) judge("velocities of other joints", velocities_of_others(problem, joint));
  const Values acceleration = values(problem, [&](const Motion& motion) { return VectorXd(motion.ddq.col(j)); });
  judge("acceleration", columns_over(problem, joint, acceleration, moving));
  const Values jerk =
      values(problem, [&](const Motion& motion) { return VectorXd(differentiate(motion.ddq.col(j), motion.step_s)); });
  judge("jerk", columns_over(problem, joint, jerk, moving));
  return best;
}

}  // namespace fxdyn::diagnosis
