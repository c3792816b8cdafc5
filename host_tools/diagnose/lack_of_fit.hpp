#pragma once

#include "host_tools/diagnose/linearised.hpp"

namespace fxdyn::diagnosis {

/// Functions of the state that name no effect, for one joint: sines and cosines of all positions, velocities and their
/// products, paths with memory, random Fourier features of (q, dq, ddq, load). Filtered, decimated and whitened like
/// everything else; rows x features, zero on the healthy session's rows unless `healthy`.
Eigen::MatrixXd features(const Linearised& at, std::size_t joint, bool healthy = false);

struct LackOfFit {
  double state_p = 1;  ///< chance that noise looks as much like a function of the state
  double time_p = 1;   ///< .. like something periodic or slow in time
  bool structured() const { return state_p < 1e-6 || time_p < 1e-6; }
};

/// Is there structure in what a fit leaves of a joint, on the rows that fit? The statistic's distribution comes from
/// the same residual at other times, so that noise of any colour counts as noise.
LackOfFit lack_of_fit(const Linearised& at, std::size_t joint, const LinearFit& fit, const Eigen::MatrixXd& features);

/// Share of the squared residual of a fit on the blocks that is a function of the state, or of the rest a matter of
/// time (lines, slow changes), the expected part of noise taken off; 0..1.
double structured_share(const Linearised& at, std::size_t joint, const LinearFit& fit, const Eigen::MatrixXd& features,
                        const std::vector<std::size_t>& blocks);

}  // namespace fxdyn::diagnosis
