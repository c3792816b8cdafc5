#pragma once

#include "model/effect.hpp"

namespace fxdyn {

/// A constant, tau = torque: amplifier offset, or a constant load. Joint side of the gearbox.
struct Offset {
  static constexpr std::string_view name = "offset";
  static constexpr std::string_view equation = "torque";
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
