#include "host_tools/regression/tie.hpp"

#include "host_tools/effects/effects.hpp"

namespace fxdyn {

std::optional<Tie> tie_of(const JointFit& design) {
  const auto column_of = [&](std::string_view effect) -> std::optional<Eigen::Index> {
    Eigen::Index at = 0;
    for (const EffectFit& fit : design.effects) {
      if (fit.effect == effect) return at;
      at += static_cast<Eigen::Index>(find_effect(fit.effect)->linear.size());
    }
    return {};
  };
  for (std::size_t e = 0; e < design.effects.size(); ++e) {
    const EffectFit& fit = design.effects[e];
    const EffectInfo& info = *find_effect(fit.effect);
    if (info.replaces.empty()) continue;
    const auto part = column_of(info.replaces);
    if (!part) continue;
    for (std::size_t s = 0; s < info.shape.size(); ++s) {
      if (info.shape[s].quantity == Quantity::unit) return Tie{*part, *column_of(fit.effect), e, s, fit.shape[s]};
    }
  }
  return {};
}

}  // namespace fxdyn
