#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <initializer_list>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "firmware/drive_node.hpp"
#include "hal/fake/can.hpp"
#include "hal/fake/clock.hpp"
#include "hal/fake/gpio.hpp"

#ifndef FXDYN_TABLES_HEADER
#define FXDYN_TABLES_HEADER "tests/golden/tables.hpp"
#endif
#include FXDYN_TABLES_HEADER

// Drive nodes of a golden model's robot on a bus in memory, and a host that talks to them. A test of every golden model
// is one source compiled with the tables of each (fxdyn_golden_test).

namespace fxdyn::test {

using Robot = tables::Model;
inline constexpr std::size_t robot_joints = Robot::joints;
inline constexpr std::array<std::int32_t, robot_joints> rated = tables::rated_torque;

// --- one joint of the robot ------------------------------------------------------------------------------------------

template <class Model, std::size_t joint>
struct OneJoint;
/// The model that a drive of joint `joint` alone computes: the other joints have no effects, as the export leaves them
/// out, unless they deflect, which moves this one's link.
template <class N, std::uint32_t outputs, class... Joints, std::size_t joint>
struct OneJoint<RobotModel<N, outputs, Joints...>, joint> {
  using Whole = RobotModel<N, outputs, Joints...>;
  template <std::size_t i>
  static constexpr bool keeps_effects = i == joint || Whole::deflects;
  template <class Indices>
  struct Make;
  template <std::size_t... i>
  struct Make<std::index_sequence<i...>> {
    using type = RobotModel<N, 1U << joint,
                            std::conditional_t<keeps_effects<i>, Joints, JointModel<typename Joints::LinkShape>>...>;
  };
  using type = typename Make<std::index_sequence_for<Joints...>>::type;

  static constexpr typename type::Parameters parameters(const typename Whole::Parameters& whole) {
    typename type::Parameters one{whole.up, whole.ticks_per_second, whole.geometry, whole.inertia, whole.constants, {}};
    constexpr std::array<std::size_t, sizeof...(Joints)> words{Joints::words...};
    std::size_t at = 0;
    for (std::size_t j = 0; j < joint && !Whole::deflects; ++j) at += words[j];
    std::copy_n(whole.words.begin() + static_cast<std::ptrdiff_t>(at), one.words.size(), one.words.begin());
    return one;
  }
};

// --- a node and its hardware -----------------------------------------------------------------------------------------

template <class Frame, class Model>
struct NodeOnWire {
  using Bus = hal::fake::CanController<Frame>;
  using Hardware = DriveHardware<Bus, hal::fake::Clock, hal::fake::CycleCounter, hal::fake::Watchdog,
                                 hal::fake::InputPin, hal::fake::OutputPin, hal::fake::OutputPin>;
  static constexpr std::uint32_t watchdog_us = 50'000;

  NodeOnWire(hal::fake::CanWire<Frame>& wire, hal::fake::Clock& clock, const typename Model::Parameters& parameters,
             NodeSettings settings = {.board = "bench"}, bool valid = true, UpdateSlot update = UpdateSlot::empty)
      : bus(wire),
        watchdog(clock, watchdog_us),
        hardware{bus, clock, counter, watchdog, enable, fault, tick_busy},
        node(hardware,
             {parameters, {table_magic, Model::layout_hash(), 0, 0x1234'5678, 0, 5}, valid, update, rated_torques},
             settings) {}

  static constexpr RatedTorques<Model> rated_torques{rated};
  Bus bus;
  hal::fake::CycleCounter counter;
  hal::fake::Watchdog watchdog;
  hal::fake::InputPin enable{true};
  hal::fake::OutputPin fault, tick_busy;
  Hardware hardware;
  DriveNode<Model, Hardware> node;
};

using Bytes = std::vector<std::uint8_t>;

/// One node and a host on one wire.
template <class Frame_ = hal::ClassicFrame, class Model_ = Robot>
class Bench {
 public:
  using Frame = Frame_;
  using Model = Model_;
  static constexpr std::size_t joints = Model::joints, outputs = Model::outputs;

  explicit Bench(NodeSettings settings = {.board = "bench"}, bool valid = true,
                 const typename Model::Parameters& parameters = tables::page.parameters,
                 UpdateSlot update = UpdateSlot::empty)
      : on_wire(wire, clock, parameters, settings, valid, update) {}

  hal::fake::Clock clock;
  hal::fake::CanWire<Frame> wire{clock};
  hal::fake::CanController<Frame> host{wire};
  NodeOnWire<Frame, Model> on_wire;
  decltype(on_wire.node)& node = on_wire.node;

  void poll() {
    for (int i = 0; node.poll(); ++i) ASSERT_LT(i, 10'000) << "the node never rests";
  }
  /// Lets time pass, as a board that sleeps as long as it may.
  void pass(std::uint64_t us) {
    while (us > 0) {
      const std::uint64_t step = std::min<std::uint64_t>(us, node.longest_sleep_us);
      clock.advance(step);
      us -= step;
      poll();
    }
  }

  static Frame frame(std::uint32_t id, const Bytes& bytes) {
    Frame f;
    f.id = id;
    f.size = static_cast<std::uint8_t>(bytes.size());
    std::copy(bytes.begin(), bytes.end(), f.data.begin());
    return f;
  }
  void send(std::uint32_t id, const Bytes& bytes) { send(frame(id, bytes)); }
  void send(const Frame& f) { ASSERT_EQ(host.send(f), hal::Status::ok); }
  /// What the node has said since this was last asked.
  std::vector<Frame> heard() {
    std::vector<Frame> frames;
    for (Frame f; host.receive(f) == hal::Status::ok;) frames.push_back(f);
    return frames;
  }
  /// The same, of one identifier.
  std::vector<Bytes> heard(std::uint32_t id) {
    std::vector<Bytes> data;
    for (const Frame& f : heard()) {
      if (f.id == id) data.emplace_back(f.data.begin(), f.data.begin() + f.size);
    }
    return data;
  }

  void nmt(canopen::NmtCommand command, std::uint8_t node_id = 0) {
    send(canopen::nmt_id, {static_cast<std::uint8_t>(command), node_id});
    poll();
  }
  /// Pre-operational with boot-up told, then operational.
  void start() {
    poll();
    nmt(canopen::NmtCommand::start);
    ASSERT_EQ(node.state(), canopen::NmtState::operational);
    heard();
  }

  std::uint32_t counted(dictionary::Counter counter) const { return node.counted(counter); }
  /// Emergencies since last asked: their codes.
  std::vector<std::uint16_t> emergencies() {
    std::vector<std::uint16_t> codes;
    for (const Bytes& data : heard(canopen::emergency_id + node.id()))
      codes.push_back(static_cast<std::uint16_t>(canopen::load<2>(data.data())));
    return codes;
  }

  // --- SDO, as a client ------------------------------------------------------------------------------------------

  Bytes request(const Bytes& bytes) {
    heard();
    send(canopen::sdo_request_id + node.id(), bytes);
    poll();
    const auto answers = heard(canopen::sdo_answer_id + node.id());
    return answers.size() == 1 ? answers[0] : Bytes{};
  }
  static Bytes initiate(std::uint8_t command, std::uint32_t index, std::uint8_t sub, std::uint32_t value = 0) {
    Bytes bytes(8);
    bytes[0] = command;
    canopen::store<2>(&bytes[1], index);
    bytes[3] = sub;
    canopen::store<4>(&bytes[4], value);
    return bytes;
  }
  using Result = std::variant<Bytes, canopen::Abort>;
  static std::optional<canopen::Abort> abort_of(const Bytes& answer) {
    if (answer.size() != 8 || answer[0] != 0x80) return std::nullopt;
    return static_cast<canopen::Abort>(canopen::load<4>(&answer[4]));
  }

  Result upload(std::uint32_t index, std::uint8_t sub) {
    Bytes answer = request(initiate(0x40, index, sub));
    if (const auto abort = abort_of(answer)) return *abort;
    if (answer.size() != 8) return canopen::Abort::timed_out;
    EXPECT_EQ(canopen::load<2>(&answer[1]), index);
    EXPECT_EQ(answer[3], sub);
    if ((answer[0] & 0x02) != 0) return Bytes(answer.begin() + 4, answer.begin() + 8 - (answer[0] >> 2 & 3));
    const std::uint32_t size = canopen::load<4>(&answer[4]);
    Bytes data;
    for (std::uint8_t toggle = 0;; toggle ^= 0x10) {
      answer = request({static_cast<std::uint8_t>(0x60 | toggle), 0, 0, 0, 0, 0, 0, 0});
      if (const auto abort = abort_of(answer)) return *abort;
      if (answer.size() != 8) return canopen::Abort::timed_out;
      EXPECT_EQ(answer[0] & 0x10, toggle);
      data.insert(data.end(), answer.begin() + 1, answer.begin() + 8 - (answer[0] >> 1 & 7));
      if ((answer[0] & 1) != 0) break;
    }
    EXPECT_EQ(data.size(), size);
    return data;
  }
  /// The number in an object; a test fails where there is none.
  std::uint32_t read(std::uint32_t index, std::uint8_t sub = 0) {
    const Result result = upload(index, sub);
    if (!std::holds_alternative<Bytes>(result)) {
      ADD_FAILURE() << std::hex << index << ":" << int{sub} << " aborts with "
                    << static_cast<std::uint32_t>(std::get<canopen::Abort>(result));
      return 0;
    }
    Bytes bytes = std::get<Bytes>(result);
    bytes.resize(4);
    return canopen::load<4>(bytes.data());
  }
  std::string text(std::uint32_t index, std::uint8_t sub = 0) {
    const Result result = upload(index, sub);
    return std::holds_alternative<Bytes>(result)
               ? std::string(std::get<Bytes>(result).begin(), std::get<Bytes>(result).end())
               : "(abort)";
  }
  /// Expedited download.
  canopen::Abort write(std::uint32_t index, std::uint8_t sub, std::uint32_t value, std::size_t bytes) {
    const Bytes answer = request(initiate(static_cast<std::uint8_t>(0x23 | (4 - bytes) << 2), index, sub, value));
    if (const auto abort = abort_of(answer)) return *abort;
    if (answer.size() != 8 || answer[0] != 0x60) return canopen::Abort::timed_out;
    return canopen::Abort::none;
  }
  canopen::Abort write_segments(std::uint32_t index, std::uint8_t sub, const Bytes& data, bool tell_size = true) {
    Bytes answer = request(initiate(tell_size ? 0x21 : 0x20, index, sub, static_cast<std::uint32_t>(data.size())));
    if (const auto abort = abort_of(answer)) return *abort;
    std::size_t at = 0;
    for (std::uint8_t toggle = 0;; toggle ^= 0x10) {
      const std::size_t count = std::min<std::size_t>(7, data.size() - at);
      const bool last = at + count == data.size();
      Bytes segment(8);
      segment[0] = static_cast<std::uint8_t>(toggle | (7 - count) << 1 | (last ? 1 : 0));
      std::copy_n(data.begin() + static_cast<std::ptrdiff_t>(at), count, segment.begin() + 1);
      at += count;
      answer = request(segment);
      if (const auto abort = abort_of(answer)) return *abort;
      if (answer.size() != 8 || answer[0] != (0x20 | toggle)) return canopen::Abort::timed_out;
      if (last) return canopen::Abort::none;
    }
  }

  // --- ticks -----------------------------------------------------------------------------------------------------

  using Setpoints = std::array<WireSetpoint, joints>;
  static Bytes bytes_of(const WireSetpoint& setpoint) {
    Bytes bytes(8);
    setpoint.store(bytes.data());
    return bytes;
  }
  void send_setpoint(std::size_t j, const WireSetpoint& setpoint) {
    send(canopen::setpoint_id + static_cast<std::uint32_t>(j) + 1, bytes_of(setpoint));
  }
  void send_setpoints(const Setpoints& setpoints) {
    for (std::size_t j = 0; j < joints; ++j) send_setpoint(j, setpoints[j]);
  }
  void sync() {
    send(canopen::sync_id, {});
    poll();
  }
  /// The torques that were sent since last asked, in the order of their identifiers; every other frame is dropped.
  std::vector<WireTorque> torques() {
    std::vector<std::pair<std::uint32_t, WireTorque>> found;
    for (const Frame& f : heard()) {
      if (f.id > canopen::torque_id && f.id <= canopen::torque_id + joints && f.size == 8)
        found.emplace_back(f.id, WireTorque::load(f.data.data()));
    }
    std::vector<WireTorque> torques;
    for (const auto& [id, torque] : found) torques.push_back(torque);
    return torques;
  }
  /// Setpoints, SYNC, torques; then the rest of the 2 ms.
  std::vector<WireTorque> tick(const Setpoints& setpoints) {
    send_setpoints(setpoints);
    sync();
    auto answer = torques();
    pass(2000);
    return answer;
  }
  std::vector<WireTorque> tick_without_setpoints() {
    sync();
    auto answer = torques();
    pass(2000);
    return answer;
  }
};

/// Setpoints of tick `k` of a smooth motion at up to 80 % of every limit.
inline std::array<WireSetpoint, robot_joints> motion(std::size_t k) {
  using N = Robot::Numbers;
  const double t = 0.002 * static_cast<double>(k);
  std::array<WireSetpoint, robot_joints> wire;
  for (std::size_t j = 0; j < robot_joints; ++j) {
    const auto& limits = tables::page.parameters.constants[j].limits;
    const double dq = std::ldexp(limits.dq_upper.raw, -Velocity<N>::bits);
    const double ddq = std::ldexp(limits.ddq_upper.raw, -Acceleration<N>::bits);
    const double lower = std::ldexp(limits.q_lower.raw, -Position<N>::bits);
    const double upper = std::ldexp(limits.q_upper.raw, -Position<N>::bits);
    const double w = 3.0 + static_cast<double>(j);
    const double a = 0.8 * std::min({dq / w, ddq / (w * w), (upper - lower) / 2});
    const double phase = w * t + static_cast<double>(j);
    wire[j].q = static_cast<std::int32_t>(
        std::lround(std::ldexp((lower + upper) / 2 + a * std::sin(phase), Position<N>::bits)));
    wire[j].dq = static_cast<std::int16_t>(std::lround(32768 * a * w * std::cos(phase) / dq));
    wire[j].ddq = static_cast<std::int16_t>(std::lround(-32768 * a * w * w * std::sin(phase) / ddq));
  }
  return wire;
}

/// What the node must compute from setpoints on the wire, tick by tick: the model itself.
class Reference {
 public:
  Robot::Torques tick(const std::array<WireSetpoint, robot_joints>& wire) {
    Robot::Setpoints setpoints;
    for (std::size_t j = 0; j < robot_joints; ++j) {
      const auto& limits = tables::page.parameters.constants[j].limits;
      const auto i = static_cast<int>(j);
      setpoints.q[i].raw = wire[j].q;
      setpoints.dq[i].raw = from_share(wire[j].dq, limits.dq_upper.raw);
      setpoints.ddq[i].raw = from_share(wire[j].ddq, limits.ddq_upper.raw);
    }
    return Robot::tick(tables::page.parameters, state_, setpoints, saturations);
  }
  Saturations saturations;

 private:
  Robot::State state_{};
};

/// A torque as it stands in the frame.
inline std::pair<std::int16_t, std::int32_t> on_wire(std::int32_t raw, std::size_t joint) {
  constexpr int bits = Torque<Robot::Numbers>::bits;
  return {to_per_mille(raw, TorqueScale::of(bits, rated[joint])), to_milli<bits>(raw)};
}

}  // namespace fxdyn::test
