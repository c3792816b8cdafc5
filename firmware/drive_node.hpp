#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "firmware/emergency.hpp"
#include "firmware/protocol/canopen.hpp"
#include "firmware/protocol/object_dictionary.hpp"
#include "firmware/protocol/setpoint_codec.hpp"
#include "firmware/protocol/torque_output.hpp"
#include "firmware/sdo_server.hpp"
#include "firmware/slow_division.hpp"
#include "hal/can.hpp"
#include "hal/clock.hpp"
#include "hal/gpio.hpp"
#include "model/fixed.hpp"
#include "model/numbers.hpp"
#include "model/table_page.hpp"
#include "model/version.hpp"
#include "model/wrapping.hpp"

// The drive node (docs/guide/node-behaviour.md). How a main_<board>.cpp wires it:
//
//   #include FXDYN_TABLES_HEADER
//   constexpr fxdyn::RatedTorques<Model> rated{fxdyn::tables::rated_torque};   // Model = fxdyn::tables::Model
//
//   Bus bus; Clock clock; ...                                                  // opened and started by the board
//   fxdyn::DriveHardware hardware{bus, clock, counter, watchdog, enable, fault, tick_busy};
//   static fxdyn::DriveNode<Model, decltype(hardware)> node(
//       hardware, {page.parameters, page.header, fxdyn::page_is_valid(page), fxdyn::UpdateSlot::empty, rated},
//       {.board = "mps2-an386"});
//   for (;;) {
//     if (!node.poll()) sleep;     // until a frame has come or node.longest_sleep_us have passed, whichever is first
//   }
//
// Parts that a board lacks are in hal/absent.hpp. The watchdog's time must be longer than 1.5 periods of SYNC
// (supervised_period_us at most) and than start-up. Hardware, parameters and `rated` outlive the node.

namespace fxdyn {

template <hal::CanBus Bus, hal::Clock Clock, hal::CycleCounter Counter, hal::Watchdog Watchdog, hal::InputPin Enable,
          hal::OutputPin Fault, hal::OutputPin TickBusy>
struct DriveHardware {
  using BusType = Bus;
  Bus& bus;
  Clock& clock;
  Counter& counter;
  Watchdog& watchdog;
  Enable& enable;       ///< asserted: torque may go out
  Fault& fault;         ///< asserted while an error is present
  TickBusy& tick_busy;  ///< asserted while a tick is computed
};

/// What a node computes with.
template <class Model>
struct NodeTables {
  const typename Model::Parameters& parameters;
  PageHeader header;
  bool valid = false;                     ///< page_is_valid()
  UpdateSlot update = UpdateSlot::empty;  ///< what the slot for updates holds; `used`: these tables
  const RatedTorques<Model>& rated;
};

/// What of a board can fail at start-up: bits of NodeSettings::hardware_failed.
namespace hardware_part {
inline constexpr std::uint8_t can = 1 << 0, wake_up_timer = 1 << 1, watchdog = 1 << 2,
                              crystal = 1 << 3;  ///< the board runs from its internal oscillator
}

/// What only the board knows.
struct NodeSettings {
  std::uint8_t id = 0;  ///< 1 .. 127; 0: number of the first joint that the node puts out
  std::uint32_t serial_number = 0;
  std::string_view board = "";       ///< hardware version 0x1009, up to 32 characters
  bool watchdog_reset = false;       ///< why the processor started
  std::uint8_t hardware_failed = 0;  ///< parts that did not start: an error that lasts, the fault output with it
  bool fd_allowed = true;            ///< false: the clock is not exact enough for CAN FD
};

/// CANopen node that puts out the feedforward torque of setpoints that come over the bus. It knows neither the board
/// nor the model; what it does is a function of frames, pins and time.
template <class Model, class Hardware>
class DriveNode {
 public:
  using NmtState = canopen::NmtState;
  using Counter = dictionary::Counter;
  static constexpr std::size_t joints = Model::joints, outputs = Model::outputs;
  static constexpr std::uint32_t longest_sleep_us = 500;
  /// Up to this period of SYNC the watchdog is fed by ticks alone; slower ones are no real time.
  static constexpr std::uint32_t supervised_period_us = 20'000;

  DriveNode(Hardware& hardware, const NodeTables<Model>& tables, const NodeSettings& settings)
      : hardware_(hardware), tables_(tables), settings_(settings) {
    for (std::size_t j = 0, o = 0; j < joints; ++j) {
      if ((Model::outputs_mask >> j & 1U) != 0) output_joints_[o++] = static_cast<std::uint8_t>(j);
    }
    if (settings_.id == 0) settings_.id = static_cast<std::uint8_t>(output_joints_[0] + 1);
    hardware_.counter.start();
    empty_measurement_ = hardware_.counter.stop();
    const std::uint32_t now = hardware_.clock.now_us();
    // ticks per second have count_bits fractional bits; the tables of a node that is not valid may say anything
    const auto ticks_per_second = static_cast<std::uint32_t>(tables_.parameters.ticks_per_second.raw);
    tick_us_ = static_cast<std::uint32_t>(
        slow_quotient(std::uint64_t{1'000'000} << count_bits, std::max<std::uint32_t>(ticks_per_second, 1)));
    for (std::size_t j = 0; j < joints; ++j) {
      // 2 * velocity limit * tick, in the position's format
      const auto distance = static_cast<std::uint64_t>(scale_limit(limits(j).dq_lower.raw, limits(j).dq_upper.raw))
                            << (position_bits + 17 >= velocity_bits ? position_bits + 17 - velocity_bits : 0);
      jump_per_tick_[j] = static_cast<std::uint32_t>(std::min<std::uint64_t>(
          slow_quotient(distance, std::max<std::uint32_t>(ticks_per_second, 1)) + 1, 0x7FFF'FFFF));
    }
    seen_lost_ = hardware_.bus.errors().lost;
    reset(now);
    if (settings_.hardware_failed != 0) errors_.raise(Error::hardware, settings_.hardware_failed, now);
    if (!tables_.valid) errors_.raise(Error::tables, 0, now);
    if (is_refused(tables_.update))
      errors_.raise(Error::update_refused, static_cast<std::uint16_t>(tables_.update), now);
    if (settings_.watchdog_reset) {
      count(Counter::watchdog_resets);
      errors_.raise(Error::watchdog_reset, 0, now);
    }
  }
  DriveNode(const DriveNode&) = delete;
  DriveNode& operator=(const DriveNode&) = delete;

  /// Handles what has come and what is due. True: there is more to do, call again at once; false: sleep until a frame
  /// comes or longest_sleep_us have passed.
  bool poll() {
    bool more = true;
    std::size_t handled = 0;
    for (; more && handled < most_frames; ++handled) {
      hardware_.counter.start();
      more = hardware_.bus.receive(received_) == hal::Status::ok;
      if (more) handle();
      const std::uint32_t cost = measured();
      if (more) since_tick_ = wrapping_add(since_tick_, cost);
    }
    hardware_.counter.start();
    serve(hardware_.clock.now_us());
    flush();
    const std::uint32_t cost = measured();
    if (handled > 1 || more) since_tick_ = wrapping_add(since_tick_, cost);  // polls for nothing are no work
    if (!is_supervised()) hardware_.watchdog.feed();
    return more || pending_ != 0;
  }

  /// How long nothing is due if no frame comes, longest_sleep_us or more: for systems where waking up is expensive.
  std::uint32_t idle_us() const {
    constexpr std::uint32_t resolution_us = 5000;  // of heartbeats, inhibit times, time-outs, and of seeing enable fall
    const bool torque_moves = consumer_lost_ != 0 || !is_due_to_tick() || !was_enabled_;
    if (off_bus_ || pending_ != 0 ||
        (torque_moves &&
         std::any_of(torques_.begin(), torques_.end(), [](const auto& torque) { return torque.value() != 0; })))
      return longest_sleep_us;
    if (!is_due_to_tick()) return resolution_us;
    const std::uint32_t since = wrapping_subtract(hardware_.clock.now_us(), sync_us_);
    return std::clamp(overdue_after_us_ - std::min(since, overdue_after_us_), longest_sleep_us, resolution_us);
  }

  NmtState state() const { return state_; }
  std::uint8_t id() const { return settings_.id; }
  std::uint32_t counted(Counter counter) const { return counters_[static_cast<std::size_t>(counter)]; }
  const ErrorLog& errors() const { return errors_; }
  /// The torque of output `o` as it goes out, raw: for a current loop on the same processor.
  std::int32_t torque(std::size_t o) const { return torques_[o].value(); }

  // What the SDO server asks for.
  using Object = dictionary::Object;
  canopen::Abort find(std::uint16_t index, std::uint8_t sub_index, Object& object) const {
    return dictionary::find(extent, index, sub_index, object);
  }
  /// The history 0x1003 has as many fields as errors were told.
  bool has_data(const Object& object) const {
    return object.entry == nullptr || object.entry->variable != dictionary::Variable::error_field ||
           object.item < errors_.history_count();
  }
  std::size_t read(const Object& object, std::uint8_t* to) const {
    if (object.type() == dictionary::Type::visible_string) {
      const std::string_view text = text_of(object.entry->variable);
      const std::size_t size = std::min(text.size(), dictionary::longest_string);
      std::copy_n(text.begin(), size, to);
      return size;
    }
    canopen::store<4>(to, object.entry == nullptr ? object.highest_sub_index : number_of(object));
    return object.size();
  }
  canopen::Abort write(const Object& object, std::span<const std::uint8_t> from) {
    if (object.type() == dictionary::Type::visible_string) {
      label_size_ = from.size();
      std::copy_n(from.begin(), label_size_, label_.begin());
      return canopen::Abort::none;
    }
    std::array<std::uint8_t, 4> bytes{};
    std::copy(from.begin(), from.end(), bytes.begin());
    const std::uint32_t value = canopen::load<4>(bytes.data());
    // every signed object that can be written has 32 bits
    const std::int64_t number =
        is_signed(object.type()) ? std::int64_t{static_cast<std::int32_t>(value)} : std::int64_t{value};
    const dictionary::Entry& entry = *object.entry;
    if (number < entry.lowest) return canopen::Abort::too_low;
    if (number > entry.highest)
      return entry.lowest == entry.highest ? canopen::Abort::invalid_value : canopen::Abort::too_high;
    return set(object, value);
  }

 private:
  using Numbers = typename Model::Numbers;
  using Bus = typename Hardware::BusType;
  using Frame = typename Bus::Frame;
  static constexpr int position_bits = Position<Numbers>::bits, velocity_bits = Velocity<Numbers>::bits,
                       acceleration_bits = Acceleration<Numbers>::bits, torque_bits = Torque<Numbers>::bits;
  static_assert(position_bits + 17 >= velocity_bits && position_bits + 17 - velocity_bits <= 32);
  static constexpr dictionary::Extent extent{joints, Model::outputs_mask};
  static constexpr bool can_fd = Frame::most_bytes >= 64 && WireSetpoint::bytes * joints <= 64;
  static constexpr std::size_t most_frames = 64;  ///< of one poll, so that a flood does not starve the rest
  static constexpr std::uint32_t all_joints = joints == 32 ? 0xFFFF'FFFF : (1U << joints) - 1;
  static constexpr std::uint32_t boot_up_retry_us = 10'000;  ///< where the bus refused it
  static constexpr std::uint32_t longest_gap = 0x00FF'FFFF;  ///< stale ticks that are counted in a row
  static constexpr std::uint32_t rate_window = 256;          ///< periods

  /// Frames that wait to be sent, one place each, most urgent first. A newer one takes the older one's place.
  static constexpr std::size_t emergency_place = 0, torque_place = 1, sdo_place = torque_place + outputs,
                               heartbeat_place = sdo_place + 1, places = heartbeat_place + 1;
  static_assert(places <= 32);

  /// What SDO can change; goes back to the default on a reset by NMT.
  struct Configuration {
    std::uint32_t sync_id = canopen::sync_id;
    std::uint32_t period_us = 0;
    std::uint32_t heartbeat_ms = dictionary::defaults::heartbeat_ms;
    std::uint32_t emergency_inhibit = dictionary::defaults::emergency_inhibit_100us;
    std::uint32_t error_behaviour = dictionary::defaults::error_behaviour;
    std::uint32_t ramp_ticks = dictionary::defaults::ramp_ticks;
    std::uint32_t tolerated = dictionary::defaults::tolerated_ticks;
    std::uint32_t patience_ms = dictionary::defaults::patience_ms;
    bool fd = false;
    bool parity = false;
    std::array<std::uint32_t, dictionary::consumers> consumers{};
    std::array<std::uint32_t, joints> setpoint_ids{};
    std::array<std::uint32_t, outputs> torque_ids{};
    std::array<std::int32_t, joints> step_limits{};  ///< [mN*m | mN]
  };

  const auto& limits(std::size_t j) const { return tables_.parameters.constants[j].limits; }
  /// The larger end of a range around zero, at least 1.
  static std::int32_t scale_limit(std::int32_t lower, std::int32_t upper) { return whole_share(lower, upper); }
  std::int32_t velocity_limit(std::size_t j) const {
    return scale_limit(limits(j).dq_lower.raw, limits(j).dq_upper.raw);
  }
  std::int32_t acceleration_limit(std::size_t j) const {
    return scale_limit(limits(j).ddq_lower.raw, limits(j).ddq_upper.raw);
  }
  std::int32_t torque_limit(std::size_t j) const {
    return scale_limit(limits(j).tau_lower.raw, limits(j).tau_upper.raw);
  }

  void count(Counter counter, std::uint32_t times = 1) { counters_[static_cast<std::size_t>(counter)] += times; }

  // --- network management ------------------------------------------------------------------------------------------

  /// As after power-on, but for the counters and the torque, which goes to zero by the ramp.
  void reset(std::uint32_t now) {
    configuration_ = {};
    configuration_.period_us = tick_us_;
    for (std::size_t j = 0; j < joints; ++j) {
      configuration_.setpoint_ids[j] = canopen::setpoint_id + static_cast<std::uint32_t>(j) + 1;
      configuration_.step_limits[j] = std::max(to_milli<torque_bits>(torque_limit(j)), std::int32_t{1});
    }
    for (std::size_t o = 0; o < outputs; ++o) {
      configuration_.torque_ids[o] = canopen::cob_no_remote | (canopen::torque_id + output_joints_[o] + 1U);
      steps_[o].following = torque_limit(output_joints_[o]);
    }
    set_ramps();
    label_size_ = 0;
    sdo_.reset();
    consumer_seen_ = 0;
    consumer_lost_ = 0;
    errors_.clear(Error::heartbeat_lost);
    listen();
    leave_operation();
    boot_up_is_out_ = false;
    state_ = NmtState::initialising;  // until the boot-up message has gone
    heartbeat_us_ = wrapping_subtract(now, boot_up_retry_us);
    pending_ = 0;  // nothing of before goes out ahead of the boot-up message
    step_us_ = now;
    release_after_us_ = tick_us_;
  }

  /// Where the bus has acceptance filters: what handle() wants. Its own identifiers are among them, since another node
  /// that sends them has to be noticed.
  void listen() {
    if constexpr (hal::FilteringCanBus<Bus>) {
      std::array<hal::IdRange, 6 + joints + outputs> ranges;
      std::size_t count = 0;
      const auto add = [&](std::uint32_t first, std::uint32_t last) {
        if (count > 0 && ranges[count - 1].last + 1 == first)
          ranges[count - 1].last = last;
        else
          ranges[count++] = {first, last};
      };
      add(canopen::nmt_id, canopen::nmt_id);
      add(configuration_.sync_id, configuration_.sync_id);
      for (const std::uint32_t own : {canopen::emergency_id, canopen::sdo_answer_id, canopen::sdo_request_id})
        add(own + settings_.id, own + settings_.id);
      add(canopen::heartbeat_id + 1, canopen::heartbeat_id + canopen::largest_node_id);
      for (const std::uint32_t cob_id : configuration_.setpoint_ids)
        if ((cob_id & canopen::cob_invalid) == 0)
          add(cob_id & canopen::cob_identifier, cob_id & canopen::cob_identifier);
      for (const std::uint32_t cob_id : configuration_.torque_ids)
        if ((cob_id & canopen::cob_invalid) == 0)
          add(cob_id & canopen::cob_identifier, cob_id & canopen::cob_identifier);
      hardware_.bus.listen({ranges.data(), count});
    }
  }

  void enter(NmtState state) {
    if (state_ == NmtState::initialising) return;  // it is left by the boot-up message alone
    if (state_ == NmtState::operational && state != NmtState::operational) leave_operation();
    if (state == NmtState::operational && state_ != NmtState::operational) {
      if (!tables_.valid) {
        errors_.report(Error::tables, 0);
        state = NmtState::pre_operational;
      } else {
        model_state_ = {};
      }
    }
    state_ = state;
  }

  void leave_operation() {
    synchronised_ = false;
    has_last_ = false;
    drop_setpoints();
    stale_ = own_ticks_ = elapsed_ = 0;
    since_tick_ = 0;
    errors_.clear(Error::setpoints_stale);
    errors_.clear(Error::sync_rate);
  }

  /// What 0x1029 says of errors of the communication.
  void communication_failed() {
    if (state_ != NmtState::operational) return;
    if (configuration_.error_behaviour == 0) enter(NmtState::pre_operational);
    if (configuration_.error_behaviour == 2) enter(NmtState::stopped);
  }

  // --- what comes --------------------------------------------------------------------------------------------------

  void handle() {
    const std::uint32_t id = received_.id;
    if (received_.extended) return count(Counter::foreign_frames);
    if (id == configuration_.sync_id) return handle_sync();
    if (const std::size_t j = joint_of_setpoint(id); j < joints) return handle_setpoint(j);
    if (id == canopen::nmt_id) return handle_nmt();
    if (id == canopen::sdo_request_id + settings_.id) return handle_sdo();
    if (is_own(id)) return handle_collision();
    if (id > canopen::heartbeat_id && id <= canopen::heartbeat_id + canopen::largest_node_id)
      return handle_heartbeat(id - canopen::heartbeat_id);
    count(Counter::foreign_frames);
  }

  /// The joint whose setpoint has this identifier; `joints` where none has.
  std::size_t joint_of_setpoint(std::uint32_t id) const {
    std::size_t j = 0;
    while (j < joints && configuration_.setpoint_ids[j] != id) ++j;
    return j;
  }

  bool is_own(std::uint32_t id) const {
    if (id == canopen::heartbeat_id + settings_.id || id == canopen::emergency_id + settings_.id ||
        id == canopen::sdo_answer_id + settings_.id)
      return true;
    return std::any_of(configuration_.torque_ids.begin(), configuration_.torque_ids.end(),
                       [&](std::uint32_t cob_id) { return (cob_id & ~canopen::cob_no_remote) == id; });
  }

  void handle_sync() {
    if (received_.remote || received_.size != 0) {
      count(Counter::malformed_frames);
      return errors_.raise(Error::sync_length, received_.size, hardware_.clock.now_us());
    }
    if (state_ != NmtState::operational) return;
    const std::uint32_t now = hardware_.clock.now_us(), periods = periods_since_sync(now);
    // one that comes at once after another is no period of its own: twice the same, or the late one and its successor
    const bool at_once =
        is_watched() && synchronised_ && own_ticks_ == 0 && wrapping_subtract(now, sync_us_) < tick_us_ / 4;
    elapsed_ = std::min(elapsed_ + (at_once ? 0 : periods), longest_gap);
    watch_rate(now, periods);
    wait_for_sync(now);
    synchronised_ = true;
    tick(periods);
  }
  /// The next SYNC is overdue after one and a half periods; where it has no period, when the host's time is up.
  void wait_for_sync(std::uint32_t now) {
    sync_us_ = now;
    overdue_after_us_ =
        is_watched() ? configuration_.period_us + configuration_.period_us / 2 : 1000 * configuration_.patience_ms;
  }
  /// Whether SYNC has a period that it must keep.
  bool is_watched() const { return configuration_.period_us != 0; }

  /// Periods from the last SYNC to this one, at least 1. After n ticks of the node's own it is the n+1st, unless it
  /// comes so soon after the last of them that it is the one that was missed, late.
  std::uint32_t periods_since_sync(std::uint32_t now) const {
    if (!is_watched() || own_ticks_ == 0) return 1;
    return own_ticks_ + (wrapping_subtract(now, sync_us_) < tick_us_ / 4 ? 0U : 1U);
  }

  /// The tables hold for their own tick alone: what effects remember is wrong at any other. n periods of SYNC have to
  /// take n ticks, give or take two ticks (jitter, a period miscounted) and a 64th. So a rate that is off by a quarter
  /// is noticed within 9 periods, one that is off by 2.5 % within a window. The error ends with a window that is right
  /// to a 64th.
  void watch_rate(std::uint32_t now, std::uint32_t periods) {
    if (!is_watched()) return;
    rate_periods_ += periods;
    const std::uint32_t passed = wrapping_subtract(now, rate_us_), expected = rate_periods_ * tick_us_;
    const std::uint32_t off = passed > expected ? passed - expected : expected - passed;
    const bool wrong = synchronised_ && off > 2 * tick_us_ + expected / 64;
    if (wrong) {
      const std::uint64_t period = slow_quotient(passed, rate_periods_);
      errors_.raise(Error::sync_rate, static_cast<std::uint16_t>(std::min<std::uint64_t>(period, 0xFFFF)), now);
    }
    if (synchronised_ && !wrong && rate_periods_ < rate_window) return;
    if (synchronised_ && off <= expected / 64) errors_.clear(Error::sync_rate);
    rate_us_ = now;
    rate_periods_ = 0;
  }

  void handle_setpoint(std::size_t j) {
    if (state_ != NmtState::operational) return;
    const bool together = can_fd && configuration_.fd;
    const std::size_t size = together ? hal::fd_length(WireSetpoint::bytes * joints) : WireSetpoint::bytes;
    if (received_.remote || received_.size != size || (together && j != 0)) {
      count(Counter::malformed_setpoints);
      return errors_.raise(Error::pdo_length, static_cast<std::uint16_t>(j + 1), hardware_.clock.now_us());
    }
    if (!together) return take_setpoint(j, received_.data.data());
    for (std::size_t i = 0; i < joints; ++i) take_setpoint(i, received_.data.data() + WireSetpoint::bytes * i);
  }

  void take_setpoint(std::size_t j, const std::uint8_t* from) {
    const std::uint32_t bit = 1U << j;
    if ((waiting_mask_ & bit) != 0) count(Counter::duplicate_setpoints);
    waiting_mask_ |= bit;
    arrivals_[j] = static_cast<std::uint8_t>(arrivals_[j] + (arrivals_[j] < 0xFF ? 1 : 0));
    waiting_[j] = WireSetpoint::load(from);
    const std::uint32_t odd = waiting_[j].is_odd() ? bit : 0;
    odd_mask_ = (odd_mask_ & ~bit) | odd;
  }

  void drop_setpoints() {
    waiting_mask_ = odd_mask_ = 0;
    arrivals_ = {};
  }

  void handle_nmt() {
    if (received_.remote || received_.size != 2) return count(Counter::malformed_frames);
    const std::uint32_t node = received_.data[1];
    if (node != 0 && node != settings_.id) return;
    using canopen::NmtCommand;
    switch (static_cast<NmtCommand>(received_.data[0])) {
      case NmtCommand::start:
        return enter(NmtState::operational);
      case NmtCommand::stop:
        return enter(NmtState::stopped);
      case NmtCommand::enter_pre_operational:
        return enter(NmtState::pre_operational);
      case NmtCommand::reset_node:
      case NmtCommand::reset_communication:
        count(Counter::nmt_resets);
        return reset(hardware_.clock.now_us());
      default:
        count(Counter::malformed_frames);
    }
  }

  void handle_sdo() {
    if (received_.remote || received_.size != 8) return count(Counter::malformed_frames);
    if (state_ != NmtState::pre_operational && state_ != NmtState::operational) return;
    std::array<std::uint8_t, 8> request, answer;
    std::copy_n(received_.data.begin(), 8, request.begin());
    if (sdo_.handle(request, *this, hardware_.clock.now_us(), answer)) put_sdo(answer);
    flush();
  }

  void put_sdo(const std::array<std::uint8_t, 8>& answer) {
    Frame& frame = put(sdo_place, canopen::sdo_answer_id + settings_.id, 8);
    std::copy(answer.begin(), answer.end(), frame.data.begin());
    counters_[static_cast<std::size_t>(Counter::sdo_aborts)] = sdo_.aborts();
  }

  /// Another node has this one's id. Both fall silent but for heartbeat and SDO, until a master has seen to it.
  void handle_collision() {
    if (received_.remote) return count(Counter::foreign_frames);
    count(Counter::id_collisions);
    errors_.raise(Error::id_collision, static_cast<std::uint16_t>(received_.id), hardware_.clock.now_us());
    if (state_ == NmtState::operational) enter(NmtState::pre_operational);
  }

  void handle_heartbeat(std::uint32_t node) {
    if (received_.remote || received_.size != 1) return count(Counter::malformed_frames);
    const auto state = static_cast<NmtState>(received_.data[0]);
    const bool works = state == NmtState::operational || state == NmtState::pre_operational;
    if (!works && state != NmtState::initialising && state != NmtState::stopped)
      return count(Counter::malformed_frames);
    const std::uint32_t now = hardware_.clock.now_us();
    for (std::size_t i = 0; i < dictionary::consumers; ++i) {
      if (!is_consumed(i) || consumer_node(i) != node) continue;
      // A boot-up message of a node that was alive says that it was reset: what it knew of this one is gone.
      if (!works) {
        if ((consumer_seen_ >> i & 1U) != 0) lose_consumer(i, now);
        continue;
      }
      consumer_seen_ |= 1U << i;
      consumer_lost_ &= ~(1U << i);
      consumer_us_[i] = now;
    }
    if (consumer_lost_ == 0) errors_.clear(Error::heartbeat_lost);
  }
  void lose_consumer(std::size_t i, std::uint32_t now) {
    consumer_seen_ &= ~(1U << i);
    consumer_lost_ |= 1U << i;
    count(Counter::lost_heartbeats);
    errors_.raise(Error::heartbeat_lost, static_cast<std::uint16_t>(consumer_node(i)), now);
    communication_failed();
  }
  std::uint32_t consumer_node(std::size_t i) const { return configuration_.consumers[i] >> 16; }
  std::uint32_t consumer_ms(std::size_t i) const { return configuration_.consumers[i] & 0xFFFFU; }
  /// An entry of node 0 or above 127, or without a time, is not used (CiA 301, 7.5.2.18).
  bool is_consumed(std::size_t i) const {
    return consumer_node(i) != 0 && consumer_node(i) <= canopen::largest_node_id && consumer_ms(i) != 0;
  }

  // --- the tick ----------------------------------------------------------------------------------------------------

  /// At SYNC, `periods` after the last one; 0: by the node's own timer where SYNC stays away. What waits is then for
  /// the SYNC that is still to come.
  void tick(std::uint32_t periods) {
    static_cast<void>(hardware_.tick_busy.set(true));  // an oscilloscope's trace: nobody to tell where it fails
    const bool by_sync = periods != 0, fresh = by_sync && accept_setpoints(periods);
    const bool enabled = is_enabled();
    ++tick_count_;
    if (fresh) {
      count(Counter::ticks);
      stale_ = 0;
      errors_.clear(Error::setpoints_stale);
      measure_model();
      count(Counter::saturations, saturations_.count);
    } else {
      count(Counter::stale_ticks);
      if (!by_sync) count(Counter::overdue_syncs);
      if (stale_ < longest_gap) ++stale_;
      if (stale_ > configuration_.tolerated)
        errors_.raise(Error::setpoints_stale, static_cast<std::uint16_t>(missing_joint()), hardware_.clock.now_us());
    }
    if (by_sync) {
      drop_setpoints();
      own_ticks_ = 0;
    } else if (own_ticks_ < longest_gap) {
      ++own_ticks_;
    }

    const bool hold = !fresh && stale_ <= configuration_.tolerated;
    const bool allowed = enabled && may_put_out();
    step_us_ = sync_us_;
    release_after_us_ = tick_us_ + tick_us_ / 2;
    bool zero = true;
    for (std::size_t o = 0; o < outputs; ++o) {
      TorqueOutput& torque = torques_[o];
      std::uint8_t status = 0;
      if (!allowed || (!fresh && !hold)) {
        torque.release(steps_[o]);
      } else if (fresh && torque.follow(model_torques_[static_cast<int>(o)].raw, steps_[o])) {
        status |= torque_status::step_limited;
        count(Counter::limited_steps);
      }
      const std::int32_t raw = torque.value();
      const auto& limit = limits(output_joints_[o]);
      if (fresh) status |= torque_status::fresh;
      if (!torque.is_following()) status |= torque_status::ramping;
      if (raw == limit.tau_lower.raw || raw == limit.tau_upper.raw) status |= torque_status::at_limit;
      if (enabled) status |= torque_status::enabled;
      statuses_[o] = status;
      zero = zero && raw == 0;
    }
    if (zero && stale_ > configuration_.tolerated + configuration_.ramp_ticks) forget();
    put_torques();
    static_cast<void>(hardware_.tick_busy.set(false));
    flush();
    if (is_supervised()) hardware_.watchdog.feed();
    end_of_measurement();
  }

  /// Every joint has a setpoint and none jumps: they become the tick's input, together. Else nothing of them is used.
  bool accept_setpoints(std::uint32_t periods) {
    if (is_watched() && own_ticks_ != 0) drop_old_setpoints(periods);
    if (waiting_mask_ != all_joints) {
      count(Counter::missing_setpoints, static_cast<std::uint32_t>(std::popcount(all_joints & ~waiting_mask_)));
      return false;
    }
    if (configuration_.parity && odd_mask_ != 0 && odd_mask_ != all_joints) {
      count(Counter::mixed_setpoints);
      return false;
    }
    std::uint32_t implausible = 0;
    if (has_last_) {
      for (std::size_t j = 0; j < joints; ++j) {
        const std::int64_t jump = std::int64_t{waiting_[j].q} - last_[j].q;
        const std::int64_t most = std::int64_t{jump_per_tick_[j]} * std::max<std::uint32_t>(elapsed_, 1);
        implausible += static_cast<std::uint32_t>(jump > most || jump < -most);
      }
    }
    count(Counter::implausible_setpoints, implausible);
    if (implausible != 0) return false;
    for (std::size_t j = 0; j < joints; ++j) {
      const auto i = static_cast<int>(j);
      setpoints_.q[i].raw = waiting_[j].q;
      setpoints_.dq[i].raw = from_share(waiting_[j].dq, velocity_limit(j));
      setpoints_.ddq[i].raw = from_share(waiting_[j].ddq, acceleration_limit(j));
    }
    last_ = waiting_;
    has_last_ = true;
    return true;
  }

  /// After SYNCs that stayed away: as many setpoints as periods have to have come for a joint, else its newest one is
  /// of one of those, and counts as missing.
  void drop_old_setpoints(std::uint32_t periods) {
    for (std::size_t j = 0; j < joints; ++j) {
      if (arrivals_[j] != periods) waiting_mask_ &= ~(1U << j);
    }
  }

  /// The first joint whose setpoint is missing, from 1; 0: none is.
  std::uint32_t missing_joint() const {
    const std::uint32_t missing = all_joints & ~waiting_mask_;
    return missing == 0 ? 0 : static_cast<std::uint32_t>(std::countr_zero(missing)) + 1;
  }

  bool is_enabled() {
    bool on = false;  // what it stays where the input can't be read
    static_cast<void>(hardware_.enable.read(on));
    return was_enabled_ = on;
  }

  /// Whether a torque other than zero may stay.
  bool is_allowed() { return may_put_out() && is_enabled(); }
  bool may_put_out() const { return consumer_lost_ == 0 && !errors_.is_present(Error::sync_rate); }

  /// As long without setpoints as the longest ramp takes: the next ones begin anew. A time and not just a torque of
  /// zero, so that drives of one joint each forget when a drive of all does.
  void forget() {
    model_state_ = {};
    has_last_ = false;
    synchronised_ = false;
    drop_setpoints();
    own_ticks_ = elapsed_ = 0;
  }

  /// What the counter says of the stretch that ends here, without its own cost; zero where that wavers by more.
  std::uint32_t measured() {
    const std::uint32_t cost = hardware_.counter.stop();
    return cost - std::min(cost, empty_measurement_);
  }

  void measure_model() {
    since_tick_ = wrapping_add(since_tick_, measured());
    saturations_ = {};
    hardware_.counter.start();
    compute();
    const std::uint32_t cost = measured();
    hardware_.counter.start();
    since_tick_ = wrapping_add(since_tick_, cost);
    note_cost(dictionary::Cost::model, cost);
  }
  /// A function of its own, from members to members, so that no part of it can leave the measured stretch.
  [[gnu::noinline]] void compute() {
    if (elapsed_ > 1) Model::skip(tables_.parameters, model_state_, elapsed_ - 1, saturations_);
    elapsed_ = 0;
    model_torques_ = Model::tick(tables_.parameters, model_state_, setpoints_, saturations_);
  }
  void end_of_measurement() {
    since_tick_ = wrapping_add(since_tick_, measured());
    hardware_.counter.start();
    note_cost(dictionary::Cost::everything, since_tick_);
    since_tick_ = 0;
  }
  /// `item`: the last one; the most follows it.
  void note_cost(dictionary::Cost item, std::uint32_t cost) {
    auto* place = costs_.data() + static_cast<std::size_t>(item);
    place[0] = cost;
    place[1] = std::max(place[1], cost);
  }

  // --- what is due -------------------------------------------------------------------------------------------------

  void serve(std::uint32_t now) {
    serve_bus(now);
    serve_heartbeats(now);
    serve_own_ticks(now);
    errors_.serve(now);
    serve_emergency(now);
    std::array<std::uint8_t, 8> answer;
    if (sdo_.time_out(now, answer)) put_sdo(answer);
    show_fault();
  }

  /// Out of bus-off a node comes after 128 times 11 recessive bits (ISO 11898-1, fault confinement), asked for at once.
  void serve_bus(std::uint32_t now) {
    const hal::CanErrors bus = hardware_.bus.errors();
    if (bus.lost != seen_lost_) {
      count(Counter::lost_received, bus.lost - seen_lost_);
      seen_lost_ = bus.lost;
      errors_.raise(Error::overrun, 0, now);
    }
    if (bus.state == hal::CanState::bus_off) {
      if (!off_bus_) {
        off_bus_ = true;
        count(Counter::bus_offs);
        communication_failed();
      }
      static_cast<void>(hardware_.bus.restart());  // its state tells what came of it
      return;
    }
    if (off_bus_) {
      off_bus_ = false;
      errors_.raise(Error::recovered_from_bus_off, static_cast<std::uint16_t>(counted(Counter::bus_offs)), now);
    }
    if (bus.state == hal::CanState::passive)
      errors_.raise(Error::error_passive, bus.transmit, now);
    else
      errors_.clear(Error::error_passive);
  }

  void serve_heartbeats(std::uint32_t now) {
    if (state_ == NmtState::initialising) {
      if (off_bus_ || is_pending(heartbeat_place) || wrapping_subtract(now, heartbeat_us_) < boot_up_retry_us) return;
      put_heartbeat();
      heartbeat_us_ = now;
    } else if (const std::uint32_t period = 1000 * configuration_.heartbeat_ms;
               period != 0 && wrapping_subtract(now, heartbeat_us_) >= period) {
      heartbeat_us_ = wrapping_subtract(now, heartbeat_us_) < 2 * period ? wrapping_add(heartbeat_us_, period) : now;
      put_heartbeat();
    }
    for (std::size_t i = 0; i < dictionary::consumers; ++i) {
      const bool late = wrapping_subtract(now, consumer_us_[i]) > 1000 * consumer_ms(i);
      if ((consumer_seen_ >> i & 1U) != 0 && late) lose_consumer(i, now);
    }
  }
  void put_heartbeat() {
    put(heartbeat_place, canopen::heartbeat_id + settings_.id, 1).data[0] = static_cast<std::uint8_t>(state_);
  }

  /// Whether a tick has to come: by SYNC or, once that is overdue, by the node's own timer.
  bool is_due_to_tick() const { return state_ == NmtState::operational && synchronised_; }
  bool is_supervised() const {
    return is_due_to_tick() && is_watched() && configuration_.period_us <= supervised_period_us;
  }

  /// Ticks without SYNC, at the tables' own rate once SYNC is overdue, so that a slow period makes no slow ramp.
  /// Between ticks, and where none is due, a torque that may not go out goes to zero at that rate too.
  void serve_own_ticks(std::uint32_t now) {
    if (is_due_to_tick() && wrapping_subtract(now, sync_us_) >= overdue_after_us_) {
      sync_us_ = wrapping_add(sync_us_, overdue_after_us_);
      if (wrapping_subtract(now, sync_us_) >= tick_us_) sync_us_ = now;  // far behind: no burst of ticks
      overdue_after_us_ = tick_us_;
      return tick(0);
    }
    if (wrapping_subtract(now, step_us_) < release_after_us_) return;
    step_us_ = wrapping_add(step_us_, release_after_us_);
    if (wrapping_subtract(now, step_us_) >= tick_us_) step_us_ = now;
    release_after_us_ = tick_us_;
    if (is_due_to_tick() && is_allowed()) return;
    for (std::size_t o = 0; o < outputs; ++o) torques_[o].release(steps_[o]);
  }

  void serve_emergency(std::uint32_t now) {
    if (!emergency_may_go_ && wrapping_subtract(now, emergency_us_) >= 100 * configuration_.emergency_inhibit)
      emergency_may_go_ = true;
    if (!emergency_may_go_ || off_bus_ || is_pending(emergency_place) ||
        (state_ != NmtState::pre_operational && state_ != NmtState::operational) || !has_booted_up())
      return;
    ErrorLog::Message message;
    if (!errors_.next(message)) return;
    emergency_may_go_ = false;
    emergency_us_ = now;
    Frame& frame = put(emergency_place, canopen::emergency_id + settings_.id, 8);
    canopen::store<2>(&frame.data[0], message.code);
    frame.data[2] = errors_.error_register();
    canopen::store<2>(&frame.data[3], message.detail);
    std::fill_n(frame.data.begin() + 5, 3, std::uint8_t{0});
  }

  /// Whether the boot-up message is out: a bus that sorts would send an EMCY ahead of it.
  bool has_booted_up() {
    if constexpr (hal::SortingCanBus<Bus>) {
      boot_up_is_out_ = boot_up_is_out_ || hardware_.bus.has_sent_all();
      return boot_up_is_out_;
    }
    return true;
  }

  void show_fault() {
    if (fault_is_shown_ && shown_fault_ == errors_.any()) return;
    shown_fault_ = errors_.any();
    fault_is_shown_ = hardware_.fault.set(shown_fault_) == hal::Status::ok;
  }

  // --- what goes ---------------------------------------------------------------------------------------------------

  bool is_pending(std::size_t place) const { return (pending_ >> place & 1U) != 0; }

  Frame& put(std::size_t place, std::uint32_t id, std::size_t size) {
    if (is_pending(place)) count(Counter::lost_sent);
    pending_ |= 1U << place;
    Frame& frame = to_send_[place];
    frame.id = id;
    frame.size = static_cast<std::uint8_t>(size);
    frame.fd = false;
    return frame;
  }

  void put_torques() {
    if (can_fd && configuration_.fd) {
      if (!may_send_torque(0)) return;
      const std::size_t size = hal::fd_length(WireTorque::bytes * outputs);
      Frame& frame = put(torque_place, configuration_.torque_ids[0] & canopen::cob_identifier, size);
      frame.fd = true;
      std::fill(frame.data.begin(), frame.data.end(), std::uint8_t{0});
      for (std::size_t o = 0; o < outputs; ++o) wire_torque(o).store(frame.data.data() + WireTorque::bytes * o);
      return;
    }
    for (std::size_t o = 0; o < outputs; ++o) {
      if (!may_send_torque(o)) continue;
      wire_torque(o).store(
          put(torque_place + o, configuration_.torque_ids[o] & canopen::cob_identifier, WireTorque::bytes).data.data());
    }
  }
  bool may_send_torque(std::size_t o) const { return (configuration_.torque_ids[o] & canopen::cob_invalid) == 0; }

  WireTorque wire_torque(std::size_t o) const {
    const std::int32_t raw = torques_[o].value();
    return {to_per_mille(raw, tables_.rated.scale[output_joints_[o]]), to_milli<torque_bits>(raw),
            static_cast<std::uint8_t>(tick_count_), statuses_[o]};
  }

  void flush() {
    if (off_bus_) {  // what waits would be old when the node comes back
      count(Counter::lost_sent, static_cast<std::uint32_t>(std::popcount(pending_)));
      pending_ = 0;
    }
    while (pending_ != 0) {
      const auto place = static_cast<std::size_t>(std::countr_zero(pending_));
      const hal::Status status = hardware_.bus.send(to_send_[place]);
      if (status == hal::Status::busy) return;
      pending_ &= pending_ - 1;
      if (status != hal::Status::ok) count(Counter::lost_sent);
      if (status == hal::Status::ok && place == heartbeat_place && state_ == NmtState::initialising)
        state_ = NmtState::pre_operational;
    }
  }

  // --- object dictionary -------------------------------------------------------------------------------------------

  std::string_view text_of(dictionary::Variable variable) const {
    using V = dictionary::Variable;
    if (variable == V::device_name) return dictionary::device_name;
    if (variable == V::cost_unit) return hardware_.counter.unit();
    if (variable == V::hardware_version) return settings_.board;
    if (variable == V::software_version) return version;
    return {label_.data(), label_size_};
  }

  /// Output whose torque joint j has; `outputs`: none.
  std::size_t output_of(std::size_t j) const {
    std::size_t o = 0;
    while (o < outputs && output_joints_[o] != j) ++o;
    return o;
  }

  std::uint32_t number_of(const Object& object) const {
    using V = dictionary::Variable;
    const std::size_t item = object.item;
    const auto word = [](std::int32_t x) { return static_cast<std::uint32_t>(x); };
    switch (object.entry->variable) {
      case V::device_type:
      case V::vendor:
        return 0;
      case V::error_register:
        return errors_.error_register();
      case V::error_count:
        return errors_.history_count();
      case V::error_field:
        return errors_.history(item);
      case V::sync_id:
        return configuration_.sync_id;
      case V::cycle_period:
        return configuration_.period_us;
      case V::emergency_id:
        return canopen::emergency_id + settings_.id;
      case V::emergency_inhibit:
        return configuration_.emergency_inhibit;
      case V::consumer_heartbeat:
        return configuration_.consumers[item];
      case V::producer_heartbeat:
        return configuration_.heartbeat_ms;
      case V::product:
        return dictionary::product_code;
      case V::revision:
        return version_number;
      case V::serial_number:
        return settings_.serial_number;
      case V::error_behaviour:
        return configuration_.error_behaviour;
      case V::sdo_request_id:
        return canopen::sdo_request_id + settings_.id;
      case V::sdo_answer_id:
        return canopen::sdo_answer_id + settings_.id;
      case V::setpoint_id:
        return configuration_.setpoint_ids[item];
      case V::torque_id:
        return configuration_.torque_ids[output_of(item)];
      case V::pdo_type:
        return 1;
      case V::setpoint_mapping:
        return dictionary::mapping(false, object.sub_index, item);
      case V::torque_mapping:
        return dictionary::mapping(true, object.sub_index, item);
      case V::tables_crc:
        return tables_.header.crc32;
      case V::layout_hash:
        return tables_.header.layout_hash;
      case V::tables_valid:
        return tables_.valid ? 1 : 0;
      case V::joints:
        return joints;
      case V::outputs:
        return Model::outputs_mask;
      case V::page:
        return tables_.update == UpdateSlot::used ? 1 : 0;
      case V::sequence:
        return tables_.header.sequence;
      case V::update_slot:
        return static_cast<std::uint32_t>(tables_.update);
      case V::counter:
        return counters_[item];
      case V::cost:
        return costs_[item];
      case V::ramp_ticks:
        return configuration_.ramp_ticks;
      case V::step_limit:
        return word(configuration_.step_limits[item]);
      case V::tolerated_ticks:
        return configuration_.tolerated;
      case V::tick_parity:
        return configuration_.parity ? 1 : 0;
      case V::patience:
        return configuration_.patience_ms;
      case V::fractional_bits:
        return word(std::array{position_bits, velocity_bits, acceleration_bits, torque_bits}[item]);
      case V::velocity_limit:
        return word(velocity_limit(item));
      case V::acceleration_limit:
        return word(acceleration_limit(item));
      case V::lower_position:
        return word(limits(item).q_lower.raw);
      case V::upper_position:
        return word(limits(item).q_upper.raw);
      case V::can_fd:
        return configuration_.fd ? 1 : 0;
      case V::rated_torque:
        return word(tables_.rated.milli[item]);
      case V::lower_torque:
        return word(to_milli<torque_bits>(limits(item).tau_lower.raw));
      case V::upper_torque:
        return word(to_milli<torque_bits>(limits(item).tau_upper.raw));
      case V::setpoint_position:
        return word(last_[item].q);
      case V::setpoint_velocity:
        return static_cast<std::uint16_t>(last_[item].dq);
      case V::setpoint_acceleration:
        return static_cast<std::uint16_t>(last_[item].ddq);
      case V::torque_per_mille:
      case V::torque_milli:
      case V::tick_count:
      case V::torque_status: {
        const std::size_t o = output_of(item);
        if (o == outputs) return 0;
        const WireTorque torque = wire_torque(o);
        if (object.entry->variable == V::torque_per_mille) return static_cast<std::uint16_t>(torque.per_mille);
        if (object.entry->variable == V::torque_milli) return word(torque.milli);
        return object.entry->variable == V::tick_count ? torque.tick : torque.status;
      }
      case V::device_name:
      case V::hardware_version:
      case V::software_version:
      case V::cost_unit:
      case V::label:
        break;  // text_of()
    }
    return 0;
  }

  canopen::Abort set(const Object& object, std::uint32_t value) {
    using V = dictionary::Variable;
    const bool operational = state_ == NmtState::operational;
    switch (object.entry->variable) {
      case V::error_count:
        errors_.clear_history();
        return canopen::Abort::none;
      case V::sync_id:
        if (operational) return canopen::Abort::device_state;
        if (value > canopen::cob_identifier || canopen::is_restricted(value) || is_taken(value, configuration_.sync_id))
          return canopen::Abort::invalid_value;
        configuration_.sync_id = value;
        listen();
        return canopen::Abort::none;
      case V::cycle_period:
        // the tables are for their own tick
        if (value > dictionary::longest_period_us(tick_us_)) return canopen::Abort::too_high;
        if (value != 0 && value < dictionary::shortest_period_us(tick_us_)) return canopen::Abort::too_low;
        configuration_.period_us = value;
        errors_.clear(Error::sync_rate);
        expect_sync();
        return canopen::Abort::none;
      case V::patience:
        configuration_.patience_ms = value;
        expect_sync();
        return canopen::Abort::none;
      case V::emergency_inhibit:
        configuration_.emergency_inhibit = value;
        return canopen::Abort::none;
      case V::consumer_heartbeat:
        if (const auto abort = check_consumer(object.item, value); abort != canopen::Abort::none) return abort;
        configuration_.consumers[object.item] = value;
        consumer_seen_ &= ~(1U << object.item);  // begins with the next heartbeat
        consumer_lost_ &= ~(1U << object.item);
        if (consumer_lost_ == 0) errors_.clear(Error::heartbeat_lost);
        return canopen::Abort::none;
      case V::producer_heartbeat:
        configuration_.heartbeat_ms = value;
        heartbeat_us_ = hardware_.clock.now_us();
        return canopen::Abort::none;
      case V::error_behaviour:
        configuration_.error_behaviour = value;
        return canopen::Abort::none;
      case V::setpoint_id:
        // bit 30 says nothing here (CiA 301, 7.5.2.35)
        return set_cob_id(configuration_.setpoint_ids[object.item], value & ~canopen::cob_no_remote);
      case V::torque_id:
        return set_cob_id(configuration_.torque_ids[output_of(object.item)], value);
      case V::ramp_ticks:
        configuration_.ramp_ticks = value;
        set_ramps();
        return canopen::Abort::none;
      case V::step_limit:
        configuration_.step_limits[object.item] = static_cast<std::int32_t>(value);
        if (const std::size_t o = output_of(object.item); o < outputs)
          steps_[o].following = static_cast<std::int32_t>(
              std::clamp<std::uint64_t>(slow_quotient(std::uint64_t{value} << torque_bits, 1000), 1, 0x7FFF'FFFF));
        return canopen::Abort::none;
      case V::tolerated_ticks:
        configuration_.tolerated = value;
        return canopen::Abort::none;
      case V::tick_parity:
        configuration_.parity = value != 0;
        return canopen::Abort::none;
      case V::can_fd:
        if (operational) return canopen::Abort::device_state;
        if (value != 0 && !can_fd) return canopen::Abort::too_high;
        if (value != 0 && !settings_.fd_allowed) return canopen::Abort::device_state;
        configuration_.fd = value != 0;
        return canopen::Abort::none;
      default:
        return canopen::Abort::read_only;
    }
  }

  /// An identifier can be changed while its PDO does not exist (bit 31), and not in operation (7.5.2.35).
  canopen::Abort set_cob_id(std::uint32_t& cob_id, std::uint32_t value) {
    if (state_ == NmtState::operational) return canopen::Abort::device_state;
    const std::uint32_t id = value & canopen::cob_identifier;
    if ((value & ~(canopen::cob_invalid | canopen::cob_no_remote | canopen::cob_identifier)) != 0 ||
        canopen::is_restricted(id))
      return canopen::Abort::invalid_value;
    if ((value & canopen::cob_invalid) == 0 && is_taken(id, cob_id)) return canopen::Abort::invalid_value;
    const bool exists = (cob_id & canopen::cob_invalid) == 0;
    if (exists && (value & canopen::cob_invalid) == 0 && id != (cob_id & canopen::cob_identifier))
      return canopen::Abort::device_state;
    cob_id = value;
    listen();
    return canopen::Abort::none;
  }

  /// Whether the node's EMCY, SYNC or a PDO has this identifier, other than `own`.
  bool is_taken(std::uint32_t id, const std::uint32_t& own) const {
    const auto has = [&](const std::uint32_t& other) {
      return &other != &own && (other & canopen::cob_invalid) == 0 && (other & canopen::cob_identifier) == id;
    };
    return id == canopen::emergency_id + settings_.id || has(configuration_.sync_id) ||
           std::any_of(configuration_.setpoint_ids.begin(), configuration_.setpoint_ids.end(), has) ||
           std::any_of(configuration_.torque_ids.begin(), configuration_.torque_ids.end(), has);
  }

  /// From now on as after a SYNC: the time-outs count anew, and nothing of before does.
  void expect_sync() {
    drop_setpoints();
    own_ticks_ = rate_periods_ = 0;
    rate_us_ = hardware_.clock.now_us();
    wait_for_sync(rate_us_);
  }

  /// Only one entry may watch a node (CiA 301, 7.5.2.18).
  canopen::Abort check_consumer(std::size_t item, std::uint32_t value) const {
    const std::uint32_t node = value >> 16, ms = value & 0xFFFFU;
    if (node > 0xFF) return canopen::Abort::invalid_value;  // bits that are reserved
    for (std::size_t i = 0; i < dictionary::consumers; ++i) {
      if (i != item && is_consumed(i) && ms != 0 && consumer_node(i) == node) return canopen::Abort::incompatible;
    }
    return canopen::Abort::none;
  }

  /// Torque limit / ticks, rounded up: the ramp is not longer than told.
  void set_ramps() {
    for (std::size_t o = 0; o < outputs; ++o) {
      const auto limit = static_cast<std::uint32_t>(torque_limit(output_joints_[o]));
      const std::uint32_t ticks = configuration_.ramp_ticks;
      steps_[o].ramp = ticks == 0 ? 0x7FFF'FFFF : static_cast<std::int32_t>(slow_quotient(limit - 1, ticks) + 1);
    }
  }

  Hardware& hardware_;
  NodeTables<Model> tables_;
  NodeSettings settings_;
  std::uint32_t empty_measurement_ = 0, tick_us_ = 0;
  std::array<std::uint8_t, outputs> output_joints_{};
  std::array<std::uint32_t, joints> jump_per_tick_{};  ///< of q, twice what the velocity limit allows

  NmtState state_ = NmtState::initialising;
  Configuration configuration_;
  ErrorLog errors_;
  SdoServer<Object> sdo_;
  std::array<std::uint32_t, dictionary::counters> counters_{};
  std::array<std::uint32_t, dictionary::costs> costs_{};
  std::uint32_t since_tick_ = 0;  ///< cost
  std::array<char, dictionary::longest_string> label_{};
  std::size_t label_size_ = 0;

  std::uint32_t waiting_mask_ = 0;               ///< bit j: waiting_[j] has come since the last SYNC
  std::uint32_t odd_mask_ = 0;                   ///< bit j: it is of an odd tick
  std::array<std::uint8_t, joints> arrivals_{};  ///< setpoints since the last SYNC, up to 255
  std::array<WireSetpoint, joints> waiting_{}, last_{};
  bool has_last_ = false, synchronised_ = false, was_enabled_ = false;
  std::uint32_t stale_ = 0;      ///< stale ticks in a row
  std::uint32_t own_ticks_ = 0;  ///< since the last SYNC
  std::uint32_t elapsed_ = 0;    ///< periods of SYNC since the setpoints of the last fresh tick
  std::uint32_t tick_count_ = 0, sync_us_ = 0, overdue_after_us_ = 0;
  std::uint32_t rate_us_ = 0, rate_periods_ = 0;      ///< when the window of watch_rate() began, periods since then
  std::uint32_t step_us_ = 0, release_after_us_ = 0;  ///< when the torques last moved, when they are released next

  typename Model::State model_state_{};
  typename Model::Setpoints setpoints_{};
  typename Model::Torques model_torques_{};
  Saturations saturations_{};
  std::array<TorqueOutput, outputs> torques_{};
  std::array<TorqueSteps, outputs> steps_{};
  std::array<std::uint8_t, outputs> statuses_{};

  std::uint32_t consumer_seen_ = 0, consumer_lost_ = 0;
  std::array<std::uint32_t, dictionary::consumers> consumer_us_{};
  std::uint32_t heartbeat_us_ = 0, emergency_us_ = 0;
  bool emergency_may_go_ = true, off_bus_ = false, fault_is_shown_ = false, shown_fault_ = false;
  bool boot_up_is_out_ = false;  ///< the last one
  std::uint32_t seen_lost_ = 0;

  Frame received_{};
  std::uint32_t pending_ = 0;  ///< bit i: to_send_[i] waits
  std::array<Frame, places> to_send_{};
};

}  // namespace fxdyn
