#include "tests/hil/fault_campaign.hpp"

#include <algorithm>
#include <cstdio>
#include <cstdlib>

namespace fxdyn::hil {
namespace {

using canopen::NmtCommand;
using canopen::NmtState;
using dictionary::Counter;
constexpr double tick_s = 0.002;
/// What the node may change a torque by in a tick: the ramp's slope for every step (objects 0x2010 and 0x2011).
constexpr std::int32_t ramp_ticks = 50;
constexpr can::Duration answer_time = std::chrono::seconds(3);
constexpr can::Duration quiet = std::chrono::milliseconds(3);
constexpr std::uint32_t most_recovery_ticks = 4 * ramp_ticks;

}  // namespace

const char* name_of(Fault fault) {
  constexpr std::array names{"drop",  "duplicate",  "reorder",    "delay",   "truncate", "flip",         "foreign",
                             "flood", "SDO random", "SDO fuzzed", "bus-off", "reset",    "wrong tables", "second node"};
  static_assert(names.size() == fault_kinds);
  return names[static_cast<std::size_t>(fault)];
}

FaultCampaign::FaultCampaign(NodeUnderTest& node, unsigned seed, can::Duration period)
    : node_(node), master_(node.bus()), random_(seed), period_(period), motion_(tables::parameters, tick_s, seed) {
  master_.other = [this](const can::Frame& frame) { take(frame); };
  master_.sdo_timeout = answer_time;
}

void FaultCampaign::run(std::uint64_t events, double slow_share) {
  configure();
  start();
  const auto each = std::max<std::uint64_t>(1, events / fault_kinds);
  std::vector<Fault> order;
  for (std::size_t kind = 0; kind < fault_kinds; ++kind) {
    const auto fault = static_cast<Fault>(kind);
    const double share = fault == Fault::wrong_tables ? slow_share : 1;
    const auto count = std::max<std::uint64_t>(1, static_cast<std::uint64_t>(static_cast<double>(each) * share));
    order.insert(order.end(), count, fault);
  }
  while (order.size() < events) order.push_back(static_cast<Fault>(random_() % 10));
  std::shuffle(order.begin(), order.end(), random_);
  for (const Fault fault : order) inject(fault);
}

void FaultCampaign::configure() {
  master_.write(id, 0x1006, 0, 1'000'000, 4);  // lockstep: SYNC may take its time
  master_.write(id, 0x1017, 0, 0, 2);
  master_.write(id, 0x1016, 1, 0, 4);
  master_.write(id, 0x1016, 2, 0, 4);
  master_.write(id, 0x1015, 0, 0, 2);  // every EMCY at once
  master_.write(id, 0x1029, 1, 1, 1);
  master_.write(id, 0x2010, 0, ramp_ticks, 2);
  master_.write(id, 0x2012, 0, dictionary::defaults::tolerated_ticks, 1);
  for (std::size_t j = 0; j < joints; ++j) {
    const auto& limits = tables::parameters.constants[j].limits;
    const std::int32_t limit = whole_share(limits.tau_lower.raw, limits.tau_upper.raw);
    step_milli_[j] = to_milli<Torque<Model::Numbers>::bits>(limit / ramp_ticks);
    master_.write(id, 0x2011, static_cast<std::uint8_t>(j + 1), static_cast<std::uint32_t>(step_milli_[j]), 4);
  }
}

/// Operational and on the model's torque.
void FaultCampaign::start() {
  master_.command(NmtCommand::start, id);
  waiting_ = 0;
  stale_ = 0;
  has_last_ = false;
  seen_.fill(false);
  for (std::uint32_t i = 0; i < most_recovery_ticks; ++i) {
    good_tick();
    if (std::all_of(torques_.begin(), torques_.end(),
                    [](const auto& torque) { return torque && (torque->status & torque_status::ramping) == 0; }))
      break;
  }
  counted_ = read_counters();
  expected_ = counted_;
}

void FaultCampaign::send(const can::Frame& frame) { node_.bus().send(frame); }

void FaultCampaign::send_setpoint(std::size_t j, const WireSetpoint& setpoint) {
  can::Frame frame{.id = canopen::setpoint_id + 1 + static_cast<std::uint32_t>(j), .size = WireSetpoint::bytes};
  setpoint.store(frame.data.data());
  send(frame);
  if ((waiting_ >> j & 1U) != 0) expect(Counter::duplicate_setpoints);
  waiting_ |= 1U << j;
  arrived_.resize(joints);
  arrived_[j] = setpoint;
}

void FaultCampaign::send_all() {
  for (std::size_t j = 0; j < joints; ++j) send_setpoint(j, setpoints_[j]);
}

/// The rule of docs/decisions/0006: q jumps by no more than twice what the velocity limit allows since the last good
/// tick.
bool FaultCampaign::is_plausible(const std::vector<WireSetpoint>& setpoints) const {
  if (!has_last_) return true;
  using N = Model::Numbers;
  bool good = true;
  for (std::size_t j = 0; j < joints; ++j) {
    const auto& limits = tables::parameters.constants[j].limits;
    const std::int64_t per_second = whole_share(limits.dq_lower.raw, limits.dq_upper.raw);
    const std::int64_t ticks_per_second = tables::parameters.ticks_per_second.raw;
    const std::int64_t most =
        ((per_second << (Position<N>::bits + 17 - Velocity<N>::bits)) / ticks_per_second + 1) * (stale_ + 1);
    good = good && std::abs(std::int64_t{setpoints[j].q} - last_[j].q) <= most;
  }
  return good;
}

/// SYNC, and the torques that have to come. What the node has to count follows from what has arrived.
void FaultCampaign::end_tick(std::uint32_t syncs) {
  ++ticks_;
  if (const can::Duration now = node_.bus().now(); now < next_tick_) master_.listen(next_tick_ - now);
  next_tick_ = node_.bus().now() + period_;
  torques_.fill(std::nullopt);
  tick_frames_ = 0;
  constexpr std::uint32_t all = (1U << joints) - 1;
  if (syncs == 0) return;
  send({.id = canopen::sync_id});
  if (waiting_ != all) {
    for (std::size_t j = 0; j < joints; ++j) {
      if ((waiting_ >> j & 1U) == 0) expect(Counter::missing_setpoints);
    }
    expect(Counter::stale_ticks);
    ++stale_;
  } else if (!is_plausible(arrived_)) {
    expect(Counter::stale_ticks);
    using N = Model::Numbers;
    for (std::size_t j = 0; j < joints; ++j) {
      const auto& limits = tables::parameters.constants[j].limits;
      const std::int64_t per_second = whole_share(limits.dq_lower.raw, limits.dq_upper.raw);
      const std::int64_t most =
          ((per_second << (Position<N>::bits + 17 - Velocity<N>::bits)) / tables::parameters.ticks_per_second.raw + 1) *
          (stale_ + 1);
      if (std::abs(std::int64_t{arrived_[j].q} - last_[j].q) > most) expect(Counter::implausible_setpoints);
    }
    ++stale_;
  } else {
    expect(Counter::ticks);
    last_ = arrived_;
    has_last_ = true;
    stale_ = 0;
  }
  waiting_ = 0;
  can::Frame frame;
  const can::Duration end = node_.bus().now() + answer_time;
  while (tick_frames_ < joints && node_.bus().now() < end) {
    if (node_.bus().receive(frame, end - node_.bus().now())) master_.dispatch(frame);
  }
}

void FaultCampaign::good_tick() {
  setpoints_ = motion_.next();
  send_all();
  end_tick(1);
}

/// A torque: no step from one tick of the node to the next larger than the slope (1 for the rounding to thousandths).
void FaultCampaign::take(const can::Frame& frame) {
  if (frame.id == canopen::sdo_answer_id + id) {
    sdo_answer_ = frame;
    return;
  }
  const std::uint32_t j = frame.id - canopen::torque_id - 1;
  if (j >= joints || frame.size != WireTorque::bytes) return;
  const WireTorque torque = WireTorque::load(frame.data.data());
  ++torques_seen_;
  ++tick_frames_;
  torques_[j] = torque;
  if (seen_[j]) {
    const auto ticks = static_cast<std::uint8_t>(torque.tick - last_tick_[j]);
    const std::int64_t step = std::abs(std::int64_t{torque.milli} - last_milli_[j]);
    const std::int64_t most = std::int64_t{step_milli_[j] + 1} * ticks + 1;
    if (step > most) ++large_steps_;
    largest_step_share_ = std::max(largest_step_share_, static_cast<double>(step) / static_cast<double>(most));
  }
  seen_[j] = true;
  last_milli_[j] = torque.milli;
  last_tick_[j] = torque.tick;
}

FaultCampaign::Counts FaultCampaign::read_counters() {
  Counts counts;
  for (std::size_t i = 0; i < counts.size(); ++i) {
    counts[i] = master_.read(id, dictionary::counter_record, static_cast<std::uint8_t>(i + 1));
  }
  return counts;
}

/// Good ticks until the torque is the model's again.
void FaultCampaign::recover(Fault fault, can::Duration since, std::uint64_t ticks_before) {
  Tally& tally = tallies_[static_cast<std::size_t>(fault)];
  std::uint32_t ticks = 0;
  const auto followed = [](const auto& torque) {
    return torque && (torque->status & (torque_status::fresh | torque_status::ramping)) == torque_status::fresh;
  };
  do {
    good_tick();
  } while (++ticks < most_recovery_ticks && !std::all_of(torques_.begin(), torques_.end(), followed));
  if (ticks == most_recovery_ticks) {
    std::printf("FAILED: %s: no torque %u ticks later\n", name_of(fault), ticks);
    ++disagreements_;
  }
  tally.longest_ticks = std::max(tally.longest_ticks, ticks_ - ticks_before);
  tally.recovery_ms.push_back(static_cast<double>((node_.bus().now() - since).count()) * 1e-6);
}

void FaultCampaign::inject(Fault fault) {
  Tally& tally = tallies_[static_cast<std::size_t>(fault)];
  ++tally.injected;
  setpoints_ = motion_.next();
  const can::Duration since = node_.bus().now();
  const std::uint64_t ticks_before = ticks_;
  switch (fault) {
    case Fault::drop:
      drop();
      break;
    case Fault::duplicate:
      duplicate();
      break;
    case Fault::reorder:
      reorder();
      break;
    case Fault::delay:
      delay();
      break;
    case Fault::truncate:
      truncate();
      break;
    case Fault::flip:
      flip();
      break;
    case Fault::foreign:
      send_foreign(1);
      break;
    case Fault::flood:
      send_foreign(64 + random_() % 193);
      break;
    case Fault::sdo_random:
      sdo_random();
      break;
    case Fault::sdo_fuzzed:
      sdo_fuzzed();
      break;
    case Fault::bus_off:
      bus_off();
      break;
    case Fault::reset:
      reset();
      break;
    case Fault::wrong_tables:
      wrong_tables();
      break;
    case Fault::second_node:
      second_node();
      break;
  }
  recover(fault, since, ticks_before);
  counted_ = read_counters();
  // What depends on the motion alone, and not on frames.
  for (const Counter free : {Counter::saturations, Counter::limited_steps}) {
    expected_[static_cast<std::size_t>(free)] = counted_[static_cast<std::size_t>(free)];
  }
  if (counted_ == expected_) {
    ++tally.counted;
    return;
  }
  if (++disagreements_ <= 10) {
    for (std::size_t i = 0; i < counted_.size(); ++i) {
      if (counted_[i] != expected_[i]) {
        std::printf("FAILED: %s: counter %zu of 0x2001 grew by %d more than was injected\n", name_of(fault), i + 1,
                    static_cast<std::int32_t>(counted_[i] - expected_[i]));
      }
    }
  }
  expected_ = counted_;
}

/// One setpoint or SYNC in a tick; one time in four all setpoints of up to 80 ticks, which is longer than the ramp.
void FaultCampaign::drop() {
  const bool burst = random_() % 4 == 0;
  for (std::size_t ticks = burst ? 1 + random_() % 80 : 0; ticks > 0; --ticks) {
    end_tick(1);
    setpoints_ = motion_.next();
  }
  const std::size_t which = random_() % (joints + 1);
  for (std::size_t j = 0; j < joints; ++j) {
    if (j != which) send_setpoint(j, setpoints_[j]);
  }
  end_tick(which == joints ? 0 : 1);  // without SYNC there is no tick, and the setpoints are still waiting
}

void FaultCampaign::duplicate() {
  const std::size_t which = random_() % (joints + 1);
  send_all();
  if (which < joints) send_setpoint(which, setpoints_[which]);
  end_tick(1);
  if (which == joints) end_tick(1);
}

void FaultCampaign::reorder() {
  const std::size_t which = any_joint();
  for (std::size_t j = 0; j < joints; ++j) {
    if (j != which) send_setpoint(j, setpoints_[j]);
  }
  end_tick(1);
  send_setpoint(which, setpoints_[which]);
}

void FaultCampaign::delay() {
  const std::size_t which = any_joint();
  const WireSetpoint late = setpoints_[which];
  for (std::size_t j = 0; j < joints; ++j) {
    if (j != which) send_setpoint(j, setpoints_[j]);
  }
  end_tick(1);
  for (std::size_t ticks = random_() % 3; ticks > 0; --ticks) good_tick();
  send_setpoint(which, late);  // overtaken by the next tick's: the newest wins
}

void FaultCampaign::truncate() {
  const std::size_t which = random_() % (joints + 2);
  if (which == joints) {  // SYNC with a counter
    send({.id = canopen::sync_id, .size = 1, .data = {any_byte()}});
    expect(Counter::malformed_frames);
  } else if (which == joints + 1) {  // NMT without a node
    send({.id = canopen::nmt_id, .size = 1, .data = {static_cast<std::uint8_t>(NmtCommand::stop)}});
    expect(Counter::malformed_frames);
  }
  for (std::size_t j = 0; j < joints; ++j) {
    if (j != which) {
      send_setpoint(j, setpoints_[j]);
      continue;
    }
    can::Frame frame{.id = canopen::setpoint_id + 1 + static_cast<std::uint32_t>(j),
                     .size = static_cast<std::uint8_t>(random_() % 8)};
    std::array<std::uint8_t, 8> bytes{};
    setpoints_[j].store(bytes.data());
    std::copy_n(bytes.begin(), frame.size, frame.data.begin());
    send(frame);
    expect(Counter::malformed_setpoints);
  }
  end_tick(1);
}

void FaultCampaign::flip() {
  const std::size_t which = any_joint();
  std::array<std::uint8_t, 8> bytes{};
  setpoints_[which].store(bytes.data());
  const std::uint32_t bit = random_() % 64;
  bytes[bit / 8] = static_cast<std::uint8_t>(bytes[bit / 8] ^ 1U << bit % 8);
  setpoints_[which] = WireSetpoint::load(bytes.data());
  send_all();
  end_tick(1);
}

void FaultCampaign::send_foreign(std::size_t count) {
  for (std::size_t i = 0; i < count; ++i) {
    can::Frame frame{.size = static_cast<std::uint8_t>(random_() % 9)};
    switch (random_() % 5) {
      case 0:
        frame.id = 0x300 + any(0x200);
        break;  // PDOs of others
      case 1:
        frame.id = 0x081 + id + any(0x70);
        break;  // EMCY of others
      case 2:
        frame.id = 0x601 + id + any(0x70);
        break;  // SDO to others
      case 3:
        frame.id = 0x7E4 + any(2);
        break;  // LSS
      default:
        frame.extended = true;
        frame.id = any(0x2000'0000);
    }
    std::generate_n(frame.data.begin(), frame.size, [&] { return any_byte(); });
    send(frame);
    expect(Counter::foreign_frames);
  }
  send_all();
  end_tick(1);
}

/// Sends a request as it is; true: the node answered.
bool FaultCampaign::sdo(const std::array<std::uint8_t, 8>& request, std::array<std::uint8_t, 8>& answer) {
  can::Frame frame{.id = canopen::sdo_request_id + id, .size = 8};
  std::copy(request.begin(), request.end(), frame.data.begin());
  sdo_answer_.reset();
  send(frame);
  if (request[0] >> 5 == 4) return false;  // an abort is not answered
  const can::Duration end = node_.bus().now() + answer_time;
  while (!sdo_answer_ && node_.bus().now() < end) {
    if (node_.bus().receive(frame, end - node_.bus().now())) master_.dispatch(frame);
  }
  if (!sdo_answer_) {
    std::printf("FAILED: an SDO request %02x was not answered\n", request[0]);
    ++disagreements_;
    return false;
  }
  std::copy_n(sdo_answer_->data.begin(), 8, answer.begin());
  if (answer[0] == 0x80) expect(Counter::sdo_aborts);
  return true;
}

void FaultCampaign::sdo_random() {
  std::array<std::uint8_t, 8> request{}, answer{};
  if (random_() % 4 == 0) {
    can::Frame frame{.id = canopen::sdo_request_id + id, .size = static_cast<std::uint8_t>(random_() % 8)};
    std::generate_n(frame.data.begin(), frame.size, [&] { return any_byte(); });
    send(frame);
    expect(Counter::malformed_frames);
  } else {
    std::generate(request.begin(), request.end(), [&] { return any_byte(); });
    sdo(request, answer);
  }
  configure();
  send_all();
  end_tick(1);
}

void FaultCampaign::sdo_fuzzed() {
  std::array<std::uint8_t, 8> request{}, answer{};
  for (std::size_t i = 2 + random_() % 8; i > 0; --i) {
    const auto& entry = dictionary::entries[random_() % dictionary::entries.size()];
    std::generate(request.begin(), request.end(), [&] { return any_byte(); });
    constexpr std::array<std::uint8_t, 8> commands{0x20, 0x21, 0x23, 0x2F, 0x40, 0x60, 0x70, 0x00};
    request[0] =
        static_cast<std::uint8_t>(commands[random_() % commands.size()] | (random_() % 8 == 0 ? random_() % 32 : 0U));
    canopen::store<2>(&request[1], entry.index);
    request[3] = static_cast<std::uint8_t>(entry.sub_index + random_() % 3);
    sdo(request, answer);
  }
  configure();
  send_all();
  end_tick(1);
}

void FaultCampaign::bus_off() {
  node_.fall_off_the_bus();
  const std::uint32_t off = expected_[static_cast<std::size_t>(Counter::bus_offs)] + 1;
  master_.listen(quiet);
  start();  // counts anew from here
  expected_[static_cast<std::size_t>(Counter::bus_offs)] = off;
}

void FaultCampaign::reset() {
  const std::uint32_t resets = expected_[static_cast<std::size_t>(Counter::nmt_resets)] + 1;
  for (std::size_t j = 0; j < random_() % joints; ++j) send_setpoint(j, setpoints_[j]);
  const NmtCommand command = random_() % 2 == 0 ? NmtCommand::reset_node : NmtCommand::reset_communication;
  master_.command(command, id);
  master_.wait_for(id, NmtState::pre_operational, answer_time);
  configure();
  start();
  expected_[static_cast<std::size_t>(Counter::nmt_resets)] = resets;
}

void FaultCampaign::wrong_tables() {
  master_.emergencies.clear();
  node_.restart(false);
  master_.wait_for(id, NmtState::pre_operational, answer_time);
  const bool refused = master_.read(id, dictionary::tables, 3) == 0;
  master_.command(NmtCommand::start, id);
  master_.wait_for(id, NmtState::pre_operational, answer_time);
  const std::uint64_t torques = torques_seen_;
  send_all();
  send({.id = canopen::sync_id});
  master_.listen(quiet);
  const bool told = std::any_of(master_.emergencies.begin(), master_.emergencies.end(),
                                [](const can::Emergency& e) { return e.code == 0x6320; });
  if (!refused || !told || torques_seen_ != torques) {
    std::printf("FAILED: wrong tables: refused %d, told %d, torques %d\n", refused, told, torques_seen_ != torques);
    ++disagreements_;
  }
  node_.restart(true);
  master_.wait_for(id, NmtState::pre_operational, answer_time);
  configure();
  start();
}

void FaultCampaign::second_node() {
  const std::uint32_t collisions = expected_[static_cast<std::size_t>(Counter::id_collisions)] + 1;
  switch (random_() % 3) {
    case 0:
      send({.id = canopen::heartbeat_id + id, .size = 1, .data = {5}});
      break;
    case 1:
      send({.id = canopen::torque_id + 1 + static_cast<std::uint32_t>(any_joint()), .size = 8});
      break;
    default:
      send({.id = canopen::sdo_answer_id + id, .size = 8});
      break;
  }
  master_.listen(quiet);
  start();
  expected_[static_cast<std::size_t>(Counter::id_collisions)] = collisions;
}

bool FaultCampaign::report() const {
  std::printf("%-13s %8s %8s   recovery: p50, p99, max ms (most ticks)\n", "fault", "injected", "counted");
  std::uint64_t injected = 0, counted = 0;
  for (std::size_t i = 0; i < fault_kinds; ++i) {
    auto times = tallies_[i].recovery_ms;
    std::sort(times.begin(), times.end());
    const auto at = [&](double share) {
      return times.empty() ? 0. : times[static_cast<std::size_t>(share * static_cast<double>(times.size() - 1))];
    };
    std::printf("%-13s %8llu %8llu   %.2f %.2f %.2f (%llu)\n", name_of(static_cast<Fault>(i)),
                static_cast<unsigned long long>(tallies_[i].injected),
                static_cast<unsigned long long>(tallies_[i].counted), at(0.5), at(0.99), at(1),
                static_cast<unsigned long long>(tallies_[i].longest_ticks));
    injected += tallies_[i].injected;
    counted += tallies_[i].counted;
  }
  std::printf(
      "%llu events, %llu counted alike, %llu ticks, %llu torques, largest step %.3f of the ramp's, %llu larger\n",
      static_cast<unsigned long long>(injected), static_cast<unsigned long long>(counted),
      static_cast<unsigned long long>(ticks_), static_cast<unsigned long long>(torques_seen_), largest_step_share_,
      static_cast<unsigned long long>(large_steps_));
  return injected == counted && disagreements_ == 0 && large_steps_ == 0;
}

}  // namespace fxdyn::hil
