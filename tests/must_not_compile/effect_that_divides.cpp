// expect: no division on the drive
#include "model/effect.hpp"
#include "tests/golden/tables.hpp"

using N = fxdyn::tables::Numbers;

#ifdef FXDYN_OK
auto ratio(fxdyn::Velocity<N> dq, fxdyn::InverseVelocity<N> reciprocal) { return dq * reciprocal; }
#else
auto ratio(fxdyn::Velocity<N> dq, fxdyn::Velocity<N> knee) { return dq / knee; }
#endif
