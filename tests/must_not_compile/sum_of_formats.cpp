// expect: no match for 'operator+'
#include "model/fixed.hpp"

#ifdef FXDYN_OK
auto sum(fxdyn::Fixed<10> a, fxdyn::Fixed<10> b) { return a + b; }
#else
auto sum(fxdyn::Fixed<10> a, fxdyn::Fixed<12> b) { return a + b; }
#endif
