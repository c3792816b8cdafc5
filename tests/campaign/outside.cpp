#include "tests/campaign/outside.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "host_tools/signals/filter.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/random.hpp"

namespace fxdyn::campaign {

using Eigen::ArrayXd;
using Eigen::Index;
using Eigen::VectorXd;

const std::vector<std::string>& outside_effects() {
  static const std::vector<std::string> names{
      "other_position",         // sin of another joint's position: a cable pulled along
      "square_wave",            // of time: a pump, a brake that sticks now and then
      "slow_wave",              // of time, without an edge
      "product_of_velocities",  // dq_j dq_k
      "tight_spot",             // friction higher around one position
      "jerk",                   // d(ddq)/dt
      "acceleration_squared",   // ddq |ddq|
      "wandering_friction",     // Coulomb friction that follows a random temperature
      "end_stop",               // a soft stop before the end of the range
  };
  return names;
}

const std::vector<std::string>& other_forms() {
  static const std::vector<std::string> names{"exponential_stribeck", "power_viscous", "hardening_spring",
                                              "offset_compensator", "slip_elements"};
  return names;
}

std::vector<std::string> names_of_form(const std::string& effect) {
  if (effect == "exponential_stribeck" || effect == "power_viscous")
    return {"stribeck", "viscous_quadratic", "viscous_cubic"};
  if (effect == "hardening_spring" || effect == "offset_compensator")
    return {"spring", "gravity_compensator", "ripple"};
  if (effect == "slip_elements") return {"presliding", "lugre", "maxwell_slip"};
  return {};
}

bool is_outside(const std::string& effect) {
  const auto in = [&](const std::vector<std::string>& names) {
    return std::find(names.begin(), names.end(), effect) != names.end();
  };
  return in(outside_effects()) || in(other_forms());
}

std::string curve_of(const Outside& outside) {
  if (outside.effect == "tight_spot") return "friction_over_position";
  if (outside.effect == "end_stop") return "position_curve";
  if (outside.effect == "other_position") return fmt::format("cross_position {}", outside.other + 1);
  if (outside.effect == "square_wave" || outside.effect == "slow_wave" || outside.effect == "wandering_friction")
    return "time_curve";
  return {};
}

Outside draw_outside(const std::string& effect, std::size_t joint, const Plan& plan, std::uint64_t seed) {
  Outside outside{effect, joint, 0, seed};
  Random random(seed);
  const std::size_t n = plan.joints();
  outside.other = (joint + 1 + random.next() % (n - 1)) % n;
  const auto j = static_cast<Index>(joint), k = static_cast<Index>(outside.other);
  outside.velocity = plan.largest_velocity[j];
  outside.other_velocity = plan.largest_velocity[k];
  for (const Motion& motion : plan.motions)
    outside.acceleration = std::max(outside.acceleration, motion.ddq.col(j).cwiseAbs().maxCoeff());
  outside.low = plan.range(j, 0);
  outside.high = plan.range(j, 1);
  outside.other_low = plan.range(k, 0);
  outside.other_high = plan.range(k, 1);
  return outside;
}

namespace {

/// Constants of a seed; the phase is drawn first, whether an effect has one or not.
struct Constants {
  Random random;
  double phase;
  explicit Constants(const Outside& o) : random(o.seed ^ 0x5EED), phase(random.uniform(0, 2 * std::numbers::pi)) {}
};

struct Spot {
  double centre, width;
};
Spot spot_of(const Outside& o, Random& random) {
  const double range = o.high - o.low, centre = o.low + range * random.uniform(0.3, 0.7);
  return {centre, range * random.uniform(0.04, 0.1)};
}

double stop_of(const Outside& o, Random& random) { return o.high - (o.high - o.low) * random.uniform(0.08, 0.2); }

}  // namespace

std::optional<Place> place_of(const Outside& o) {
  Constants constants(o);
  if (o.effect == "tight_spot") {
    const Spot spot = spot_of(o, constants.random);
    return Place{"q", spot.centre - spot.width, spot.centre + spot.width};  // 95 % of its power
  }
  if (o.effect == "end_stop") return Place{"q", stop_of(o, constants.random), o.high};
  return {};
}

VectorXd outside_torque(const Outside& o, const Motion& motion) {
  Constants constants(o);
  Random& random = constants.random;
  const auto j = static_cast<Index>(o.joint), k = static_cast<Index>(o.other);
  const ArrayXd q = motion.q.col(j), dq = motion.dq.col(j), ddq = motion.ddq.col(j);
  const ArrayXd sign = (dq / (0.01 * o.velocity)).tanh();
  const double phase = constants.phase;
  ArrayXd column;
  if (o.effect == "other_position") {
    const double waves = random.uniform(1.2, 3) * 2 * std::numbers::pi / (o.other_high - o.other_low);
    column = (waves * motion.q.col(k).array() + phase).sin();
  } else if (o.effect == "square_wave") {
    const double period = random.uniform(3, 12);
    column = (2 * std::numbers::pi / period * motion.t.array() + phase).sin().sign();
  } else if (o.effect == "slow_wave") {
    const double period = random.uniform(6, 25);
    column = (2 * std::numbers::pi / period * motion.t.array() + phase).sin();
  } else if (o.effect == "product_of_velocities") {
    column = dq / o.velocity * motion.dq.col(k).array() / o.other_velocity;
  } else if (o.effect == "tight_spot") {
    const Spot spot = spot_of(o, random);
    column = sign * (-((q - spot.centre) / spot.width).square()).exp();
  } else if (o.effect == "jerk") {
    column = differentiate(motion.ddq.col(j), motion.step_s) / o.acceleration;
  } else if (o.effect == "acceleration_squared") {
    column = ddq * ddq.abs() / (o.acceleration * o.acceleration);
  } else if (o.effect == "end_stop") {
    column = (q - stop_of(o, random)).max(0.0) / (o.high - o.low) * 10;
  } else if (o.effect == "exponential_stribeck") {
    column = sign * (-dq.abs() / (o.velocity * random.uniform(0.02, 0.08))).exp();
  } else if (o.effect == "power_viscous") {
    const double power = random.uniform(1.4, 1.7);
    column = sign * (dq.abs() / o.velocity).pow(power);
  } else if (o.effect == "hardening_spring") {
    const ArrayXd u = 2 * (q - o.low) / (o.high - o.low) - 1 + random.uniform(-0.3, 0.3);
    column = u + random.uniform(0.3, 0.8) * u.cube();
  } else if (o.effect == "offset_compensator") {
    // A spring between two points: its lever and its length turn with the joint.
    const double near = random.uniform(0.3, 0.6);
    const ArrayXd angle = q + phase;
    column = angle.sin() * near / (1 + near * near - 2 * near * angle.cos()).sqrt();
  } else if (o.effect == "slip_elements") {
    const double widest = (o.high - o.low) * random.uniform(1e-3, 4e-3);
    column = ArrayXd::Zero(q.size());
    for (const double share : {0.3, 0.7, 1.6}) {
      double z = 0;
      for (Index i = 0; i < q.size(); ++i) {
        if (i > 0) z = std::clamp(z + q[i] - q[i - 1], -share * widest, share * widest);
        column[i] += z / (share * widest) / 3 - sign[i] / 3;
      }
    }
  } else if (o.effect == "wandering_friction") {
    ArrayXd temperature = ArrayXd::Zero(motion.t.size());
    for (int i = 0; i < 5; ++i) {
      const double period = 8 * std::pow(2.0, i) * random.uniform(0.8, 1.2);
      temperature += (2 * std::numbers::pi / period * motion.t.array() + random.uniform(0, 6.28)).sin();
    }
    column = temperature * sign;
  } else {
    throw InputError("no effect outside the catalogue is called " + o.effect);
  }
  return o.amplitude * column.matrix();
}

std::optional<Swept> swept(const Outside& o, double duration_s) {
  const std::string curve = curve_of(o);
  if (curve.empty()) return {};
  constexpr Index points = 400;
  const bool of_time = curve == "time_curve", of_other = curve.starts_with("cross_position");
  const double from = of_time    ? 0
                      : of_other ? o.other_low
                                 : o.low,
               to = of_time    ? duration_s
                    : of_other ? o.other_high
                               : o.high;
  const VectorXd x = VectorXd::LinSpaced(points, from, to);
  // One motion that passes all of it in the positive direction.
  const auto n = static_cast<Index>(std::max(o.joint, o.other) + 1);
  Motion motion{"",
                (to - from) / static_cast<double>(points - 1),
                VectorXd::Zero(points),
                Eigen::MatrixXd::Zero(points, n),
                Eigen::MatrixXd::Zero(points, n),
                Eigen::MatrixXd::Zero(points, n)};
  motion.dq.col(static_cast<Index>(o.joint)).setConstant(o.velocity);
  if (of_time)
    motion.t = x;
  else
    motion.q.col(static_cast<Index>(of_other ? o.other : o.joint)) = x;
  const VectorXd y = outside_torque(o, motion);
  const bool friction = o.effect == "tight_spot" || o.effect == "wandering_friction";
  return Swept{{x.begin(), x.end()}, {y.begin(), y.end()}, friction};
}

void scale(Outside& outside, double share, const Plan& plan) {
  outside.amplitude = 1;
  double power = 0, samples = 0;
  for (const Motion& motion : plan.motions) {
    power += outside_torque(outside, motion).squaredNorm();
    samples += static_cast<double>(motion.t.size());
  }
  outside.amplitude = share * plan.healthy.joints[outside.joint].rated_torque / std::sqrt(power / samples);
}

}  // namespace fxdyn::campaign
