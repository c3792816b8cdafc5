#include "host_tools/effects/braking.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "host_tools/effects/effect_roles.hpp"

namespace fxdyn {
namespace {

/// What explains a contact that is too stiff to have this parameter: what the effect replaces, and those parts of it
/// that do without the parameter.
std::string stiff_parts(const EffectInfo& info, std::string_view parameter) {
  std::string out = fmt::format("`{}`", info.replaces);
  for (const std::string_view part : info.unites) {
    if (part.empty()) continue;
    const auto& shape = find_effect(part)->shape;
    if (std::none_of(shape.begin(), shape.end(), [&](const ParameterInfo& one) { return one.name == parameter; }))
      out += fmt::format(" and `{}`", part);
  }
  return out;
}

/// The first of the effect's parameters that is out of the catalogue's range.
std::optional<std::string> out_of_range(const EffectFit& fit, const EffectInfo& info) {
  const auto check = [&](const ParameterInfo& parameter, double value) -> std::optional<std::string> {
    if (value >= parameter.lower && value <= parameter.upper) return std::nullopt;
    const bool stiff = parameter.values.seen_by_encoder && info.unites_others() && value < parameter.lower;
    return fmt::format(
        "{}: {} {:g} is not within {:g} .. {:g} {}: {}", info.name, parameter.name, value, parameter.lower,
        parameter.upper, parameter.unit,
        stiff ? fmt::format("bristles that do not bend are {}, take those", stiff_parts(info, parameter.name))
              : "correct it");
  };
  for (std::size_t i = 0; i < fit.shape.size(); ++i) {
    if (auto why = check(info.shape[i], fit.shape[i])) return why;
  }
  // A damping that came out below zero of noisy data is no reason to refuse the model; a static friction is.
  return info.brakes.given ? check(info.linear[0], fit.linear[0]) : std::nullopt;
}

}  // namespace

std::optional<double> most_that_brakes(const JointFit& joint, const EffectFit& fit, double dq_limit) {
  const Braking& brakes = find_effect(fit.effect)->brakes;
  if (!brakes.given) return std::nullopt;
  const EffectFit* viscous = joint.find(viscous_friction_effect().name);
  const double speed = brakes.speed(fit.shape.data(), dq_limit);
  return brakes.most(fit.shape.data(), speed, fit.linear[0], viscous == nullptr ? 0 : viscous->linear[0]);
}

void let_it_brake(JointFit& joint) {
  constexpr double within = 0.999;
  for (EffectFit& fit : joint.effects) {
    const auto most = most_that_brakes(joint, fit, joint.dq_limit);
    if (!most) continue;
    double& value = fit.linear[find_effect(fit.effect)->brakes.coefficient];
    value = std::min(value, within * *most);
  }
}

std::optional<std::string> why_it_does_not_brake(const JointFit& joint, double dq_limit) {
  for (const EffectFit& fit : joint.effects) {
    const EffectInfo& info = *find_effect(fit.effect);
    if (!info.brakes.given && !info.unites_others()) continue;
    if (auto why = out_of_range(fit, info)) return why;
    if (!info.brakes.given) continue;
    const double value = fit.linear[info.brakes.coefficient], most = *most_that_brakes(joint, fit, dq_limit);
    if (value <= most) continue;
    return fmt::format(
        "{}: with a {} of {:.4g} it would drive the joint at {:.3g}/s instead of braking it; at most "
        "{:.4g} here",
        info.name, info.linear[info.brakes.coefficient].name, value, info.brakes.speed(fit.shape.data(), dq_limit),
        most);
  }
  return std::nullopt;
}

}  // namespace fxdyn
