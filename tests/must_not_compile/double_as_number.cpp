// expect: narrowing conversion of
#include "model/fixed.hpp"

#ifdef FXDYN_OK
constexpr fxdyn::Fixed<16> x{98304};
#else
constexpr fxdyn::Fixed<16> x{1.5};
#endif
