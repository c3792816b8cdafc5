#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "host_tools/effects/forward.hpp"
#include "host_tools/simulate/closed_loop.hpp"

namespace fxdyn {

/// A motion with a stop: it rests for rest_s, moves, and rests again.
struct Move {
  std::string kind;          ///< point_to_point | reversals | slow
  Reference reference;       ///< without feedforward; all joints move
  Eigen::Index start, stop;  ///< samples at which it begins to move and has come to rest
  Eigen::Index asked_stop;   ///< `stop` before it was shaped or slowed down
};

inline constexpr double rest_s = 1.5;

/// Quintic segments from rest to rest (continuous acceleration, zero at both ends) within the joints' limits, `repeats`
/// moves of each kind:
///   point_to_point  one segment between random poses in the middle 60 % of the ranges, at 80 % of the limits
///   reversals       eight segments of 0.1 rad (0.02 m) back and forth, at half the limits or slower
///   slow            0.06 rad (0.01 m) there and back, at most 0.03 rad/s (5 mm/s)
/// @param seed another one gives other poses
std::vector<Move> make_moves(const IdentifiedModel& robot, double tick_s, std::uint64_t seed, int repeats = 2);

/// The same path in a motion that takes `ticks` longer: velocities and accelerations are as much smaller everywhere.
Move slower(const Move& move, Eigen::Index ticks);

}  // namespace fxdyn
