#pragma once

#include <filesystem>
#include <functional>
#include <string>

#include "host_tools/report/vibration_result.hpp"
#include "host_tools/simulate/closed_loop.hpp"
#include "host_tools/vibration/options.hpp"

namespace fxdyn {

/// `fxdyn vibration`: what the model is worth as feedforward of a robot whose gears bend. Returns vibration.json.
///
/// The robot is the one of the project's first train log with a scenario, in MuJoCo: motors and links with K, B,
/// rotors and friction with presliding, which share no code with the model. Each joint's motor has
///
///   tau = kp (q_r - q) + kd (dq_r - dq) + feedforward,  kp = M w^2, kd = 2 damping M w
///
/// at the drive's tick, on the motor's encoder (2^22 steps a turn of the joint, dq by differences). Bandwidth and
/// damping are the best of a grid for the PD alone, on other moves than those that are judged, and stay.
///
/// Feedforward: none; friction (rigid body, rotors, Coulomb and viscous friction, offset by least squares); rigid (the
/// same without its friction); model (what diagnosis and training made: DIR/model.json); model_elastic, where the model
/// knows how gears bend: the same at motor_reference(), which the PD gets, too ("reference": "motor");
/// model_elastic_shaped: the same of the links' path shaped by the model's modes under this PD (shaper.hpp), which is
/// the path that its links have to follow. All but none are the firmware's fixed-point code, fed with the reference;
/// the models also in double, and both once more on exact encoders (fixed_against_double: of the motors' remaining
/// error, how much it is another, and how far the paths are apart). A shaped move ends later ("path": delay_s of each
/// move). So beside it: none_shaped, the PD alone on the shaped path, none_slower and model_elastic_slower, the
/// unshaped move in the longer time. Then the models with parameters 20 % too small, too large, and each parameter of
/// the model one or the other at random; motors' reference and shaper are then made from those, too.
///
/// Per move and over all joints:
///   tracking_motor  RMS of q - what the motors were asked for while it moves [mrad | mm]
///   tracking_link   RMS of q_link - q_r, the links' reference (shaped, slower) whatever the motors' is [mrad | mm]
///   residual   largest |q_link - its place at the end| after the stop of its reference, mean over the joints [mrad |
///     mm]
///   residual_late   the same from one instant on in all rows: late_s after the stop as it was asked for, when the
///     slowest shaped reference has stopped, too [mrad | mm]
///   settling_s  from the stop until every link stays within a quarter of the PD's residual of that place
///   still_s   the same from the stop as it was asked for: with what shaping or a slower move takes
///   roughness  RMS of the torque's change from tick to tick, of rated, mean over the joints
/// "ratios": the same over all moves, of none's and of rigid's.
/// @throws InputError: no train log comes from a scenario
VibrationResult vibration(const std::filesystem::path& project, const std::filesystem::path& directory,
                          const VibrationOptions& options = {});

/// A drive that is asked for its torque tick by tick.
struct Feedforward {
  std::function<void(const Reference&)> begin;          ///< the robot at rest at the reference's start
  std::function<Eigen::VectorXd(Eigen::Index)> torque;  ///< at a sample of it [N*m | N]
  std::size_t most_moves = 0;                           ///< the first ones alone; 0: all
};
/// The same moves with this drive in the loop, beside what DIR/vibration.json says of none and the model on the host,
/// under its controller. It is made first where it is missing or of something else.
VibrationResult vibration_with(const std::filesystem::path& project, const std::filesystem::path& directory,
                               const Feedforward& drive, const VibrationOptions& options = {});

}  // namespace fxdyn
