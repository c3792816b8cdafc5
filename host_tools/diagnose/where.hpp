#pragma once

#include <optional>
#include <vector>

#include "host_tools/diagnose/options.hpp"
#include "host_tools/regression/dataset.hpp"
#include "host_tools/report/diagnosis_result.hpp"
#include "host_tools/robot/robot.hpp"

namespace fxdyn::diagnosis {

/// Where a gap sits: the intervals of the joint's velocity, speed, position, acceleration, load and direction, and of
/// other joints' positions, that hold more of its power than of the samples. Listed are those that are clearer than
/// every interval of every signal that the same error has when it is shifted in time against the motion
/// (ReportOptions::region_chance). Else the place of a free curve, which other data confirmed. Else an interval of
/// time, if an error of the same spectrum that is the same everywhere never has one that is as clear. Else an octave of
/// frequency, with a larger share of the gap than of the load: a gap as slow as the motion itself is nowhere. The
/// clearest first.
/// @param index the joint @param load the rigid body's torque on it over each log, full rate [N*m | N]
/// @param error its filtered residual likewise @param noise its noise floor
/// @param of_curve place_of() the joint's free curve
GapPlace where(const Robot& robot, std::size_t index, const std::vector<const ProcessedLog*>& logs,
               const std::vector<Eigen::VectorXd>& load, const std::vector<Eigen::VectorXd>& error, double noise,
               const ReportOptions& options, const std::optional<GapRegion>& of_curve = {});

}  // namespace fxdyn::diagnosis
