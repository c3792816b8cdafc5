#pragma once

#include <Eigen/Dense>
#include <cstdint>
#include <functional>

namespace fxdyn {

struct EvolutionSettings {
  int generations = 100, population = 16;
  double step = 0.3;  ///< first standard deviation of each coordinate
  std::uint64_t seed = 1;
};

/// Smallest value of an objective without gradients: evolution strategy with covariance adaptation (Hansen, "The CMA
/// Evolution Strategy: A Tutorial", 2016: weighted recombination, step-size control, rank-one and rank-mu update).
/// A generation is evaluated on all cores; the result depends on the seed only. Returns the best point seen, which may
/// be `start`. `each_generation` is called from this thread.
Eigen::VectorXd minimise(const std::function<double(const Eigen::VectorXd&)>& objective, const Eigen::VectorXd& start,
                         const EvolutionSettings& settings, const std::function<void()>& each_generation);

}  // namespace fxdyn
