#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "host_tools/regression/metrics_result.hpp"

namespace fxdyn {

/// Errors of the stages at one joint.
struct StageFigures {
  std::vector<PooledError> shown;             ///< on the logs that are shown
  std::vector<std::optional<double>> judged;  ///< on what judges; none: not known
  std::size_t exported = 0;                   ///< the stage that the joint has in model.json
  /// Another stage is better than the exported one by 2 %: on the logs that are shown, or on what judges.
  bool another_is_better_on_shown() const;
  bool another_is_better_on_judging() const;
};
StageFigures stage_figures(const MetricsResult& result, Role role, std::size_t joint);

}  // namespace fxdyn
