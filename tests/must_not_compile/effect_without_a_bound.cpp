// expect: an effect emits a number of the quantity it names
#include "model/effect.hpp"
#include "tests/golden/tables.hpp"

using N = fxdyn::tables::Numbers;

struct Push {
  static constexpr std::array<fxdyn::ParameterInfo, 0> shape{};
  template <class M>
  using State = fxdyn::NoState;
  template <class M, class Emit>
  static void basis(const fxdyn::JointInput<M>& u, fxdyn::Words<M>, State<M>&, fxdyn::Saturations&, Emit&& emit) {
    const auto power = u.dq * u.sign;
#ifdef FXDYN_OK
    emit(fxdyn::as<fxdyn::Quantity::velocity>, 0, M::template proven_narrow<fxdyn::Velocity<M>>(power));
#else
    emit(fxdyn::as<fxdyn::Quantity::velocity>, 0, power);
#endif
  }
};

auto torque(const fxdyn::JointInput<N>& u, fxdyn::Words<N> words, Push::State<N>& state, fxdyn::Saturations& counted) {
  return fxdyn::contribution<Push, N>(u, words, state, counted);
}
