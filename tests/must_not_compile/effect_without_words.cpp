// expect: an effect says in plain words what it is, and which experiment shows it
#include "model/effect.hpp"

struct Nameless {
#ifdef FXDYN_OK
  static constexpr fxdyn::EffectTraits traits{.words = "it pushes", .experiments = {fxdyn::experiments::all_poses}};
#else
  static constexpr fxdyn::EffectTraits traits{.words = "it pushes"};
#endif
  static constexpr std::array<fxdyn::ParameterInfo, 0> shape{};
};
static_assert(fxdyn::Declared<Nameless>::value);
