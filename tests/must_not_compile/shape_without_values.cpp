// expect: an effect says which values of each shape parameter to try
#include "model/effect.hpp"
#include "model/shapes.hpp"

#ifdef FXDYN_OK
constexpr fxdyn::ShapeValues values = fxdyn::shapes::velocity;
#else
constexpr fxdyn::ShapeValues values{};
#endif

struct Bump {
  static constexpr fxdyn::EffectTraits traits{.words = "a bump", .experiments = {fxdyn::experiments::constant_speeds}};
  static constexpr std::array shape{
      fxdyn::ParameterInfo{"velocity", "rad/s", "m/s", 1e-5, 1e3, fxdyn::Quantity::inverse_velocity, "", values}};
};
static_assert(fxdyn::Declared<Bump>::value);
