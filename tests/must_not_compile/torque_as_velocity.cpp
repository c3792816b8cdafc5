// expect: could not convert
#include "tests/golden/tables.hpp"

using N = fxdyn::tables::Numbers;

void brake(fxdyn::Velocity<N>);
#ifdef FXDYN_OK
void use(fxdyn::Velocity<N> dq) { brake(dq); }
#else
void use(fxdyn::Torque<N> tau) { brake(tau); }
#endif
