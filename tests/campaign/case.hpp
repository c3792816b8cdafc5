#pragma once

#include <cstdint>
#include <map>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "host_tools/effects/identified_model.hpp"

namespace fxdyn::campaign {

/// What a robot is told to be: URDF, and the friction that a healthy one has. The seed of a case moves it by some %.
struct TestRobot {
  std::string name, urdf;  ///< urdf: path within the sources
  std::vector<double> rated_torque, acceleration, viscous, coulomb, width, offset, rotor_inertia;
};
/// Two arms with turning joints, one with a lift: the campaign's. Then a small arm of two joints.
const std::vector<TestRobot>& test_robots();
inline constexpr std::size_t campaign_robots = 3, small_arm = 3;

/// An effect that a case asks for. What is not given is drawn from the case's seed.
struct Wanted {
  std::string effect;                  ///< of the catalogue, or of outside_effects()
  double share = 0;                    ///< RMS of the torque change at the joint that feels it most, share of rated
  std::optional<std::size_t> joint{};  ///< from 0
  bool same_joint_as_first = false;    ///< second of a pair
  double deflection = 0;               ///< > 0: scaled to this RMS deflection [rad | m] instead of to `share`
  bool grows = false;                  ///< the background's first effect, on top of itself
};

enum class Group {
  single,
  mujoco,
  clean,
  changed_friction,
  pair,
  outside,
  no_baseline,
  background,
  dual_encoder,
  controlled,  ///< moved by a controller, on the internal plant
};
std::string to_string(Group group);

/// How each role is recorded: four logs, each another kind of motion.
struct Recording {
  double log_s = 10;  ///< length of a log
  double sample_s = 0.002;
  int encoder_bits = 17;
};

struct Case {
  std::string name;  ///< its folder
  Group group = Group::single;
  std::size_t robot = 0;  ///< in test_robots()
  std::uint64_t seed = 1;
  std::vector<Wanted> effects;
  std::vector<Wanted> background;  ///< of the healthy robot too
  bool mujoco = false, closed_loop = false;
  bool baseline = true;
  bool link_encoders = false;
  Recording recording;
  double friction_change = 0;  ///< every friction coefficient by up to this share, between baseline and the rest
  double clock_s = 0;          ///< time of the session's first sample
};

/// The full campaign, and the small one of the tests.
std::vector<Case> all_cases();
std::vector<Case> small_cases();

}  // namespace fxdyn::campaign
