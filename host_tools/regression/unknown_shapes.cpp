#include "host_tools/regression/unknown_shapes.hpp"

#include <algorithm>

namespace fxdyn {
namespace {

/// Widths and distances that no joint has: what the catalogue's bounds leave.
constexpr double smallest_shape = 1e-8, largest_shape = 1e3;

}  // namespace

bool is_continuous(const ParameterInfo& shape) {
  if (shape.values.search != ShapeSearch::refine) return false;
  return shape.quantity == Quantity::inverse_velocity || shape.quantity == Quantity::inverse_path ||
         shape.quantity == Quantity::unit;
}

void UnknownShape::set(double to) const { *value = std::clamp(to, least, most); }

std::vector<UnknownShape> unknown_shapes(JointFit& design) {
  std::vector<UnknownShape> out{{&design.sign_width, smallest_shape, largest_shape}};
  for (EffectFit& fit : design.effects) {
    const auto infos = find_effect(fit.effect)->shape;
    for (std::size_t i = 0; i < infos.size(); ++i) {
      if (!is_continuous(infos[i])) continue;
      out.push_back({&fit.shape[i], std::max(smallest_shape, infos[i].lower), std::min(largest_shape, infos[i].upper)});
    }
  }
  return out;
}

}  // namespace fxdyn
