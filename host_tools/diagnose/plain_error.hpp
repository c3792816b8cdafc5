#pragma once

#include <Eigen/Dense>
#include <vector>

#include "host_tools/diagnose/options.hpp"
#include "host_tools/diagnose/session_log.hpp"
#include "host_tools/effects/forward.hpp"

namespace fxdyn::diagnosis {

/// Mean squares of the filtered error on the logs that judge, by joint; empty: there are none.
Eigen::VectorXd plain_error(const IdentifiedModel& model, const std::vector<SessionLog>& logs);
/// Whether a joint's error is larger than before by more than a name may raise it. @param before, after plain_error()
bool is_worse(const GateOptions& options, const Eigen::VectorXd& before, const Eigen::VectorXd& after,
              Eigen::Index joint);

/// By joint: whether a model errs more there than the one before. On the validate logs by more than a name may raise
/// the error; where there are none, on the train logs by more than a fit of them can: blocks judge fits that are
/// linear, and so none that lost its way (a shape without a hold, two columns that are nearly one).
std::vector<bool> harmed_joints(const GateOptions& options, const IdentifiedModel& before, const IdentifiedModel& after,
                                const std::vector<SessionLog>& logs);

/// How many of them are.
std::size_t count_harmed(const GateOptions& options, const IdentifiedModel& before, const IdentifiedModel& after,
                         const std::vector<SessionLog>& logs);

}  // namespace fxdyn::diagnosis
