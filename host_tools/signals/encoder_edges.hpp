#pragma once

#include <Eigen/Dense>

namespace fxdyn {

/// Position from an encoder's edges. While a joint moves more slowly than one count a sample, an encoder shows a
/// staircase: what it knows is when the position crosses the edge between two counts. There the position is exact, and
/// between edges it is taken as linear in time (Merry, van de Molengraft, Steinbuch 2010, Mechatronics 20, "encoder
/// events"). Filtering the staircase instead makes a pulse of velocity of each count.
///
/// A sample whose neighbours have other counts stays as it is, where the joint is fast or flickers between two counts.
/// No value leaves its own count, since both edges bound it. Before the first edge and after the last one the position
/// rests.
/// @param q samples at equal intervals [rad | m]
/// @param step of the encoder [rad | m]
Eigen::VectorXd between_edges(const Eigen::Ref<const Eigen::VectorXd>& q, double step);

}  // namespace fxdyn
