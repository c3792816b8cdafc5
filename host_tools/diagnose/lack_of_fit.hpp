#pragma once

#include "host_tools/diagnose/features.hpp"
#include "host_tools/diagnose/linearised.hpp"
#include "host_tools/diagnose/options.hpp"

namespace fxdyn::diagnosis {

struct LackOfFit {
  double state_p = 1;  ///< chance that noise looks as much like a function of the state
  double time_p = 1;   ///< .. like something periodic or slow in time
  /// .. like a function of a variable that is neither the own motion nor the load, beside those of these; where state_p
  /// says structure
  double elsewhere_p = 1;
  bool structured(const LackOfFitOptions& options) const { return state_p < options.state || time_p < options.time; }
};

/// Is there structure in what a fit leaves of a joint, on the rows that fit? All functions together see anything, and
/// each family of them its own kind where that is small (Bonferroni over the families). The statistics' distribution
/// comes from the healthy session's residual, else from the same residual at other times: noise of any colour counts as
/// noise.
/// @param alone the same columns fitted to the healthy session only; null where there is none
LackOfFit lack_of_fit(const Linearised& problem, std::size_t joint, const LinearFit& fit, const LinearFit* alone,
                      const Eigen::MatrixXd& features);

/// Share of the squared residual of a fit on the blocks that is a function of the state, or of the rest a matter of
/// time (lines, slow changes), the expected part of noise taken off; 0..1.
/// @param healthy of the blocks of the healthy session instead of today's, where matters of time are not looked for
double structured_share(const Linearised& problem, std::size_t joint, const LinearFit& fit,
                        const Eigen::MatrixXd& features, const std::vector<std::size_t>& blocks, bool healthy = false);

}  // namespace fxdyn::diagnosis
