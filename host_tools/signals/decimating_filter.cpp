#include "host_tools/signals/decimating_filter.hpp"

#include <algorithm>
#include <complex>
#include <vector>

#include "host_tools/signals/filter.hpp"
#include "host_tools/support/vectors.hpp"

namespace fxdyn {
namespace {

using Complex = std::complex<double>;
using Eigen::Index;
using Eigen::MatrixXd;

constexpr Index lanes = DecimatingFilter::lanes;

/// One direction, from wanted sample to wanted sample.
struct Leaps {
  const double* x;        ///< the first one
  Index to_next;          ///< from sample to sample, negative backwards
  Index step;             ///< samples to the next wanted one
  Index silent, written;  ///< so many only lead there; the rest is added to `out`
  double* out;
  bool adds;  ///< to what is there; else writes, and middle times the sample itself
  double middle;
  const double *powers, *leap, *at_rest, *residue;  ///< DecimatingFilter's weights
};

/// sum_p r_p S_p with S_p = sum_{n >= 1} p^n x_{k-n}; from one wanted sample to the next,
/// S_p <- p^step S_p + sum_{n = 1}^{step} p^n x_{k-n}. It starts from where the first sample has lasted for ever.
template <class V>
[[gnu::always_inline]] inline void leap_through(const Leaps& leaps) {
  using Double = typename V::Double;
  constexpr int parts = lanes / V::size;
  Double re[2][parts], im[2][parts];
#pragma GCC unroll 4
  for (int p = 0; p < parts; ++p) {
    const Double x = V::at(leaps.x + p * V::size).value;
#pragma GCC unroll 2
    for (int s = 0; s < 2; ++s) {
      re[s][p] = leaps.at_rest[2 * s] * x;
      im[s][p] = leaps.at_rest[2 * s + 1] * x;
    }
  }
  const double* x = leaps.x;
  double* out = leaps.out;
  for (Index k = 0;; ++k) {
    if (k >= leaps.silent) {
#pragma GCC unroll 4
      for (int p = 0; p < parts; ++p) {
        double* const y = out + p * V::size;
        V::at(y).value = (leaps.adds ? V::at(y).value : leaps.middle * V::at(x + p * V::size).value) +
                         ((leaps.residue[0] * re[0][p] - leaps.residue[1] * im[0][p]) +
                          (leaps.residue[2] * re[1][p] - leaps.residue[3] * im[1][p]));
      }
      out += leaps.to_next > 0 ? lanes : -lanes;
    }
    if (k + 1 == leaps.silent + leaps.written) break;
#pragma GCC unroll 2
    for (int s = 0; s < 2; ++s) {
      const double a = leaps.leap[2 * s], b = leaps.leap[2 * s + 1];
#pragma GCC unroll 4
      for (int p = 0; p < parts; ++p) {
        const Double turned = a * re[s][p] - b * im[s][p];
        im[s][p] = a * im[s][p] + b * re[s][p];
        re[s][p] = turned;
      }
    }
    // The sample furthest away has the highest power.
    const double* w = leaps.powers + 4 * leaps.step;
    for (Index n = 0; n < leaps.step; ++n, x += leaps.to_next) {
      w -= 4;
#pragma GCC unroll 4
      for (int p = 0; p < parts; ++p) {
        const Double value = V::at(x + p * V::size).value;
#pragma GCC unroll 2
        for (int s = 0; s < 2; ++s) {
          re[s][p] = re[s][p] + w[2 * s] * value;
          im[s][p] = im[s][p] + w[2 * s + 1] * value;
        }
      }
    }
  }
}

void leap_two(const Leaps& leaps) { leap_through<Vector<2>>(leaps); }
FXDYN_FOUR_AT_ONCE void leap_four(const Leaps& leaps) { leap_through<Vector<4>>(leaps); }
FXDYN_EIGHT_AT_ONCE void leap_eight(const Leaps& leaps) { leap_through<Vector<8>>(leaps); }

}  // namespace

DecimatingFilter::DecimatingFilter(double cutoff_hz, double step_s, Index samples, Index first, Index step, Index kept)
    : samples_(samples), first_(first), step_(step), kept_(kept) {
  const ZeroPhaseFilter filter(cutoff_hz, step_s);
  const auto& sections = filter.sections();
  identity_ = sections.empty() || samples < 3;
  // So far that the ends are forgotten to 1e-13: 6.5 times the 1 % of edge_samples().
  const Index pad = filter.edge_samples() * 13 / 2 + 1;
  front_ = (first + pad + step - 1) / step;
  back_ = (samples + pad - first - (kept - 1) * step + step - 1) / step;
  if (identity_) return;
  /// The filter's transfer function at 1/z = w, but for the factor 1 - p w of section `without`.
  const auto transfer = [&](Complex w, std::size_t without, Complex p) {
    Complex product = 1;
    for (std::size_t s = 0; s < sections.size(); ++s) {
      const auto& [b0, b1, b2, a1, a2] = sections[s];
      product *= b0 + w * (b1 + w * b2);
      product /= s == without ? 1.0 - std::conj(p) * w : 1.0 + w * (a1 + w * a2);
    }
    return product;
  };
  powers_.resize(static_cast<std::size_t>(step));
  middle_ = 0;
  for (std::size_t s = 0; s < pairs; ++s) {
    const auto& section = sections.at(s);
    const Complex p(-section.a1 / 2, std::sqrt(section.a2 - section.a1 * section.a1 / 4));
    const Complex r = transfer(1.0 / p, s, p) * transfer(p, sections.size(), p);
    const auto put = [&](Weights& weights, Complex value) {
      weights[2 * s] = value.real();
      weights[2 * s + 1] = value.imag();
    };
    Complex power = 1;
    for (Weights& weights : powers_) put(weights, power *= p);
    put(leap_, power);
    put(at_rest_, p / (1.0 - p));
    put(residue_, 2.0 * r);
    middle_ += 4 * (r * p / (1.0 + p)).real();  // nothing passes at half the sampling rate
  }
}

void DecimatingFilter::continue_beyond(MatrixXd& tile) const {
  const auto at = [&](Index i) { return Eigen::Map<Eigen::Array<double, lanes, 1>>(tile.data() + lanes * i); };
  const Index begin = before(), end = begin + samples_, last = samples_ - 1;
  for (Index i = 1; i <= begin; ++i) at(begin - i) = 2 * at(begin) - at(begin + std::min(i, last));
  for (Index i = 1; end - 1 + i < tile.cols(); ++i) at(end - 1 + i) = 2 * at(end - 1) - at(end - 1 - std::min(i, last));
}

void DecimatingFilter::operator()(MatrixXd& tile, MatrixXd& out) const {
  const Index at = front_ * step_;
  if (identity_) {
    for (Index r = 0; r < kept_; ++r) out.col(r) = tile.col(at + r * step_);
    return;
  }
  continue_beyond(tile);
  Leaps leaps{
      tile.data(),  lanes,           step_,          front_, kept_, out.data(), false, middle_, powers_.front().data(),
      leap_.data(), at_rest_.data(), residue_.data()};
  const auto leap = widest(&leap_eight, &leap_four, &leap_two);
  leap(leaps);
  leaps.to_next = -lanes;
  leaps.x = tile.data() + lanes * (at + (kept_ - 1 + back_) * step_);
  leaps.silent = back_;
  leaps.adds = true;
  leaps.out = out.data() + lanes * (kept_ - 1);
  leap(leaps);
}

}  // namespace fxdyn
