#pragma once

#include "model/effect.hpp"

namespace fxdyn {

/// Counterweight or gas spring that balances a revolute joint over one turn, tau = cos cos(q) + sin sin(q), amplitude
/// and phase in one. Joint side of the gearbox.
struct GravityCompensator {
  static constexpr std::string_view name = "gravity_compensator";
  static constexpr std::string_view equation = "cos cos(q) + sin sin(q)";
  static constexpr EffectTraits traits{.words = "a balancer, or a mass on the joint that the model does not have",
                                       .experiments = {experiments::wide_range},
                                       .needs_revolute = true,
                                       .changes_by_one_more = true,
                                       .as_masses_about_axis = true};
  static constexpr std::array<ParameterInfo, 0> shape{};
  static constexpr std::array linear{ParameterInfo{"cos", "N*m", "N", -unbounded, unbounded, Quantity::unit,
                                                   "Klimchik, Wu, Dumas, Caro, Furet, Pashkevich 2013"},
                                     ParameterInfo{"sin", "N*m", "N", -unbounded, unbounded, Quantity::unit,
                                                   "Klimchik, Wu, Dumas, Caro, Furet, Pashkevich 2013"}};
  template <class N>
  using State = NoState;
  static constexpr double stored_shape(std::size_t, double value, double) { return value; }

  template <class N, class Emit>
  static constexpr void basis(const JointInput<N>& u, Words<N>, NoState&, Saturations&, Emit&& emit) {
    const auto turn = sin_cos(u.q);
    emit(as<Quantity::unit>, 0, turn.cosine);
    emit(as<Quantity::unit>, 1, turn.sine);
  }
};

}  // namespace fxdyn
