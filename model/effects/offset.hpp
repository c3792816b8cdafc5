#pragma once

#include "model/effect.hpp"

namespace fxdyn {

/// A constant, tau = torque: amplifier offset, or a constant load. Joint side of the gearbox.
struct Offset {
  static constexpr std::string_view name = "offset";
  static constexpr std::string_view equation = "torque";
  static constexpr EffectTraits traits{
      .words = "a constant torque: offset of the amplifier, or a load that never changes",
      .experiments = {experiments::wide_range, experiments::slow_reversals, experiments::wide_range_or_baseline},
      .nominal = true,
      .friction = true};
  static constexpr std::array<ParameterInfo, 0> shape{};
  static constexpr std::array linear{ParameterInfo{"torque", "N*m", "N", -unbounded, unbounded, Quantity::unit,
                                                   "Janot, Gautier, Brunot 2019 (EMPS), Eq. 1"}};
  template <class N>
  using State = NoState;
  static constexpr double stored_shape(std::size_t, double value, double) { return value; }

  template <class N, class Emit>
  static constexpr void basis(const JointInput<N>&, Words<N>, NoState&, Saturations&, Emit&& emit) {
    emit(as<Quantity::unit>, 0, N::one());
  }
};

}  // namespace fxdyn
