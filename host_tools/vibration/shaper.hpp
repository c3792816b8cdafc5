#pragma once

#include <Eigen/Dense>
#include <vector>

#include "host_tools/effects/forward.hpp"
#include "host_tools/simulate/closed_loop.hpp"
#include "host_tools/vibration/modes.hpp"
#include "host_tools/vibration/moves.hpp"

namespace fxdyn {

/// A sequence of impulses at the ticks. A reference that is convolved with it starts and ends where it did, and ends
/// delay_s() later. No impulse is negative and their sum is 1: no velocity and no acceleration gets larger.
struct Shaper {
  double step_s = 0;
  Eigen::VectorXd impulses;
  Eigen::Index delay() const { return impulses.size() - 1; }  ///< [ticks]
  double delay_s() const { return step_s * static_cast<double>(delay()); }
};

/// What a mode swings with after the last impulse, as a share of what it would swing with after one impulse of 1
/// (Singer, Seering, "Preshaping command inputs to reduce system vibration", J. Dyn. Syst. Meas. Control 112, 1990).
double residual_vibration(const Shaper& shaper, double frequency_hz, double damping);

/// Frequencies that must not be excited.
struct Band {
  double low_hz = 0, high_hz = 0;
  double damping = 0;  ///< the least of its modes
};

struct ShaperSettings {
  /// Share of its own frequency that a mode may be off, to both sides. Inertia and compliance both 20 % too small put
  /// it 25 % too high, so that the true one is 20 % lower; both too large, 20 % higher.
  double margin = 0.2;
  /// Largest residual_vibration() in the bands; 5 % as in extra-insensitive shapers (Singhose, Seering, Singer 1994).
  double tolerance = 0.05;
};

/// The shortest shaper that leaves at most `tolerance` of every frequency in the bands: specified insensitivity by
/// frequency sampling (Singhose, Seering, Singer, "Input shaping for vibration reduction with specified insensitivity
/// to modeling errors", Japan-USA Symposium on Flexible Automation, 1996), for all modes at once. One impulse where
/// there are no bands.
/// @throws DataError where four periods of the slowest frequency are not enough
Shaper design_shaper(const std::vector<Band>& bands, double step_s, double tolerance);

/// The bands of a model's modes along a path: each mode, slowest first, from the lowest to the highest frequency that
/// it has at poses on the way, and the margin on both sides. Without modes that die away within a cycle or two
/// (damping 0.2), and those above four times the slowest: what a jump of the jerk excites goes with the third power of
/// the period, and a 64th is below the tolerance.
/// @param loop the motors' controller; empty: they don't move
std::vector<Band> bands_along(const IdentifiedModel& model, const Reference& path, const MotorLoop& loop,
                              double margin);

/// Convolved, and longer by the delay. It has to start and end at rest.
Reference shaped(const Reference& path, const Shaper& shaper);
Move shaped(const Move& move, const Shaper& shaper);

/// How far the furthest point of a joint is cut short at most: a path that turns between two stops is shaped there,
/// too [rad | m].
double cut_short(const Reference& path, const Reference& after);

}  // namespace fxdyn
