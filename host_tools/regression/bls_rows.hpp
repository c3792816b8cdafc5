#pragma once

#include "host_tools/effects/joint_fit.hpp"
#include "host_tools/regression/dataset.hpp"

namespace fxdyn {

/// Whether bls_rows() knows its inputs and activation: physical ones or bristles, and tanh.
bool has_fast_rows(const BroadLearningFit& bls);

/// Columns of a joint's BLS over a log as fits use them, filtered and decimated: broad_learning_basis() of every
/// sample, rows x (inputs + nodes), to 1e-13 of their size 1. Eight nodes at a time stay in the processor's cache from
/// the argument to the kept row. Only of a BLS with has_fast_rows().
Eigen::MatrixXd bls_rows(const BroadLearningFit& bls, const ProcessedLog& log, Eigen::Index joint);

}  // namespace fxdyn
