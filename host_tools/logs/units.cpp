#include "host_tools/logs/units.hpp"

#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include "host_tools/logs/quantile.hpp"
#include "host_tools/support/error.hpp"

namespace fxdyn {

using Eigen::Index;

namespace {

/// What to write where q and its derivatives are in different units: position_gain is all theirs.
std::string leave_out_velocity(const Log& log) {
  return fmt::format("leave out the velocity (columns = {{ dq = false{} }}), which is then differentiated from q",
                     log.ddq.size() > 0 ? ", ddq = false" : "");
}

/// The line to write where these joints' positions are in degrees.
std::string gain_line(const std::vector<bool>& in_degrees) {
  std::vector<std::string> gains;
  gains.reserve(in_degrees.size());
  for (const bool is : in_degrees) gains.emplace_back(is ? "0.0174532925" : "1");
  return fmt::format("position_gain = [{}] (in its [[log]], or in [signals] for all logs)", fmt::join(gains, ", "));
}

/// "q2 looks", "q1, q2 and q4 look"
std::string that_look(const std::vector<bool>& in_degrees) {
  std::vector<std::string> names;
  for (std::size_t j = 0; j < in_degrees.size(); ++j) {
    if (in_degrees[j]) names.push_back(fmt::format("q{}", j + 1));
  }
  if (names.size() == 1) return names[0] + " looks";
  const std::string last = names.back();
  names.pop_back();
  return fmt::format("{} and {} look", fmt::join(names, ", "), last);
}

constexpr double degrees = 180 / std::numbers::pi;

/// Slope of q over dq, by least squares; nothing where it is too noisy or at rest.
std::optional<double> slope_over_velocity(const Log& log, Index joint) {
  // Over 20 ms on either side: the slope from one sample to the next is mostly the encoder's noise.
  const Index half = std::max<Index>(1, static_cast<Index>(0.02 / log.step_s));
  const Index n = log.samples() - 2 * half;
  if (n < 5) return std::nullopt;
  const Eigen::VectorXd span = log.t.tail(n) - log.t.head(n);
  const Eigen::VectorXd slope = (log.q.col(joint).tail(n) - log.q.col(joint).head(n)).cwiseQuotient(span);
  const Eigen::VectorXd dq = log.dq.col(joint).segment(half, n);
  const double power = dq.squaredNorm();
  if (power == 0 || slope.dot(dq) < 0.7 * slope.norm() * dq.norm()) return std::nullopt;
  return slope.dot(dq) / power;
}

/// Units: compares dq with the slope of q.
void check_velocities(const Log& log, const std::vector<bool>& revolute, const std::string& where) {
  std::vector<bool> in_degrees(revolute.size(), false);
  std::optional<double> first;
  for (Index joint = 0; joint < log.joints(); ++joint) {
    const std::optional<double> ratio = slope_over_velocity(log, joint);
    if (!ratio) continue;
    const auto near = [&ratio](double value) { return std::abs(*ratio / value - 1) < 0.15; };
    const bool turns = revolute[static_cast<std::size_t>(joint)];
    if (turns && near(degrees)) {
      in_degrees[static_cast<std::size_t>(joint)] = true;
      if (!first) first = ratio;
    }
    if (turns && near(1 / degrees)) {
      throw InputError(fmt::format(
          "{}: dq{} looks like degrees (q{} changes only {:.3g} times as fast): it lacks a factor of pi/180; {}", where,
          joint + 1, joint + 1, *ratio, leave_out_velocity(log)));
    }
    if (near(1e-3)) {
      throw InputError(
          fmt::format("{}: t looks like milliseconds (q{} changes only {:.3g} times as fast as dq{} says); write "
                      "time_unit = \"ms\" into its [[log]]",
                      where, joint + 1, *ratio, joint + 1));
    }
  }
  if (!first) return;
  throw InputError(
      fmt::format("{}: {} like degrees (the position changes {:.3g} times as fast as dq says); multiply by pi/180: {}, "
                  "and {}",
                  where, that_look(in_degrees), *first, gain_line(in_degrees), leave_out_velocity(log)));
}

/// What else may stand where degrees are seen: torques, if the torque's columns hold no more than angles.
std::string exchanged_hint(const Log& log) {
  constexpr double turn = 2 * std::numbers::pi;
  if (log.tau.size() == 0 || !(log.tau.cwiseAbs().maxCoeff() < turn)) return "";
  return "; or, if the columns of q and tau are exchanged, exchange them (columns = { q = .., tau = .. })";
}

/// Units without dq: a joint that turns more than four times, less than an arm's few hundred degrees do as radians, and
/// does so faster than robots turn for a good part of the log. Where one is in degrees, all that turn are.
void check_range(const Log& log, Index joint, const std::vector<bool>& revolute, const std::string& where) {
  const double range = log.q.col(joint).maxCoeff() - log.q.col(joint).minCoeff();
  if (range < 25 || range > 800) return;
  const Index stride =
      std::clamp<Index>(static_cast<Index>(0.02 / log.step_s), 1, std::max<Index>(1, log.samples() / 4));
  const Index n = log.samples() - stride;
  const Eigen::VectorXd speed =
      (log.q.col(joint).tail(n) - log.q.col(joint).head(n)).cwiseAbs() / (static_cast<double>(stride) * log.step_s);
  const double fast = quantile(speed, 0.9);
  if (fast < 25) return;
  throw InputError(fmt::format(
      "{}: q{} looks like degrees (range {:.3g}, {:.3g} per second), multiply by pi/180: {}; or, if it is the motor's "
      "angle, divide by the gear ratio (position_gain, too){}",
      where, joint + 1, range, fast, gain_line(revolute), exchanged_hint(log)));
}

/// Slow logs: one joint may turn more than twice, but not nearly every joint of an arm.
void check_ranges(const Log& log, const std::vector<bool>& revolute, const std::string& where) {
  std::size_t turning = 0;
  double widest = 0;
  for (Index joint = 0; joint < log.joints(); ++joint) {
    if (!revolute[static_cast<std::size_t>(joint)]) continue;
    const double range = log.q.col(joint).maxCoeff() - log.q.col(joint).minCoeff();
    if (range > 4 * std::numbers::pi) ++turning;
    widest = std::max(widest, range);
  }
  const auto count = static_cast<std::size_t>(std::count(revolute.begin(), revolute.end(), true));
  if (count < 3 || turning + 1 < count || widest > 800) return;
  throw InputError(fmt::format(
      "{}: q looks like degrees ({} of {} joints turn more than twice), multiply by pi/180: {}; or, if they are "
      "the motors' angles, divide by the gear ratios (position_gain, too){}",
      where, turning, count, gain_line(revolute), exchanged_hint(log)));
}

/// Rows that are far apart while nothing moves faster than a crawl: milliseconds at a high rate.
void check_crawl(const Log& log, const std::vector<bool>& revolute, const std::string& where) {
  constexpr double slowest_rate_s = 0.02;  // of which seconds are beyond doubt
  constexpr double crawl = 0.02;           // [rad/s]: less than any recorded motion's top speed
  constexpr double moved = 0.1;            // [rad]
  if (log.step_s < slowest_rate_s) return;
  double fastest = 0, widest = 0;
  for (Index joint = 0; joint < log.joints(); ++joint) {
    if (!revolute[static_cast<std::size_t>(joint)]) continue;
    const Eigen::VectorXd q = log.q.col(joint);
    const Index n = q.size() - 1;
    widest = std::max(widest, q.maxCoeff() - q.minCoeff());
    fastest = std::max(fastest, quantile((q.tail(n) - q.head(n)).cwiseAbs() / log.step_s, 0.99));
  }
  if (widest < moved || fastest > crawl) return;
  throw InputError(fmt::format(
      "{}: t looks like milliseconds (as seconds no joint turns faster than {:.2g} rad/s); write time_unit = "
      "\"ms\" into its [[log]], or \"s\" if it is so slow",
      where, fastest));
}

}  // namespace

void check_units(const Log& log, const std::vector<bool>& revolute, const std::string& where, bool time_is_known) {
  if (log.dq.size() > 0) check_velocities(log, revolute, where);
  for (Index joint = 0; joint < log.joints(); ++joint) {
    if (revolute[static_cast<std::size_t>(joint)]) check_range(log, joint, revolute, where);
  }
  check_ranges(log, revolute, where);
  if (!time_is_known) check_crawl(log, revolute, where);
}

}  // namespace fxdyn
