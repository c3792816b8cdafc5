#pragma once

#include "host_tools/check/arrangement_search.hpp"
#include "host_tools/check/check.hpp"
#include "host_tools/check/torque_column.hpp"
#include "host_tools/project/project.hpp"

namespace fxdyn {

/// A mistake of columns or URDF for people: what, how much the torque error falls, and the line to write.
CheckFinding in_words(const ArrangementFinding& finding, const Project& project, const ArrangementOptions& options);
/// A warning: motion and torque were recorded at different times.
CheckFinding in_words(const TorqueLead& lead);

}  // namespace fxdyn
