#pragma once

namespace fxdyn {

/// When the robot ran, by the logs' own time stamps: what drifts has done so since the start.
struct Session {
  double start_s = 0, end_s = 0;
};

}  // namespace fxdyn
