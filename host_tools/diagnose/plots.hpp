#pragma once

#include <filesystem>
#include <vector>

#include "host_tools/effects/forward.hpp"
#include "host_tools/regression/dataset.hpp"
#include "host_tools/report/diagnosis_result.hpp"

namespace fxdyn {

/// DIR/plots/diagnosis_joint_<index>.svg: what the model lacked, before and after, for each joint on which something
/// was found or is unexplained (those of robot effects too). Residual (measured minus model, both filtered at the
/// torque cut-off) over time, against velocity and position, and its spectrum beside the noise floor. Velocity and
/// position show all logs; time and spectrum the log in which the model gained most. Plots of an earlier diagnosis are
/// removed.
/// @return the files, in the order of the joints
/// @throws InputError where gnuplot is missing or fails
std::vector<std::filesystem::path> write_diagnosis_plots(const IdentifiedModel& nominal,
                                                         const IdentifiedModel& diagnosed,
                                                         const std::vector<ProcessedLog>& held_out,
                                                         const DiagnosisResult& diagnosis,
                                                         const std::filesystem::path& directory);

}  // namespace fxdyn
