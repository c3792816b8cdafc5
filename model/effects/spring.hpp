#pragma once

#include "model/effect.hpp"

namespace fxdyn {

/// A spring along the joint, tau = stiffness * q + offset: cable harness, balancing spring near its middle. The offset
/// carries the position at rest, -offset / stiffness. Joint side of the gearbox.
struct Spring {
  static constexpr std::string_view name = "spring";
  static constexpr std::string_view equation = "stiffness q + offset";
  static constexpr EffectTraits traits{.words = "a spring along the joint: a cable harness, a balancing spring",
                                       .experiments = {experiments::wide_range, experiments::wide_range_or_baseline},
                                       .changes_by_one_more = true};
  static constexpr std::array<ParameterInfo, 0> shape{};
  static constexpr std::array linear{
      ParameterInfo{"stiffness", "N*m/rad", "N/m", -unbounded, unbounded, Quantity::position, "Hooke's law"},
      ParameterInfo{"offset", "N*m", "N", -unbounded, unbounded, Quantity::unit, "Hooke's law"}};
  template <class N>
  using State = NoState;
  static constexpr double stored_shape(std::size_t, double value, double) { return value; }

  template <class N, class Emit>
  static constexpr void basis(const JointInput<N>& u, Words<N>, NoState&, Saturations&, Emit&& emit) {
    emit(as<Quantity::position>, 0, u.q);
    emit(as<Quantity::unit>, 1, N::one());
  }
};

}  // namespace fxdyn
