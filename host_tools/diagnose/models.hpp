#pragma once

#include <vector>

#include "host_tools/diagnose/base_parameters.hpp"
#include "host_tools/diagnose/options.hpp"
#include "host_tools/effects/model_value.hpp"
#include "host_tools/effects/robot_columns.hpp"

namespace fxdyn::diagnosis {

/// Of a payload [kg], whose centre is first moment over mass.
inline constexpr double least_mass = 1e-6;

/// Two states of one robot: before (the baseline, a session known to be healthy) and now. Base parameters are the same;
/// friction may differ a little, named effects are in `current` only. Without a baseline `healthy` is not used.
struct Models {
  ModelValue healthy, current;
  bool has_baseline = false;
  std::vector<EffectCandidate> fixed;   ///< from a link encoder: the torque does not change it
  std::vector<std::size_t> background;  ///< joints whose healthy session has structure that no effect explains
  std::vector<EffectCandidate> held;    ///< unnamed effects that stay what the healthy session's fit gave
  std::vector<Rotor> rotors;
  std::vector<double> curve_size{};  ///< by joint: prior deviation of a free curve's heights [N*m | N]
  double smallest_step_s = 1;        ///< of all logs and of the drive's tick: what bounds a delay
  std::vector<double>
      largest_load{};                 ///< by joint: the largest structural torque of the logs [N*m | N]; empty: unknown
  std::vector<double> least_width{};  ///< by joint [rad/s | m/s]: no sign is narrower; empty: unknown
  Options options;                    ///< thresholds of all that is done with these models

  const IdentifiedModel& of(bool of_healthy) const { return of_healthy ? healthy : current; }
};

}  // namespace fxdyn::diagnosis
