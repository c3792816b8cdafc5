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

/// A velocity below which friction is another one. Narrower than the sign is the sign; wider is viscous friction.
inline constexpr ShapeValues velocity{.tried =
                                          [](const MotionScales& s) {
                                            const double from = std::max(3e-3 * s.speed, 1.5 * s.sign_width);
                                            return geometric(std::min(from, 0.1 * s.speed), 0.2 * s.speed, 9);
                                          },
                                      .judged =
                                          [](const MotionScales& s) {
                                            return shares_of(s.speed, {0.025, 0.01, 0.05});
                                          },
                                      .fitted =
                                          [](const MotionScales& s) {
                                            return ShapeRange{3e-3 * s.speed, 0.15 * s.speed};
                                          }};

/// A path over which a contact bends before it slides.
inline constexpr ShapeValues distance{
    .tried = [](const MotionScales& s) { return s.turns ? geometric(2e-4, 2e-2, 10) : geometric(1e-5, 1e-3, 10); },
    .judged =
        [](const MotionScales& s) {
          return s.turns ? ValueList{3e-3, 1e-3, 9e-3} : ValueList{1e-4, 3e-5, 3e-4};
        },
    .fitted =
        [](const MotionScales& s) {
          return ShapeRange{1e-6 * s.range, 0.1 * s.range};
        },
    .seen_by_encoder = true};

/// What repeats with the position; 20 rad^-1 is a gear's tooth.
inline constexpr ShapeValues wavenumber{
    .judged =
        [](const MotionScales& s) {
          return s.turns ? ValueList{20.0, 4.0, 100.0} : ValueList{600.0, 120.0, 3000.0};
        },
    .search = ShapeSearch::spectrum};

/// Of warming up.
inline constexpr ShapeValues time_constant{
    .tried = [](const MotionScales& s) { return geometric(0.1 * s.seconds, 4 * s.seconds, 5); },
    .judged =
        [](const MotionScales& s) {
          return shares_of(s.seconds, {1, 0.3, 3});
        }};

/// A torque that cuts the largest ones.
inline constexpr ShapeValues torque_limit{
    .tried =
        [](const MotionScales& s) {
          return shares_of(s.torque, {0.45, 0.55, 0.63, 0.7, 0.76, 0.82, 0.87, 0.91, 0.95});
        },
    .judged =
        [](const MotionScales& s) {
          return shares_of(s.torque, {0.85, 0.7, 0.95});
        }};

/// Of a bus and a current loop [s].
inline constexpr ShapeValues delay{.tried = [](const MotionScales& s) { return geometric(5e-4, s.upper, 5); },
                                   .judged =
                                       [](const MotionScales&) {
                                         return ValueList{2e-3, 1e-3, 4e-3};
                                       }};

/// Damping over stiffness of a gear [s].
inline constexpr ShapeValues relaxation{
    .tried =
        [](const MotionScales&) {
          return ValueList{1e-3, 8e-3};
        },
    .judged =
        [](const MotionScales&) {
          return ValueList{1e-3, 5e-3};
        },
    .of_link = [](const MotionScales&) { return ValueList{1e-3, 0, 1e-3, 3e-3, 8e-3, 2e-2}; }};

/// A small load that decides which flank of a gear is in touch.
inline constexpr ShapeValues small_load{
    .tried = [](const MotionScales& s) { return geometric(0.015 * s.structural, 0.25 * s.structural, 4); },
    .judged =
        [](const MotionScales& s) {
          return shares_of(s.structural, {0.05, 0.02, 0.1});
        },
    .of_link =
        [](const MotionScales& s) {
          return shares_of(s.structural, {0.03, 0.01, 0.025, 0.06, 0.15});
        }};

/// A direction: same or opposite.
inline constexpr ShapeValues direction{.tried =
                                           [](const MotionScales&) {
                                             return ValueList{1, -1};
                                           },
                                       .judged =
                                           [](const MotionScales&) {
                                             return ValueList{1, -1};
                                           },
                                       .search = ShapeSearch::list};

/// Width of a sign of its own.
inline constexpr ShapeValues width{.tried =
                                       [](const MotionScales& s) {
                                         return geometric(std::max(0.3 * s.sign_width, 1e-3 * s.speed),
                                                          std::max(3 * s.sign_width, 0.03 * s.speed), 3);
                                       },
                                   .judged = [](const MotionScales& s) { return shares_of(s.speed, {0.01}); },
                                   .fitted =
                                       [](const MotionScales& s) {
                                         return ShapeRange{1e-4 * s.speed, 0.3 * s.speed};
                                       }};

/// Any other joint of the robot; its index from 1.
inline constexpr ShapeValues other_joint{.tried =
                                             [](const MotionScales& s) {
                                               ValueList others;
                                               for (unsigned k = 0; k < s.joints; ++k) {
                                                 if (k != s.joint) others.add(k + 1);
                                               }
                                               return others;
                                             },
                                         .judged =
                                             [](const MotionScales& s) {
                                               ValueList others;
                                               for (unsigned k = s.joint; k-- > 0;) others.add(k + 1);
                                               for (unsigned k = s.joint + 1; k < s.joints; ++k) others.add(k + 1);
                                               return others;
                                             },
                                         .search = ShapeSearch::list};

/// The joint before or after; its index from 1. Motors that share a gear turn joints of one type.
inline constexpr ShapeValues neighbour{.tried =
                                           [](const MotionScales& s) {
                                             ValueList mates;
                                             if (s.like_previous) mates.add(s.joint);
                                             if (s.like_next) mates.add(s.joint + 2);
                                             return mates;
                                           },
                                       .judged =
                                           [](const MotionScales& s) {
                                             ValueList mates;
                                             if (s.joint > 0) mates.add(s.joint);
                                             if (s.joint + 1 < s.joints) mates.add(s.joint + 2);
                                             return mates;
                                           },
                                       .search = ShapeSearch::list};

}  // namespace fxdyn::shapes
