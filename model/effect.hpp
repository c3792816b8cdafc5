#pragma once

#include <array>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <type_traits>

#include "model/math.hpp"
#include "model/numbers.hpp"

// An effect is a contribution to one joint's torque, tau = theta^T phi(u; shape, state): theta linear coefficients,
// shape nonlinear parameters, state what it remembers from tick to tick. Each effect stands in one file of
// model/effects and is the only definition of its formula: firmware and simulator sum coefficient * phi, the identifier
// takes phi as columns.

namespace fxdyn {

/// One parameter of an effect, as the user sees it (SI, joint side of the gearbox).
struct ParameterInfo {
  std::string_view name;
  std::string_view unit;            ///< revolute joint
  std::string_view unit_prismatic;  ///< prismatic joint
  double lower, upper;              ///< bounds that fits and scenarios keep
  /// Linear parameter: the quantity of its phi. Shape: the quantity that the tables store (see stored_shape()).
  Quantity quantity;
  std::string_view source;
};

inline constexpr double unbounded = 1e30;

/// What a joint's effects see in one tick.
template <class N>
struct JointInput {
  Position<N> q{};
  Velocity<N> dq{};
  Acceleration<N> ddq{};
  Unit<N> sign{};          ///< tanh(dq / width): the Coulomb sign with the joint's fitted width, shared by all effects
  Torque<N> structural{};  ///< rigid-body torque of this tick (RNEA)
  Torque<N> total{};       ///< structural + the effects before this one; only for effects with `needs_total`
  /// All joints of the robot in chain order, for effects that couple joints (`needs_peers`); q, dq, ddq, sign are set.
  std::span<const JointInput> peers{};
};

/// What sum(theta phi) of an effect is.
enum class ActsOn : std::uint8_t {
  torque,    ///< added to the joint's torque
  position,  ///< deflection delta between motor and link: the rigid body moves at q - delta
  body,      ///< no sum: changes the parameters of the rigid body (BodyEffects in catalogue.hpp)
};

/// What an effect says of itself where it differs from the usual: a torque out of the joint's own motion.
template <class E>
inline constexpr ActsOn acts_on = [] {
  if constexpr (requires { E::acts_on; }) return E::acts_on;
  return ActsOn::torque;
}();
template <class E>
inline constexpr bool needs_structural = requires {
  requires E::needs_structural;
};
template <class E>
inline constexpr bool needs_total = requires {
  requires E::needs_total;
};
template <class E>
inline constexpr bool needs_peers = requires {
  requires E::needs_peers;
};

/// Stored parameters of one effect: its shape words, then its coefficients. Memory belongs to the caller.
template <class N>
struct Words {
  const typename N::Word* data = nullptr;

  template <Quantity quantity>
  constexpr auto number(std::size_t i) const {
    return N::template load<typename N::template Of<quantity>>(data[i]);
  }
  template <Quantity quantity>
  constexpr auto coefficient(std::size_t i) const {
    return N::template load<typename N::template Coefficient<quantity>>(data[i]);
  }
};

/// Names the quantity of a phi where an effect emits it: emit(as<Quantity::velocity>, 0, u.dq).
template <Quantity quantity>
inline constexpr std::integral_constant<Quantity, quantity> as{};

/// For effects without memory.
struct NoState {};

namespace detail {
struct EmitNothing {
  template <class Tag, class Phi>
  constexpr void operator()(Tag, std::size_t, const Phi&) const {}
};
}  // namespace detail

/// `E::shape` and `E::linear` describe the parameters, `E::State<N>` the memory (value-initialised: at rest),
/// `E::stored_shape(i, value, tick_s)` gives the stored form of shape parameter i, and `E::basis` emits every phi once.
template <class E, class N>
concept Effect = requires(const JointInput<N>& u, Words<N> words, typename E::template State<N>& state,
                          Saturations& saturations) {
  { E::name } -> std::convertible_to<std::string_view>;
  { E::equation } -> std::convertible_to<std::string_view>;
  { E::shape.size() } -> std::convertible_to<std::size_t>;
  { E::linear.size() } -> std::convertible_to<std::size_t>;
  { E::stored_shape(std::size_t{}, double{}, double{}) } -> std::same_as<double>;
  E::template basis<N>(u, words, state, saturations, detail::EmitNothing{});
};

/// theta^T phi of one effect for this tick; steps its state.
template <class E, class N>
constexpr typename N::TorqueSum contribution(const JointInput<N>& u, Words<N> words,
                                             typename E::template State<N>& state, Saturations& saturations) {
  const Words<N> coefficients{words.data + E::shape.size()};
  auto sum = N::no_torque();
  E::template basis<N>(u, words, state, saturations, [&](auto tag, std::size_t i, auto phi) {
    sum = sum + coefficients.template coefficient<decltype(tag)::value>(i) * phi;
  });
  return sum;
}

}  // namespace fxdyn
