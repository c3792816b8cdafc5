#pragma once

#include <string>
#include <vector>

#include "host_tools/regression/dataset.hpp"
#include "host_tools/report/diagnosis_result.hpp"
#include "host_tools/robot/robot.hpp"

namespace fxdyn::diagnosis {

/// A region in a robot engineer's words: "at reversals, below 0.05 rad/s", "between 0.85 and 1.05 rad", "in the first 4
/// s", "while joint 3 is between 1.2 and 1.5 rad". @param joint the one whose gap it is @param logs whose times are
/// told
std::string words_of(const GapRegion& region, const Robot& robot, std::size_t joint,
                     const std::vector<const ProcessedLog*>& logs);

/// The clearest region and its shares: "83 % of the gap is between 0.85 and 1.05 rad, in 12 % of the time". Where there
/// is none: nothing.
std::string sentence_of(const std::vector<GapRegion>& regions, const Robot& robot, std::size_t joint,
                        const std::vector<const ProcessedLog*>& logs);

}  // namespace fxdyn::diagnosis
