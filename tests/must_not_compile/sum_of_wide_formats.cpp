// expect: no match for 'operator+'
#include "model/fixed.hpp"

#ifdef FXDYN_OK
auto sum(fxdyn::Wide<40> a, fxdyn::Wide<40> b) { return a + b; }
#else
auto sum(fxdyn::Wide<40> a, fxdyn::Wide<44> b) { return a + b; }
#endif
