// expect: no match for 'operator='
#include "model/fixed.hpp"

void set(fxdyn::Fixed<16>& x, double value) {
#ifdef FXDYN_OK
  static_cast<void>(value);
  x = fxdyn::Fixed<16>{98304};
#else
  x = value;
#endif
}
