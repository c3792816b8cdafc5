#pragma once

#include <Eigen/Dense>
#include <cstdint>
#include <map>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "firmware/protocol/torque_output.hpp"
#include "host_tools/can/lockstep.hpp"
#include "host_tools/effects/forward.hpp"
#include "host_tools/export/export.hpp"

namespace fxdyn {

/// What the drives of a bus did, as can_replay.json has it.
struct DriveReport {
  struct Node {
    std::uint8_t id = 0;
    std::string board, version;
    std::uint32_t tables_crc = 0;
    std::vector<std::size_t> joints;  ///< from 0
    std::uint32_t most_cost_of_a_tick = 0;
    std::map<std::string, std::uint32_t> counters;
  };
  std::uint64_t ticks = 0, equal_ticks = 0;
  std::uint64_t disabled_ticks = 0;  ///< a node's enable input was low
  std::uint64_t frames_lost = 0;
  double p50_ms = 0, p99_ms = 0, max_ms = 0;  ///< round trip
  double ticks_per_second = 0;
  std::vector<Node> nodes;

  /// Every torque frame is the host's, and none was lost.
  bool bit_exact() const { return equal_ticks == ticks && frames_lost == 0; }
};
nlohmann::json to_json(const DriveReport& report);

/// Drive nodes on a CAN bus that together put out the torques of a model, in lockstep with the host: all setpoints of a
/// tick, SYNC, then it waits for all torques. The host computes what every torque frame has to say, byte for byte,
/// with the node's own functions (firmware/protocol/setpoint_codec.hpp, firmware/protocol/torque_output.hpp).
class CanDrives {
 public:
  struct Settings {
    std::vector<std::uint8_t> nodes;  ///< node ids; empty: whoever answers of 1 .. number of joints
    bool fd = false;
    std::uint8_t master = 0;  ///< id whose heartbeat the nodes watch (can::Guard); 0: none
  };

  /// Finds the nodes, reads who they are, and configures them over SDO.
  /// @throws InputError: nobody answers, other tables (CRC, layout), a joint that no node or two put out
  CanDrives(can::Bus& bus, const IdentifiedModel& model, const Settings& settings);

  /// Stops the nodes that run, whatever the reason to leave.
  ~CanDrives();
  CanDrives(const CanDrives&) = delete;
  CanDrives& operator=(const CanDrives&) = delete;

  /// Resets and starts the nodes, no others on the bus: the robot at rest, torque zero.
  void restart();
  /// Takes them to pre-operational, where the torque goes to zero by its ramp.
  void stop();
  std::vector<std::uint8_t> nodes() const;

  struct Tick {
    std::vector<double> torque;  ///< of every joint, what its node said [N*m | N]; NaN: nothing came
    bool equal = false;          ///< every frame is what the host expects
  };
  /// One tick of the setpoints q, dq, ddq of all joints.
  Tick tick(const Eigen::VectorXd& q, const Eigen::VectorXd& dq, const Eigen::VectorXd& ddq);

  /// Of all ticks so far; asks the nodes for their counters.
  DriveReport report();

 private:
  struct Node {
    std::uint8_t id = 0;
    std::uint32_t outputs = 0, crc = 0;
    std::string board{}, version{};
  };
  struct Joint {
    std::int32_t velocity = 1, acceleration = 1;  ///< raw, of a share of 32768
    std::int32_t lowest = 0, highest = 0;         ///< raw torque limits
    TorqueScale per_mille;
    TorqueSteps steps;
    TorqueOutput output;
    std::uint8_t first_count = 0;
  };

  void identify(Node& node);
  void use_fd(const Node& node);
  void wait_for_zero_torque(const Node& node);
  void check(const Node& node);
  [[noreturn]] void no_answer(const std::string& who);

  can::Master master_;
  const IdentifiedModel& model_;
  FixedModel fixed_;
  bool fd_;
  std::uint8_t heartbeat_of_;
  bool runs_ = false;
  std::vector<Node> nodes_;
  std::vector<Joint> joints_;
  std::unique_ptr<can::Lockstep> lockstep_;
  std::uint64_t since_restart_ = 0, ticks_ = 0, equal_ticks_ = 0, disabled_ticks_ = 0, lost_ = 0;
  can::RoundTrips round_trips_;
  double busy_s_ = 0;
};

}  // namespace fxdyn
