#pragma once

#include <cstddef>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "host_tools/logs/log.hpp"

namespace fxdyn {

/// A joint in the closed loop that plays a recorded motion, on the model before and after as the plant
/// (play_forward()).
struct PlayedJoint {
  std::string joint, position_unit, torque_unit;
  /// RMS of simulated minus recorded position [rad | m]; none: that plant failed.
  std::optional<double> tracking_before{}, tracking_after{};
  /// RMS of what the controller added to the recorded torque [N*m | N]; likewise.
  std::optional<double> torque_before{}, torque_after{};
};

/// A recorded motion in closed loop, a row a joint.
struct PlayedForward {
  std::string log;
  double from_s = 0, seconds = 0;
  std::vector<PlayedJoint> joints{};
  std::string failed_before{}, failed_after{};  ///< why the model is no plant; empty: it is one
};

/// What a diagnosis is worth on logs that fitted nothing of it: the key "evidence" of diagnosis.json
/// (held_out_evidence()).
struct HeldOutEvidence {
  struct Log {
    std::string file;
    Role role = Role::test;
    double from_s = 0, to_s = 0;  ///< the window
  };
  /// RMS of measured minus model torque [N*m | N]; none: it can't be told.
  struct Joint {
    std::string joint, unit;
    std::optional<double> before{}, after{};
    std::optional<double> after_fixed{};  ///< with the torque that the fixed-point firmware would compute
    std::optional<double> noise_floor{};  ///< of white noise, as in metrics.json
  };
  struct FixedPoint {
    bool computed = false;
    std::string why_not{};             ///< empty where it is computed
    std::vector<std::string> notes{};  ///< samples that the firmware clamps
  };
  std::vector<Log> held_out{};
  std::vector<Joint> joints{};
  FixedPoint fixed_point{};
  std::optional<PlayedForward> forward{};  ///< none: no log was held out
  std::string note{};                      ///< empty: none
};
nlohmann::json to_json(const HeldOutEvidence& evidence);
HeldOutEvidence evidence_of(const nlohmann::json& file);

}  // namespace fxdyn
