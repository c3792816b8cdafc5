#pragma once

#include <cmath>
#include <span>

#include "model/broad_learning_inputs.hpp"
#include "model/dense.hpp"
#include "model/table_page.hpp"

namespace fxdyn {

// ---- activations: what a node makes of its argument ----------------------------------------------------------------
// `one` is the raw int16 that stands for 1; `steepest(x)` the largest slope at arguments no nearer to zero than x.

/// tanh (paper Eq. 25). The paper's sigmoid needs no activation of its own, 1 / (1 + e^-x) = 1/2 + tanh(x / 2) / 2:
/// half the weights, half the coefficients, and half the sum of the coefficients in the joint's offset.
struct TanhNodes {
  static constexpr std::string_view name = "tanh";
  static constexpr std::int32_t one = raw::activation_one;
  static constexpr int argument_bits = raw::tanh_argument_bits, argument_width = raw::tanh_argument_width;
  static constexpr double kernel_error = raw::tanh_line_error;

  static double of(double x) { return std::tanh(x); }
  static double steepest(double x) { return 1 - of(x) * of(x); }
  static constexpr std::int64_t weighted(std::size_t nodes, const std::int32_t* coefficients, const std::int32_t* x) {
    return raw::weighted_tanh(nodes, coefficients, x);
  }
};

/// The ramp, max(x, 0) / 8 and 1 from x = 8 on: the rectifier (ReLU) within the range of the arguments. The eighth is
/// the output weights' to undo.
struct RampNodes {
  static constexpr std::string_view name = "relu";
  static constexpr std::int32_t one = 32768;
  static constexpr int argument_bits = raw::ramp_argument_bits, argument_width = raw::ramp_argument_width;
  static constexpr double kernel_error = raw::ramp_error;

  static constexpr double of(double x) { return x < 0 ? 0 : (x < 8 ? x / 8 : 1); }
  static constexpr double steepest(double) { return 1.0 / 8; }
  static constexpr std::int64_t weighted(std::size_t nodes, const std::int32_t* coefficients, const std::int32_t* x) {
    return raw::weighted_ramp(nodes, coefficients, x);
  }
};

/// Broad Learning System as an effect of one joint (paper Eqs. 22-29).
///   u                                           inputs, see broad_learning_inputs.hpp
///   h_k = xi(sum_i w_ki u_i + b_k)              k = 1 .. nodes; xi: an activation from above
///   tau = sum_i c_i u_i + sum_k c_k h_k
/// The feature layer of the paper (Eq. 23) is linear here, so it folds into w and into the output weights c_i (Z W_h =
/// u W_z W_h); what is left of it are the inputs themselves. A friction force depends on where the joint came from, so
/// the usual inputs carry memory; x = [q, dq, ddq] (Eq. 22, `StateInputs`) has none.
///
/// In fixed point w, u, h and the c_k are int16, sums have 64 bits (dense.hpp). Weights are trained on the grid of
/// their format, so that only u, h and the c_k are rounded.
///
/// Words: those of the inputs; per node a row (bias, w_k1 ..); the coefficients of the inputs; those of the nodes.
/// Packed number systems hold two weights or node coefficients a word. The number of nodes is even.
template <class Inputs>
struct BroadLearningLayout {
  static constexpr std::size_t inputs = Inputs::size;
  static_assert(inputs % 2 == 0, "two inputs a word");
  static constexpr std::size_t rows = Inputs::shape.size();  ///< word where the rows begin

  static constexpr std::size_t row_words(bool packed) { return packed ? raw::row_words<inputs> : inputs + 1; }
  static constexpr std::size_t shape_words(std::size_t nodes, bool packed) { return rows + nodes * row_words(packed); }
  static constexpr std::size_t coefficient_words(std::size_t nodes, bool packed) {
    return inputs + (packed ? nodes / 2 : nodes);
  }
  static constexpr std::size_t words(std::size_t nodes, bool packed) {
    return shape_words(nodes, packed) + coefficient_words(nodes, packed);
  }
};

/// The arguments of the nodes: x_k = sum_i w_ki u_i + b_k.
template <class N, class Activation, std::size_t inputs>
constexpr void broad_learning_arguments(std::size_t nodes, const std::array<Feature<N>, inputs>& u,
                                        const typename N::Word* row, typename N::NodeArgument* x) {
  if constexpr (N::packed) {
    std::array<std::int32_t, inputs / 2> packed{};
#pragma GCC unroll 8
    for (std::size_t i = 0; i < packed.size(); ++i) packed[i] = raw::pack(u[2 * i].raw, u[2 * i + 1].raw);
    raw::dense<inputs, Activation::argument_width>(nodes, N::weight_bits() + small_bits - Activation::argument_bits,
                                                   row, packed.data(), x);
  } else {
    for (std::size_t k = 0; k < nodes; ++k, row += inputs + 1) {
      auto sum = N::template load<Weight<N>>(row[1]) * u[0];
      for (std::size_t i = 1; i < inputs; ++i) sum = sum + N::template load<Weight<N>>(row[1 + i]) * u[i];
      x[k] = sum + align(N::template load<Weight<N>>(row[0]), sum);
    }
  }
}

/// Emits the inputs, then the activations, for number systems that are not packed: the columns of a fit.
template <class Inputs, class Activation, class N, class Emit>
constexpr void broad_learning_basis(std::size_t nodes, const JointInput<N>& joint, Words<N> words,
                                    typename Inputs::template State<N>& state, Saturations& saturations,
                                    std::span<typename N::NodeArgument> scratch, Emit&& emit) {
  const auto u = Inputs::template values<N>(joint, words, state, saturations);
  for (std::size_t i = 0; i < u.size(); ++i) emit(as<Quantity::feature>, i, u[i]);
  broad_learning_arguments<N, Activation>(nodes, u, words.data + BroadLearningLayout<Inputs>::rows, scratch.data());
  for (std::size_t k = 0; k < nodes; ++k)
    emit(as<Quantity::activation>, u.size() + k, N::template activation<Activation>(scratch[k]));
}

/// The torque. `bits`: fractional bits of the node coefficients, an integral_constant in firmware, an int on the host.
/// `scratch` holds one value a node.
template <class Inputs, class Activation, class N, class Bits>
constexpr typename N::TorqueSum broad_learning_sum(std::size_t nodes, Bits bits, const JointInput<N>& joint,
                                                   Words<N> words, typename Inputs::template State<N>& state,
                                                   Saturations& saturations,
                                                   std::span<typename N::NodeArgument> scratch) {
  using Layout = BroadLearningLayout<Inputs>;
  const Words<N> coefficients{words.data + Layout::shape_words(nodes, N::packed)};
  auto sum = N::no_torque();
  if constexpr (N::packed) {
    const auto u = Inputs::template values<N>(joint, words, state, saturations);
    for (std::size_t i = 0; i < u.size(); ++i)
      sum = sum + coefficients.template coefficient<Quantity::feature>(i) * u[i];
    broad_learning_arguments<N, Activation>(nodes, u, words.data + Layout::rows, scratch.data());
    const auto* outputs = coefficients.data + u.size();
    return sum + N::node_sum(Activation::weighted(nodes, outputs, scratch.data()), bits);
  } else {
    broad_learning_basis<Inputs, Activation, N>(
        nodes, joint, words, state, saturations, scratch, [&](auto tag, std::size_t i, auto phi) {
          if constexpr (decltype(tag)::value == Quantity::activation)
            sum = sum + N::node_coefficient(coefficients.data[i], bits) * phi;
          else
            sum = sum + coefficients.template coefficient<decltype(tag)::value>(i) * phi;
        });
    return sum;
  }
}

/// The BLS with its size, the format of its node coefficients, inputs and activation fixed, for JointModel.
template <std::size_t nodes, int coefficient_bits, class Inputs = PhysicalInputs, class Activation = TanhNodes>
struct BroadLearning {
  static_assert(nodes % 2 == 0, "pad the nodes with a zero to an even number");
  static constexpr std::string_view name = "bls";
  static constexpr std::size_t words = BroadLearningLayout<Inputs>::words(nodes, true);
  template <class N>
  using State = typename Inputs::template State<N>;

  template <class N>
  static constexpr typename N::TorqueSum sum(const JointInput<N>& u, Words<N> data, State<N>& state,
                                             Saturations& saturations) {
    std::array<typename N::NodeArgument, nodes> scratch;
    return broad_learning_sum<Inputs, Activation, N>(nodes, std::integral_constant<int, coefficient_bits>{}, u, data,
                                                     state, saturations, scratch);
  }
  static constexpr void hash(LayoutHash& hash) { hash_layout(hash, nodes, coefficient_bits); }
  /// The same of any size: what the host computes from a model of its own.
  static constexpr void hash_layout(LayoutHash& hash, std::size_t count, int bits) {
    hash.add(name);
    hash.add(static_cast<std::int32_t>(count));
    hash.add(bits);
    // What tables were made with before there was a choice keeps its hash.
    if constexpr (!std::is_same_v<Inputs, PhysicalInputs>) hash.add(Inputs::name);
    if constexpr (!std::is_same_v<Activation, TanhNodes>) hash.add(Activation::name);
  }
};

}  // namespace fxdyn
