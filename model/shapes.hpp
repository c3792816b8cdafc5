#pragma once

#include <algorithm>
#include <cmath>
#include <initializer_list>

#include "model/effect_traits.hpp"

// The usual values of shape parameters by kind, for ParameterInfo::values. An effect whose shape is of no such kind
// declares its own.

namespace fxdyn::shapes {

/// `count` values with equal ratios, both ends included.
inline ValueList geometric(double from, double to, int count) {
  ValueList values;
  for (int i = 0; i < count; ++i) values.add(from * std::pow(to / from, static_cast<double>(i) / (count - 1)));
  return values;
}

inline ValueList shares_of(double scale, std::initializer_list<double> shares) {
  ValueList values;
  for (const double share : shares) values.add(share * scale);
  return values;
}

namespace detail {
using Scales = const MotionScales&;

// velocity
inline constexpr double widths_of_sign = 1.5;
inline ValueList low_speeds(Scales s) {
  const double from = std::max(3e-3 * s.speed, widths_of_sign * s.sign_width);
  return geometric(std::min(from, 0.1 * s.speed), 0.2 * s.speed, 9);
}
inline ValueList usual_speeds(Scales s) { return shares_of(s.speed, {0.025, 0.01, 0.05}); }
inline ShapeRange low_speed_range(Scales s) { return {3e-3 * s.speed, 0.15 * s.speed}; }

// distance
inline ValueList paths(Scales s) { return s.turns ? geometric(2e-4, 2e-2, 10) : geometric(1e-5, 1e-3, 10); }
inline ValueList usual_paths(Scales s) {
  if (s.turns) return {3e-3, 1e-3, 9e-3};
  return {1e-4, 3e-5, 3e-4};
}
inline ShapeRange path_range(Scales s) { return {1e-6 * s.range, 0.1 * s.range}; }

// wavenumber
inline ValueList usual_wavenumbers(Scales s) {
  if (s.turns) return {20, 4, 100};
  return {600, 120, 3000};
}

// time constant, torque limit, delay
inline ValueList times_of_session(Scales s) { return geometric(0.1 * s.seconds, 4 * s.seconds, 5); }
inline ValueList usual_times_of_session(Scales s) { return shares_of(s.seconds, {1, 0.3, 3}); }
inline ValueList limits(Scales s) { return shares_of(s.torque, {0.45, 0.55, 0.63, 0.7, 0.76, 0.82, 0.87, 0.91, 0.95}); }
inline ValueList usual_limits(Scales s) { return shares_of(s.torque, {0.85, 0.7, 0.95}); }
inline ValueList delays(Scales s) { return geometric(5e-4, s.upper, 5); }
inline ValueList usual_delays(Scales) { return {2e-3, 1e-3, 4e-3}; }

// relaxation, small load
inline ValueList relaxations(Scales) { return {1e-3, 8e-3}; }
inline ValueList usual_relaxations(Scales) { return {1e-3, 5e-3}; }
inline ValueList link_relaxations(Scales) { return {1e-3, 0, 1e-3, 3e-3, 8e-3, 2e-2}; }
inline ValueList loads(Scales s) { return geometric(0.015 * s.structural, 0.25 * s.structural, 4); }
inline ValueList usual_loads(Scales s) { return shares_of(s.structural, {0.05, 0.02, 0.1}); }
inline ValueList link_loads(Scales s) { return shares_of(s.structural, {0.03, 0.01, 0.025, 0.06, 0.15}); }

// share of the static friction
inline ValueList friction_shares(Scales) { return {0.7, 0.5, 0.85}; }
inline ShapeRange friction_share_range(Scales) { return {0.3, 1}; }

// direction, width
inline ValueList both_directions(Scales) { return {1, -1}; }
inline ValueList widths(Scales s) {
  return geometric(std::max(0.3 * s.sign_width, 1e-3 * s.speed), std::max(3 * s.sign_width, 0.03 * s.speed), 3);
}
inline ValueList usual_widths(Scales s) { return shares_of(s.speed, {0.01}); }
inline ShapeRange width_range(Scales s) { return {1e-4 * s.speed, 0.3 * s.speed}; }

// other joints: indices from 1
inline ValueList others_in_order(Scales s) {
  ValueList others;
  for (unsigned k = 0; k < s.joints; ++k) {
    if (k != s.joint) others.add(k + 1);
  }
  return others;
}
inline ValueList others_before_first(Scales s) {
  ValueList others;
  for (unsigned k = s.joint; k > 0; --k) others.add(k);
  for (unsigned k = s.joint + 1; k < s.joints; ++k) others.add(k + 1);
  return others;
}
inline ValueList mates(Scales s) {
  ValueList found;
  if (s.like_previous) found.add(s.joint);
  if (s.like_next) found.add(s.joint + 2);
  return found;
}
inline ValueList neighbours(Scales s) {
  ValueList found;
  if (s.joint > 0) found.add(s.joint);
  if (s.joint + 1 < s.joints) found.add(s.joint + 2);
  return found;
}

// free curves: over the whole motion
inline ValueList lowest(Scales s) { return {s.lowest}; }
inline ValueList range(Scales s) { return {s.range}; }
inline ValueList lowest_speed(Scales s) { return {-s.speed}; }
inline ValueList range_of_speed(Scales s) { return {2 * s.speed}; }
inline ValueList lowest_load(Scales s) { return {-s.structural}; }
inline ValueList range_of_load(Scales s) { return {2 * s.structural}; }
}  // namespace detail

/// A velocity below which friction is another one; wider is viscous friction.
inline constexpr ShapeValues velocity{
    .tried = detail::low_speeds, .judged = detail::usual_speeds, .fitted = detail::low_speed_range};
/// .. of a friction that turns with the joint's sign: narrower than that is the sign.
inline constexpr ShapeValues velocity_beyond_sign{.tried = detail::low_speeds,
                                                  .judged = detail::usual_speeds,
                                                  .fitted = detail::low_speed_range,
                                                  .least_of_sign = detail::widths_of_sign};
/// A path over which a contact bends before it slides.
inline constexpr ShapeValues distance{
    .tried = detail::paths, .judged = detail::usual_paths, .fitted = detail::path_range, .seen_by_encoder = true};
/// What repeats with the position; 20 rad^-1 is a gear's tooth.
inline constexpr ShapeValues wavenumber{.judged = detail::usual_wavenumbers, .search = ShapeSearch::spectrum};
/// Of warming up.
inline constexpr ShapeValues time_constant{.tried = detail::times_of_session, .judged = detail::usual_times_of_session};
/// A torque that cuts the largest ones.
inline constexpr ShapeValues torque_limit{.tried = detail::limits, .judged = detail::usual_limits};
/// Of a bus and a current loop [s].
inline constexpr ShapeValues delay{.tried = detail::delays, .judged = detail::usual_delays};
/// Damping over stiffness of a gear [s].
inline constexpr ShapeValues relaxation{
    .tried = detail::relaxations, .judged = detail::usual_relaxations, .of_link = detail::link_relaxations};
/// A small load that decides which flank of a gear is in touch. A gap that the largest load does not close is a spring:
/// tanh(1 / 0.4) = 0.987.
inline constexpr ShapeValues small_load{
    .tried = detail::loads, .judged = detail::usual_loads, .most_of_load = 0.4, .of_link = detail::link_loads};
/// Coulomb's friction as a share of the static one.
inline constexpr ShapeValues friction_share{
    .tried = detail::friction_shares, .judged = detail::friction_shares, .fitted = detail::friction_share_range};
/// Same or opposite.
inline constexpr ShapeValues direction{
    .tried = detail::both_directions, .judged = detail::both_directions, .search = ShapeSearch::list};
/// Width of a sign of its own.
inline constexpr ShapeValues width{
    .tried = detail::widths, .judged = detail::usual_widths, .fitted = detail::width_range};
/// Any other joint of the robot; its index from 1.
inline constexpr ShapeValues other_joint{
    .tried = detail::others_in_order, .judged = detail::others_before_first, .search = ShapeSearch::list};
/// The joint before or after; its index from 1. Motors that share a gear turn joints of one type.
inline constexpr ShapeValues neighbour{
    .tried = detail::mates, .judged = detail::neighbours, .search = ShapeSearch::list};
/// Where a free curve's knots begin, and how far they reach.
inline constexpr ShapeValues curve_from{.tried = detail::lowest, .judged = detail::lowest, .search = ShapeSearch::list};
inline constexpr ShapeValues curve_span{.tried = detail::range, .judged = detail::range, .search = ShapeSearch::list};
inline constexpr ShapeValues curve_velocity_from{
    .tried = detail::lowest_speed, .judged = detail::lowest_speed, .search = ShapeSearch::list};
inline constexpr ShapeValues curve_velocity_span{
    .tried = detail::range_of_speed, .judged = detail::range_of_speed, .search = ShapeSearch::list};
inline constexpr ShapeValues curve_load_from{
    .tried = detail::lowest_load, .judged = detail::lowest_load, .search = ShapeSearch::list};
inline constexpr ShapeValues curve_load_span{
    .tried = detail::range_of_load, .judged = detail::range_of_load, .search = ShapeSearch::list};

}  // namespace fxdyn::shapes
