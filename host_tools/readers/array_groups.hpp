#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "host_tools/arrays/arrays.hpp"

namespace fxdyn {

/// A column of a log that is a part of an array: its number `channel` of each sample.
struct ArrayColumn {
  std::string name;
  std::size_t array, channel;
  bool has_better_name = false;  ///< the next column is the same one, as the file itself calls it
};

/// Arrays with one common time: those of a file, of a struct or of a group.
struct ArrayGroup {
  std::string topic;  ///< its name: "log", "data/demo_0"; "/": the file itself
  std::uint64_t samples = 0;
  std::vector<ArrayColumn> columns;      ///< the stamps first; their array is none where there is only a rate
  std::vector<std::size_t> other_times;  ///< arrays that have to hold the same stamps
  double rate_hz = 0;                    ///< of a demonstration without stamps
  /// Arrays that are no columns, by their columns' name, and why.
  std::vector<std::pair<std::string, std::string>> unusable;
  bool has_stamps() const { return rate_hz == 0; }
};

/// How an array's numbers lie: those of one sample side by side, or those of one channel.
struct ArrayOrder {
  std::uint64_t channels = 1;
  bool sample_by_sample = true;
};
/// Of an array with so many samples, whichever of its dimensions they are; nothing: it has another number of them.
std::optional<ArrayOrder> order_of(const ArrayInfo& array, std::uint64_t samples);

/// "t", "Time", "t_ms", "timestamp [us]".
bool is_time_name(std::string name);

/// The logs of a file, by content. A group is what stands around a vector of stamps (t, time, timestamp, tout, or what
/// `time_name` says); a demonstration of robomimic (demo_0, demo_1, ..) is one even without, if the file has their
/// rate. Columns are called as in a CSV: "q1".."q6" of q with 6 channels, "tau" of a vector, "obs.q1" in a group
/// within. Where a file names the channels of an array, a second column has that name: "obs.q.elbow". Of Simulink's
/// structure with time they have the signal's label, or the variable's name.
std::vector<ArrayGroup> groups_of(const ArrayList& list, const std::string& time_name);

}  // namespace fxdyn
