#pragma once

#include <Eigen/Dense>
#include <vector>

#include "host_tools/diagnose/blocks.hpp"
#include "host_tools/diagnose/options.hpp"

namespace fxdyn::diagnosis {

/// Something in the residual that is a matter of time.
struct TimeStructure {
  double p = 1;      ///< chance that noise looks as much like it
  double share = 0;  ///< of the squared residual
};

/// Lines in the periodograms of today's blocks against their neighbourhood; blocks that touch are one.
TimeStructure spectral_lines(const std::vector<SessionLog>& logs, const Blocks& blocks, const Eigen::VectorXd& e,
                             const std::vector<std::size_t>& of, const LackOfFitOptions& options);

/// Means of today's blocks over stretches against those of the healthy session, all of its blocks.
TimeStructure slow_changes(const std::vector<SessionLog>& logs, const Blocks& blocks, const Eigen::VectorXd& e,
                           const std::vector<std::size_t>& of, const LackOfFitOptions& options);

/// Chance of F(freedom, other) beyond `ratio` (Paulson's normal approximation).
double chance(double ratio, double freedom, double other);

}  // namespace fxdyn::diagnosis
