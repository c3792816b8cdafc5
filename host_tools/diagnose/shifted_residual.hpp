#pragma once

#include <Eigen/Dense>

#include "host_tools/diagnose/blocks.hpp"
#include "host_tools/support/random.hpp"

namespace fxdyn::diagnosis {

/// Values of a block at other times, `by` rows later, its end followed by its beginning: the same noise, which has
/// nothing to do with the motion.
inline void shift(Eigen::Index by, const Eigen::VectorXd& values, const Block& block, Eigen::Ref<Eigen::VectorXd> out) {
  out.segment(block.first, block.count - by) = values.segment(block.first + by, block.count - by);
  out.segment(block.first + block.count - by, by) = values.segment(block.first, by);
}

/// The same, moved by a random part of the block, not by less than 8 % either way.
inline void shift(Random& random, const Eigen::VectorXd& residual, const Block& block,
                  Eigen::Ref<Eigen::VectorXd> out) {  // NOLINT(performance-unnecessary-value-param): a reference itself
  const auto by = static_cast<Eigen::Index>(random.uniform(0.08, 0.92) * static_cast<double>(block.count));
  shift(by, residual, block, out);
}

}  // namespace fxdyn::diagnosis
