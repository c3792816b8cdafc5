// expect: an effect remembers plain numbers
#include "model/effect.hpp"
#include "tests/golden/tables.hpp"

#include <vector>

using N = fxdyn::tables::Numbers;

struct Push {
  static constexpr std::array<fxdyn::ParameterInfo, 0> shape{};
  template <class M>
#ifdef FXDYN_OK
  using State = std::array<fxdyn::Velocity<M>, 4>;
#else
  using State = std::vector<fxdyn::Velocity<M> >;
#endif
  template <class M, class Emit>
  static void basis(const fxdyn::JointInput<M>& u, fxdyn::Words<M>, State<M>&, fxdyn::Saturations&, Emit&& emit) {
    emit(fxdyn::as<fxdyn::Quantity::velocity>, 0, u.dq);
  }
};

auto torque(const fxdyn::JointInput<N>& u, fxdyn::Words<N> words, Push::State<N>& state, fxdyn::Saturations& counted) {
  return fxdyn::contribution<Push, N>(u, words, state, counted);
}
