#include "host_tools/diagnose/curve_sentence.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "host_tools/diagnose/where_words.hpp"

namespace fxdyn::diagnosis {
namespace {

/// The largest way off the curve's median, and where it is more than half of that. A curve that goes as far to the
/// other side, by half at least, changes over all of its interval.
struct Bump {
  double height = 0;  ///< less than 0: a dip
  bool both_ways = false;
  double from = 0, to = 0;
};

Bump bump_of(const std::vector<CurveResult::Point>& p) {
  std::vector<double> sorted(p.size());
  std::transform(p.begin(), p.end(), sorted.begin(), [](const CurveResult::Point& point) { return point.y; });
  std::sort(sorted.begin(), sorted.end());
  const double median = sorted[sorted.size() / 2], up = sorted.back() - median, down = median - sorted.front();
  if (2 * std::min(up, down) > std::max(up, down)) return {up + down, true, p.front().x, p.back().x};
  const double height = up > down ? up : -down;
  const auto share = [&](std::size_t i) { return (p[i].y - median) / height; };
  std::size_t peak = 0;
  for (std::size_t i = 0; i < p.size(); ++i) {
    if (share(i) > share(peak)) peak = i;
  }
  std::size_t from = peak, to = peak;
  while (from > 0 && share(from - 1) > 0.5) --from;
  while (to + 1 < p.size() && share(to + 1) > 0.5) ++to;
  if (from == to) {  // the curve is known at points only
    from -= from > 0 ? 1 : 0;
    to += to + 1 < p.size() ? 1 : 0;
  }
  return {height, false, p[from].x, p[to].x};
}

/// "friction rises by 0.8 N*m between 0.85 and 1.05 rad".
std::string sentence_of(const CurveResult& curve, const Bump& bump, const Robot& robot, std::size_t joint,
                        const std::vector<SessionLog>& logs) {
  const std::string what = curve.friction ? "friction" : "torque";
  const std::string size = fmt::format("{:.2g} {}", std::fabs(bump.height), robot.joints[joint].torque_unit());
  if (bump.both_ways) {
    return fmt::format("{} changes by {} between {:.2f} and {:.2f} {}{}", what, size, bump.from, bump.to, curve.unit,
                       curve.joint > 0      ? fmt::format(" of joint {}", curve.joint)
                       : !curve.log.empty() ? " of " + curve.log
                                            : "");
  }
  std::vector<const ProcessedLog*> shown;
  for (const SessionLog& log : logs) {
    if (!log.healthy) shown.push_back(&log.log);
  }
  const GapRegion region = place_of(curve);
  return fmt::format("{} {} by {} {}", what, bump.height > 0 ? "rises" : "falls", size,
                     words_of(region, robot, joint, shown));
}

}  // namespace

GapRegion place_of(const CurveResult& curve) {
  GapRegion out;
  out.signal = curve.signal;
  out.joint = curve.joint;
  out.from = curve.from;
  out.to = curve.to;
  out.log = curve.log;
  return out;
}

void tell(CurveResult& curve, const Robot& robot, std::size_t joint, const std::vector<SessionLog>& logs) {
  const Bump bump = bump_of(curve.points);
  curve.from = bump.from;
  curve.to = bump.to;
  curve.sentence = sentence_of(curve, bump, robot, joint, logs);
}

}  // namespace fxdyn::diagnosis
