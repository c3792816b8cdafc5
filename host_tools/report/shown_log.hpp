#pragma once

#include <Eigen/Dense>
#include <memory>
#include <vector>

#include "host_tools/effects/forward.hpp"
#include "host_tools/page/plot.hpp"
#include "host_tools/regression/dataset.hpp"

namespace fxdyn {

struct ReportInput;

/// A log as the page draws it: samples x joints without the filter's transients, torques filtered at the torque
/// cut-off [N*m | N].
struct ShownLog {
  const ProcessedLog* log = nullptr;
  Eigen::VectorXd t;  ///< [s]
  Eigen::MatrixXd q, dq, ddq, measured, predicted, residual;
  Eigen::MatrixXd load;  ///< torque of the model's rigid body
};

/// Torque of the model over the log, as ShownLog::predicted.
Eigen::MatrixXd shown_torque(const IdentifiedModel& model, const ProcessedLog& log);

/// Those of the page's logs that have torque.
std::vector<ShownLog> shown_logs(const IdentifiedModel& model, const std::vector<ProcessedLog>& logs);
/// The same, computed once for a page: several sections draw them.
const std::vector<ShownLog>& shown_logs(const ReportInput& input);

/// One column of all logs, one after another, with NaN between two logs.
Eigen::VectorXd joined(const std::vector<ShownLog>& logs, Eigen::MatrixXd ShownLog::*of, Eigen::Index joint);
/// The same of columns that belong to the logs, one each.
Eigen::VectorXd joined(const std::vector<Eigen::VectorXd>& columns);

/// Root of a residual's power spectral density up to 1.5 times the torque's cut-off [N*m/Hz^0.5 | N/Hz^0.5].
Trace spectrum_curve(const Eigen::VectorXd& residual, const ProcessedLog& log, const char* colour, const char* title);
/// The joint's noise as white noise below the cut-off: noise^2 = density * cut-off. No curve where it is not known.
std::vector<Trace> noise_curve(const ProcessedLog& log, Eigen::Index joint);

}  // namespace fxdyn
