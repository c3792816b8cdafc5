#pragma once

#include "model/effects/bristle.hpp"

namespace fxdyn {

/// LuGre friction (Canudas de Wit et al. 1995; Han, Wu, Hui 2025, Eqs. 20-21) without its viscous term, which is the
/// effect `viscous`. With the bristle deflection in parts of its largest one, y = sigma0 z / Fs:
///   dy/dt = (dq - |dq| y / n(dq)) / distance,   n(dq) = share + (1 - share) exp(-(dq / velocity)^2),
///   tau = static (y - share s) + damping (dq - |dq| y / n(dq)).
/// Fs = static, Fc = share static: static friction and Coulomb's; distance = Fs / sigma0; damping = sigma1; s is the
/// sign that the effect `coulomb` has: with its amplitude share * static, both add up to static y. Joint side.
/// The step of a tick: Bristle. It is stable at every tick, so that no tick is too long.
///
/// What a set of parameters can be is active: bristles that are still bent as at rest, y = 1, pull with
/// static + damping dq (1 - 1 / n(dq)), which turns round where damping is large and n < 1. LuGre friction is passive
/// at every speed only with viscous >= damping (1 - share) / share (Barabanov and Ortega, IEEE Trans. Automatic Control
/// 45, 2000, pp. 830-832). That is more than published sets have, since bristles don't stay bent at speed. Asked for is
/// what any friction has to have: it still brakes at the Stribeck velocity, where bristles let go, or at the joint's
/// limit where that is less.
struct Lugre {
  static constexpr std::string_view name = "lugre";
  static constexpr std::string_view equation =
      "static (y - share s) + damping (dq - |dq| y / n), dy/dt = (dq - |dq| y / n) / distance, "
      "n = share + (1 - share) exp(-(dq / velocity)^2)";
  static double judged_speed(const double* at, double limit) { return limit > 0 && limit < at[1] ? limit : at[1]; }
  /// static + viscous v + damping v (1 - 1 / n) >= 0
  static double most_damping(const double* at, double speed, double first, double viscous) {
    const double velocity = at[1], share = at[2];
    const double n = share + (1 - share) * exp_negative(speed * speed / (velocity * velocity));
    return (first / speed + (viscous > 0 ? viscous : 0)) * n / (1 - n);
  }
  static constexpr EffectTraits traits{
      .words = "stick-slip: bristles bend before they slide, and slide more easily the faster they do",
      .experiments = {experiments::small_reversals},
      .friction = true,
      .brakes = {1, judged_speed, most_damping, true},
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
    Bristle<N> bristle{};
    Velocity<N> dq{};  ///< of the tick before
  };
  static constexpr double stored_shape(std::size_t i, double value, double tick_s) {
    return i == 0 ? tick_s / value : i == 1 ? 1 / value : 1 - value;
  }

  template <class N, class Emit>
  static constexpr void basis(const JointInput<N>& u, Words<N> words, State<N>& state, Saturations&, Emit&& emit) {
    const auto most_fall = words.template number<Quantity::unit>(2);
    const auto level = SlidingLevel<N>::at(u.dq, words.template number<Quantity::inverse_velocity>(1), most_fall);
    state.bristle.step(u.dq + state.dq, words.template number<Quantity::inverse_path>(0), level);
    state.dq = u.dq;

    const auto y = state.bristle.y;
    const auto coulomb = N::template proven_narrow<Unit<N>>(N::one() - most_fall) * u.sign;
    emit(as<Quantity::unit>, 0, N::template clamp<Unit<N>>(align(y, coulomb) - coulomb));
    emit(as<Quantity::velocity>, 1, state.bristle.rate(u.dq, level));
  }
};

}  // namespace fxdyn
