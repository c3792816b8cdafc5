#pragma once

#include "host_tools/check/arrangement_search.hpp"
#include "host_tools/check/check.hpp"
#include "host_tools/check/torque_column.hpp"
#include "host_tools/project/project.hpp"

namespace fxdyn {

/// A mistake of columns or URDF for people: what, how much the torque error falls, and the lines to write.
/// @param all the arrangement with all mistakes undone @param signals that the logs have: "t", "q", ..
CheckFinding in_words(const ArrangementFinding& finding, const Arrangement& all, const Project& project,
                      const std::vector<std::string>& signals, const ArrangementOptions& options);
/// A warning: motion and torque were recorded at different times.
CheckFinding in_words(const TorqueLead& lead);

}  // namespace fxdyn
