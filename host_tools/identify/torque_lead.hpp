#pragma once

#include "host_tools/identify/options.hpp"
#include "host_tools/regression/fitter.hpp"

namespace fxdyn {

/// How far the torque column is ahead of the motion, one number for all joints: a grid within a fifth of a period of
/// the torque cut-off on either side, at most 10 ms, then parabolas through the best three, by the mean logarithm of
/// the held-out error. Hysteresis and other missing physics look like a lag too, but like another one on every joint,
/// so a lead is kept only where, against none, the mean falls by the share that an effect has to bring, the best point
/// is not at the end of the grid, and at least four joints in five gain that much and would choose nearly the same lead
/// (within a fifth) for themselves. One number for all joints does not overfit, so blocks of one log ask for no more.
void find_torque_lead(Fitter& fitter, double cutoff_hz, const StructureOptions& options);

}  // namespace fxdyn
