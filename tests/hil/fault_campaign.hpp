#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include FXDYN_TABLES_HEADER

#include "firmware/protocol/object_dictionary.hpp"
#include "host_tools/can/lockstep.hpp"
#include "tests/hil/node_picture.hpp"
#include "tests/hil/undisturbed.hpp"

// Faults on a node's bus, thousands of each kind, while motion is streamed to it. The injector works out what the node
// has to count and which ticks are fresh; it runs the model beside the node. After every fault the node's counters are
// compared with that; in every tick the torques are, whose steps are bounded through resets, power cycles and bus-off
// as well: by the ramp's, and where no ramp is under way by those of a node that misses nothing. Nothing here knows
// whether the node is in memory, behind a real bus or in an emulator, nor which golden model it has
// (FXDYN_TABLES_HEADER).

namespace fxdyn::hil {

enum class Fault : std::uint8_t {
  drop,        ///< a setpoint or the SYNC does not come; or no setpoint at all for a while
  burst,       ///< every other setpoint gets lost, for some ticks
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
  sync_late,   ///< by up to a period
  sync_twice,  ///< two at once
  sync_lost,   ///< SYNC stays away, and the node's own timer takes over
  heartbeat,   ///< the master's is lost, or says that it was reset or stopped
  bus_off,
  reset,         ///< by NMT, in mid-stream
  second_node,   ///< another node's frames under its identifiers
  sync_rate,     ///< SYNC at another rate than the tables' tick for a while
  wrong_tables,  ///< it starts with tables that are corrupt
};
inline constexpr std::size_t fault_kinds = 21;
const char* name_of(Fault fault);

/// What a campaign needs of the node besides its bus, whose clock is the node's: it may be one of an emulator.
class NodeUnderTest {
 public:
  virtual ~NodeUnderTest() = default;
  virtual can::Bus& bus() = 0;
  /// Bus-off; it is on the bus again within half a period, or when this returns. How many of its frames that cost.
  virtual std::uint32_t fall_off_the_bus() = 0;
  /// False: its controller has acceptance filters.
  virtual bool sees_foreign_frames() const { return true; }
  /// Power off and on again, with good tables or with corrupt ones.
  virtual void restart(bool good_tables) = 0;
};

/// When a master sends the setpoints of a SYNC.
enum class Order : std::uint8_t {
  before,  ///< just before it
  after,   ///< just after the SYNC before it, as most masters send their PDOs
};

struct CampaignOptions {
  unsigned seed = 1;
  /// Of SYNC, which the node then watches: for a bus whose time is exact. Zero: as fast as the answers come, 0x1006 =
  /// 0.
  can::Duration period{};
  Order order = Order::before;  ///< without a period there is no difference
  double slow_share = 1;        ///< of the faults that restart the node, beside the others'
};

class FaultCampaign {
 public:
  FaultCampaign(NodeUnderTest& node, const CampaignOptions& options);

  /// `events` faults, events / fault_kinds of each kind but for the slow ones, which are fewer.
  void run(std::uint64_t events);
  /// A table of what was injected and counted; true: the two agreed, every torque came and was what it had to be, and
  /// no step of it was too large.
  bool report() const;

 private:
  using Model = tables::Model;
  using Counter = dictionary::Counter;
  using Counts = std::array<std::uint32_t, dictionary::counters>;
  static constexpr std::size_t joints = Model::joints;
  static constexpr std::uint8_t id = 1;
  /// Of recently_stale_: as long as any effect remembers ticks (Delay::capacity).
  static constexpr std::uint32_t remembered_ticks = (1U << Delay::capacity) - 1;
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
  void do_fault(Fault fault);
  void drop();
  void burst();
  void duplicate();
  void reorder();
  void delay();
  void late_lost();
  void truncate();
  void flip();
  void send_foreign(std::size_t count);
  void sdo_random();
  void sdo_fuzzed();
  void sync_late();
  void sync_twice();
  void sync_lost();
  void sync_lost_in_time();
  void sync_lost_in_lockstep();
  void check_own_ticks(std::int64_t least, std::int64_t most);
  void sync_rate();
  void heartbeat();
  void bus_off();
  void reset();
  void wrong_tables();
  void second_node();

  // Frames of a tick.
  bool is_timed() const { return options_.period.count() > 0; }
  void wait_until(can::Duration time);
  void drain();
  void send(const can::Frame& frame);
  void next_setpoints();
  void next_tick_of_lockstep();
  void begin_setpoints();
  void send_setpoint(std::size_t j, const WireSetpoint& setpoint);
  void send_all();
  void send_all_but(std::size_t which);
  void end_tick(bool sync, can::Duration late = {});
  void sync();
  void whole_tick();
  void good_tick();
  void check_torques(bool fresh);
  void take(const can::Frame& frame);
  void take_torque(std::size_t j, const WireTorque& torque);
  std::int64_t even_step(std::size_t j) const;
  void note_tick(bool fresh);
  bool is_told(std::uint16_t code) const;
  void fail(const char* what);
  void recover(Fault fault, can::Duration since, std::uint64_t ticks_before);
  bool sdo(const std::array<std::uint8_t, 8>& request, std::array<std::uint8_t, 8>& answer);
  Counts read_counters();
  void expect(Counter counter, std::uint32_t times = 1) { picture_.expect(counter, times); }
  std::uint32_t any(std::uint32_t below) { return static_cast<std::uint32_t>(random_() % below); }
  std::size_t any_joint() { return random_() % joints; }
  std::uint8_t any_byte() { return static_cast<std::uint8_t>(random_()); }

  NodeUnderTest& node_;
  CampaignOptions options_;
  can::Master master_;
  std::mt19937 random_;
  Undisturbed<Model> motion_;
  NodePicture<Model> picture_;
  can::Duration spacing_, last_sync_{}, next_sync_{};
  std::array<Tally, fault_kinds> tallies_{};
  std::uint64_t disagreements_ = 0, ticks_ = 0, large_steps_ = 0, uneven_steps_ = 0, torques_seen_ = 0,
                missing_torques_ = 0, wrong_torques_ = 0;
  Fault fault_{};
  std::vector<WireSetpoint> setpoints_;  ///< of this tick
  bool motion_has_had_sync_ = true;      ///< since they were its next
  std::uint32_t recently_stale_ = 0;     ///< bit i: the tick i ticks ago was stale

  // What came from it.
  bool answering_ = false;  ///< a SYNC has been sent whose torques have not all come
  std::array<std::optional<WireTorque>, joints> torques_{};
  std::array<std::int32_t, joints> step_milli_{}, last_milli_{};
  std::array<std::uint8_t, joints> last_tick_{};
  std::array<std::uint32_t, joints> since_ramp_{};  ///< torques
  std::array<can::Duration, joints> last_time_{};   ///< not after the node's tick
  can::Duration last_request_{};                    ///< when SYNC was sent
  std::array<bool, joints> ramped_unseen_{};  ///< it has been out of operation since: the torque moved without frames
  /// A torque that may not go out goes to zero between ticks too, where those are slower than the tables' tick.
  bool ramps_by_time_ = false;
  std::uint32_t tick_frames_ = 0, own_ticks_ = 0, own_frames_ = 0;
  std::optional<can::Frame> sdo_answer_;
  double largest_step_share_ = 0, largest_uneven_share_ = 0;
};

}  // namespace fxdyn::hil
