#pragma once

#include <string>
#include <vector>

#include "host_tools/diagnose/session_log.hpp"
#include "host_tools/report/diagnosis_result.hpp"
#include "host_tools/robot/robot.hpp"

namespace fxdyn::diagnosis {

/// Where the curve is off its median; without shares of gap and time.
GapRegion place_of(const CurveResult& curve);

/// Sets where a drawn curve is off its median, and says so: "friction rises by 0.8 N*m between 0.85 and 1.05 rad".
/// @param joint the one whose curve it is
void tell(CurveResult& curve, const Robot& robot, std::size_t joint, const std::vector<SessionLog>& logs);

}  // namespace fxdyn::diagnosis
