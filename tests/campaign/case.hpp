#pragma once

#include <array>
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
  std::string urdf_text{};                     ///< of a drawn robot, in place of the file
  std::array<double, 3> gravity{0, 0, -9.81};  ///< in the base's frame: wall and ceiling mounting
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
  drawn,       ///< robot, friction and recording drawn at random: the second campaign
};
std::string to_string(Group group);

/// How each role is recorded: four logs, each another kind of motion, or the first so many of them.
struct Recording {
  double log_s = 10;  ///< length of a log
  double sample_s = 0.002;
  int encoder_bits = 17;
  std::size_t logs = 4;
  double noise = 0.01;     ///< white, of the torque, share of rated; coloured noise is 0.3 of it
  double jitter = 0;       ///< of the stamps, share of the step
  double lost = 0;         ///< share of the samples that are missing
  double torque_step = 0;  ///< of the measured current, share of rated torque; 0: not rounded
};

/// What a healthy joint's friction is beside viscous friction. All but the first have code of the campaign's own.
enum class Friction {
  catalogue,    ///< the model's smooth sign
  lugre,        ///< bristles, integrated as a differential equation
  maxwell,      ///< Maxwell slip: springs in parallel, each of which slips at a force of its own
  smooth_sign,  ///< a sign function of another form
};
std::string to_string(Friction friction);

struct Case {
  std::string name;  ///< its folder
  Group group = Group::single;
  std::size_t robot = 0;                       ///< in test_robots()
  std::optional<std::uint64_t> drawn_robot{};  ///< seed of a robot drawn at random, in place of `robot`
  Friction friction = Friction::catalogue;
  std::uint64_t seed = 1;
  std::vector<Wanted> effects;
  std::vector<Wanted> background;  ///< of the healthy robot too
  bool mujoco = false, closed_loop = false;
  bool baseline = true, validate = true;
  bool link_encoders = false;
  Recording recording;
  double friction_change = 0;  ///< every friction coefficient by up to this share, between baseline and the rest
  double clock_s = 0;          ///< time of the session's first sample
};

/// The robot of a case.
const TestRobot& robot_of(const Case& wanted);
/// A serial robot drawn at random: 2 to 7 joints, arms, parallel axes, SCARA, gantry; on the floor, a wall, a ceiling.
TestRobot draw_robot(std::uint64_t seed);

/// The full campaign, and the small one of the tests.
std::vector<Case> all_cases();
std::vector<Case> small_cases();
/// The second campaign: robot, friction and recording drawn at random, `count` cases from a seed on.
std::vector<Case> drawn_cases(std::uint64_t first_seed, std::size_t count);

}  // namespace fxdyn::campaign
