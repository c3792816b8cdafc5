#include <fmt/format.h>

#include <array>
#include <cmath>

#include "host_tools/support/random.hpp"
#include "tests/campaign/case.hpp"
#include "tests/campaign/outside.hpp"

namespace fxdyn::campaign {
namespace {

const std::vector<std::string> named{"stribeck",
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
                                     "joint_coupling",
                                     "motor_coupling",
                                     "payload",
                                     "payload",
                                     "gravity_tilt",
                                     "delay",
                                     "elasticity"};
const std::vector<std::string> of_links{"elasticity", "backlash", "eccentricity"};

template <class List>
const auto& one_of(const List& list, Random& random) {
  return list[random.next() % std::size(list)];
}
bool chance(double share, Random& random) { return random.uniform() < share; }

Recording draw_recording(Random& random) {
  constexpr std::array rates{100.0, 125.0, 200.0, 250.0, 500.0, 500.0, 1000.0, 1000.0, 2000.0, 4000.0};
  Recording recorded;
  const double rate = one_of(rates, random);
  recorded.sample_s = 1 / rate;
  recorded.encoder_bits = static_cast<int>(std::lround(random.uniform(13.5, 22.4)));
  recorded.log_s = rate > 1000 ? 8 : 5 * std::round(random.uniform(1.6, 3));
  recorded.logs = rate > 1000 ? 3 : 2 + random.next() % 3;
  recorded.noise = 0.002 * std::pow(5.0, random.uniform());
  if (chance(0.2, random)) recorded.jitter = random.uniform(0.1, 0.6);
  if (chance(0.15, random)) recorded.lost = random.uniform(0.002, 0.02);
  if (chance(0.25, random)) recorded.torque_step = random.uniform(0.001, 0.004);
  return recorded;
}

Case draw_case(std::uint64_t seed) {
  Random random(seed * 48271 + 29);
  Case one;
  one.group = Group::drawn;
  one.seed = seed;
  one.drawn_robot = seed;
  constexpr std::array frictions{Friction::lugre, Friction::maxwell, Friction::smooth_sign, Friction::catalogue};
  one.friction = frictions[seed % frictions.size()];
  one.recording = draw_recording(random);
  one.baseline = chance(0.6, random);
  one.validate = chance(0.7, random);
  one.closed_loop = chance(0.2, random);
  if (chance(0.4, random)) one.friction_change = random.uniform(0.02, 0.06);
  one.clock_s = chance(0.25, random) ? random.uniform(-50, 5e4) : 0;
  const double kind = random.uniform(), share = 0.002 * std::pow(10.0, random.uniform());
  std::string what = "clean";
  if (kind < 0.52) {
    one.effects = {{what = one_of(named, random), share}};
  } else if (kind < 0.58) {
    Wanted wanted{what = one_of(of_links, random)};
    wanted.deflection = 1e-4 * std::pow(5.0, random.uniform());
    one.effects = {wanted};
    one.link_encoders = true;
  } else if (kind < 0.66) {
    one.effects = {{what = one_of(other_forms(), random), share}};
  } else if (kind < 0.8) {
    one.effects = {{what = one_of(outside_effects(), random), share}};
  }
  one.name = fmt::format("drawn_{}_{}_{:.0f}Hz_{}", what, to_string(one.friction), 1 / one.recording.sample_s, seed);
  return one;
}

}  // namespace

std::vector<Case> drawn_cases(std::uint64_t first_seed, std::size_t count) {
  std::vector<Case> out;
  for (std::size_t i = 0; i < count; ++i) out.push_back(draw_case(first_seed + i));
  return out;
}

}  // namespace fxdyn::campaign
