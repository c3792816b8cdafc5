#pragma once

#include <array>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <type_traits>

#include "model/effect_traits.hpp"
#include "model/math.hpp"
#include "model/numbers.hpp"

// An effect is a contribution to one joint's torque, tau = theta^T phi(u; shape, state): theta linear coefficients,
// shape nonlinear parameters, state what it remembers from tick to tick. Each effect stands in one file of
// model/effects and is the only definition of its formula: firmware and simulator sum coefficient * phi, the identifier
// takes phi as columns.

namespace fxdyn {

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
  template <Quantity quantity>
  constexpr auto deflection_coefficient(std::size_t i) const {
    return N::template load<typename N::template DeflectionCoefficient<quantity>>(data[i]);
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

/// What the host has to know of an effect beside its formula. Checked where the catalogue is made.
template <class E>
struct Declared {
  static_assert(
      requires { E::traits.words; }, "an effect declares `static constexpr EffectTraits traits`");
  static_assert(!E::traits.words.empty() && !E::traits.experiments[0].text.empty(),
                "an effect says in plain words what it is, and which experiment shows it");
  static_assert(
      [] {
        for (const ParameterInfo& shape : E::shape) {
          if (!shape.values.declared()) return false;
        }
        return true;
      }(),
      "an effect says which values of each shape parameter to try (model/shapes.hpp)");
  static_assert(needs_total<E> == (E::traits.of_total != OfTotal::nothing),
                "an effect that needs the total says what it does with it");
  static_assert(!E::traits.nominal || E::shape.size() == 0, "a nominal effect has no shape");
  static_assert(
      !E::traits.drifts() || requires { E::warmth(0.0, 0.0); }, "an effect that drifts has a warmth()");
  static constexpr bool value = true;
};

template <class... Effects>
struct EffectList {
  static constexpr std::size_t size = sizeof...(Effects);
  /// Calls visit.operator()<E>() for each effect, in order.
  template <class Visit>
  static constexpr void for_each(Visit&& visit) {
    (visit.template operator()<Effects>(), ...);
  }
  template <template <class...> class To>
  using apply = To<Effects...>;
};

namespace detail {
template <class... A, class... B>
EffectList<A..., B...> join(EffectList<A...>, EffectList<B...>);
}  // namespace detail
template <class First, class Second>
using Joined = decltype(detail::join(First{}, Second{}));

/// Words of one effect in the tables.
template <class E>
inline constexpr std::size_t words_of = [] {
  if constexpr (requires { E::words; })
    return E::words;
  else
    return E::shape.size() + E::linear.size();
}();

namespace detail {
/// What an effect emits is a stored number of the quantity that it names.
template <class N, class Tag, class Phi>
consteval void check_phi() {
  static_assert(std::is_same_v<Phi, typename N::template Of<Tag::value>>,
                "an effect emits a number of the quantity it names: N::clamp where the value may leave its range, "
                "N::proven_narrow where it can't");
}
}  // namespace detail

/// theta^T phi of one effect for this tick, as N::TorqueSum or N::DeflectionSum; steps its state.
template <class E, class N>
constexpr auto contribution(const JointInput<N>& u, Words<N> words, typename E::template State<N>& state,
                            Saturations& saturations) {
  static_assert(std::is_trivially_copyable_v<typename E::template State<N>>,
                "an effect remembers plain numbers: nothing that allocates or points elsewhere");
  if constexpr (requires { E::template sum<N>(u, words, state, saturations); }) {
    return E::template sum<N>(u, words, state, saturations);
  } else {
    const Words<N> coefficients{words.data + E::shape.size()};
    if constexpr (acts_on<E> == ActsOn::position) {
      auto sum = N::no_deflection();
      E::template basis<N>(u, words, state, saturations, [&](auto tag, std::size_t i, auto phi) {
        detail::check_phi<N, decltype(tag), decltype(phi)>();
        sum = sum + coefficients.template deflection_coefficient<decltype(tag)::value>(i) * phi;
      });
      return sum;
    } else {
      auto sum = N::no_torque();
      E::template basis<N>(u, words, state, saturations, [&](auto tag, std::size_t i, auto phi) {
        detail::check_phi<N, decltype(tag), decltype(phi)>();
        sum = sum + coefficients.template coefficient<decltype(tag)::value>(i) * phi;
      });
      return sum;
    }
  }
}

}  // namespace fxdyn
