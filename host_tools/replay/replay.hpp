#pragma once

#include <cstdint>
#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "host_tools/hil/can_replay.hpp"
#include "host_tools/pipeline/pipeline.hpp"
#include "host_tools/report/vibration_result.hpp"

namespace fxdyn {

struct Replay {
  bool same = false;           ///< every torque and saturation count
  std::filesystem::path file;  ///< replay.json: in DIR, or in DIR/joint_N for the drive of one joint
};
/// `fxdyn replay`: streams the test logs (and a perturbed copy) to the firmware image under QEMU.
Replay replay(Pipeline& pipeline, const std::filesystem::path& image, Eigen::Index max_ticks);

struct CanReplaySettings {
  std::string interface;            ///< as in "can0"
  std::vector<std::uint8_t> nodes;  ///< ids; empty: whoever answers of 1 .. number of joints
  bool fd = false;
  bool closed_loop = false;  ///< no log: the vibration experiment with the torque of the bus
  Eigen::Index most_ticks = 20000;
  std::size_t most_moves = 0;  ///< of the closed loop; 0: all
};
/// Content of can_replay.json.
struct CanReplay {
  struct Joint {
    std::string name, unit;
    std::optional<double> error_to_measured, of_rated;  ///< RMS [N*m | N, -]; none: a torque did not come
    double measured_rms = 0;
  };
  struct PlayedLog {
    std::string name;
    Eigen::Index ticks = 0, equal_ticks = 0;
    std::vector<Joint> joints;
  };
  std::string interface;
  bool fd = false;
  std::optional<VibrationResult> closed_loop;
  std::vector<PlayedLog> logs;  ///< without a closed loop
  DriveReport drives;
};
nlohmann::json to_json(const CanReplay& result);
/// `fxdyn replay --can`: streams the test and validate logs under SYNC to the drive nodes of a bus, in lockstep,
/// compares every torque frame with the host's fixed-point model and the torque with the measured one:
/// DIR/can_replay.json.
/// @throws InputError: no such interface, it is down, no node answers, other tables
CanReplay replay_on_can(Pipeline& pipeline, const CanReplaySettings& settings);
std::string can_replay_table(const CanReplay& result);

}  // namespace fxdyn
