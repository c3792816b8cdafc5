#include "host_tools/regression/bls_rows.hpp"

#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include "host_tools/signals/decimating_filter.hpp"
#include "host_tools/support/vectors.hpp"
#include "model/broad_learning.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

constexpr int lanes = DecimatingFilter::lanes;

/// e^y = 2^k (even + odd) / (even - odd), |r| <= ln(2) / 2 what is left of y: Pade's approximant of fifth order over
/// fifth, to 9e-16; k goes straight into the exponent's bits. |y| < 700.
template <class V>
struct Exponential {
  using Double = typename V::Double;
  using Integer = typename V::Integer;
  Double up, down;  ///< 2^k (even + odd), even - odd

  [[gnu::always_inline]] explicit Exponential(Double y) {
    constexpr double to_integer = 0x1.8p52;       // a sum with it has whole numbers in its lowest bits
    constexpr std::int64_t bias = 1023, to = 52;  // of the exponent
    const Double z = y * (1 / std::numbers::ln2), shifted = z + to_integer;
    const Double r = (z - (shifted - to_integer)) * std::numbers::ln2, s = r * r;
    const Double even = (30 * s + 3360) * s + 30240, odd = ((s + 420) * s + 15120) * r;
    up = (even + odd) * reinterpret_cast<Double>((reinterpret_cast<Integer>(shifted) + bias) << to);
    down = even - odd;
  }
};

/// tanh x = (e^2x - 1) / (e^2x + 1) to 5e-16.
template <class V>
[[gnu::always_inline]] inline typename V::Double tanh_of_vector(typename V::Double x) {
  using Double = typename V::Double;
  constexpr double end = 20;  // 1 - tanh(20) < 1e-17
  x = x < -end ? Double{} - end : x;
  x = x > end ? Double{} + end : x;
  const Exponential<V> e(2 * x);
  return (e.up - e.down) / (e.up + e.down);
}

/// tanh(b_k + sum_i w_ki u_i) of eight nodes for each sample, their sums in the model's order.
/// @param weights first the nodes' bias, then the weights of each input: (1 + inputs) x lanes
template <class V, int inputs>
[[gnu::always_inline]] inline void nodes_of(const double* u, Index samples, const double* weights, double* out) {
  for (Index k = 0; k < samples; ++k, u += inputs, out += lanes) {
#pragma GCC unroll 4
    for (int lane = 0; lane < lanes; lane += V::size) {
      typename V::Double sum = V::at(weights + lanes + lane).value * u[0];
#pragma GCC unroll 8
      for (int i = 1; i < inputs; ++i) sum = sum + V::at(weights + lanes * (1 + i) + lane).value * u[i];
      V::at(out + lane).value = tanh_of_vector<V>(sum + V::at(weights + lane).value);
    }
  }
}

template <int inputs>
void nodes_two(const double* u, Index samples, const double* weights, double* out) {
  nodes_of<Vector<2>, inputs>(u, samples, weights, out);
}
template <int inputs>
FXDYN_FOUR_AT_ONCE void nodes_four(const double* u, Index samples, const double* weights, double* out) {
  nodes_of<Vector<4>, inputs>(u, samples, weights, out);
}
template <int inputs>
FXDYN_EIGHT_AT_ONCE void nodes_eight(const double* u, Index samples, const double* weights, double* out) {
  nodes_of<Vector<8>, inputs>(u, samples, weights, out);
}

/// 1 - e^-x of eight numbers x >= 0, to 2e-16.
template <class V>
[[gnu::always_inline]] inline void shares_of(const double* x, double* out) {
  using Double = typename V::Double;
  constexpr double end = 700;
#pragma GCC unroll 4
  for (int lane = 0; lane < lanes; lane += V::size) {
    Double y = V::at(x + lane).value;
    y = y > end ? Double{} + end : y;
    const Exponential<V> e(-y);
    V::at(out + lane).value = (e.down - e.up) / e.down;
  }
}

void shares_two(const double* x, double* out) { shares_of<Vector<2>>(x, out); }
FXDYN_FOUR_AT_ONCE void shares_four(const double* x, double* out) { shares_of<Vector<4>>(x, out); }
FXDYN_EIGHT_AT_ONCE void shares_eight(const double* x, double* out) { shares_of<Vector<8>>(x, out); }

/// Calls step(k, 1 - e^-x(k)) for the samples in turn, the exponentials of eight at a time.
template <class X, class Step>
void with_shares(Index samples, X&& x_of, Step&& step) {
  const auto shares = widest(&shares_eight, &shares_four, &shares_two);
  for (Index from = 0; from < samples; from += lanes) {
    const Index count = std::min<Index>(lanes, samples - from);
    std::array<double, lanes> x{}, share;
    for (Index k = 0; k < count; ++k) x[static_cast<std::size_t>(k)] = x_of(from + k);
    shares(x.data(), share.data());
    for (Index k = 0; k < count; ++k) step(from + k, share[static_cast<std::size_t>(k)]);
  }
}

/// What the nodes see, inputs x samples: Inputs::values() with the states' exponentials of eight samples at a time.
template <class Inputs>
MatrixXd inputs_of(const BroadLearningFit& bls, const Eigen::VectorXd& dq, double step_s);

template <>
MatrixXd inputs_of<PhysicalInputs>(const BroadLearningFit& bls, const Eigen::VectorXd& dq, double step_s) {
  const auto stored = PhysicalInputs::stored(bls, step_s);
  const Words<Real> words{stored.data()};
  MatrixXd out(PhysicalInputs::size, dq.size());
  for (Index k = 0; k < dq.size(); ++k) out(0, k) = curved_velocity<Real>(dq[k], words, 0);
  for (Index i = 0; i < static_cast<Index>(PhysicalInputs::distances); ++i) {
    const double inverse_path = stored[static_cast<std::size_t>(2 + i)];
    double z = 0;
    with_shares(
        dq.size(), [&](Index k) { return std::fabs(dq[k]) * inverse_path; },
        [&](Index k, double share) {
          z = relax<Real>(z, sign_of(dq[k]), share);
          out(1 + i, k) = Real::feature(z);
        });
  }
  return out;
}

template <>
MatrixXd inputs_of<BristlesInputs>(const BroadLearningFit& bls, const Eigen::VectorXd& dq, double step_s) {
  const auto stored = BristlesInputs::stored(bls, step_s);
  const Words<Real> words{stored.data()};
  MatrixXd out(BristlesInputs::size, dq.size());
  std::vector<SlidingLevel<Real>> levels(static_cast<std::size_t>(dq.size()));
  const auto level = [&](Index k) -> SlidingLevel<Real>& { return levels[static_cast<std::size_t>(k)]; };
  const double inverse_velocity = stored[5], most_fall = stored[6];
  with_shares(
      dq.size(),
      [&](Index k) {
        const double ratio = Real::clamp<Argument<Real>>(dq[k] * inverse_velocity);
        return ratio * ratio;
      },
      [&](Index k, double share) {
        const double n = 1 - most_fall * share;
        level(k) = {1 - share, n, reciprocal_of(n)};
        out(0, k) = curved_velocity<Real>(dq[k], words, 0);
        out(5, k) = as_feature<Real>(1 - share - share);
      });
  const auto way = [&](Index k) { return dq[k] + (k > 0 ? dq[k - 1] : 0); };
  for (Index i = 0; i < static_cast<Index>(BristlesInputs::distances); ++i) {
    const double inverse_path = stored[static_cast<std::size_t>(2 + i)];
    Bristle<Real> bristle;
    with_shares(
        dq.size(), [&](Index k) { return std::fabs(way(k)) / 2 * (inverse_path * level(k).inverse); },
        [&](Index k, double share) {
          bristle.y = relax<Real>(bristle.y, signed_as(level(k).n, way(k)), share);
          out(1 + i, k) = as_feature<Real>(bristle.y);
          if (i == 1) out(4, k) = Real::feature(bristle.rate(dq[k], level(k)) * stored[7]);
        });
  }
  return out;
}

template <class Inputs>
MatrixXd rows_of(const BroadLearningFit& bls, const ProcessedLog& log, Index joint) {
  constexpr int inputs = Inputs::size;
  static_assert(inputs < lanes);
  const MatrixXd u = inputs_of<Inputs>(bls, log.joint_velocity(joint), log.step_s);
  const Index rows = log.rows(), columns = inputs + bls.nodes();
  const DecimatingFilter filter(log.filter.torque_cutoff_hz, log.step_s, log.samples(), log.first, log.decimation,
                                rows);
  MatrixXd out(rows, columns), tile(lanes, filter.tile_samples()), kept(lanes, rows);
  const auto nodes = widest(&nodes_eight<inputs>, &nodes_four<inputs>, &nodes_two<inputs>);
  for (Index from = 0; from < columns; from += lanes) {
    const Index count = std::min<Index>(lanes, columns - from);
    MatrixXd weights = MatrixXd::Zero(lanes, 1 + inputs);
    for (Index lane = 0; lane < count; ++lane) {
      const Index node = from + lane - inputs;
      if (node < 0) continue;
      weights(lane, 0) = bls.weights(node, inputs);
      weights.row(lane).tail(inputs) = bls.weights.row(node).head(inputs);
    }
    double* first = tile.col(filter.before()).data();
    nodes(u.data(), log.samples(), weights.data(), first);
    if (from == 0) tile.block(0, filter.before(), inputs, log.samples()) = u;
    filter(tile, kept);
    for (Index lane = 0; lane < count; ++lane) out.col(from + lane) = kept.row(lane).transpose();
  }
  return out;
}

}  // namespace

bool has_fast_rows(const BroadLearningFit& bls) {
  return (bls.inputs == PhysicalInputs::name || bls.inputs == BristlesInputs::name) &&
         bls.activation == TanhNodes::name;
}

MatrixXd bls_rows(const BroadLearningFit& bls, const ProcessedLog& log, Index joint) {
  return bls.inputs == BristlesInputs::name ? rows_of<BristlesInputs>(bls, log, joint)
                                            : rows_of<PhysicalInputs>(bls, log, joint);
}

}  // namespace fxdyn
