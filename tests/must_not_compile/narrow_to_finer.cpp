// expect: narrowing to a finer format
#include "tests/golden/tables.hpp"

using N = fxdyn::tables::Numbers;

#ifdef FXDYN_OK
constexpr int bits = 30;
#else
constexpr int bits = 10;
#endif
auto stored(fxdyn::Wide<bits> x, fxdyn::Saturations& saturations) {
  return N::narrow<fxdyn::Fixed<20>>(x, saturations);
}
