#pragma once

#include "model/effects/dahl.hpp"

namespace fxdyn {

/// Broad Learning System on physical inputs with memory, as an effect of one joint (paper Eqs. 22-29; inputs: see
/// below).
///   u   = [asinh(dq / reference velocity), z_1, z_2, z_3]      z: Dahl states of three presliding distances
///   h_k = tanh(sum_i w_ki u_i + b_k)                           k = 1 .. nodes
///   tau = sum_i c_i u_i + sum_k c_k h_k
/// The feature layer of the paper (Eq. 23) is linear here, so it folds into w and into the output weights c_i (Z W_h =
/// u W_z W_h); what is left of it are the inputs themselves. A friction force depends on where the joint came from, so
/// the inputs carry memory; x = [q, dq, ddq] (Eq. 22) has none.
///
/// Words: inverse reference velocity, three tick/distance, then per node w_k1 .. w_k4, b_k, then the coefficients
/// c_1 .. c_4 (inputs), c_1 .. c_nodes (activations).
struct BroadLearningInputs {
  static constexpr std::size_t count = 4;
  static constexpr std::size_t distances = 3;
};

template <class N>
struct BroadLearningState {
  std::array<Dahl<N>, BroadLearningInputs::distances> dahl{};
};

constexpr std::size_t broad_learning_shape_words(std::size_t nodes) {
  return 1 + BroadLearningInputs::distances + nodes * (BroadLearningInputs::count + 1);
}
constexpr std::size_t broad_learning_coefficients(std::size_t nodes) { return BroadLearningInputs::count + nodes; }

/// Emits the inputs, then the activations. `nodes` is a constant in firmware, a variable on the host.
template <class N, class Emit>
constexpr void broad_learning_basis(std::size_t nodes, const JointInput<N>& joint, Words<N> words,
                                    BroadLearningState<N>& state, Saturations& saturations, Emit&& emit) {
  constexpr std::size_t inputs = BroadLearningInputs::count;
  std::array<Argument<N>, inputs> u{};
  u[0] = asinh_of(N::template clamp<Ratio<N>>(joint.dq * words.template number<Quantity::inverse_velocity>(0)));
  for (std::size_t i = 1; i < inputs; ++i) {
    const auto z = state.dahl[i - 1].step(joint.dq, words.template number<Quantity::inverse_path>(i), saturations);
    u[i] = N::template convert<Argument<N>>(z, saturations);
  }
  for (std::size_t i = 0; i < inputs; ++i) emit(as<Quantity::argument>, i, u[i]);

  for (std::size_t k = 0; k < nodes; ++k) {
    const std::size_t row = 1 + BroadLearningInputs::distances + k * (inputs + 1);
    auto sum = words.template number<Quantity::weight>(row) * u[0];
    for (std::size_t i = 1; i < inputs; ++i) sum = sum + words.template number<Quantity::weight>(row + i) * u[i];
    sum = sum + align(words.template number<Quantity::weight>(row + inputs), sum);
    emit(as<Quantity::unit>, inputs + k, tanh_of(N::template clamp<Argument<N>>(sum)));
  }
}

/// The BLS with its size fixed, for JointModel.
template <std::size_t nodes>
struct BroadLearning {
  static constexpr std::string_view name = "bls";
  static constexpr std::string_view equation = "sum c u + sum c tanh(w u + b)";
  // Only the sizes: the words have no names of their own.
  static constexpr std::array<Quantity, broad_learning_shape_words(nodes)> shape{};
  static constexpr std::array<Quantity, broad_learning_coefficients(nodes)> linear{};
  template <class N>
  using State = BroadLearningState<N>;
  static constexpr double stored_shape(std::size_t, double value, double) { return value; }

  template <class N, class Emit>
  static constexpr void basis(const JointInput<N>& u, Words<N> words, State<N>& state, Saturations& saturations,
                              Emit&& emit) {
    broad_learning_basis<N>(nodes, u, words, state, saturations, emit);
  }
};

}  // namespace fxdyn
