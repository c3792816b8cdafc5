#include "tests/hil/fault_campaign.hpp"

#include <algorithm>
#include <bit>
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
constexpr can::Duration start_time = std::chrono::seconds(30);  // of a process on a busy machine
constexpr can::Duration quiet = std::chrono::milliseconds(3);
constexpr std::uint32_t most_recovery_ticks = 4 * ramp_ticks;
/// What SYNC's period is told to be where the test has no business with it: it may take its time.
constexpr std::uint32_t patient_us = 1'000'000;

using Counts = std::array<std::uint32_t, dictionary::counters>;
/// What grows without any fault.
Counts faults_alone(Counts counts) {
  for (const Counter regular : {Counter::ticks, Counter::saturations, Counter::limited_steps})
    counts[static_cast<std::size_t>(regular)] = 0;
  return counts;
}

}  // namespace

const char* name_of(Fault fault) {
  constexpr std::array names{"drop",    "duplicate", "reorder",      "delay",      "late and lost", "truncate",
                             "flip",    "foreign",   "flood",        "SDO random", "SDO fuzzed",    "SYNC lost",
                             "bus-off", "reset",     "wrong tables", "second node"};
  static_assert(names.size() == fault_kinds);
  return names[static_cast<std::size_t>(fault)];
}

FaultCampaign::FaultCampaign(NodeUnderTest& node, unsigned seed, can::Duration period)
    : node_(node),
      master_(node.bus()),
      random_(seed),
      period_(period),
      own_period_(period.count() > 0 ? period : std::chrono::milliseconds(20)),
      motion_(tables::parameters, tick_s, seed) {
  master_.other = [this](const can::Frame& frame) { take(frame); };
  master_.sdo_timeout = answer_time;
}

void FaultCampaign::run(std::uint64_t events, double slow_share) {
  master_.wait_for(id, NmtState::pre_operational, start_time);
  configure();
  expected_ = read_counters();
  start();
  const auto each = std::max<std::uint64_t>(1, events / fault_kinds);
  std::vector<Fault> order;
  for (std::size_t kind = 0; kind < fault_kinds; ++kind) {
    const auto fault = static_cast<Fault>(kind);
    const double share = fault == Fault::wrong_tables ? slow_share : 1;
    const auto count = std::max<std::uint64_t>(1, static_cast<std::uint64_t>(static_cast<double>(each) * share));
    order.insert(order.end(), count, fault);
  }
  while (order.size() < events)
    order.push_back(static_cast<Fault>(random_() % static_cast<std::uint32_t>(Fault::bus_off)));
  std::shuffle(order.begin(), order.end(), random_);
  for (const Fault fault : order) inject(fault);
}

void FaultCampaign::configure() {
  master_.write(id, 0x1006, 0, patient_us, 4);
  master_.write(id, 0x1017, 0, 0, 2);
  master_.write(id, 0x1016, 1, 0, 4);
  master_.write(id, 0x1016, 2, 0, 4);
  master_.write(id, 0x1015, 0, 0, 2);  // every EMCY at once
  master_.write(id, 0x1029, 1, 1, 1);
  master_.write(id, 0x2010, 0, ramp_ticks, 2);
  master_.write(id, 0x2012, 0, dictionary::defaults::tolerated_ticks, 1);
  master_.write(id, 0x2013, 0, 1, 1);  // the motion's setpoints carry the tick's parity
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
  for (std::uint32_t i = 0; i < most_recovery_ticks; ++i) {
    good_tick();
    if (std::all_of(torques_.begin(), torques_.end(),
                    [](const auto& torque) { return torque && (torque->status & torque_status::ramping) == 0; }))
      break;
  }
}

/// The node forgets what it was told, its model starts anew, and its torque goes to zero without a frame.
void FaultCampaign::left_operation() {
  waiting_ = 0;
  stale_ = 0;
  has_last_ = false;
  state_ = {};
  ramped_unseen_.fill(true);
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
std::uint32_t FaultCampaign::implausible_setpoints() const {
  if (!has_last_) return 0;
  using N = Model::Numbers;
  std::uint32_t count = 0;
  for (std::size_t j = 0; j < joints; ++j) {
    const auto& limits = tables::parameters.constants[j].limits;
    const std::int64_t per_second = whole_share(limits.dq_lower.raw, limits.dq_upper.raw);
    const std::int64_t ticks_per_second = tables::parameters.ticks_per_second.raw;
    const std::int64_t most =
        ((per_second << (Position<N>::bits + 17 - Velocity<N>::bits)) / ticks_per_second + 1) * (stale_ + 1);
    count += std::abs(std::int64_t{arrived_[j].q} - last_[j].q) > most ? 1 : 0;
  }
  return count;
}

/// What the node makes of the setpoints that have arrived, at SYNC: true, they are one tick's.
bool FaultCampaign::accept() {
  constexpr std::uint32_t all = (1U << joints) - 1;
  if (waiting_ != all) {
    expect(Counter::missing_setpoints, static_cast<std::uint32_t>(std::popcount(all & ~waiting_)));
    return false;
  }
  const bool odd = arrived_[0].is_odd();
  if (std::any_of(arrived_.begin(), arrived_.end(), [&](const auto& setpoint) { return setpoint.is_odd() != odd; })) {
    expect(Counter::mixed_setpoints);
    return false;
  }
  const std::uint32_t implausible = implausible_setpoints();
  expect(Counter::implausible_setpoints, implausible);
  return implausible == 0;
}

void FaultCampaign::compute() {
  Model::Setpoints input;
  for (std::size_t j = 0; j < joints; ++j) {
    const auto i = static_cast<int>(j);
    const auto& limits = tables::parameters.constants[j].limits;
    input.q[i].raw = arrived_[j].q;
    input.dq[i].raw = from_share(arrived_[j].dq, whole_share(limits.dq_lower.raw, limits.dq_upper.raw));
    input.ddq[i].raw = from_share(arrived_[j].ddq, whole_share(limits.ddq_lower.raw, limits.ddq_upper.raw));
  }
  Saturations saturations;
  model_torques_ = Model::tick(tables::parameters, state_, input, saturations);
  expect(Counter::ticks);
  expect(Counter::saturations, saturations.count);
  last_ = arrived_;
  has_last_ = true;
  stale_ = 0;
}

/// After `tolerated` and a ramp of them the node forgets where it was.
void FaultCampaign::stale_tick() {
  expect(Counter::stale_ticks);
  if (++stale_ <= dictionary::defaults::tolerated_ticks + ramp_ticks) return;
  has_last_ = false;
  state_ = {};
}

/// SYNC, and the torques that have to come. What the node has to count follows from what has arrived.
void FaultCampaign::end_tick(bool sync) {
  ++ticks_;
  if (const can::Duration now = node_.bus().now(); now < next_tick_) master_.listen(next_tick_ - now);
  next_tick_ = node_.bus().now() + period_;
  torques_.fill(std::nullopt);
  tick_frames_ = 0;
  if (!sync) return;
  send({.id = canopen::sync_id});
  const bool fresh = accept();
  if (fresh)
    compute();
  else
    stale_tick();
  waiting_ = 0;
  can::Frame frame;
  const can::Duration end = node_.bus().now() + answer_time;
  while (tick_frames_ < joints && node_.bus().now() < end) {
    if (node_.bus().receive(frame, end - node_.bus().now())) master_.dispatch(frame);
  }
  check_torques(fresh);
}

/// Every torque has come, says whether the tick was fresh, and where it follows the model it is the model's of exactly
/// the setpoints of this tick: no half of an update got into it.
void FaultCampaign::check_torques(bool fresh) {
  for (std::size_t j = 0; j < joints; ++j) {
    if (!torques_[j]) {
      if (++missing_torques_ <= 10) std::printf("FAILED: no torque of joint %zu came at SYNC\n", j + 1);
      continue;
    }
    const std::uint8_t status = torques_[j]->status;
    const bool says_fresh = (status & torque_status::fresh) != 0;
    const bool follows = says_fresh && (status & (torque_status::ramping | torque_status::step_limited)) == 0;
    const std::int32_t model = to_milli<Torque<Model::Numbers>::bits>(model_torques_[static_cast<int>(j)].raw);
    if (says_fresh == fresh && (!follows || torques_[j]->milli == model)) continue;
    if (++wrong_torques_ <= 10)
      std::printf("FAILED: joint %zu: status %02x of a %s tick, %d mN m, the model's %d\n", j + 1, status,
                  fresh ? "fresh" : "stale", torques_[j]->milli, model);
  }
}

void FaultCampaign::good_tick() {
  setpoints_ = motion_.next();
  send_all();
  end_tick(true);
}

/// A torque: no step from one tick of the node to the next larger than the slope (1 for the rounding to thousandths).
/// Out of operation the node goes on ramping without counting ticks: there the time that passed tells how many there
/// were.
void FaultCampaign::take(const can::Frame& frame) {
  if (frame.id == canopen::sdo_answer_id + id) {
    sdo_answer_ = frame;
    return;
  }
  const std::uint32_t j = frame.id - canopen::torque_id - 1;
  if (j >= joints || frame.size != WireTorque::bytes) return;
  const WireTorque torque = WireTorque::load(frame.data.data());
  const can::Duration now = node_.bus().now();
  ++torques_seen_;
  ++tick_frames_;
  torques_[j] = torque;
  std::int64_t ticks = static_cast<std::uint8_t>(torque.tick - last_tick_[j]);
  if (ramped_unseen_[j])
    ticks += std::chrono::duration_cast<std::chrono::milliseconds>(now - last_time_[j]).count() / 2 + 1;
  const std::int64_t step = std::abs(std::int64_t{torque.milli} - last_milli_[j]);
  const std::int64_t most = std::int64_t{step_milli_[j] + 1} * ticks + 1;
  if (step > most && ++large_steps_ <= 10)
    std::printf("FAILED: torque of joint %u steps by %lld mN m in %lld ticks\n", j + 1, static_cast<long long>(step),
                static_cast<long long>(ticks));
  largest_step_share_ = std::max(largest_step_share_, static_cast<double>(step) / static_cast<double>(most));
  ramped_unseen_[j] = false;
  last_milli_[j] = torque.milli;
  last_tick_[j] = torque.tick;
  last_time_[j] = now;
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
  const Counts before = expected_;
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
    case Fault::late_lost:
      late_lost();
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
    case Fault::sync_lost:
      sync_lost();
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
  // How often 0x2011 held a torque back depends on the torque to a unit, which a ramp out of operation leaves unknown.
  constexpr auto limited = static_cast<std::size_t>(Counter::limited_steps);
  expected_[limited] = counted_[limited];
  if (counted_ == expected_) {
    const bool to_be_seen = fault == Fault::wrong_tables || faults_alone(expected_) != faults_alone(before);
    ++(to_be_seen ? tally.counted : tally.invisible);
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
    end_tick(true);
    setpoints_ = motion_.next();
  }
  const std::size_t which = random_() % (joints + 1);
  for (std::size_t j = 0; j < joints; ++j) {
    if (j != which) send_setpoint(j, setpoints_[j]);
  }
  end_tick(which != joints);  // without SYNC there is no tick, and the setpoints are still waiting
}

void FaultCampaign::duplicate() {
  const std::size_t which = random_() % (joints + 1);
  send_all();
  if (which < joints) send_setpoint(which, setpoints_[which]);
  end_tick(true);
  if (which == joints) end_tick(true);
}

void FaultCampaign::reorder() {
  const std::size_t which = any_joint();
  for (std::size_t j = 0; j < joints; ++j) {
    if (j != which) send_setpoint(j, setpoints_[j]);
  }
  end_tick(true);
  send_setpoint(which, setpoints_[which]);
}

void FaultCampaign::delay() {
  const std::size_t which = any_joint();
  const WireSetpoint late = setpoints_[which];
  for (std::size_t j = 0; j < joints; ++j) {
    if (j != which) send_setpoint(j, setpoints_[j]);
  }
  end_tick(true);
  for (std::size_t ticks = random_() % 3; ticks > 0; --ticks) good_tick();
  send_setpoint(which, late);  // the next tick's comes behind it
}

/// The late one completes a tick that is not its own, and nothing in the frames says so but their parity.
void FaultCampaign::late_lost() {
  const std::size_t which = any_joint();
  const WireSetpoint late = setpoints_[which];
  for (std::size_t j = 0; j < joints; ++j) {
    if (j != which) send_setpoint(j, setpoints_[j]);
  }
  end_tick(true);
  setpoints_ = motion_.next();
  send_setpoint(which, late);
  for (std::size_t j = 0; j < joints; ++j) {
    if (j != which) send_setpoint(j, setpoints_[j]);
  }
  end_tick(true);
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
  end_tick(true);
}

void FaultCampaign::flip() {
  const std::size_t which = any_joint();
  std::array<std::uint8_t, 8> bytes{};
  setpoints_[which].store(bytes.data());
  const std::uint32_t bit = random_() % 64;
  bytes[bit / 8] = static_cast<std::uint8_t>(bytes[bit / 8] ^ 1U << bit % 8);
  setpoints_[which] = WireSetpoint::load(bytes.data());
  send_all();
  end_tick(true);
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
  end_tick(true);
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
  end_tick(true);
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
  end_tick(true);
}

/// The node's own timer: stale ticks 1.5 periods after the last SYNC, and every period from there until the torque has
/// been zero long enough. How many there were, their torques say.
void FaultCampaign::sync_lost() {
  if (random_() % 2 == 0) send_all();  // of a tick that never comes
  const std::uint8_t before = last_tick_[0];
  const auto period_us = static_cast<std::uint32_t>(own_period_ / std::chrono::microseconds(1));
  const std::int64_t most = dictionary::defaults::tolerated_ticks + ramp_ticks + 1 - std::int64_t{stale_};
  const can::Duration away = own_period_ * (1 + random_() % 60);
  const can::Duration begin = node_.bus().now();
  master_.write(id, 0x1006, 0, period_us, 4);  // from here on it counts
  master_.listen(away);
  master_.write(id, 0x1006, 0, patient_us, 4);
  // ticks of its own come no faster than the tables' tick
  const auto longest = std::chrono::duration_cast<std::chrono::milliseconds>(node_.bus().now() - begin).count() / 2;
  const auto own_ticks = static_cast<std::uint8_t>(last_tick_[0] - before);
  for (std::uint32_t i = 0; i < own_ticks; ++i) stale_tick();
  expect(Counter::overdue_syncs, own_ticks);
  if (own_ticks > 0) {
    waiting_ = 0;
  }
  // In memory time is exact; a process may be kept waiting, and does what is due when it runs again.
  const std::int64_t least = period_.count() > 0 ? std::min<std::int64_t>(away / own_period_ - 1, most) : 0;
  if (own_ticks < least || own_ticks > std::min(longest, most)) {
    std::printf("FAILED: SYNC lost for %lld ticks: %u ticks of the node's own\n", static_cast<long long>(longest),
                own_ticks);
    ++disagreements_;
  }
}

void FaultCampaign::bus_off() {
  node_.fall_off_the_bus();
  expect(Counter::bus_offs);
  master_.listen(quiet);
}

void FaultCampaign::reset() {
  for (std::size_t j = random_() % joints; j > 0; --j) send_setpoint(j, setpoints_[j]);
  const NmtCommand command = random_() % 2 == 0 ? NmtCommand::reset_node : NmtCommand::reset_communication;
  master_.command(command, id);
  master_.wait_for(id, NmtState::pre_operational, answer_time);
  expect(Counter::nmt_resets);
  left_operation();
  configure();
  start();
}

void FaultCampaign::wrong_tables() {
  master_.emergencies.clear();
  node_.restart(false);
  master_.wait_for(id, NmtState::pre_operational, start_time);
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
  master_.wait_for(id, NmtState::pre_operational, start_time);
  // From power-on: nothing counted, and a torque of zero, whatever it was before.
  left_operation();
  expected_.fill(0);
  last_milli_.fill(0);
  last_tick_.fill(0);
  ramped_unseen_.fill(false);
  configure();
  start();
}

void FaultCampaign::second_node() {
  expect(Counter::id_collisions);
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
  left_operation();
  start();
}

bool FaultCampaign::report() const {
  std::printf("%-13s %8s %8s %9s   recovery: p50, p99, max ms (most ticks)\n", "fault", "injected", "counted",
              "invisible");
  Tally all;
  for (std::size_t i = 0; i < fault_kinds; ++i) {
    auto times = tallies_[i].recovery_ms;
    std::sort(times.begin(), times.end());
    const auto at = [&](double share) {
      return times.empty() ? 0. : times[static_cast<std::size_t>(share * static_cast<double>(times.size() - 1))];
    };
    const auto number = [](std::uint64_t x) { return static_cast<unsigned long long>(x); };
    std::printf("%-13s %8llu %8llu %9llu   %.2f %.2f %.2f (%llu)\n", name_of(static_cast<Fault>(i)),
                number(tallies_[i].injected), number(tallies_[i].counted), number(tallies_[i].invisible), at(0.5),
                at(0.99), at(1), number(tallies_[i].longest_ticks));
    all.injected += tallies_[i].injected;
    all.counted += tallies_[i].counted;
    all.invisible += tallies_[i].invisible;
  }
  std::printf(
      "%llu events, %llu counted alike, %llu invisible, %llu ticks, %llu torques, %llu missing, %llu wrong, largest "
      "step "
      "%.3f of the ramp's, %llu larger\n",
      static_cast<unsigned long long>(all.injected), static_cast<unsigned long long>(all.counted),
      static_cast<unsigned long long>(all.invisible), static_cast<unsigned long long>(ticks_),
      static_cast<unsigned long long>(torques_seen_), static_cast<unsigned long long>(missing_torques_),
      static_cast<unsigned long long>(wrong_torques_), largest_step_share_,
      static_cast<unsigned long long>(large_steps_));
  return all.injected == all.counted + all.invisible && disagreements_ == 0 && large_steps_ == 0 &&
         missing_torques_ == 0 && wrong_torques_ == 0;
}

}  // namespace fxdyn::hil
