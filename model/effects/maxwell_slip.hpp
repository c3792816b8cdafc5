#pragma once

#include "model/effect.hpp"
#include "model/shapes.hpp"

namespace fxdyn {

namespace detail {
/// Of one contact of MaxwellSlip.
constexpr ParameterInfo slip_force(std::string_view which) {
  return {which, "N*m", "N", 0, unbounded, Quantity::unit, "Rizos, Fassois 2004"};
}
}  // namespace detail

/// Maxwell slip: friction of many contacts that slip one after the other. Each is a spring that bends with the motion
/// and slips where it is full, z_i <- limited to [-1, 1] of z_i + way / distance_i, with distance_i = distance / 2^(i -
/// 1):
///   tau = sum_i force_i (z_i - s).
/// s is the sign that the effect `coulomb` has: with its amplitude the sum of the forces, friction is sum force_i z_i.
/// It remembers every reversal that no larger one has passed since, which a single bristle does not. The way of a tick
/// is that of the mean velocity of its ends. It is stable for every tick, since |z_i| <= 1. Joint side. Rizos and
/// Fassois 2004 (there with distances that are free); Al-Bender, Lampaert, Swevers 2005.
struct MaxwellSlip {
  static constexpr std::size_t elements = 5;
  static constexpr std::string_view name = "maxwell_slip";
  static constexpr std::string_view equation =
      "sum_i force_i (z_i - s), z_i <- z_i + way / (distance / 2^(i - 1)) within -1 .. 1";
  static constexpr EffectTraits traits{
      .words = "friction builds up over a path after a reversal, as many contacts slip one after the other",
      .experiments = {experiments::small_reversals},
      .friction = true,
      .replaces = "coulomb",
      .unites = {"presliding", "lugre"}};
  static constexpr std::array shape{ParameterInfo{"distance", "rad", "m", 1e-7, 0.1, Quantity::inverse_path,
                                                  "Rizos, Fassois 2004: of the last contact that slips",
                                                  shapes::distance}};
  static constexpr std::array linear{detail::slip_force("force_1"), detail::slip_force("force_2"),
                                     detail::slip_force("force_3"), detail::slip_force("force_4"),
                                     detail::slip_force("force_5")};
  template <class N>
  struct State {
    std::array<Unit<N>, elements> z{};
    Velocity<N> dq{};  ///< of the tick before
  };
  static constexpr double stored_shape(std::size_t, double distance, double tick_s) { return tick_s / distance; }

  template <class N, class Emit>
  static constexpr void basis(const JointInput<N>& u, Words<N> words, State<N>& state, Saturations&, Emit&& emit) {
    const auto mean = N::template proven_narrow<Velocity<N>>(half_of(u.dq + state.dq));
    state.dq = u.dq;
    auto moved = N::template clamp<Unit<N>>(mean * words.template number<Quantity::inverse_path>(0));
    for (std::size_t i = 0; i < elements; ++i) {
      state.z[i] = slip(state.z[i], moved);
      // 2 itself is just outside the format
      emit(as<Quantity::unit>, i, N::template clamp<Unit<N>>(state.z[i] - u.sign));
      moved = doubled(moved);
    }
  }
};

}  // namespace fxdyn
