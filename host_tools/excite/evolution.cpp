#include "host_tools/excite/evolution.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "host_tools/support/parallel.hpp"
#include "host_tools/support/random.hpp"

namespace fxdyn {

Eigen::VectorXd minimise(const std::function<double(const Eigen::VectorXd&)>& objective, const Eigen::VectorXd& start,
                         const EvolutionSettings& settings, const std::function<void()>& each_generation) {
  using Eigen::MatrixXd;
  using Eigen::VectorXd;
  const Eigen::Index n = start.size(), offspring = settings.population, parents = offspring / 2;
  const auto dimension = static_cast<double>(n);

  // The tutorial's defaults (its Table 1).
  VectorXd weights(parents);
  for (Eigen::Index i = 0; i < parents; ++i) {
    weights[i] = std::log(0.5 * static_cast<double>(offspring + 1)) - std::log(static_cast<double>(i + 1));
  }
  weights /= weights.sum();
  const double mass = 1 / weights.squaredNorm();
  const double c_path = (4 + mass / dimension) / (dimension + 4 + 2 * mass / dimension);
  const double c_step = (mass + 2) / (dimension + mass + 5);
  const double c_one = 2 / ((dimension + 1.3) * (dimension + 1.3) + mass);
  const double c_mu = std::min(1 - c_one, 2 * (mass - 2 + 1 / mass) / ((dimension + 2) * (dimension + 2) + mass));
  const double damping = 1 + 2 * std::max(0.0, std::sqrt((mass - 1) / (dimension + 1)) - 1) + c_step;
  const double usual_length = std::sqrt(dimension) * (1 - 1 / (4 * dimension) + 1 / (21 * dimension * dimension));

  VectorXd mean = start, path = VectorXd::Zero(n), step_path = VectorXd::Zero(n), best = start;
  MatrixXd covariance = MatrixXd::Identity(n, n);
  double step = settings.step, best_value = objective(start);
  Random random(settings.seed);
  MatrixXd drawn(n, offspring);  // each N(0, C)
  std::vector<double> values(static_cast<std::size_t>(offspring));
  std::vector<Eigen::Index> order(values.size());

  for (int generation = 0; generation < settings.generations; ++generation) {
    const Eigen::SelfAdjointEigenSolver<MatrixXd> axes(covariance);
    const VectorXd lengths = axes.eigenvalues().cwiseMax(1e-20).cwiseSqrt();
    for (double& x : drawn.reshaped()) x = random.normal();
    drawn = axes.eigenvectors() * (lengths.asDiagonal() * drawn).eval();
    parallel_for(values.size(),
                 [&](std::size_t i) { values[i] = objective(mean + step * drawn.col(static_cast<Eigen::Index>(i))); });
    std::iota(order.begin(), order.end(), Eigen::Index{0});
    std::stable_sort(order.begin(), order.end(), [&](Eigen::Index a, Eigen::Index b) {
      return values[static_cast<std::size_t>(a)] < values[static_cast<std::size_t>(b)];
    });
    if (const double value = values[static_cast<std::size_t>(order[0])]; value < best_value) {
      best_value = value;
      best = mean + step * drawn.col(order[0]);
    }
    order.resize(static_cast<std::size_t>(parents));
    const MatrixXd chosen = drawn(Eigen::all, order);
    order.resize(values.size());

    const VectorXd move = chosen * weights;
    mean += step * move;
    const VectorXd white = axes.eigenvectors() * (axes.eigenvectors().transpose() * move).cwiseQuotient(lengths);
    step_path = (1 - c_step) * step_path + std::sqrt(c_step * (2 - c_step) * mass) * white;
    const double length = step_path.norm() / usual_length;
    const double settled = 1 - std::pow(1 - c_step, 2 * (generation + 1));
    const double moving = length / std::sqrt(settled) < 1.4 + 2 / (dimension + 1) ? 1 : 0;
    path = (1 - c_path) * path + moving * std::sqrt(c_path * (2 - c_path) * mass) * move;
    const double lost = (1 - moving) * c_path * (2 - c_path);
    covariance = (1 - c_one - c_mu + c_one * lost) * covariance + c_one * path * path.transpose() +
                 c_mu * chosen * weights.asDiagonal() * chosen.transpose();
    step *= std::exp(std::min(1.0, c_step / damping * (length - 1)));
    each_generation();
  }
  return best;
}

}  // namespace fxdyn
