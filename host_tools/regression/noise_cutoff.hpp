#pragma once

#include <vector>

#include "host_tools/logs/log.hpp"

namespace fxdyn {

/// What differentiation may make of the encoder's noise, as a share of the RMS torque of the joint. Classical
/// identification asks for a regressor whose error is far below the torque's (Gautier, Janot, Vandanjon 2013); with
/// one per cent the cut-offs are those that the authors of public logs chose by hand: docs/guide/project.md.
inline constexpr double noise_share = 0.01;

/// The highest cut-off of the position at which the noise of velocity and acceleration, times the joint's load, stays
/// below `noise_share` of its torque, the smallest of all joints [Hz]; infinite: no log has torque, or no joint noise.
///
/// The torque of a joint over all logs is fitted by offset + Coulomb s + b dq + k q + J ddq, with motion and torque
/// below `band_hz`. White noise of the position of density S [rad^2 / Hz, one-sided], filtered at f, makes a torque of
/// the mean square
///   S (J^2 (2 pi)^4 f^5 / 5 + b^2 (2 pi)^2 f^3 / 3);
/// where the velocity is measured, of density S_v, S_v (J^2 (2 pi)^2 f^3 / 3 + b^2 f). S is that of the highest octave,
/// at least that of a step of the encoder, step^2 / 12 over all frequencies. J and b count where they are two standard
/// deviations away from nothing.
/// @param band_hz in which the robot moves for certain
/// @param encoder_step per joint, 0: none was found [rad | m]
/// @param moves whether a joint moves by more than its noise
double noise_cutoff(const std::vector<Log>& logs, double band_hz, const std::vector<double>& encoder_step,
                    const std::vector<bool>& moves);

}  // namespace fxdyn
