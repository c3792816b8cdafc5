#pragma once

#include <optional>
#include <string>
#include <vector>

#include "host_tools/diagnose/options.hpp"
#include "host_tools/effects/forward.hpp"
#include "host_tools/regression/dataset.hpp"

namespace fxdyn::diagnosis {

/// Short impacts in a joint's torque.
struct Impacts {
  double per_second = 0, healthy = 0;  ///< today; in the healthy session
  double largest = 0;                  ///< above the band [N*m | N] ..
  std::string log;                     ///< .. and where it is
  double t = 0;                        ///< .. by the log's clock [s]
};

/// What a few samples hold and the torque's filter takes away, of joints that the healthy session shows less of: parts
/// that strike as a gap closes, a loose connector. Of the error h = e - lowpass(e), e = tau - predict(model), what is
/// beyond 6 standard deviations (of the log, from its median) and what friction may change by where the velocity is
/// uncertain (friction_swing) counts once every 20 ms. Today's train logs and the
/// validate logs, where there are any, must each have three times as many a second as the healthy session.
/// @param now at least one log @param healthy the model of `before`
/// @returns by joint; nothing without a healthy session
std::vector<std::optional<Impacts>> find_impacts(const IdentifiedModel& model, const std::vector<ProcessedLog>& now,
                                                 const IdentifiedModel& healthy,
                                                 const std::vector<ProcessedLog>& before, const ImpactOptions& options);

}  // namespace fxdyn::diagnosis
