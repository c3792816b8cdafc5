#include "host_tools/signals/filter.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <numbers>
#include <vector>

#include "host_tools/support/vectors.hpp"

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
    const auto at = [&](Index k) { return middle[k] * columns.middleRows(ends - half + k, inner); };
    result.middleRows(ends, inner) = at(0) + at(1) + at(2) + at(3) + at(4) + at(5) + at(6);
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

ZeroPhaseFilter::ZeroPhaseFilter(double cutoff_hz, double step_s, int order) : cutoff_hz_(cutoff_hz) {
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

namespace {

/// `sections` second-order sections one after another over the columns side by side, in place and sample by sample:
/// each step waits for the one before it, and the other columns and sections fill the wait. `step`: from sample to
/// sample, negative backwards. `state`: sections x 2 x columns.
template <class V, int columns, int sections, class Section>
[[gnu::always_inline]] inline void pass(const Section* section, double* x, Index samples, Index step, double* state) {
  constexpr int parts = columns / V::size;
  typename V::Double z1[sections][parts], z2[sections][parts];
#pragma GCC unroll 4
  for (int s = 0; s < sections; ++s) {
#pragma GCC unroll 4
    for (int p = 0; p < parts; ++p) {
      z1[s][p] = V::at(state + (2 * s) * columns + p * V::size).value;
      z2[s][p] = V::at(state + (2 * s + 1) * columns + p * V::size).value;
    }
  }
  for (Index k = 0; k < samples; ++k, x += step) {
#pragma GCC unroll 4
    for (int p = 0; p < parts; ++p) {
      typename V::Double value = V::at(x + p * V::size).value;
#pragma GCC unroll 4
      for (int s = 0; s < sections; ++s) {
        const typename V::Double y = section[s].b0 * value + z1[s][p];
        z1[s][p] = section[s].b1 * value - section[s].a1 * y + z2[s][p];
        z2[s][p] = section[s].b2 * value - section[s].a2 * y;
        value = y;
      }
      V::at(x + p * V::size).value = value;
    }
  }
#pragma GCC unroll 4
  for (int s = 0; s < sections; ++s) {
#pragma GCC unroll 4
    for (int p = 0; p < parts; ++p) {
      V::at(state + (2 * s) * columns + p * V::size).value = z1[s][p];
      V::at(state + (2 * s + 1) * columns + p * V::size).value = z2[s][p];
    }
  }
}

template <int columns, int sections, class Section>
void pass_two(const Section* section, double* x, Index samples, Index step, double* state) {
  pass<Vector<2>, columns, sections>(section, x, samples, step, state);
}
template <int columns, int sections, class Section>
FXDYN_FOUR_AT_ONCE void pass_four(const Section* section, double* x, Index samples, Index step, double* state) {
  pass<Vector<std::min(columns, 4)>, columns, sections>(section, x, samples, step, state);
}
template <int columns, int sections, class Section>
FXDYN_EIGHT_AT_ONCE void pass_eight(const Section* section, double* x, Index samples, Index step, double* state) {
  pass<Vector<columns>, columns, sections>(section, x, samples, step, state);
}

/// Samples side by side from `x` on; `step` as in pass().
struct Run {
  double* x;
  Index samples, step;
};

/// Over the runs one after another, from the state at rest on their first value.
template <int columns, int sections, class Section>
void pass_over(const Section* section, std::initializer_list<Run> runs) {
  std::array<double, 2 * sections * columns> state;
  for (int c = 0; c < columns; ++c) {
    double value = runs.begin()->x[c];
    for (int s = 0; s < sections; ++s) {
      const double z2 = (section[s].b2 - section[s].a2) * value;
      const double z1 = (section[s].b1 - section[s].a1) * value + z2;
      state[static_cast<std::size_t>(2 * s * columns + c)] = z1;
      state[static_cast<std::size_t>((2 * s + 1) * columns + c)] = z2;
      value = section[s].b0 * value + z1;
    }
  }
  const auto pass = widest(&pass_eight<columns, sections, Section>, &pass_four<columns, sections, Section>,
                           &pass_two<columns, sections, Section>);
  for (const Run& run : runs) pass(section, run.x, run.samples, run.step, state.data());
}

}  // namespace

template <int columns>
void ZeroPhaseFilter::apply_to(double* side_by_side, Index samples) const {
  const Index n = samples;
  const auto at = [&](Index i) { return Eigen::Map<Eigen::Array<double, columns, 1>>(side_by_side + i * columns); };
  // Far enough for the start to be forgotten to 1e-13: 6.5 times the 1 % of edge_samples().
  const Index pad = std::min(n - 1, edge_samples() * 13 / 2 + 1);
  // A zero-phase filter leaves straight lines alone: the one through the ends is taken out, so that the reflection is
  // about zero and ramps pass exactly.
  const Eigen::Array<double, columns, 1> start = at(0), slope = (at(n - 1) - start) / static_cast<double>(n - 1);
  for (Index i = 0; i < n; ++i) at(i) -= start + slope * static_cast<double>(i);
  at(n - 1).setZero();
  Eigen::Array<double, columns, Eigen::Dynamic> before(columns, pad), after(columns, pad);
  for (Index i = 1; i <= pad; ++i) {
    before.col(pad - i) = -at(i);
    after.col(i - 1) = -at(n - 1 - i);
  }
  const auto forward = [&]<int sections>(const Section* section) {
    pass_over<columns, sections>(
        section, {{before.data(), pad, columns}, {side_by_side, n, columns}, {after.data(), pad, columns}});
  };
  const auto backward = [&]<int sections>(const Section* section) {
    pass_over<columns, sections>(section, {{after.data() + (pad - 1) * columns, pad, -columns},
                                           {side_by_side + (n - 1) * columns, n, -columns},
                                           {before.data() + (pad - 1) * columns, pad, -columns}});
  };
  const auto all = [&](const auto& over) {
    std::size_t s = 0;
    for (; s + 2 <= sections_.size(); s += 2) over.template operator()<2>(&sections_[s]);
    if (s < sections_.size()) over.template operator()<1>(&sections_[s]);
  };
  all(forward);
  all(backward);
  for (Index i = 0; i < n; ++i) at(i) += start + slope * static_cast<double>(i);
}

MatrixXd ZeroPhaseFilter::apply(const Eigen::Ref<const MatrixXd>& columns) const {
  if (sections_.empty() || columns.rows() < 3) return columns;
  MatrixXd result(columns.rows(), columns.cols());
  const Index n = columns.rows();
  constexpr Index lanes = 8;
  std::vector<double> work;
  const auto take = [&]<int wide>(Index from, Index count) {
    work.assign(static_cast<std::size_t>(n * wide), 0.0);
    for (Index c = 0; c < count; ++c) {
      for (Index i = 0; i < n; ++i) work[static_cast<std::size_t>(i * wide + c)] = columns(i, from + c);
    }
    apply_to<wide>(work.data(), n);
    for (Index c = 0; c < count; ++c) {
      for (Index i = 0; i < n; ++i) result(i, from + c) = work[static_cast<std::size_t>(i * wide + c)];
    }
  };
  for (Index from = 0; from < columns.cols(); from += lanes) {
    const Index count = std::min(lanes, columns.cols() - from);
    if (count > 4)
      take.operator()<8>(from, count);
    else if (count > 2)
      take.operator()<4>(from, count);
    else
      take.operator()<2>(from, count);
  }
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
