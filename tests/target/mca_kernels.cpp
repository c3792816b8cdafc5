// The inner loops of the tick, a function each, for mca.sh: the library's own functions, without loops, since llvm-mca
// doesn't follow branches.

#include "model/joint_model.hpp"
#include "tests/golden/tables.hpp"

using N = fxdyn::tables::Numbers;
namespace raw = fxdyn::raw;

extern "C" {

/// Two BLS nodes: their arguments from four inputs.
void kernel_two_nodes(const std::int32_t* rows, const std::int32_t* u, std::int32_t* out) {
  raw::dense<4, raw::tanh_argument_width>(2, N::weight_bits() - 1, rows, u, out);
}

/// Their activations, weighted and added up.
void kernel_two_tanh(const std::int32_t* coefficients, const std::int32_t* x, std::int64_t* out) {
  *out = raw::weighted_tanh(2, coefficients, x);
}

/// The same of two ramps.
void kernel_two_ramps(const std::int32_t* coefficients, const std::int32_t* x, std::int64_t* out) {
  *out = raw::weighted_ramp(2, coefficients, x);
}

/// Sixteen products of a dense row.
void kernel_row_16(const std::int32_t* row, const std::int32_t* u, std::int64_t* out) {
  *out = raw::dense_row<16>(row, u).value();
}

/// Sine and cosine of a joint's position.
void kernel_sin_cos(const fxdyn::Position<N>* q, fxdyn::SineCosine<fxdyn::Unit<N>>* out) { *out = fxdyn::sin_cos(*q); }

/// A vector turned into the next link's frame, any twist.
void kernel_rotate(const fxdyn::LinkGeometry<N>* link, const fxdyn::LinkMotion<N>* motion,
                   fxdyn::Vector3<fxdyn::LinearAcceleration<N>>* v) {
  *v = fxdyn::detail::to_child<N>(fxdyn::AnyLink{}, *link, *motion, *v);
}

/// A step of Dahl's model.
void kernel_dahl(fxdyn::Dahl<N>* state, const fxdyn::Velocity<N>* dq, const fxdyn::InversePath<N>* inverse_path,
                 fxdyn::Saturations* saturations) {
  state->step(*dq, *inverse_path, *saturations);
}
}
