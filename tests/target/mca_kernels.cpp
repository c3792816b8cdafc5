// The inner loops of the tick, a function each, for mca.sh. Without loops: llvm-mca doesn't follow branches.

#include "model/math.hpp"
#include "model/numbers.hpp"
#include "tests/golden/tables.hpp"

using N = fxdyn::tables::Numbers;
using fxdyn::Argument;
using fxdyn::Saturations;
using fxdyn::Unit;
using fxdyn::Weight;

extern "C" {

/// Weighted sum of a BLS node with its four inputs and its bias.
void kernel_node(const Weight<N>* w, const Argument<N>* u, Argument<N>* out) {
  auto sum = w[0] * u[0] + w[1] * u[1] + w[2] * u[2] + w[3] * u[3];
  *out = N::clamp<Argument<N>>(sum + align(w[4], sum));
}

/// Its activation.
void kernel_tanh(const Argument<N>* x, Unit<N>* out) { *out = fxdyn::tanh_of(*x); }

/// Sine and cosine of a joint's position.
void kernel_sin_cos(const fxdyn::Position<N>* q, Unit<N>* sine, Unit<N>* cosine) {
  const auto result = fxdyn::sin_cos(*q);
  *sine = result.sine;
  *cosine = result.cosine;
}

/// A vector turned into the next link's frame.
void kernel_rotate(const Unit<N>* r, const fxdyn::LinearAcceleration<N>* v, fxdyn::LinearAcceleration<N>* out,
                   Saturations& saturations) {
#pragma GCC unroll 3
  for (int i = 0; i < 3; ++i) {
    out[i] = N::narrow<fxdyn::LinearAcceleration<N>>(r[3 * i] * v[0] + r[3 * i + 1] * v[1] + r[3 * i + 2] * v[2],
                                                     saturations);
  }
}
}
