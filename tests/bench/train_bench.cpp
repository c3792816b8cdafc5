// The sweep over ridge and nodes that a search of the BLS's hyperparameters makes, against the straightforward way.

#include <benchmark/benchmark.h>

#include <array>
#include <cmath>

#include "host_tools/random.hpp"
#include "host_tools/train/ridge.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr Index rows = 15000, nodes = 120;
constexpr std::array<double, 8> ridges{1e-5, 1e-4, 3e-4, 1e-3, 3e-3, 1e-2, 3e-2, 1e-1};
constexpr std::array<Index, 4> sizes{20, 40, 80, 120};

struct Data {
  MatrixXd x{rows, nodes};
  VectorXd y{rows};
  Data() {
    Random random(1);
    for (Index c = 0; c < nodes; ++c) {
      for (Index r = 0; r < rows; ++r) x(r, c) = std::tanh(random.normal());
    }
    for (Index r = 0; r < rows; ++r) y[r] = x(r, 0) + random.normal();
  }
};

const Data& data() {
  static const Data d;
  return d;
}

/// Training error of all candidates: 32 a sweep.
void ridge_sweep_moments(benchmark::State& state) {
  const Data& d = data();
  for (auto _ : state) {
    Moments moments(nodes);
    moments.add(d.x, d.y);
    double least = 1e300;
    for (const double ridge : ridges) {
      GrowingRidge grown(moments, ridge);
      for (const Index n : sizes) least = std::min(least, moments.mean_square(grown.solve(n)));
    }
    benchmark::DoNotOptimize(least);
  }
}
BENCHMARK(ridge_sweep_moments)->Unit(benchmark::kMillisecond);

void ridge_sweep_dense(benchmark::State& state) {
  const Data& d = data();
  for (auto _ : state) {
    double least = 1e300;
    for (const double ridge : ridges) {
      for (const Index n : sizes) {
        const auto x = d.x.leftCols(n);
        MatrixXd gram = x.transpose() * x;
        gram.diagonal().array() += ridge * static_cast<double>(rows);
        const VectorXd w = gram.ldlt().solve(x.transpose() * d.y);
        least = std::min(least, (d.y - x * w).squaredNorm() / static_cast<double>(rows));
      }
    }
    benchmark::DoNotOptimize(least);
  }
}
BENCHMARK(ridge_sweep_dense)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace fxdyn
