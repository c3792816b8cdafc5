#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <numbers>
#include <vector>

#include "host_tools/log/log.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Weights of the values at `points` in the derivatives at 0, column k for the k-th one (Fornberg, "Generation of
/// finite difference formulas on arbitrarily spaced grids", Math. Comp. 1988).
MatrixXd derivative_weights(const VectorXd& points, Index highest) {
  const Index n = points.size();
  MatrixXd weights = MatrixXd::Zero(n, highest + 1);
  weights(0, 0) = 1;
  double c1 = 1;
  for (Index i = 1; i < n; ++i) {
    double c2 = 1;
    for (Index j = 0; j < i; ++j) {
      const double c3 = points[i] - points[j];
      c2 *= c3;
      if (j == i - 1) {
        for (Index k = std::min(i, highest); k >= 0; --k) {
          const double below = k > 0 ? static_cast<double>(k) * weights(i - 1, k - 1) : 0.0;
          weights(i, k) = c1 * (below - points[i - 1] * weights(i - 1, k)) / c2;
        }
      }
      for (Index k = std::min(i, highest); k >= 0; --k) {
        const double below = k > 0 ? static_cast<double>(k) * weights(j, k - 1) : 0.0;
        weights(j, k) = (points[i] * weights(j, k) - below) / c3;
      }
    }
    c1 = c2;
  }
  return weights;
}

/// Weights for `width` consecutive samples of which number `at` is the one to differentiate at.
VectorXd stencil(Index width, Index at, Index derivative) {
  const VectorXd points =
      VectorXd::LinSpaced(width, 0.0, static_cast<double>(width - 1)).array() - static_cast<double>(at);
  return derivative_weights(points, derivative).col(derivative);
}

/// Central differences of seven samples; near the ends `end_width` samples, so that the order stays the same.
MatrixXd derive(const Eigen::Ref<const MatrixXd>& columns, double step_s, Index derivative, Index end_width) {
  constexpr Index half = 3;
  const Index n = columns.rows();
  MatrixXd result = MatrixXd::Zero(n, columns.cols());
  if (n <= derivative) return result;
  const double scale = 1 / std::pow(step_s, static_cast<double>(derivative));
  const Index width = std::min(end_width, n);
  const Index ends = n > 2 * half ? half : n;  // a short log has no middle
  const VectorXd middle = n > 2 * half ? VectorXd(stencil(2 * half + 1, half, derivative) * scale) : VectorXd();
  if (const Index inner = n - 2 * ends; inner > 0) {
    for (Index k = 0; k < middle.size(); ++k)
      result.middleRows(ends, inner) += middle[k] * columns.middleRows(ends - half + k, inner);
  }
  for (Index i = 0; i < n; ++i) {
    if (i == ends) i = std::max(ends, n - ends);
    if (i == n) break;
    const Index from = i < ends ? 0 : n - width;
    const VectorXd weights = stencil(width, i - from, derivative) * scale;
    for (Index c = 0; c < columns.cols(); ++c) result(i, c) = weights.dot(columns.col(c).segment(from, width));
  }
  return result;
}

}  // namespace

ZeroPhaseFilter::ZeroPhaseFilter(double cutoff_hz, double step_s, int order) : cutoff_hz_(cutoff_hz), step_s_(step_s) {
  if (!(cutoff_hz > 0) || order < 1 || cutoff_hz >= 0.95 * 0.5 / step_s) return;
  // Bilinear transform, the cut-off kept by prewarping: analog pole p gives the discrete pole (1 + p) / (1 - p).
  const double warped = std::tan(std::numbers::pi * cutoff_hz * step_s);
  for (int k = 0; k < order / 2; ++k) {
    const double angle = std::numbers::pi * (2 * k + 1) / (2 * order) + std::numbers::pi / 2;
    const std::complex<double> p = std::polar(warped, angle);
    const std::complex<double> z = (1.0 + p) / (1.0 - p);
    const double a1 = -2 * z.real(), a2 = std::norm(z);
    const double gain = std::norm(p) / std::norm(1.0 - p);  // 1 at frequency 0: (1 + a1 + a2) / 4
    sections_.push_back({gain, 2 * gain, gain, a1, a2});
  }
  if (order % 2 == 1) {
    const double gain = warped / (1 + warped);
    sections_.push_back({gain, gain, 0, (warped - 1) / (1 + warped), 0});
  }
}

/// `lanes` columns side by side from column `from`: each step waits for the one before it, and columns fill the wait.
template <Index lanes>
void ZeroPhaseFilter::apply_to(const Eigen::Ref<const MatrixXd>& columns, Index from, MatrixXd& result) const {
  using Lanes = Eigen::Array<double, 1, lanes>;
  const Index n = columns.rows();
  // Far enough for the start to be forgotten to 1e-9: 4.5 times the 1 % of edge_samples().
  const Index pad = std::min(n - 1, edge_samples() * 9 / 2 + 1);
  std::vector<Lanes> work(static_cast<std::size_t>(n + 2 * pad));
  // In place, from state at rest on the first value.
  const auto pass = [this](auto begin, auto end) {
    for (const Section& s : sections_) {
      const Lanes first = *begin;
      Lanes z2 = (s.b2 - s.a2) * first;
      Lanes z1 = (s.b1 - s.a1) * first + z2;
      for (auto it = begin; it != end; ++it) {
        const Lanes x = *it;
        const Lanes y = s.b0 * x + z1;
        z1 = s.b1 * x - s.a1 * y + z2;
        z2 = s.b2 * x - s.a2 * y;
        *it = y;
      }
    }
  };
  const auto at = [&](Index i) -> Lanes& { return work[static_cast<std::size_t>(pad + i)]; };
  // A zero-phase filter leaves straight lines alone: the one through the ends is taken out, so that the reflection is
  // about zero and ramps pass exactly.
  Lanes start, slope;
  for (Index c = 0; c < lanes; ++c) {
    start[c] = columns(0, from + c);
    slope[c] = (columns(n - 1, from + c) - start[c]) / static_cast<double>(n - 1);
  }
  for (Index c = 0; c < lanes; ++c) {
    for (Index i = 0; i < n; ++i) at(i)[c] = columns(i, from + c) - (start[c] + slope[c] * static_cast<double>(i));
  }
  at(n - 1).setZero();
  for (Index i = 1; i <= pad; ++i) {
    at(-i) = -at(i);
    at(n - 1 + i) = -at(n - 1 - i);
  }
  pass(work.begin(), work.end());
  pass(work.rbegin(), work.rend());
  for (Index c = 0; c < lanes; ++c) {
    for (Index i = 0; i < n; ++i) result(i, from + c) = at(i)[c] + (start[c] + slope[c] * static_cast<double>(i));
  }
}

MatrixXd ZeroPhaseFilter::apply(const Eigen::Ref<const MatrixXd>& columns) const {
  if (sections_.empty() || columns.rows() < 3) return columns;
  MatrixXd result(columns.rows(), columns.cols());
  Index from = 0;
  const auto take = [&]<Index lanes>() {
    for (; from + lanes <= columns.cols(); from += lanes) apply_to<lanes>(columns, from, result);
  };
  take.operator()<8>();
  take.operator()<4>();
  take.operator()<2>();
  take.operator()<1>();
  return result;
}

Index ZeroPhaseFilter::edge_samples() const {
  double radius = 0;  // of the slowest pole
  for (const Section& s : sections_) radius = std::max(radius, s.a2 > 0 ? std::sqrt(s.a2) : std::abs(s.a1));
  if (radius <= 0) return 0;
  return static_cast<Index>(std::ceil(std::log(0.01) / std::log(radius)));
}

MatrixXd differentiate(const Eigen::Ref<const MatrixXd>& columns, double step_s) {
  return derive(columns, step_s, 1, 7);
}

MatrixXd differentiate_twice(const Eigen::Ref<const MatrixXd>& columns, double step_s) {
  return derive(columns, step_s, 2, 8);
}

MatrixXd at_other_times(const Eigen::Ref<const MatrixXd>& columns, double steps) {
  if (steps == 0) return columns;
  const double whole = std::floor(steps), u = steps - whole;
  // Lagrange's weights of the samples at -1, 0, 1, 2
  const std::array<double, 4> weights{-u * (u - 1) * (u - 2) / 6, (u + 1) * (u - 1) * (u - 2) / 2,
                                      -(u + 1) * u * (u - 2) / 2, (u + 1) * u * (u - 1) / 6};
  const Index n = columns.rows();
  MatrixXd out = MatrixXd::Zero(n, columns.cols());
  for (Index k = 0; k < n; ++k) {
    for (Index i = 0; i < 4; ++i) {
      const Index at = std::clamp<Index>(k + static_cast<Index>(whole) + i - 1, 0, n - 1);
      out.row(k) += weights[static_cast<std::size_t>(i)] * columns.row(at);
    }
  }
  return out;
}

}  // namespace fxdyn
