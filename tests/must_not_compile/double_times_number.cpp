// expect: no match for 'operator*'
#include "model/fixed.hpp"

#ifdef FXDYN_OK
auto twice(fxdyn::Fixed<16> x) { return fxdyn::Fixed<0>{2} * x; }
#else
auto twice(fxdyn::Fixed<16> x) { return 2.0 * x; }
#endif
