#include "host_tools/regression/bls_rows.hpp"

#include <array>
#include <cmath>
#include <numbers>

#include "host_tools/signals/decimating_filter.hpp"
#include "host_tools/support/vectors.hpp"
#include "model/broad_learning.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

constexpr int lanes = DecimatingFilter::lanes;
constexpr int inputs = PhysicalInputs::size;
static_assert(inputs < lanes);

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
template <class V>
[[gnu::always_inline]] inline void nodes_of(const double* u, Index samples, const double* weights, double* out) {
  for (Index k = 0; k < samples; ++k, u += inputs, out += lanes) {
#pragma GCC unroll 4
    for (int lane = 0; lane < lanes; lane += V::size) {
      typename V::Double sum = V::at(weights + lanes + lane) * u[0];
#pragma GCC unroll 4
      for (int i = 1; i < inputs; ++i) sum = sum + V::at(weights + lanes * (1 + i) + lane) * u[i];
      V::at(out + lane) = tanh_of_vector<V>(sum + V::at(weights + lane));
    }
  }
}

void nodes_two(const double* u, Index samples, const double* weights, double* out) {
  nodes_of<Vector<2>>(u, samples, weights, out);
}
FXDYN_FOUR_AT_ONCE void nodes_four(const double* u, Index samples, const double* weights, double* out) {
  nodes_of<Vector<4>>(u, samples, weights, out);
}
FXDYN_EIGHT_AT_ONCE void nodes_eight(const double* u, Index samples, const double* weights, double* out) {
  nodes_of<Vector<8>>(u, samples, weights, out);
}

/// 1 - e^-x of eight numbers x >= 0, to 2e-16.
template <class V>
[[gnu::always_inline]] inline void shares_of(const double* x, double* out) {
  using Double = typename V::Double;
  constexpr double end = 700;
#pragma GCC unroll 4
  for (int lane = 0; lane < lanes; lane += V::size) {
    Double y = V::at(x + lane);
    y = y > end ? Double{} + end : y;
    const Exponential<V> e(-y);
    V::at(out + lane) = (e.down - e.up) / e.down;
  }
}

void shares_two(const double* x, double* out) { shares_of<Vector<2>>(x, out); }
FXDYN_FOUR_AT_ONCE void shares_four(const double* x, double* out) { shares_of<Vector<4>>(x, out); }
FXDYN_EIGHT_AT_ONCE void shares_eight(const double* x, double* out) { shares_of<Vector<8>>(x, out); }

/// What the nodes see, inputs x samples: PhysicalInputs::values() with the states' exponentials of eight samples at a
/// time.
MatrixXd inputs_of(const BroadLearningFit& bls, const Eigen::VectorXd& dq, double step_s) {
  const auto stored = PhysicalInputs::stored(bls, step_s);
  const Words<Real> words{stored.data()};
  const auto shares = widest(&shares_eight, &shares_four, &shares_two);
  MatrixXd out(inputs, dq.size());
  for (Index k = 0; k < dq.size(); ++k) out(0, k) = curved_velocity<Real>(dq[k], words, 0);
  for (Index i = 1; i < inputs; ++i) {
    const double inverse_path = stored[static_cast<std::size_t>(1 + i)];
    double z = 0;
    for (Index from = 0; from < dq.size(); from += lanes) {
      const Index count = std::min<Index>(lanes, dq.size() - from);
      std::array<double, lanes> x{}, share;
      for (Index k = 0; k < count; ++k) x[static_cast<std::size_t>(k)] = std::fabs(dq[from + k]) * inverse_path;
      shares(x.data(), share.data());
      for (Index k = 0; k < count; ++k) {
        z = relax<Real>(z, sign_of(dq[from + k]), share[static_cast<std::size_t>(k)]);
        out(i, from + k) = Real::feature(z);
      }
    }
  }
  return out;
}

}  // namespace

bool has_fast_rows(const BroadLearningFit& bls) {
  return bls.inputs == PhysicalInputs::name && bls.activation == TanhNodes::name;
}

MatrixXd bls_rows(const BroadLearningFit& bls, const ProcessedLog& log, Index joint) {
  const MatrixXd u = inputs_of(bls, log.joint_velocity(joint), log.step_s);
  const Index rows = log.rows(), columns = inputs + bls.nodes();
  const DecimatingFilter filter(log.filter.torque_cutoff_hz, log.step_s, log.samples(), log.first, log.decimation,
                                rows);
  MatrixXd out(rows, columns), tile(lanes, filter.tile_samples()), kept(lanes, rows);
  const auto nodes = widest(&nodes_eight, &nodes_four, &nodes_two);
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

}  // namespace fxdyn
