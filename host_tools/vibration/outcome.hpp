#pragma once

#include <vector>

#include "host_tools/report/vibration_result.hpp"
#include "host_tools/simulate/mujoco_plant.hpp"
#include "host_tools/vibration/moves.hpp"

namespace fxdyn {

/// When a link counts as still, and from when on all rows are compared.
struct Instants {
  double band = 0;    ///< off its place at the end [rad | m]
  double late_s = 0;  ///< after the stop as it was asked for
};

/// What one move comes to.
struct Outcome {
  double motor = 0, link = 0;     ///< mean squares of the error while it moves [rad^2 | m^2]
  double with_rest = 0;           ///< the link's, to the end
  double residual = 0, late = 0;  ///< from the stop on, and from Instants::late_s on [rad | m]
  double settling_s = 0;          ///< from the stop on
  double still_s = 0;             ///< from the stop on as it was asked for
  double roughness = 0;
  Eigen::MatrixXd q;  ///< of the motors
};

/// @param asked what the motors got; the links had to be where the move has them
Outcome outcome_of(const PlantRun& run, const Move& move, const Reference& asked, const IdentifiedModel& plant,
                   const Instants& instants);

/// Sets a method's figures: means over all moves and over those of each kind.
void set_means(VibrationMethod& method, const std::vector<Move>& moves, const std::vector<Outcome>& outcomes);

/// Adds its ratios: over all moves, against the PD alone and the rigid body among `methods`.
void add_ratios(VibrationMethod& method, const std::vector<VibrationMethod>& methods);

}  // namespace fxdyn
