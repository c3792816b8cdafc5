#pragma once

#include "model/effect.hpp"
#include "model/shapes.hpp"

namespace fxdyn {

/// Torque that comes late, tau = share * (total(t - time) - total(t)): bus and current loop. `total` is the structural
/// torque plus the effects before this one; before the first tick it counts as constant, between ticks it is
/// interpolated. share is 1; a fit that gives another value says that it is something else. Joint side of the gearbox.
struct Delay {
  static constexpr std::string_view name = "delay";
  static constexpr std::string_view equation = "share (total(t - time) - total(t))";
  static constexpr bool needs_total = true;
  static constexpr std::uint32_t capacity = 16;           ///< ticks, a power of two
  static constexpr std::uint32_t largest = capacity - 1;  ///< delay [ticks]
  static constexpr EffectTraits traits{.words = "the torque comes late: bus and current loop",
                                       .experiments = {experiments::fast_motion},
                                       .share = true,
                                       .most_ticks = largest,
                                       .of_total = OfTotal::delays};
  static constexpr std::array shape{ParameterInfo{"time", "s", "s", 0, 0.03, Quantity::count,
                                                  "bus and current loop; at most 15 ticks, 0.03 s at 2 ms",
                                                  shapes::delay}};
  static constexpr std::array linear{ParameterInfo{"share", "-", "-", 0, 2, Quantity::torque, "1 by definition"}};
  template <class N>
  struct State {
    std::array<Torque<N>, capacity> past{};
    std::uint32_t now = 0;     ///< ticks since the start; wraps
    std::uint32_t oldest = 0;  ///< age of the oldest entry
  };
  static constexpr double stored_shape(std::size_t, double time, double tick_s) { return time / tick_s; }

  template <class N, class Emit>
  static constexpr void basis(const JointInput<N>& u, Words<N> words, State<N>& state, Saturations&, Emit&& emit) {
    state.past[state.now % capacity] = u.total;
    const auto ticks = split_count(words.template number<Quantity::count>(0));
    const auto before = [&](std::uint32_t age) {
      const std::uint32_t kept = age < state.oldest ? age : state.oldest;
      return state.past[(state.now - kept) % capacity];
    };
    const auto delayed = blend<N>(before(ticks.whole), before(ticks.whole + 1), ticks.rest);
    emit(as<Quantity::torque>, 0, N::template proven_narrow<Torque<N>>(delayed - u.total));
    ++state.now;
    state.oldest += static_cast<std::uint32_t>(state.oldest < largest);
  }
};

}  // namespace fxdyn
