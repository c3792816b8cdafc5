#include "host_tools/identify/bls_rows.hpp"

#include <array>
#include <numbers>

#include "host_tools/vectors.hpp"
#include "model/broad_learning.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

constexpr int lanes = ZeroPhaseFilter::lanes;
constexpr int inputs = PhysicalInputs::size;

/// 1 / k! of k = 0 .. 12
constexpr auto inverse_factorials = [] {
  std::array<double, 13> out{1};
  for (std::size_t k = 1; k < out.size(); ++k) out[k] = out[k - 1] / static_cast<double>(k);
  return out;
}();

/// tanh x = 1 - 2 / (e^2x + 1) to 4e-16. e^y = 2^k e^r with |r| <= ln(2) / 2: the series, its even and odd powers side
/// by side, and k straight into the exponent's bits.
template <class V>
[[gnu::always_inline]] inline typename V::Double tanh_of_vector(typename V::Double x) {
  using Double = typename V::Double;
  using Integer = typename V::Integer;
  constexpr double end = 20;                    // 1 - tanh(20) < 1e-17
  constexpr double to_integer = 0x1.8p52;       // a sum with it has whole numbers in its lowest bits
  constexpr std::int64_t bias = 1023, to = 52;  // of the exponent
  x = x < -end ? Double{} - end : x;
  x = x > end ? Double{} + end : x;
  const Double z = x * (2 / std::numbers::ln2), shifted = z + to_integer;
  const Double r = (z - (shifted - to_integer)) * std::numbers::ln2, square = r * r;
  constexpr std::size_t highest = inverse_factorials.size() - 1;
  static_assert(highest % 2 == 0);
  Double even = Double{} + inverse_factorials[highest], odd = Double{} + inverse_factorials[highest - 1];
#pragma GCC unroll 16
  for (std::size_t k = 2; k < highest; k += 2) {
    even = even * square + inverse_factorials[highest - k];
    odd = odd * square + inverse_factorials[highest - 1 - k];
  }
  const Double exponential = even * square + inverse_factorials[0] + odd * r;
  const Double power = reinterpret_cast<Double>((reinterpret_cast<Integer>(shifted) + bias) << to);
  return 1 - 2 / (exponential * power + 1);
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

/// What the nodes see, inputs x samples.
MatrixXd inputs_of(const BroadLearningFit& bls, const Eigen::VectorXd& dq, double step_s) {
  const auto words = PhysicalInputs::stored(bls, step_s);
  MatrixXd out(inputs, dq.size());
  PhysicalInputs::State<Real> state;
  Saturations none;
  for (Index k = 0; k < dq.size(); ++k) {
    const auto u = PhysicalInputs::values<Real>({0, dq[k], 0, 0, 0}, Words<Real>{words.data()}, state, none);
    for (std::size_t i = 0; i < u.size(); ++i) out(static_cast<Index>(i), k) = u[i];
  }
  return out;
}

}  // namespace

bool has_fast_rows(const BroadLearningFit& bls) {
  return bls.inputs == PhysicalInputs::name && bls.activation == TanhNodes::name;
}

MatrixXd bls_rows(const BroadLearningFit& bls, const ProcessedLog& log, Index joint) {
  const MatrixXd u = inputs_of(bls, log.joint_velocity(joint), log.step_s);
  const ZeroPhaseFilter filter(log.filter.torque_cutoff_hz, log.step_s);
  MatrixXd out(log.rows(), inputs + bls.nodes());
  out.leftCols(inputs) = log.decimate(filter.apply(u.transpose()));
  MatrixXd tile(lanes, log.samples());
  for (Index node = 0; node < bls.nodes(); node += lanes) {
    const Index count = std::min<Index>(lanes, bls.nodes() - node);
    MatrixXd weights = MatrixXd::Zero(lanes, 1 + inputs);
    weights.topLeftCorner(count, 1) = bls.weights.block(node, inputs, count, 1);
    weights.topRightCorner(count, inputs) = bls.weights.block(node, 0, count, inputs);
    (four_at_once ? nodes_four : nodes_two)(u.data(), log.samples(), weights.data(), tile.data());
    filter.apply_in_place(tile);
    for (Index r = 0; r < out.rows(); ++r)
      out.row(r).segment(inputs + node, count) = tile.col(log.first + r * log.decimation).head(count);
  }
  return out;
}

}  // namespace fxdyn
