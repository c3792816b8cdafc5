#pragma once

#include <Eigen/Dense>
#include <limits>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "host_tools/effects/forward.hpp"
#include "host_tools/effects/robot_columns.hpp"
#include "host_tools/robot/robot.hpp"
#include "host_tools/signals/motion.hpp"
#include "host_tools/support/progress.hpp"

// What an experiment will see, before anyone moves the robot. docs/guide/sight.md explains the figures.

namespace fxdyn {

struct SightSettings {
  Eigen::VectorXd noise;  ///< torque noise, white: standard deviation of one sample, per joint [N*m | N]
  std::optional<double> torque_cutoff_hz;  ///< else chosen as `identify` would (choose_filter())
  double threshold = 5;  ///< an effect is detected where its coefficient is that many standard deviations from zero
};

/// How well one effect with one shape stands out.
struct Visibility {
  std::vector<double> shape;
  double rho = 0;  ///< share (RMS) of its torque, filtered, that the nominal model does not absorb, 0..1
  /// Smallest effect found: RMS of its unfiltered torque over the motions at the joint that feels it most, share of
  /// rated torque.
  double smallest = std::numeric_limits<double>::infinity();
  std::vector<double> parameters{};  ///< smallest value of each column's parameter alone; infinite: not identifiable
};

/// Another effect that looks the same once the nominal model has taken its part.
struct Confusion {
  std::string effect;  ///< or `base_parameters_name` (effects.hpp)
  double correlation =
      0;             ///< multiple correlation: share (RMS) of what is left of this effect that the other one can take
  std::string cure;  ///< what would separate the two
};

enum class SightVerdict {
  seen,              ///< from 0.5 % of rated torque
  weak,              ///< only where it is larger
  not_identifiable,  ///< the nominal model absorbs it (rho^2 < 1e-5), or the motion does not excite it
};
std::string_view to_string(SightVerdict verdict);

/// One effect at one joint, or on the body.
struct EffectSight {
  std::string effect;
  std::optional<std::size_t> joint;  ///< index from 0; none: the robot as a whole
  SightVerdict verdict = SightVerdict::not_identifiable;
  Visibility typical, worst;          ///< over the shapes of typical_shapes() (effect_information.hpp)
  std::optional<Visibility> healthy;  ///< with a recording of the same motions from when the effect was not there
  std::vector<Confusion> confused;    ///< correlation >= 0.95, largest first
};

struct Sight {
  Robot robot;
  Eigen::VectorXd noise;  ///< within the torque cut-off, share of rated torque
  double torque_cutoff_hz = 0, threshold = 0;
  double seconds = 0;                ///< of motion without the filters' edges
  double independent_samples = 0;    ///< N_eff: two per period of the cut-off
  std::vector<EffectSight> effects;  ///< catalogue order, within an effect by joint
};

/// Judges every effect of the catalogue on every joint. The nominal regressor is what `diagnose` starts from: base
/// parameters and, per joint, viscous, coulomb, offset, rotor_inertia; weighted least squares over all joints, torque
/// and columns filtered and decimated alike.
///   RMS_min = threshold sigma / (rho sqrt(N_eff)),  generally: threshold / sqrt(u^T R u), R = C^T W C - C^T W A (A^T W
///   A)^-1 A^T W C the information on the effect's columns C that the nominal columns A leave.
/// Effects with several columns: rho^2 is the mean over the directions of their span that the nominal model leaves.
/// Linear in the effect: for large delays, gaps and tilts an orientation.
/// @throws InputError: no motion, motions of other joints or different steps, noise that is not positive; DataError: a
/// motion too short for its filter
Sight see(const IdentifiedModel& nominal, const std::vector<Motion>& motions, const SightSettings& settings,
          Progress& progress);

/// The key "sight" of excite.json: percent of rated torque, correlations, shapes and parameters with units; a value
/// that can't be reached is null.
nlohmann::json sight_json(const Sight& sight, const std::vector<std::string>& assumptions = {});

/// For the terminal, at most 100 characters wide: one row an effect with its best and worst joint, then what can't be
/// separated and what would help.
std::string sight_table(const Sight& sight, const std::vector<std::string>& assumptions = {});

}  // namespace fxdyn
