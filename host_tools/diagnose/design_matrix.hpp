#pragma once

#include <vector>

#include "host_tools/diagnose/block_solver.hpp"
#include "host_tools/diagnose/log_columns.hpp"
#include "host_tools/diagnose/unknowns.hpp"

namespace fxdyn::diagnosis {

/// The measurement as a linear function of the unknowns, around the models of the columns:
///   y = tau - predict(model) + J x0 = J x + noise,
/// torque and columns filtered and decimated alike. @returns by joint x, y and the columns that it feels
std::vector<JointRows> design_matrix(const LogColumns& columns, const std::vector<Unknown>& unknowns,
                                     const Blocks& blocks);

}  // namespace fxdyn::diagnosis
