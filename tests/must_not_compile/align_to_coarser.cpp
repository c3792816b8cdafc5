// expect: the accumulator is coarser than the number: narrow explicitly
#include "model/fixed.hpp"

#ifdef FXDYN_OK
constexpr int bits = 40;
#else
constexpr int bits = 10;
#endif
auto sum(fxdyn::Wide<bits> total, fxdyn::Fixed<20> x) { return total + align(x, total); }
