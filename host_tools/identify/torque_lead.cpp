#include "host_tools/identify/torque_lead.hpp"

#include <algorithm>
#include <cmath>

namespace fxdyn {
namespace {

/// Logarithm of each joint's held-out error.
Eigen::VectorXd logarithms(const std::vector<Judgement>& judgements) {
  Eigen::VectorXd out(static_cast<Eigen::Index>(judgements.size()));
  for (std::size_t j = 0; j < judgements.size(); ++j)
    out[static_cast<Eigen::Index>(j)] = std::log(std::max(judgements[j].rmse, 1e-300));
  return out;
}

}  // namespace

void find_torque_lead(Fitter& fitter, double cutoff_hz, const StructureOptions& options) {
  constexpr int half = 6;
  const std::vector<Eigen::MatrixXd> torque = fitter.filtered_torque();
  const auto judge = [&](double lead) {
    fitter.set_torque_lead(lead, torque);
    return logarithms(fitter.held_out());
  };
  const Eigen::VectorXd none = judge(0);
  const double grid = std::min(options.longest_lead / cutoff_hz, options.longest_lead_s) / half;
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
  const double worth = -std::log(1 - options.worth_keeping);
  double agree = 0;
  for (Eigen::Index j = 0; j < none.size(); ++j)
    agree += none[j] - best[j] > worth &&
             std::fabs(own_lead[j] - best_lead) < options.same_lead * std::fabs(best_lead) + 0.1 * grid;
  const bool keep =
      !at_end && (none - best).mean() > worth && agree >= options.agreeing * static_cast<double>(none.size());
  fitter.set_torque_lead(keep ? best_lead : 0, torque);
}

}  // namespace fxdyn
