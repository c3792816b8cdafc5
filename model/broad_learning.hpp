#pragma once

#include <span>

#include "model/dense.hpp"
#include "model/effects/dahl.hpp"
#include "model/table_page.hpp"

namespace fxdyn {

/// Broad Learning System on physical inputs with memory, as an effect of one joint (paper Eqs. 22-29; inputs: see
/// below).
///   u   = [asinh(dq / reference velocity) / span, z_1, z_2, z_3]    z: Dahl states of three presliding distances
///   h_k = tanh(sum_i w_ki u_i + b_k)                                k = 1 .. nodes
///   tau = sum_i c_i u_i + sum_k c_k h_k
/// The feature layer of the paper (Eq. 23) is linear here, so it folds into w and into the output weights c_i (Z W_h =
/// u W_z W_h); what is left of it are the inputs themselves. A friction force depends on where the joint came from, so
/// the inputs carry memory; x = [q, dq, ddq] (Eq. 22) has none.
///
/// In fixed point w, u, h and the c_k are int16, sums have 64 bits (dense.hpp). Weights are trained on the grid of
/// their format, so that only u, h and the c_k are rounded.
///
/// Words: inverse reference velocity, 1 / span, three tick/distance; per node a row (bias, w_k1 .. w_k4); the
/// coefficients c_1 .. c_4 of the inputs; those of the nodes. Packed number systems hold two weights or node
/// coefficients a word. The number of nodes is even.
struct BroadLearningLayout {
  static constexpr std::size_t inputs = 4;
  static constexpr std::size_t distances = 3;
  static constexpr std::size_t rows = 2 + distances;  ///< word where the rows begin

  static constexpr std::size_t row_words(bool packed) { return packed ? raw::row_words<inputs> : inputs + 1; }
  static constexpr std::size_t shape_words(std::size_t nodes, bool packed) { return rows + nodes * row_words(packed); }
  static constexpr std::size_t coefficient_words(std::size_t nodes, bool packed) {
    return inputs + (packed ? nodes / 2 : nodes);
  }
  static constexpr std::size_t words(std::size_t nodes, bool packed) {
    return shape_words(nodes, packed) + coefficient_words(nodes, packed);
  }
};

template <class N>
struct BroadLearningState {
  std::array<Dahl<N>, BroadLearningLayout::distances> dahl{};
};

template <class N>
using BroadLearningInputs = std::array<Feature<N>, BroadLearningLayout::inputs>;

template <class N>
constexpr BroadLearningInputs<N> broad_learning_inputs(const JointInput<N>& joint, Words<N> words,
                                                       BroadLearningState<N>& state, Saturations& saturations) {
  BroadLearningInputs<N> u{};
  const auto ratio = N::template clamp<Ratio<N>>(joint.dq * words.template number<Quantity::inverse_velocity>(0));
  u[0] = N::feature(asinh_of(ratio) * words.template number<Quantity::unit>(1));
  for (std::size_t i = 1; i < u.size(); ++i) {
    const auto z = state.dahl[i - 1].step(joint.dq, words.template number<Quantity::inverse_path>(1 + i), saturations);
    u[i] = N::feature(z * N::one());
  }
  return u;
}

/// The arguments of the nodes: x_k = sum_i w_ki u_i + b_k.
template <class N>
constexpr void broad_learning_arguments(std::size_t nodes, const BroadLearningInputs<N>& u, Words<N> words,
                                        typename N::NodeArgument* x) {
  constexpr std::size_t inputs = BroadLearningLayout::inputs;
  const auto* row = words.data + BroadLearningLayout::rows;
  if constexpr (N::packed) {
    const std::array packed{raw::pack(u[0].raw, u[1].raw), raw::pack(u[2].raw, u[3].raw)};
    raw::dense<inputs, raw::tanh_argument_width>(nodes, N::weight_bits() + small_bits - raw::tanh_argument_bits, row,
                                                 packed.data(), x);
  } else {
    for (std::size_t k = 0; k < nodes; ++k, row += inputs + 1) {
      auto sum = N::template load<Weight<N>>(row[1]) * u[0];
      for (std::size_t i = 1; i < inputs; ++i) sum = sum + N::template load<Weight<N>>(row[1 + i]) * u[i];
      x[k] = sum + align(N::template load<Weight<N>>(row[0]), sum);
    }
  }
}

/// Emits the inputs, then the activations, for number systems that are not packed: the columns of a fit.
template <class N, class Emit>
constexpr void broad_learning_basis(std::size_t nodes, const JointInput<N>& joint, Words<N> words,
                                    BroadLearningState<N>& state, Saturations& saturations,
                                    std::span<typename N::NodeArgument> scratch, Emit&& emit) {
  const auto u = broad_learning_inputs<N>(joint, words, state, saturations);
  for (std::size_t i = 0; i < u.size(); ++i) emit(as<Quantity::feature>, i, u[i]);
  broad_learning_arguments<N>(nodes, u, words, scratch.data());
  for (std::size_t k = 0; k < nodes; ++k) emit(as<Quantity::activation>, u.size() + k, N::activation(scratch[k]));
}

/// The torque. `bits`: fractional bits of the node coefficients, an integral_constant in firmware, an int on the host.
/// `scratch` holds one value a node.
template <class N, class Bits>
constexpr typename N::TorqueSum broad_learning_sum(std::size_t nodes, Bits bits, const JointInput<N>& joint,
                                                   Words<N> words, BroadLearningState<N>& state,
                                                   Saturations& saturations,
                                                   std::span<typename N::NodeArgument> scratch) {
  const Words<N> coefficients{words.data + BroadLearningLayout::shape_words(nodes, N::packed)};
  auto sum = N::no_torque();
  if constexpr (N::packed) {
    const auto u = broad_learning_inputs<N>(joint, words, state, saturations);
    for (std::size_t i = 0; i < u.size(); ++i)
      sum = sum + coefficients.template coefficient<Quantity::feature>(i) * u[i];
    broad_learning_arguments<N>(nodes, u, words, scratch.data());
    const auto* outputs = coefficients.data + u.size();
    return sum + N::node_sum(raw::weighted_tanh(nodes, outputs, scratch.data()), bits);
  } else {
    broad_learning_basis<N>(nodes, joint, words, state, saturations, scratch, [&](auto tag, std::size_t i, auto phi) {
      if constexpr (decltype(tag)::value == Quantity::activation)
        sum = sum + N::node_coefficient(coefficients.data[i], bits) * phi;
      else
        sum = sum + coefficients.template coefficient<decltype(tag)::value>(i) * phi;
    });
    return sum;
  }
}

/// The BLS with its size and the format of its node coefficients fixed, for JointModel.
template <std::size_t nodes, int coefficient_bits>
struct BroadLearning {
  static_assert(nodes % 2 == 0, "pad the nodes with a zero to an even number");
  static constexpr std::string_view name = "bls";
  static constexpr std::size_t words = BroadLearningLayout::words(nodes, true);
  template <class N>
  using State = BroadLearningState<N>;

  template <class N>
  static constexpr typename N::TorqueSum sum(const JointInput<N>& u, Words<N> data, State<N>& state,
                                             Saturations& saturations) {
    std::array<typename N::NodeArgument, nodes> scratch;
    return broad_learning_sum<N>(nodes, std::integral_constant<int, coefficient_bits>{}, u, data, state, saturations,
                                 scratch);
  }
  static constexpr void hash(LayoutHash& hash) {
    hash.add(name);
    hash.add(static_cast<std::int32_t>(nodes));
    hash.add(coefficient_bits);
  }
};

}  // namespace fxdyn
