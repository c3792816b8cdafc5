#pragma once

#include <Eigen/Dense>
#include <cstdint>

#include "host_tools/support/random.hpp"

namespace fxdyn {

/// argmin_W 1/(2 N) |A W - Y|^2 + lambda sum|W|, N the rows, by the alternating direction method of multipliers, a
/// fixed number of rounds. Elements that do not pay are exactly zero.
Eigen::MatrixXd lasso(const Eigen::MatrixXd& a, const Eigen::MatrixXd& y, double lambda);

/// W_1 .. W_m of the windows below, side by side: (inputs + 1) x (windows features), the bias last.
Eigen::MatrixXd sparse_feature_weights(const Eigen::MatrixXd& u, Eigen::Index windows, Eigen::Index features,
                                       Random& random);

/// Input weights of nodes on sparse-autoencoder features (Chen, Liu 2018): nodes x (inputs + 1), the bias last.
///   A_i = U R_i                            random features of a window, U = [u, 1]; each scaled to +-1
///   W_i = argmin |A_i W - U|^2 + L1        how the features give the inputs back
///   Z_i = U W_i^T                          the window's features: few features depend on an input
///   x = [Z_1 .. Z_m, 1] W_h                arguments of the nodes, W_h random, its columns orthonormal in groups
/// All of this is linear, so it folds: w = [W_1^T .. W_m^T, e] W_h. Each node's largest argument on the data becomes 2,
/// as random weights have it. Fewer nodes are the first of more.
/// @param u inputs, one row a sample
Eigen::MatrixXd sparse_weights(const Eigen::MatrixXd& u, Eigen::Index nodes, Eigen::Index windows,
                               Eigen::Index features, std::uint64_t seed);

}  // namespace fxdyn
