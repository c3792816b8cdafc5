// The sweep over ridge and nodes that a search of the BLS's hyperparameters makes, against the straightforward way.

#include <benchmark/benchmark.h>

#include <array>
#include <cmath>

#include "host_tools/regression/bls_rows.hpp"
#include "host_tools/regression/fitter.hpp"
#include "host_tools/support/random.hpp"
#include "host_tools/train/ridge.hpp"
#include "host_tools/train/tuning.hpp"
#include "tests/support/chains.hpp"
#include "tests/support/filter.hpp"

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

/// What a search of a BLS's hyperparameters asks for, as it asks: Fitter::held_out_with(), from the motion on. One
/// joint, so that nothing but that joint is fitted either way; 15 000 rows fit, 5 000 judge, at a fifth of the sampling
/// rate.
struct Search {
  std::vector<ProcessedLog> logs;
  Fitter fitter;
  JointFit design;
  std::vector<MatrixXd> base;  ///< by log: the rigid body's columns, rows x base parameters
  std::vector<VectorXd> torque;

  Search() : logs{log_of(rows, Role::train), log_of(5000, Role::validate)}, fitter(robot(), logs, {nominal()}) {
    design = BlsDesigner(fitter, 0, TrainSettings{})({.nodes = nodes});
    Regressor regressor(fitter.chain());
    for (const ProcessedLog& log : logs) {
      const MotionRows motion = log.link_motion(0, log.samples());
      MatrixXd columns(log.samples(), static_cast<Index>(fitter.base().columns.size()));
      for (Index k = 0; k < log.samples(); ++k) {
        const MatrixXd& y = regressor(motion.q.row(k), motion.dq.row(k), motion.ddq.row(k));
        for (Index c = 0; c < columns.cols(); ++c)
          columns(k, c) = y(0, fitter.base().columns[static_cast<std::size_t>(c)]);
      }
      base.push_back(log.decimate(log.filter_columns(columns)));
      torque.push_back(log.decimate(log.filter_columns(log.tau)).col(0));
    }
  }

  static Robot robot() { return test::Chains(1).robot(1, false); }
  static JointFit nominal() {
    JointFit joint;
    joint.rated_torque = joint.tau_limit = 20;
    joint.q_lower = -2;
    joint.q_upper = 2;
    joint.dq_limit = 4;
    joint.ddq_limit = 20;
    return joint;
  }
  static ProcessedLog log_of(Index kept, Role role) {
    constexpr Index decimation = 5;
    Log log;
    log.role = role;
    log.step_s = 0.002;
    const auto edge = static_cast<Index>(0.3 / log.step_s);
    const Index samples = kept * decimation + 2 * edge;
    log.t = VectorXd::LinSpaced(samples, 0, log.step_s * static_cast<double>(samples - 1));
    log.to_s = log.step_s * static_cast<double>(samples);
    const double phase = role == Role::train ? 0 : 1;
    log.q = log.dq = log.ddq = log.tau = MatrixXd::Zero(samples, 1);
    Random random(role == Role::train ? 1 : 2);
    for (Index k = 0; k < samples; ++k) {
      for (const double w : {0.7, 1.9, 4.3}) {
        const double a = 0.8 / w, at = w * log.t[k] + phase * w;
        log.q(k, 0) += a * std::sin(at);
        log.dq(k, 0) += a * w * std::cos(at);
        log.ddq(k, 0) -= a * w * w * std::sin(at);
      }
      log.tau(k, 0) = 2 * std::tanh(log.dq(k, 0) / 0.03) + log.dq(k, 0) + 0.1 * random.normal();
    }
    return process(std::move(log), test::filter_of(25, 12, 0.3));
  }

  /// Columns of a log with so many nodes: rigid body, then the BLS's.
  MatrixXd columns(std::size_t log, Index count) const {
    MatrixXd out(base[log].rows(), base[log].cols() + bls_count(count));
    out << base[log], bls_rows(*first_nodes(design, count).bls, logs[log], 0);
    return out;
  }
  Index bls_count(Index count) const { return design.bls->input_count() + count; }

  /// Held-out RMSE of one candidate: the full normal equations anew, by Eigen's LDLT.
  double dense(const Eigen::Ref<const MatrixXd>& train, const Eigen::Ref<const MatrixXd>& judge, Index count,
               double ridge) const {
    MatrixXd gram = train.transpose() * train;
    gram.diagonal().tail(bls_count(count)).array() += ridge * static_cast<double>(train.rows());
    const VectorXd w = gram.ldlt().solve(train.transpose() * torque[0]);
    return (torque[1] - judge * w).norm() / std::sqrt(static_cast<double>(judge.rows()));
  }
};

const Search& the_search() {
  static const Search search;
  return search;
}

void held_out_sweep(benchmark::State& state) {
  const Search& search = the_search();
  const std::vector<Index> counts(sizes.begin(), sizes.end());
  const std::vector<double> values(ridges.begin(), ridges.end());
  for (auto _ : state) benchmark::DoNotOptimize(search.fitter.held_out_with(0, search.design, counts, values));
}
BENCHMARK(held_out_sweep)->Unit(benchmark::kMillisecond);

/// From columns that cost nothing.
void held_out_sweep_dense(benchmark::State& state) {
  const Search& search = the_search();
  const MatrixXd train = search.columns(0, nodes), judge = search.columns(1, nodes);
  const std::vector<double> values(ridges.begin(), ridges.end());
  const auto ours = search.fitter.held_out_with(0, search.design, {sizes.begin(), sizes.end()}, values);
  for (auto _ : state) {
    for (std::size_t r = 0; r < ridges.size(); ++r) {
      for (std::size_t s = 0; s < sizes.size(); ++s) {
        const Index count = search.base[0].cols() + search.bls_count(sizes[s]);
        const double rmse = search.dense(train.leftCols(count), judge.leftCols(count), sizes[s], ridges[r]);
        if (std::fabs(rmse - ours[s][r].rmse) > 1e-6 * rmse) state.SkipWithError("not the same error");
      }
    }
  }
}
BENCHMARK(held_out_sweep_dense)->Unit(benchmark::kMillisecond);

/// Columns and all for every candidate.
void held_out_sweep_dense_from_motion(benchmark::State& state) {
  const Search& search = the_search();
  for (auto _ : state) {
    for (const double ridge : ridges) {
      for (const Index count : sizes)
        benchmark::DoNotOptimize(search.dense(search.columns(0, count), search.columns(1, count), count, ridge));
    }
  }
}
BENCHMARK(held_out_sweep_dense_from_motion)->Unit(benchmark::kMillisecond);

/// One candidate of 120 nodes, as a particle of the swarm asks.
void held_out_one(benchmark::State& state) {
  const Search& search = the_search();
  for (auto _ : state) benchmark::DoNotOptimize(search.fitter.held_out_with(0, search.design, {1e-3}));
}
BENCHMARK(held_out_one)->Unit(benchmark::kMillisecond);

void held_out_one_dense_from_motion(benchmark::State& state) {
  const Search& search = the_search();
  for (auto _ : state)
    benchmark::DoNotOptimize(search.dense(search.columns(0, nodes), search.columns(1, nodes), nodes, 1e-3));
}
BENCHMARK(held_out_one_dense_from_motion)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace fxdyn
