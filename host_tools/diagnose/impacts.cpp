#include "host_tools/diagnose/impacts.hpp"

#include <algorithm>
#include <cmath>

#include "host_tools/diagnose/velocity_doubt.hpp"
#include "host_tools/effects/identified_model.hpp"
#include "host_tools/support/parallel.hpp"

namespace fxdyn::diagnosis {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Median of a normal variable's magnitude in standard deviations: Phi^-1(3 / 4).
constexpr double median_of_sigma = 0.6745;

/// Impacts of one joint in some logs.
struct Count {
  double impacts = 0, seconds = 0;
  Impacts worst;

  double per_second() const { return seconds > 0 ? impacts / seconds : 0; }
};

/// Dry friction turns somewhere between the samples about a reversal, so that what one sample has of it says nothing: a
/// straight line between those before and after. Where the velocity changes its sign for longer, the joint rests.
void bridge_reversals(VectorXd& error, const VectorXd& dq) {
  constexpr Index longest = 4;  // samples; two see a reversal, and noise may turn the velocity once more
  const auto turns = [&](Index k) { return k + 1 < dq.size() && dq[k - 1] * dq[k + 1] < 0; };
  for (Index k = 1; k + 1 < error.size(); ++k) {
    if (!turns(k)) continue;
    Index end = k + 1;
    while (turns(end)) ++end;
    if (end - k <= longest && end < error.size()) {
      const double step = (error[end] - error[k - 1]) / static_cast<double>(end - k + 1);
      for (Index i = k; i < end; ++i) error[i] = error[i - 1] + step;
    }
    k = end;
  }
}

double median_size(const Eigen::Ref<const VectorXd>& of) {
  std::vector<double> sizes(of.begin(), of.end());
  for (double& size : sizes) size = std::fabs(size);
  const auto middle = sizes.begin() + of.size() / 2;
  std::nth_element(sizes.begin(), middle, sizes.end());
  return *middle;
}

/// @param error measured less predicted torque of the joint, all samples @param friction the model's, of the joint
void add(Count& to, const ProcessedLog& log, std::size_t joint, VectorXd error, const JointFit& friction,
         const ImpactOptions& options) {
  const Index count = log.last - log.first;
  const VectorXd predicted = log.tau.col(static_cast<Index>(joint)) - error;  // its load, without the impacts
  VectorXd swing = log.joint_velocity(static_cast<Index>(joint));             // a long log's columns: as few as will do
  bridge_reversals(error, swing);
  swing = friction_swing(log, joint, friction, swing, predicted, options.of_velocity);
  error -= log.filter_columns(error);
  const auto above = error.segment(log.first, count);
  const double sigma = median_size(above) / median_of_sigma;
  to.seconds += static_cast<double>(count) * log.step_s;
  if (!(sigma > 0)) return;  // most of it is one step of the torque's
  const auto apart = static_cast<Index>(options.together_s / log.step_s);
  Index last = -apart - 1;
  for (Index k = 0; k < count; ++k) {
    const double size = std::fabs(above[k]);
    if (!(size >= options.beyond * sigma + swing[log.first + k])) continue;
    if (size > to.worst.largest) {
      to.worst.largest = size;
      to.worst.log = log.name;
      to.worst.t = log.t[log.first + k];
    }
    if (k - last > apart) to.impacts += 1;
    last = k;
  }
}

}  // namespace

std::vector<std::optional<Impacts>> find_impacts(const IdentifiedModel& model, const std::vector<ProcessedLog>& now,
                                                 const IdentifiedModel& healthy,
                                                 const std::vector<ProcessedLog>& before,
                                                 const ImpactOptions& options) {
  const auto n = static_cast<std::size_t>(now.front().tau.cols());
  std::vector<std::optional<Impacts>> out(n);
  if (before.empty()) return out;
  std::vector<Count> train(n), judges(n), old(n);
  const auto count = [n, &options](const IdentifiedModel& of, const std::vector<ProcessedLog>& logs, auto&& list_of) {
    for (const ProcessedLog& log : logs) {
      MatrixXd error = log.tau;
      add_prediction(-1, of, log, error);
      std::vector<Count>& list = list_of(log);
      parallel_for(
          n, [&](std::size_t j) { add(list[j], log, j, error.col(static_cast<Index>(j)), of.joints[j], options); });
    }
  };
  count(model, now,
        [&](const ProcessedLog& log) -> std::vector<Count>& { return log.role == Role::validate ? judges : train; });
  count(healthy, before, [&](const ProcessedLog&) -> std::vector<Count>& { return old; });
  for (std::size_t j = 0; j < n; ++j) {
    const double allowed = options.times * (old[j].impacts + options.added) / std::max(old[j].seconds, 1e-9);
    const bool judged = judges[j].seconds > 0;
    if (train[j].per_second() < allowed || (judged && judges[j].per_second() < allowed)) continue;
    const Count& worst = judged && judges[j].worst.largest > train[j].worst.largest ? judges[j] : train[j];
    out[j] = worst.worst;
    out[j]->per_second = (train[j].impacts + judges[j].impacts) / (train[j].seconds + judges[j].seconds);
    out[j]->healthy = old[j].per_second();
  }
  return out;
}

}  // namespace fxdyn::diagnosis
