#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "host_tools/effects/identified_model.hpp"
#include "host_tools/signals/fourier.hpp"

namespace fxdyn {

/// One [[log]] of a scenario.
struct ScenarioLog {
  std::string name;
  double duration_s = 10, period_s = 10, speed = 1;
  int order = 5;
  std::uint64_t seed = 0;
  double start_s = 0;    ///< since the session's start
  double amplitude = 1;  ///< share of the motion's size once it is scaled to the limits
  /// Of each joint, planned by `fxdyn excite`, with period_s; empty: drawn from the seed.
  std::vector<FourierJoint> series;
};

/// A position loop on every joint.
struct ScenarioControl {
  double bandwidth_hz = 6;
  bool feedforward = true;  ///< of the rigid body's torque along the reference
  double tick_s = 0.002;
};

/// A sine on the measured torque of every joint, as a structure that vibrates shows in it.
struct TorqueVibration {
  double amplitude = 0;     ///< share of rated torque
  double frequency_hz = 0;  ///< below half of the sampling rate
};

/// A scenario file (docs/guide/scenario.md).
struct Scenario {
  enum class Plant { internal, mujoco };
  enum class Motion { prescribed, closed_loop };

  IdentifiedModel plant;
  Plant plant_kind = Plant::internal;
  Motion motion = Motion::prescribed;
  ScenarioControl control;
  std::vector<FourierBounds> bounds;
  double sample_s = 0.002;
  double start_s = 0;    ///< the session's clock at its start
  double jitter = 0;     ///< stamps are off by uniform +- jitter * sample_s / 2
  int encoder_bits = 0;  ///< per turn of the joint, or per metre; 0: exact
  int link_encoder_bits = 0;
  std::vector<bool> link_encoder;  ///< which joints have one; empty: none
  double torque_noise = 0;         ///< white, share of rated torque
  double ar_noise = 0;             ///< first-order autoregressive, RMS as share of rated torque
  double ar_pole = 0.95;           ///< its correlation from sample to sample
  TorqueVibration vibration;
  bool exact_motion = false;  ///< logs carry exact q, dq, ddq
  std::uint64_t seed = 1;
  std::vector<ScenarioLog> logs;
};

/// @throws InputError with file and line.
Scenario read_scenario(const std::filesystem::path& file);

/// Of the internal plant under a controller [s].
inline constexpr double longest_controlled_step = 0.0005;
/// Of the plant's run [s]: a fraction of the samples' step, under a controller a whole fraction of its tick.
double plant_step(const Scenario& scenario);

}  // namespace fxdyn
