#include "host_tools/diagnose/where_words.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "host_tools/support/time_text.hpp"

namespace fxdyn::diagnosis {
namespace {

/// Edges of an interval with three digits of its length, so that a short one late in a log can be told from its
/// beginning.
std::string edge(double value, const GapRegion& region) {
  const double length = region.to - region.from, largest = std::max(std::fabs(region.from), std::fabs(region.to));
  const int more = length > 0 && largest > length ? static_cast<int>(std::floor(std::log10(largest / length))) : 0;
  return fmt::format("{:.{}g}", value, 3 + more);
}

std::string between(const GapRegion& region, const std::string& unit) {
  return fmt::format("between {} and {} {}", edge(region.from, region), edge(region.to, region), unit);
}

/// A log's first or last seconds, where the interval begins or ends within a class of 24 of its end; else a time of its
/// clock.
std::string words_of_time(const GapRegion& region, const std::vector<const ProcessedLog*>& logs) {
  double first = 1e300, last = -1e300;  // of a session: from its first log to its last
  for (const ProcessedLog* log : logs) {
    if (!region.log.empty() && log->name != region.log) continue;
    first = std::min(first, log->t[log->first]);
    last = std::max(last, log->t[log->last - 1]);
  }
  const std::string of = region.log.empty() ? "" : " of " + region.log;
  const double near_s = (last - first) / 24;
  const bool begins = region.from - first < near_s, ends = last - region.to < near_s;
  if (begins && !ends) return fmt::format("in the first {:.2g} s{}", region.to - first, of);
  if (ends && !begins) return fmt::format("in the last {:.2g} s{}", last - region.from, of);
  return fmt::format("between {} and {} s{}", time_text(region.from), time_text(region.to), of);
}

/// Slow motion that is small against the logs' fastest is where a joint reverses.
constexpr double reversal_share = 0.25;

std::string words_of_speed(double below, std::size_t joint, const std::string& unit,
                           const std::vector<const ProcessedLog*>& logs) {
  double fastest = 0;
  for (const ProcessedLog* log : logs)
    fastest = std::max(fastest, log->joint_motion(static_cast<Eigen::Index>(joint)).dq.cwiseAbs().maxCoeff());
  return fmt::format("at {}, below {:.2g} {}", below < reversal_share * fastest ? "reversals" : "low speed", below,
                     unit);
}

}  // namespace

std::string words_of(const GapRegion& region, const Robot& robot, std::size_t joint,
                     const std::vector<const ProcessedLog*>& logs) {
  const Joint& own = robot.joints[joint];
  const std::string position = own.position_unit();
  if (region.signal == "direction") return region.to > 0 ? "in positive direction" : "in negative direction";
  if (region.signal == "q" && region.joint > 0)
    return fmt::format("while joint {} is {}", region.joint,
                       between(region, robot.joints[region.joint - 1].position_unit()));
  if (region.signal == "q") return between(region, position);
  const std::string velocity = position + "/s";
  // An interval of the velocity around zero is one of slow motion, too.
  const bool around_zero = std::min(-region.from, region.to) > 0.5 * std::max(-region.from, region.to);
  if ((region.signal == "speed" && region.from <= 0) || (region.signal == "dq" && around_zero))
    return words_of_speed(std::max(-region.from, region.to), joint, velocity, logs);
  if (region.signal == "dq") return "at velocities " + between(region, velocity);
  if (region.signal == "speed") return "at speeds " + between(region, velocity);
  if (region.signal == "ddq") return "at accelerations " + between(region, position + "/s^2");
  if (region.signal == "load") return "under loads " + between(region, own.torque_unit());
  if (region.signal == "frequency") return "at frequencies " + between(region, "Hz");
  return words_of_time(region, logs);
}

std::string sentence_of(const std::vector<GapRegion>& regions, const Robot& robot, std::size_t joint,
                        const std::vector<const ProcessedLog*>& logs) {
  if (regions.empty()) return {};
  const GapRegion& first = regions.front();
  std::string out =
      fmt::format("{:.0f} % of the gap is {}", 100 * *first.share_of_gap, words_of(first, robot, joint, logs));
  if (first.signal != "frequency") out += fmt::format(", in {:.0f} % of the time", 100 * *first.share_of_time);
  return out;
}

}  // namespace fxdyn::diagnosis
