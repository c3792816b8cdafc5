#include "host_tools/diagnose/noise_model.hpp"

#include <algorithm>
#include <cmath>

#include "host_tools/diagnose/autoregression.hpp"
#include "host_tools/diagnose/features.hpp"
#include "host_tools/diagnose/velocity_doubt.hpp"
#include "host_tools/regression/solver.hpp"
#include "host_tools/support/parallel.hpp"

namespace fxdyn::diagnosis {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

/// Standard deviations in the median of a normal variable's magnitude: 1 / Phi^-1(3 / 4).
constexpr double sigma_of_median = 1.4826;

/// Of a function's own square: what it may be of the others and still counts. A numeric choice.
constexpr double dependent = 1e-4;

VectorXd rows_of(const Blocks& blocks, const std::vector<std::size_t>& which, const VectorXd& residual) {
  std::vector<double> out;
  for (const std::size_t b : which) {
    const Block& block = blocks.all[b];
    out.insert(out.end(), residual.data() + block.first, residual.data() + block.first + block.count);
  }
  return Eigen::Map<VectorXd>(out.data(), static_cast<Index>(out.size()));
}

/// A whitened row is as doubtful as those that it is made of.
VectorXd whitened_doubt(const Blocks& blocks, const VectorXd& doubt, const VectorXd& whitening) {
  VectorXd sum = doubt;
  for (const Block& b : blocks.of_log) {
    for (Index lag = 1; lag <= whitening.size() && lag < b.count; ++lag)
      sum.segment(b.first + lag, b.count - lag) +=
          whitening[lag - 1] * whitening[lag - 1] * doubt.segment(b.first, b.count - lag);
  }
  return sum;
}

}  // namespace

double robust_sigma(VectorXd values) {
  values = values.cwiseAbs();
  double* middle = values.data() + values.size() / 2;
  std::nth_element(values.data(), middle, values.data() + values.size());
  return sigma_of_median * *middle;
}

NoiseModel::NoiseModel(const Blocks& blocks, std::vector<VectorXd> whitening, const std::vector<VectorXd>& doubt,
                       double doubtful)
    : blocks_(blocks),
      least_scale_(std::sqrt(1 / (1 + doubtful))),
      whitening_(std::move(whitening)),
      row_scale_(doubt.size()) {
  parallel_for(doubt.size(), [&](std::size_t j) {
    row_scale_[j] = (1 + whitened_doubt(blocks_, doubt[j], whitening_[j]).array()).sqrt().inverse();
  });
}

MatrixXd NoiseModel::apply(std::size_t log, std::size_t joint, const MatrixXd& rows) const {
  const Block& b = blocks_.of_log[log];
  return row_scale_[joint].segment(b.first, b.count).asDiagonal() * prewhitened(rows, whitening_[joint]);
}

bool NoiseModel::is_doubtful(std::size_t joint, Index row) const { return row_scale_[joint][row] < least_scale_; }

double NoiseModel::doubtful_share(std::size_t joint) const {
  const auto doubtful = (row_scale_[joint].array() < least_scale_).count();
  return static_cast<double>(doubtful) / static_cast<double>(row_scale_[joint].size());
}

double NoiseModel::log_scale(std::size_t joint) const {
  double sum = 0;
  for (const std::size_t b : blocks_.fit)
    sum += row_scale_[joint].segment(blocks_.all[b].first, blocks_.all[b].count).array().log().sum();
  return sum;
}

/// A residual without what functions of the state explain of the healthy session's rows: structure is no noise, and an
/// autoregression of it would whiten away whatever is as slow.
VectorXd without_background(const LogColumns& columns, const Blocks& blocks, std::size_t joint, VectorXd e) {
  const std::vector<std::size_t>& structured = columns.background();
  if (std::find(structured.begin(), structured.end(), joint) == structured.end()) return e;
  const std::size_t n = columns.joints();
  const NoiseModel white(blocks, std::vector<VectorXd>(n, VectorXd::Zero(1)),
                         std::vector<VectorXd>(n, VectorXd::Zero(blocks.rows())), 1);
  MatrixXd f = features(columns, white, blocks, joint, true);
  VectorXd y = VectorXd::Zero(e.size());
  for (const Block& b : blocks.of_log) {
    if (b.healthy) {
      y.segment(b.first, b.count) = e.segment(b.first, b.count);
    } else {
      f.middleRows(b.first, b.count).setZero();
    }
  }
  const VectorXd size = f.colwise().norm().transpose();
  f = f * size.unaryExpr([](double s) { return s > 0 ? 1 / s : 0.0; }).asDiagonal();
  MatrixXd gram = f.transpose() * f;
  gram.diagonal().array() += dependent;
  return e - f * SymmetricSolver(gram).solve(f.transpose() * y);
}

NoiseModel estimate_noise(const LogColumns& columns, const BlockSolver& solver, const LinearFit& fit,
                          const std::vector<std::size_t>& quiet, std::vector<VectorXd> whitening) {
  const Blocks& blocks = solver.blocks();
  const std::size_t n = columns.joints();
  const NoiseOptions& options = columns.options().noise;
  std::vector<VectorXd> coefficients(n), doubts(n);
  parallel_for(n, [&](std::size_t j) {
    const auto k = static_cast<Index>(j);
    const VectorXd e = solver.residual(j, fit);
    const double sigma = std::max(robust_sigma(rows_of(blocks, quiet, e)), 1e-12 / std::sqrt(solver.weights()[k]));
    doubts[j].resize(blocks.rows());
    const VectorXd of_noise = without_background(columns, blocks, j, e);
    std::vector<VectorXd> parts;
    for (std::size_t l = 0; l < columns.logs().size(); ++l) {
      const Block& b = blocks.of_log[l];
      const VectorXd u = velocity_doubt(columns.logs()[l].log, j, columns.joint(l, j), columns.motion(l).dq.col(k),
                                        columns.robot(l).structural().col(k), sigma);
      doubts[j].segment(b.first, b.count) = u;
      const bool use = columns.has_baseline() ? b.healthy : b.fits;
      if (use) parts.emplace_back((of_noise.segment(b.first, b.count).array() / (1 + u.array()).sqrt()).matrix());
    }
    coefficients[j] = autoregression(parts);
  });
  return {blocks, whitening.empty() ? std::move(coefficients) : std::move(whitening), doubts, options.doubtful};
}

}  // namespace fxdyn::diagnosis
