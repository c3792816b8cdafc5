#include "host_tools/effects/lugre_check.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string_view>

#include "host_tools/effects/effect_roles.hpp"

namespace fxdyn {
namespace {

constexpr std::string_view lugre = "lugre";

/// The first of the effect's parameters that is out of the catalogue's range.
std::optional<std::string> out_of_range(const EffectFit& fit, const EffectInfo& info) {
  const auto check = [](const ParameterInfo& parameter, double value) -> std::optional<std::string> {
    if (value >= parameter.lower && value <= parameter.upper) return std::nullopt;
    const bool stiff = parameter.name == "distance" && value < parameter.lower;
    return fmt::format("lugre: {} {:g} is not within {:g} .. {:g} {}: {}", parameter.name, value, parameter.lower,
                       parameter.upper, parameter.unit,
                       stiff ? "bristles that do not bend are `coulomb` and `stribeck`, take those" : "correct it");
  };
  for (std::size_t i = 0; i < fit.shape.size(); ++i) {
    if (auto why = check(info.shape[i], fit.shape[i])) return why;
  }
  // A damping that came out below zero of noisy data is no reason to refuse the model; a static friction is.
  return check(info.linear[0], fit.linear[0]);
}

/// At which the rule is asked: the Stribeck velocity, or the joint's limit where that is less.
double judged_speed(const EffectFit& fit, double dq_limit) {
  return dq_limit > 0 ? std::min(fit.shape[1], dq_limit) : fit.shape[1];
}

}  // namespace

std::optional<double> most_lugre_damping(const JointFit& joint, double dq_limit) {
  const EffectFit* fit = joint.find(lugre);
  if (fit == nullptr) return std::nullopt;
  const double velocity = fit->shape[1], share = fit->shape[2], speed = judged_speed(*fit, dq_limit);
  const EffectFit* viscous = joint.find(viscous_friction_effect().name);
  const double n = share + (1 - share) * std::exp(-speed * speed / (velocity * velocity));
  // static + viscous v + damping v (1 - 1 / n) >= 0
  return (fit->linear[0] / speed + (viscous == nullptr ? 0 : std::max(0.0, viscous->linear[0]))) * n / (1 - n);
}

void limit_lugre_damping(JointFit& joint) {
  constexpr double within = 0.999;
  const auto most = most_lugre_damping(joint, joint.dq_limit);
  if (!most) return;
  for (EffectFit& fit : joint.effects) {
    if (fit.effect == lugre) fit.linear[1] = std::min(fit.linear[1], within * *most);
  }
}

std::optional<std::string> lugre_is_no_friction(const JointFit& joint, double dq_limit) {
  const EffectFit* fit = joint.find(lugre);
  if (fit == nullptr) return std::nullopt;
  if (auto why = out_of_range(*fit, *find_effect(lugre))) return why;
  const double damping = fit->linear[1], most = *most_lugre_damping(joint, dq_limit);
  if (damping <= most) return std::nullopt;
  return fmt::format(
      "lugre: with a damping of {:.4g} it would drive the joint at {:.3g}/s instead of braking it; at most {:.4g} here",
      damping, judged_speed(*fit, dq_limit), most);
}

}  // namespace fxdyn
