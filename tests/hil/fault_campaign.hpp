#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "firmware/object_dictionary.hpp"
#include "host_tools/can/lockstep.hpp"
#include "tests/golden/tables.hpp"
#include "tests/hil/motion.hpp"

// Faults on a node's bus, thousands of each kind, while motion is streamed to it. The injector works out what the node
// has to count and which ticks are fresh; it runs the model beside the node. After every fault the node's counters are
// compared with that; in every tick the torques are, whose steps are bounded through resets, power cycles and bus-off
// as well. Nothing here knows whether the node is in memory or behind a real bus.

namespace fxdyn::hil {

enum class Fault : std::uint8_t {
  drop,        ///< a setpoint or the SYNC does not come
  duplicate,   ///< one comes twice
  reorder,     ///< SYNC overtakes a setpoint
  delay,       ///< a setpoint comes one to three ticks late
  late_lost,   ///< a setpoint comes one tick late, and the next one of its joint does not come
  truncate,    ///< a setpoint loses bytes, or a SYNC or NMT frame has a wrong length
  flip,        ///< a bit of a setpoint
  foreign,     ///< an identifier that nobody here has
  flood,       ///< 64 to 256 of them at once
  sdo_random,  ///< eight random bytes, or a request of the wrong length
  sdo_fuzzed,  ///< transfers of objects that exist, with wrong sizes, toggles, orders, values
  sync_lost,   ///< SYNC stays away at a period at which the node's own timer takes over
  bus_off,
  reset,         ///< by NMT, in mid-stream
  wrong_tables,  ///< it starts with tables that are corrupt
  second_node,   ///< another node's frames under its identifiers
};
inline constexpr std::size_t fault_kinds = 16;
const char* name_of(Fault fault);

/// What a campaign needs of the node besides its bus.
class NodeUnderTest {
 public:
  virtual ~NodeUnderTest() = default;
  virtual can::Bus& bus() = 0;
  virtual void fall_off_the_bus() = 0;
  /// Power off and on again, with good tables or with corrupt ones.
  virtual void restart(bool good_tables) = 0;
};

class FaultCampaign {
 public:
  /// `period`: of the ticks; zero: as fast as the answers come.
  FaultCampaign(NodeUnderTest& node, unsigned seed, can::Duration period);

  /// `events` faults. The rare kinds are as frequent as the others: events / fault_kinds each; `slow_share` thins those
  /// out that restart the node.
  void run(std::uint64_t events, double slow_share = 1);
  /// A table of what was injected and counted; true: the two agreed, every torque came and was what it had to be, and
  /// no step of it was too large.
  bool report() const;

 private:
  using Model = tables::Model;
  using Counter = dictionary::Counter;
  using Counts = std::array<std::uint32_t, dictionary::counters>;
  static constexpr std::size_t joints = Model::joints;
  static constexpr std::uint8_t id = 1;
  struct Tally {
    std::uint64_t injected = 0, counted = 0;  ///< events; those that the node counted as the injector expected
    std::uint64_t invisible = 0;  ///< nothing to count: what arrived is no less plausible than what was sent
    std::vector<double> recovery_ms;
    std::uint64_t longest_ticks = 0;
  };

  void configure();
  void start();
  void left_operation();
  void inject(Fault fault);
  void drop();
  void duplicate();
  void reorder();
  void delay();
  void late_lost();
  void truncate();
  void flip();
  void send_foreign(std::size_t count);
  void sdo_random();
  void sdo_fuzzed();
  void sync_lost();
  void bus_off();
  void reset();
  void wrong_tables();
  void second_node();

  // Frames of a tick.
  void send(const can::Frame& frame);
  void send_setpoint(std::size_t j, const WireSetpoint& setpoint);
  void send_all();
  void end_tick(bool sync);
  bool accept();
  void compute();
  void stale_tick();
  void check_torques(bool fresh);
  void good_tick();
  std::uint32_t implausible_setpoints() const;
  void take(const can::Frame& frame);
  void recover(Fault fault, can::Duration since, std::uint64_t ticks_before);
  bool sdo(const std::array<std::uint8_t, 8>& request, std::array<std::uint8_t, 8>& answer);
  Counts read_counters();
  void expect(Counter counter, std::uint32_t times = 1) { expected_[static_cast<std::size_t>(counter)] += times; }
  std::uint32_t any(std::uint32_t below) { return static_cast<std::uint32_t>(random_() % below); }
  std::size_t any_joint() { return random_() % joints; }
  std::uint8_t any_byte() { return static_cast<std::uint8_t>(random_()); }

  NodeUnderTest& node_;
  can::Master master_;
  std::mt19937 random_;
  can::Duration period_, next_tick_{};
  can::Duration own_period_;  ///< at which the node's own timer is to act
  Motion<Model> motion_;
  std::array<Tally, fault_kinds> tallies_{};
  Counts expected_{}, counted_{};
  std::uint64_t disagreements_ = 0, ticks_ = 0, large_steps_ = 0, torques_seen_ = 0, missing_torques_ = 0,
                wrong_torques_ = 0;

  // The injector's picture of the node.
  std::vector<WireSetpoint> setpoints_;  ///< of this tick
  std::uint32_t waiting_ = 0;            ///< joints whose setpoint has come since the last SYNC
  std::vector<WireSetpoint> arrived_, last_;
  bool has_last_ = false;
  std::uint32_t stale_ = 0;
  Model::State state_{};
  Model::Torques model_torques_{};

  // What came from it.
  std::array<std::optional<WireTorque>, joints> torques_{};
  std::array<std::int32_t, joints> step_milli_{}, last_milli_{};
  std::array<std::uint8_t, joints> last_tick_{};
  std::array<can::Duration, joints> last_time_{};
  std::array<bool, joints> ramped_unseen_{};  ///< it has been out of operation since: the torque moved without frames
  std::uint32_t tick_frames_ = 0;
  std::optional<can::Frame> sdo_answer_;
  double largest_step_share_ = 0;
};

}  // namespace fxdyn::hil
