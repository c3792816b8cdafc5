#pragma once

#include <Eigen/Dense>
#include <string>
#include <vector>

#include "host_tools/diagnose/explore.hpp"

namespace fxdyn::diagnosis {

/// What a session that is known to be healthy has beside the nominal model: learned, not reported.
struct HealthySession {
  Models models;                          ///< its effects have no names
  std::vector<EffectCandidate> effects;   ///< what was found
  std::vector<std::size_t> structured{};  ///< joints at which more is left than these explain
  Eigen::VectorXd error{};                ///< judged_error(), by joint
};

/// @param nominal the session's own model as the current one @param logs its logs, as today's
/// @param task the search of today's logs
HealthySession learn_healthy(Models nominal, const std::vector<SessionLog>& logs, const SearchTask& task,
                             Progress& progress);

/// Whether the first one errs less, in the geometric mean of all joints.
bool errs_less(const HealthySession& one, const HealthySession& other);

}  // namespace fxdyn::diagnosis
