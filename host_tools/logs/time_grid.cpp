#include "host_tools/logs/time_grid.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "host_tools/logs/quantile.hpp"
#include "host_tools/support/error.hpp"

namespace fxdyn {

using Eigen::Index;

namespace {

Eigen::VectorXd differences(const Eigen::VectorXd& x) { return x.tail(x.size() - 1) - x.head(x.size() - 1); }

}  // namespace

double check_stamps(Log& log, const std::string& file) {
  const Eigen::VectorXd steps = differences(log.t);
  const double step = quantile(steps, 0.5);
  Index widest = 0;
  const double gap = steps.maxCoeff(&widest);
  if (gap > 10 * step) {
    throw InputError(
        fmt::format("{}: gap of {:.6g} s after t = {:.9g} s (the step is {:.6g} s); use windows (from_s, to_s) "
                    "on either side of it",
                    file, gap, log.t[widest], step));
  }
  const double mean = (log.t[log.t.size() - 1] - log.t[0]) / static_cast<double>(steps.size());
  // Stamps written with few digits alternate about the grid: what counts is the distance from it.
  double jitter = 0;
  for (Index i = 0; i < log.t.size(); ++i) {
    jitter = std::max(jitter, std::abs(log.t[i] - (log.t[0] + mean * static_cast<double>(i))));
  }
  log.resampled = jitter > 0.01 * step && (steps.array() - step).abs().maxCoeff() > 0.01 * step;
  return log.resampled ? step : mean;
}

Eigen::MatrixXd interpolate(const Eigen::MatrixXd& columns, const Eigen::VectorXd& t, const Eigen::VectorXd& at) {
  Eigen::MatrixXd result(at.size(), columns.cols());
  Index left = 0;
  for (Index i = 0; i < at.size(); ++i) {
    while (left + 2 < t.size() && t[left + 1] <= at[i]) ++left;
    const double share = std::clamp((at[i] - t[left]) / (t[left + 1] - t[left]), 0.0, 1.0);
    result.row(i) = (1 - share) * columns.row(left) + share * columns.row(left + 1);
  }
  return result;
}

double encoder_step(const Eigen::Ref<const Eigen::VectorXd>& q) {
  double smallest = 1e300, largest = 0;
  for (Index k = 1; k < q.size(); ++k) {
    const double step = std::fabs(q[k] - q[k - 1]);
    largest = std::max(largest, step);
    if (step > 1e-12) smallest = std::min(smallest, step);
  }
  if (smallest > largest) return 0;
  Index counted = 0, multiples = 0;
  for (Index k = 1; k < q.size(); ++k) {
    const double steps = std::fabs(q[k] - q[k - 1]) / smallest;
    if (steps < 0.5 || steps > 10) continue;  // of more the first one's rounding makes any number
    ++counted;
    multiples += std::fabs(steps - std::round(steps)) < 0.02 * steps + 0.02;
  }
  return counted > 20 && static_cast<double>(multiples) > 0.9 * static_cast<double>(counted) ? smallest : 0;
}

void resample(Log& log, double step) {
  const double length = log.t[log.t.size() - 1] - log.t[0];
  const auto count = static_cast<Index>(std::floor(length / step * (1 + 1e-12))) + 1;
  const Eigen::VectorXd grid =
      Eigen::VectorXd::LinSpaced(count, 0, static_cast<double>(count - 1)).array() * step + log.t[0];
  for (Eigen::MatrixXd* signal : {&log.q, &log.dq, &log.ddq, &log.tau, &log.qlink}) {
    if (signal->size() > 0) *signal = interpolate(*signal, log.t, grid);
  }
  log.t = grid;
}

void unwrap(Eigen::Ref<Eigen::VectorXd> angle) {
  constexpr double turn = 2 * std::numbers::pi;
  double offset = 0;
  for (Index i = 1; i < angle.size(); ++i) {
    const double jump = angle[i] + offset - angle[i - 1];
    if (std::abs(std::abs(jump) - turn) < 1.0) offset -= std::copysign(turn, jump);
    angle[i] += offset;
  }
}

}  // namespace fxdyn
