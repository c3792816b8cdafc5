#pragma once

#include <Eigen/Dense>
#include <optional>
#include <vector>

#include "host_tools/diagnose/linearised.hpp"

namespace fxdyn::diagnosis {

/// A candidate with a better shape, and its columns (Linearised::make()).
struct Refined {
  Group group;
  std::vector<Eigen::MatrixXd> columns;
};

/// The searched shape of a candidate, and the rotor's inertia that comes with it, by interval search around where they
/// are: the coefficients of the candidate and of a fit's columns are solved inside (separable least squares).
/// Nothing: no better shape was found.
std::optional<Refined> refined(const Linearised& problem, const LinearFit& beside, const Group& start);

}  // namespace fxdyn::diagnosis
