// expect: could not convert
#include "model/fixed.hpp"

#ifdef FXDYN_OK
fxdyn::Wide<40> product(fxdyn::Fixed<20> a, fxdyn::Fixed<20> b) { return a * b; }
#else
fxdyn::Fixed<20> product(fxdyn::Fixed<20> a, fxdyn::Fixed<20> b) { return a * b; }
#endif
