#pragma once

#include <Eigen/Dense>
#include <array>
#include <vector>

#include "host_tools/diagnose/options.hpp"
#include "host_tools/diagnose/session_log.hpp"

namespace fxdyn::diagnosis {

/// Samples [from, to) of a log. Of these, counted from `from`, [first, last) count: what a filter's ends or an effect's
/// memory spoil lies before and after them.
struct Window {
  Eigen::Index from = 0, to = 0, first = 0, last = 0;
};

/// Recordings that are longer than a diagnosis has room for, as windows: parts of equal length, spread evenly over each
/// of them. Slow changes show in them as in the whole, and what the search takes no longer grows with the length. The
/// longest recordings give up rows first: all that are cut keep the same number, and shorter ones stay whole.
/// @param logs with the decimation that they are to have; their columns are not looked at, and may be none
/// @returns by log; one window: the log itself
std::vector<std::vector<Window>> plan_windows(const std::vector<SessionLog>& logs, Eigen::Index joints,
                                              const SessionOptions& options);
/// .. of logs that all stay whole.
std::vector<std::vector<Window>> whole_logs(const std::vector<SessionLog>& logs);
/// Every window as a log of its own, as old as the session is when it begins; all but the first continue it.
std::vector<SessionLog> in_windows(const SessionLog& entry, const std::vector<Window>& windows);

/// How far each joint moves in the logs of a session that fit [rad | m].
class Ranges {
 public:
  explicit Ranges(Eigen::Index joints) {
    for (auto& [low, high] : of_) {
      low.setConstant(joints, 1e300);
      high = -low;
    }
  }
  /// @param q of one joint, all samples of the log
  void add(const SessionLog& entry, Eigen::Index joint, const Eigen::Ref<const Eigen::VectorXd>& q);
  /// Whether all joints of both sessions move by a share of what they do in others. A joint that moves less in the
  /// windows than in its session would not be known.
  bool reach(double share, const Ranges& others) const;

 private:
  std::array<std::array<Eigen::ArrayXd, 2>, 2> of_;  ///< by session, the healthy one second: lowest, highest
};

/// The windows of today's logs as they were recorded, neither smoothed nor thinned more: what else is fitted around
/// what was found needs no more of a long log than the search.
/// @param recorded train and validate logs @param logs their sessions, see sessions()
/// @returns empty: today's logs are whole
std::vector<ProcessedLog> windows_as_recorded(const std::vector<ProcessedLog>& recorded,
                                              const std::vector<SessionLog>& logs, const SessionOptions& options);

/// Samples [from, to) of a log. What a filter's ends or an effect's memory spoil there has to be in it, and be left
/// out: [first, last) are the samples that count, of the part.
ProcessedLog part_of(const ProcessedLog& log, Eigen::Index from, Eigen::Index to, Eigen::Index first,
                     Eigen::Index last);

}  // namespace fxdyn::diagnosis
