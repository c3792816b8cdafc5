#include <fmt/format.h>

#include "host_tools/support/random.hpp"
#include "tests/campaign/case.hpp"
#include "tests/campaign/outside.hpp"

namespace fxdyn::campaign {
namespace {

const std::vector<std::string> effects{"stribeck",
                                       "presliding",
                                       "asymmetric_friction",
                                       "viscous_quadratic",
                                       "viscous_cubic",
                                       "load_friction",
                                       "torque_gain",
                                       "ripple",
                                       "spring",
                                       "gravity_compensator",
                                       "friction_drift",
                                       "saturation",
                                       "joint_coupling",
                                       "motor_coupling",
                                       "payload",
                                       "gravity_tilt",
                                       "delay",
                                       "elasticity",
                                       "backlash",
                                       "eccentricity"};

/// Effects that came later: their cases come last, so that the others keep their seeds.
const std::vector<std::string> later{"soft_knee"};

/// Two effects at once: pairs that are met together, and pairs that are easily taken for one another.
const std::vector<std::pair<std::string, std::string>> pairs{
    {"stribeck", "ripple"},          {"presliding", "viscous_cubic"},     {"payload", "ripple"},
    {"friction_drift", "spring"},    {"load_friction", "stribeck"},       {"gravity_tilt", "viscous_quadratic"},
    {"torque_gain", "ripple"},       {"asymmetric_friction", "spring"},   {"joint_coupling", "presliding"},
    {"delay", "stribeck"},           {"gravity_compensator", "stribeck"}, {"payload", "friction_drift"},
    {"viscous_quadratic", "ripple"}, {"motor_coupling", "ripple"},        {"saturation", "stribeck"}};

class List {
 public:
  Case& add(Group group, std::size_t robot, std::vector<Wanted> wanted, const std::string& name) {
    Case one;
    one.group = group;
    one.robot = robot;
    one.effects = std::move(wanted);
    one.seed = seed_++;
    one.name = fmt::format("{}_{}_{}_{}", to_string(group), name, test_robots()[robot].name, one.seed);
    one.clock_s = clock_.uniform() < 0.25 ? clock_.uniform(-50, 5e4) : 0;
    cases_.push_back(one);
    return cases_.back();
  }
  std::size_t next_robot() { return robot_++ % campaign_robots; }
  std::vector<Case> take() { return std::move(cases_); }

 private:
  std::vector<Case> cases_;
  std::uint64_t seed_ = 1;
  std::size_t robot_ = 0;
  Random clock_{2024};
};

std::string label(const std::string& effect, double share) { return fmt::format("{}_{:g}", effect, 100 * share); }

void add_singles(List& list, const std::vector<std::string>& of) {
  for (const std::string& effect : of) {
    for (const auto& [share, seeds] : {std::pair{0.002, 3}, std::pair{0.006, 4}, std::pair{0.02, 3}}) {
      for (int i = 0; i < seeds; ++i)
        list.add(Group::single, list.next_robot(), {{effect, share}}, label(effect, share));
    }
  }
}

void add_mujoco(List& list, const std::vector<std::string>& of) {
  for (std::size_t e = 0; e < of.size(); ++e) {
    for (std::size_t robot = 0; robot < campaign_robots; ++robot) {
      const double share = (e + robot) % 3 == 2 ? 0.02 : 0.006;
      Case& one = list.add(Group::mujoco, robot, {{of[e], share}}, label(of[e], share));
      one.mujoco = true;
      // MuJoCo has these two in prescribed motion only.
      const bool prescribed_only = of[e] == "backlash" || of[e] == "motor_coupling";
      one.closed_loop = (e + robot) % 3 == 1 && !prescribed_only;
    }
  }
}

void add_clean(List& list) {
  for (int i = 0; i < 40; ++i) {
    Case& one = list.add(Group::clean, list.next_robot(), {}, "");
    one.mujoco = i % 8 == 7;
    one.closed_loop = i % 16 == 15;
    one.baseline = i % 10 != 9;
  }
  for (int i = 0; i < 20; ++i) list.add(Group::changed_friction, list.next_robot(), {}, "").friction_change = 0.05;
}

void add_pairs(List& list) {
  for (std::size_t i = 0; i < 2 * pairs.size(); ++i) {
    const auto& [first, second] = pairs[i / 2];
    const double share = i % 2 == 0 ? 0.006 : 0.02;
    const bool same = (i / 2) % 2 == 0;
    list.add(Group::pair, list.next_robot(), {{first, share}, {second, share, {}, same}},
             label(first + "_" + second, share));
  }
}

void add_outside(List& list) {
  for (const std::string& effect : outside_effects()) {
    for (const double share : {0.002, 0.006, 0.006, 0.02, 0.02})
      list.add(Group::outside, list.next_robot(), {{effect, share}}, label(effect, share));
  }
}

void add_others(List& list) {
  for (std::size_t i = 0; i < 20; ++i)
    list.add(Group::no_baseline, list.next_robot(), {{effects[i], 0.006}}, label(effects[i], 0.006)).baseline = false;
  for (const char* effect : {"ripple", "stribeck", "viscous_cubic", "presliding", "joint_coupling"})
    list.add(Group::no_baseline, list.next_robot(), {{effect, 0.006}}, label(effect, 0.006)).baseline = false;

  const std::vector<std::string> changes{
      "spring", "viscous_quadratic", "payload",        "torque_gain", "load_friction",
      "delay",  "friction_drift",    "joint_coupling", "ripple",      "presliding"};
  for (std::size_t i = 0; i < 20; ++i) {
    const bool quiet = i % 3 == 2;
    const std::string& effect = changes[i % changes.size()];
    const std::vector<Wanted> wanted = quiet ? std::vector<Wanted>{} : std::vector<Wanted>{{effect, 0.006}};
    Case& one =
        list.add(Group::background, (i + i / 3) % campaign_robots, wanted, quiet ? "quiet" : label(effect, 0.006));
    one.background = {{"ripple", 0.006}, {"stribeck", 0.01}};
  }

  for (std::size_t i = 0; i < 15; ++i) {
    const std::string effect = i % 3 == 0 ? "elasticity" : (i % 3 == 1 ? "eccentricity" : "backlash");
    Wanted wanted{effect};
    wanted.deflection = std::vector{1e-4, 2e-4, 5e-4, 1e-4, 2e-4}[i / 3];
    list.add(Group::dual_encoder, (i + i / 3) % campaign_robots, {wanted},
             fmt::format("{}_{:g}mrad", effect, 1e3 * wanted.deflection))
        .link_encoders = true;
  }
}

/// What the healthy robot has already, at least twice as large today: wear.
void add_grown(List& list) {
  for (const char* effect : {"ripple", "spring", "joint_coupling"}) {
    for (std::size_t robot = 0; robot < campaign_robots; ++robot) {
      Wanted more{effect, 0.006};
      more.grows = true;
      list.add(Group::background, robot, {more}, label(std::string("grown_") + effect, 0.006)).background = {
          {effect, 0.005}};
    }
  }
}

/// Joints that a controller moves stick, come loose and shake; its torque answers the encoder's noise.
void add_controlled(List& list) {
  for (const std::string& effect : effects) {
    list.add(Group::controlled, list.next_robot(), {{effect, 0.006}}, label(effect, 0.006)).closed_loop = true;
  }
  for (int i = 0; i < 12; ++i) {
    Case& one = list.add(Group::clean, list.next_robot(), {}, "controlled");
    one.closed_loop = true;
    one.mujoco = i % 2 == 0;
  }
}

}  // namespace

std::vector<Case> all_cases() {
  List list;
  add_singles(list, effects);
  add_mujoco(list, effects);
  add_clean(list);
  add_pairs(list);
  add_outside(list);
  add_others(list);
  add_controlled(list);
  add_grown(list);
  add_singles(list, later);
  add_mujoco(list, later);
  return list.take();
}

std::vector<Case> small_cases() {
  constexpr std::size_t puma = 0, ur10 = 1, scara = 2;
  List list;
  list.add(Group::clean, scara, {}, "");
  list.add(Group::changed_friction, puma, {}, "").friction_change = 0.05;
  list.add(Group::single, scara, {{"stribeck", 0.006}}, "stribeck");
  list.add(Group::single, ur10, {{"ripple", 0.006}}, "ripple");
  list.add(Group::single, scara, {{"viscous_quadratic", 0.02}}, "viscous_quadratic");
  list.add(Group::single, puma, {{"payload", 0.02}}, "payload");
  list.add(Group::single, scara, {{"joint_coupling", 0.006}}, "joint_coupling");
  list.add(Group::pair, scara, {{"stribeck", 0.02}, {"ripple", 0.02}}, "stribeck_ripple");
  list.add(Group::outside, scara, {{"square_wave", 0.02}}, "square_wave");
  list.add(Group::outside, scara, {{"other_position", 0.02}}, "other_position");
  list.add(Group::mujoco, scara, {{"presliding", 0.02}}, "presliding").mujoco = true;
  Case& spring = list.add(Group::mujoco, scara, {{"spring", 0.02}}, "spring");
  spring.mujoco = spring.closed_loop = true;
  Case& cubic = list.add(Group::mujoco, puma, {{"viscous_cubic", 0.006, 3}}, "viscous_cubic");
  cubic.mujoco = cubic.closed_loop = true;
  Case& dual = list.add(Group::dual_encoder, scara, {{"elasticity", 0, {}, false, 5e-4}}, "elasticity");
  dual.link_encoders = true;
  return list.take();
}

}  // namespace fxdyn::campaign
