#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "tests/campaign/case.hpp"

namespace fxdyn::campaign {

/// One log of a role.
struct SessionLog {
  std::string name;
  double period_s = 10, speed = 1, start_s = 0;
  int order = 5;
  std::uint64_t seed = 0;
};
/// fast, mid (up to 3.5 Hz), slow, and reversals (creeping to and fro), each log_s long. Every role has trajectories of
/// its own.
std::vector<SessionLog> recording(const std::string& role, std::uint64_t seed, double start_s,
                                  const Recording& recorded);

/// What a scenario file is made of.
struct Session {
  std::string urdf;  ///< beside the scenario file
  const TestRobot* robot = nullptr;
  std::vector<double> viscous, coulomb, width, offset, rotor_inertia;
  std::vector<std::pair<std::optional<std::size_t>, EffectFit>> effects;
  std::vector<SessionLog> logs;
  std::uint64_t seed = 1;
  double clock_s = 0, sample_s = 0.002, ar_pole = 0.95, jitter = 0, torque_noise = 0.01;
  double log_s = 10;
  int encoder_bits = 17;
  bool mujoco = false, closed_loop = false, link_encoders = false;
  bool noise = true;          ///< and encoders; else signals are exact
  bool exact_motion = false;  ///< dq and ddq in the logs
};
/// The robot's healthy friction, moved a little by the seed.
Session healthy_session(const Case& wanted);
std::string to_toml(const Session& session);

}  // namespace fxdyn::campaign
