#pragma once

#include "model/effect.hpp"
#include "model/shapes.hpp"

namespace fxdyn {

/// LuGre friction (Canudas de Wit et al. 1995; Han, Wu, Hui 2025, Eqs. 20-21) without its viscous term, which is the
/// effect `viscous`. With the bristle deflection in parts of its largest one, y = sigma0 z / Fs:
///   dy/dt = (dq - |dq| y / n(dq)) / distance,   n(dq) = share + (1 - share) exp(-(dq / velocity)^2),
///   tau = static (y - share s) + damping (dq - |dq| y / n(dq)).
/// Fs = static, Fc = share static: static friction and Coulomb's; distance = Fs / sigma0; damping = sigma1; s is the
/// sign that the effect `coulomb` has: with its amplitude share * static, both add up to static y. Joint side.
///
/// Each tick is stepped exactly for a constant velocity, the mean of those at its ends, and n of its end:
///   y <- y e + n s (1 - e),   e = exp(-|mean| tick / (distance n)).
/// It is stable for every tick, since y stays between its last value and n s. The mean makes the path of a tick right
/// to second order; with the velocity at its end alone the error is 20 to 80 times as large.
struct Lugre {
  static constexpr std::string_view name = "lugre";
  static constexpr std::string_view equation =
      "static (y - share s) + damping (dq - |dq| y / n), dy/dt = (dq - |dq| y / n) / distance, "
      "n = share + (1 - share) exp(-(dq / velocity)^2)";
  static constexpr EffectTraits traits{
      .words = "stick-slip: bristles bend before they slide, and slide more easily the faster they do",
      .experiments = {experiments::small_reversals},
      .friction = true,
      .replaces = "coulomb",
      .unites = {"presliding", "stribeck"}};
  static constexpr std::array shape{ParameterInfo{"distance", "rad", "m", 1e-7, 0.03, Quantity::inverse_path,
                                                  "Han, Wu, Hui 2025, Eq. 20", shapes::distance},
                                    ParameterInfo{"velocity", "rad/s", "m/s", 1e-5, 1e3, Quantity::inverse_velocity,
                                                  "Han, Wu, Hui 2025, Eq. 21", shapes::velocity},
                                    ParameterInfo{"share", "1", "1", 0.25, 0.99, Quantity::unit,
                                                  "Han, Wu, Hui 2025, Eq. 21: Fc / Fs", shapes::friction_share}};
  static constexpr std::array linear{
      ParameterInfo{"static", "N*m", "N", 0, unbounded, Quantity::unit, "Han, Wu, Hui 2025, Eq. 21"},
      ParameterInfo{"damping", "N*m*s/rad", "N*s/m", 0, unbounded, Quantity::velocity, "Han, Wu, Hui 2025, Eq. 20"}};
  template <class N>
  struct State {
    Unit<N> y{};
    Velocity<N> dq{};  ///< of the tick before
  };
  static constexpr double stored_shape(std::size_t i, double value, double tick_s) {
    return i == 0 ? tick_s / value : i == 1 ? 1 / value : 1 - value;
  }

  template <class N, class Emit>
  static constexpr void basis(const JointInput<N>& u, Words<N> words, State<N>& state, Saturations&, Emit&& emit) {
    const auto inverse_path = words.template number<Quantity::inverse_path>(0);
    const auto inverse_velocity = words.template number<Quantity::inverse_velocity>(1);
    const auto most_fall = words.template number<Quantity::unit>(2);
    const auto one = N::one();
    const auto bell = bell_of<N>(N::template clamp<Argument<N>>(u.dq * inverse_velocity));
    const auto fall = N::template proven_narrow<Unit<N>>(most_fall * N::template proven_narrow<Unit<N>>(one - bell));
    const auto n = N::template proven_narrow<Unit<N>>(one - fall);
    const auto inverse = reciprocal_of(n);

    const auto way = u.dq + state.dq;
    const auto mean = N::template proven_narrow<Velocity<N>>(half_of(way));
    const auto rate = N::template proven_narrow<InversePath<N>>(inverse_path * inverse);
    const auto decay = exp_negative(N::template clamp<Argument<N>>(magnitude(mean) * rate));
    state.y = relax<N>(state.y, signed_as(n, way), N::template proven_narrow<Unit<N>>(one - decay));
    state.dq = u.dq;

    const auto coulomb = N::template proven_narrow<Unit<N>>(one - most_fall) * u.sign;
    const auto sliding = magnitude(u.dq) * N::template proven_narrow<Ratio<N>>(state.y * inverse);
    emit(as<Quantity::unit>, 0, N::template clamp<Unit<N>>(align(state.y, coulomb) - coulomb));
    emit(as<Quantity::velocity>, 1, N::template proven_narrow<Velocity<N>>(align(u.dq, sliding) - sliding));
  }
};

}  // namespace fxdyn
