#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "tests/campaign/plan.hpp"

namespace fxdyn::campaign {

/// Torques that the catalogue has no name for.
const std::vector<std::string>& outside_effects();
/// Torques of another form than the catalogue's column, and the names under which each is right: those of its class.
/// Empty for any other name.
const std::vector<std::string>& other_forms();
std::vector<std::string> names_of_form(const std::string& effect);
/// Whether an effect is one of these, not one of the catalogue.
bool is_outside(const std::string& effect);

/// One of them with everything drawn that it needs.
struct Outside {
  std::string effect;
  std::size_t joint = 0, other = 0;  ///< from 0; other: whose motion it takes, where it takes one
  std::uint64_t seed = 0;            ///< of its constants
  double amplitude = 1;              ///< [N*m | N], for columns of RMS near one
  double velocity = 1, other_velocity = 1, acceleration = 1;  ///< scales of the joints' motion
  double low = 0, high = 1, other_low = 0, other_high = 1;    ///< ranges of their positions
};
Outside draw_outside(const std::string& effect, std::size_t joint, const Plan& plan, std::uint64_t seed);

/// Its torque over a motion; motion.t is the time since the session's start.
Eigen::VectorXd outside_torque(const Outside& outside, const Motion& motion);

/// Where its torque sits, in the signals of a gap's regions; none: all over the motion.
struct Place {
  std::string signal;
  double from = 0, to = 0;
};
std::optional<Place> place_of(const Outside& outside);

/// The free curve that has its form, "cross_position 4" where it is over the position of joint 4; "": none has.
std::string curve_of(const Outside& outside);

/// That curve: the torque, of friction in the positive direction, over the variable's range in the plan, or over time
/// since the session's start [s].
struct Swept {
  std::vector<double> x, y;
  bool friction = false;  ///< its sign is that of the motion
};
/// @param duration_s of the session; @returns nothing where no curve has the form
std::optional<Swept> swept(const Outside& outside, double duration_s);

/// The amplitude that makes it the share of rated torque (RMS over the plan's motions).
void scale(Outside& outside, double share, const Plan& plan);

}  // namespace fxdyn::campaign
