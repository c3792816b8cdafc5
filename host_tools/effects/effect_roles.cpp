#include "host_tools/effects/effect_roles.hpp"

#include <algorithm>
#include <stdexcept>
#include <string>

#include "model/catalogue.hpp"

namespace fxdyn {
namespace {

template <class Plays>
const EffectInfo& first_that(Plays&& plays, const char* role) {
  const auto& all = effect_infos();
  const auto found = std::find_if(all.begin(), all.end(), plays);
  if (found == all.end()) throw std::logic_error(std::string("no effect of the catalogue is ") + role);
  return *found;
}

template <class Plays>
const EffectFit* first_of(const JointFit& joint, Plays&& plays) {
  const auto found = std::find_if(joint.effects.begin(), joint.effects.end(),
                                  [&](const EffectFit& fit) { return plays(*find_effect(fit.effect)); });
  return found == joint.effects.end() ? nullptr : &*found;
}

bool adds_mass(const EffectInfo& info) {
  bool out = false;
  BodyEffects::for_each([&]<class E>() {
    if constexpr (requires { &E::add_to; }) out |= E::name == info.name;
  });
  return out;
}

}  // namespace

const EffectInfo& load_effect() {
  static const EffectInfo& found = first_that(adds_mass, "a load");
  return found;
}
bool is_load(std::string_view effect) { return effect == load_effect().name; }

bool turns_gravity(std::string_view effect) {
  bool out = false;
  BodyEffects::for_each([&]<class E>() {
    if constexpr (requires { &E::turn; }) out |= E::name == effect;
  });
  return out;
}

const EffectInfo& rotor_effect() {
  static const EffectInfo& found = first_that([](const EffectInfo& info) { return info.in_base; }, "a rotor");
  return found;
}

const EffectInfo& dry_friction_effect() {
  static const EffectInfo& found = first_that(
      [](const EffectInfo& info) { return info.nominal && info.turns_with_sign == TurnsWithSign::amplitude; },
      "dry friction");
  return found;
}

const EffectInfo& viscous_friction_effect() {
  static const EffectInfo& found = first_that(
      [](const EffectInfo& info) {
        return info.nominal && info.friction && info.linear[0].quantity == Quantity::velocity;
      },
      "viscous friction");
  return found;
}

const EffectInfo& friction_of_load_effect() {
  static const EffectInfo& found =
      first_that([](const EffectInfo& info) { return info.turns_with_sign == TurnsWithSign::load; },
                 "friction that grows with the load");
  return found;
}

const EffectInfo& constant_effect() {
  static const EffectInfo& found =
      first_that([](const EffectInfo& info) { return info.nominal && info.has_constant; }, "a constant torque");
  return found;
}

const EffectInfo& presliding_effect() {
  static const EffectInfo& found = first_that(
      [](const EffectInfo& info) { return info.identified > 0 && info.replaces == dry_friction_effect().name; },
      "friction that builds up over a path");
  return found;
}

const EffectInfo& compliance_effect() {
  static const EffectInfo& found = first_that(is_compliance, "a compliance");
  return found;
}

const EffectInfo& play_effect() {
  static const EffectInfo& found =
      first_that([](const EffectInfo& info) { return info.bends() && info.linear[0].quantity == Quantity::unit; },
                 "play of the gear");
  return found;
}

const EffectInfo& once_a_turn_effect() {
  static const EffectInfo& found = first_that(
      [](const EffectInfo& info) {
        return info.acts_on == ActsOn::position && !info.needs_structural && info.needs_revolute;
      },
      "an error that repeats once a turn");
  return found;
}

bool is_compliance(const EffectInfo& info) { return info.bends() && info.linear[0].quantity == Quantity::torque; }

const EffectFit* dry_friction_of(const JointFit& joint) {
  return first_of(joint, [](const EffectInfo& info) { return &info == &dry_friction_effect(); });
}

const EffectFit* compliance_of(const JointFit& joint) { return first_of(joint, is_compliance); }

}  // namespace fxdyn
