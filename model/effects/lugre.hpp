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
/// Each tick is stepped exactly for the mean of its velocity at both ends:
///   y <- y e + n s (1 - e),   e = exp(-|mean| tick / (distance n(mean))).
/// It is stable for every tick, since y stays between its last value and n s. The mean makes the path of a tick right
/// to second order; with the velocity at the end of the tick the error is 50 times as large.
struct LuGre {
  static constexpr std::string_view name = "lugre";
  static constexpr std::string_view equation =
      "static (y - share s) + damping (dq - |dq| y / n), dy/dt = (dq - |dq| y / n) / distance, "
      "n = share + (1 - share) exp(-(dq / velocity)^2)";
  static constexpr EffectTraits traits{
      .words = "stick-slip: bristles bend before they slide, and slide more easily the faster they do",
      .experiments = {experiments::small_reversals},
      .friction = true,
      .identified = 5,
      .replaces = "coulomb",
      .unites = {"presliding", "stribeck"}};
  static constexpr std::array shape{
      ParameterInfo{"distance", "rad", "m", 1e-7, 0.03, Quantity::inverse_path, "Han, Wu, Hui 2025, Eq. 20",
                    shapes::distance},
      ParameterInfo{"velocity", "rad/s", "m/s", 1e-5, 1e3, Quantity::inverse_velocity, "Han, Wu, Hui 2025, Eq. 21",
                    shapes::velocity},
      ParameterInfo{"share", "1", "1", 0.25, 1, Quantity::unit, "Han, Wu, Hui 2025, Eq. 21: Fc / Fs",
                    shapes::friction_share}};
  static constexpr std::array linear{
      ParameterInfo{"static", "N*m", "N", 0, unbounded, Quantity::unit, "Han, Wu, Hui 2025, Eq. 21"},
      ParameterInfo{"damping", "N*m*s/rad", "N*s/m", 0, unbounded, Quantity::velocity, "Han, Wu, Hui 2025, Eq. 20"}};
  template <class N>
  struct State {
    Unit<N> y{};
    Velocity<N> dq{};  ///< of the tick before
  };
  static constexpr double stored_shape(std::size_t i, double value, double tick_s) {
    return i == 0 ? tick_s / value : i == 1 ? 1 / value : value;
  }

  /// n(dq), between share and 1.
  template <class N>
  static constexpr Unit<N> steady(Velocity<N> dq, InverseVelocity<N> inverse_velocity, Unit<N> share) {
    return blend<N>(share, N::one(), bell_of<N>(N::template clamp<Argument<N>>(dq * inverse_velocity)));
  }

  template <class N, class Emit>
  static constexpr void basis(const JointInput<N>& u, Words<N> words, State<N>& state, Saturations&, Emit&& emit) {
    const auto inverse_velocity = words.template number<Quantity::inverse_velocity>(1);
    const auto share = words.template number<Quantity::unit>(2);
    const auto sum = u.dq + state.dq;
    const auto mean = N::template proven_narrow<Velocity<N>>(half_of(sum));
    const auto path = N::template clamp<Argument<N>>(magnitude(mean) * words.template number<Quantity::inverse_path>(0));
    const auto n = steady<N>(mean, inverse_velocity, share);
    const auto decay = exp_negative(N::template clamp<Argument<N>>(path * reciprocal_of(n)));
    const auto target = N::template proven_narrow<Unit<N>>(n * sign_of(sum));
    state.y = relax<N>(state.y, target, N::template proven_narrow<Unit<N>>(N::one() - decay));
    state.dq = u.dq;
    const auto now = N::template clamp<Ratio<N>>(state.y * reciprocal_of(steady<N>(u.dq, inverse_velocity, share)));
    const auto sliding = magnitude(u.dq) * now;
    const auto coulomb = share * u.sign;
    emit(as<Quantity::unit>, 0, N::template clamp<Unit<N>>(align(state.y, coulomb) - coulomb));
    emit(as<Quantity::velocity>, 1, N::template clamp<Velocity<N>>(align(u.dq, sliding) - sliding));
  }
};

}  // namespace fxdyn
