#pragma once

#include "model/effect.hpp"

namespace fxdyn {

/// Gear wheel or encoder disc off its centre, delta = sin sin(q) + cos cos(q), once a turn of a revolute joint. Acts on
/// the position: the link is at q - delta. Link side of the gearbox, in its angle.
struct Eccentricity {
  static constexpr std::string_view name = "eccentricity";
  static constexpr std::string_view equation = "delta = sin sin(q) + cos cos(q)";
  static constexpr ActsOn acts_on = ActsOn::position;
  static constexpr EffectTraits traits{
      .words = "an eccentric gear or encoder disc: an error of position that repeats once a turn",
      .experiments = {experiments::fast_motion},
      .needs_revolute = true};
  static constexpr std::array<ParameterInfo, 0> shape{};
  static constexpr std::array linear{
      ParameterInfo{"sin", "rad", "m", -0.1, 0.1, Quantity::unit, "Tuttle, Seering 1996 (kinematic error)"},
      ParameterInfo{"cos", "rad", "m", -0.1, 0.1, Quantity::unit, "Tuttle, Seering 1996 (kinematic error)"}};
  template <class N>
  using State = NoState;
  static constexpr double stored_shape(std::size_t, double value, double) { return value; }

  template <class N, class Emit>
  static constexpr void basis(const JointInput<N>& u, Words<N>, NoState&, Saturations&, Emit&& emit) {
    const auto turn = sin_cos(u.q);
    emit(as<Quantity::unit>, 0, turn.sine);
    emit(as<Quantity::unit>, 1, turn.cosine);
  }
};

}  // namespace fxdyn
