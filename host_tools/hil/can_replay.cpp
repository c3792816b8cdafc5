#include "host_tools/hil/can_replay.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <utility>

#include "firmware/protocol/object_dictionary.hpp"
#include "host_tools/can/guard.hpp"
#include "host_tools/effects/model_parts.hpp"
#include "host_tools/support/error.hpp"
#include "model/table_page.hpp"

namespace fxdyn {
namespace {

using nlohmann::json;
using namespace std::chrono_literals;

/// In lockstep a tick takes as long as it takes: SYNC counts as overdue later than the torques are given up, so that a
/// slow host never makes a node's own timer tick in between.
constexpr std::chrono::milliseconds patience = 6s;
constexpr can::Duration torque_time = 5s;
constexpr can::Duration answer_time = 500ms, start_time = 10s;

}  // namespace

CanDrives::CanDrives(can::Bus& bus, const IdentifiedModel& model, const Settings& settings)
    : master_(bus), model_(model), fixed_(model, formats_of(model)), fd_(settings.fd), heartbeat_of_(settings.master) {
  const std::size_t n = robot_of(model).size();
  std::vector<std::uint8_t> ids = settings.nodes;
  if (ids.empty()) {
    for (std::size_t id = 1; id <= n; ++id) ids.push_back(static_cast<std::uint8_t>(id));
  }
  const auto usual_timeout = master_.sdo_timeout;
  master_.sdo_timeout = answer_time;
  std::uint32_t driven = 0;
  for (const std::uint8_t id : ids) {
    Node node{.id = id};
    try {
      static_cast<void>(master_.read(id, 0x1000, 0));
    } catch (const can::SdoAbort&) {
      // It is there.
    } catch (const can::NodeError&) {
      if (!settings.nodes.empty()) no_answer(fmt::format("node {} does not answer", id));
      continue;
    }
    identify(node);
    check(node);
    if ((driven & node.outputs) != 0)
      throw InputError(fmt::format(
          "node {} puts out a joint that another node puts out: give each drive an image of its own "
          "([target] joints in the project, then toolchains/build_node.sh DIR/joint_N/tables.hpp OUT BOARD)",
          id));
    driven |= node.outputs;
    nodes_.push_back(std::move(node));
  }
  master_.sdo_timeout = usual_timeout;
  if (nodes_.empty()) no_answer(fmt::format("no node answers to SDO (ids {})", fmt::join(ids, ", ")));
  for (std::size_t j = 0; j < n; ++j) {
    if ((driven >> j & 1U) == 0)
      throw InputError(
          fmt::format("no node puts out joint {} ({}): is its drive on the bus? `candump {},700:780` shows "
                      "who is; other ids: --nodes",
                      j + 1, robot_of(model).joints[j].name, bus.name()));
  }
  joints_.resize(n);
  for (std::size_t j = 0; j < n; ++j) {
    const auto sub = static_cast<std::uint8_t>(j + 1);
    const std::uint8_t id = nodes_.front().id;
    Joint& joint = joints_[j];
    joint.velocity = static_cast<std::int32_t>(master_.read(id, 0x2021, sub));
    joint.acceleration = static_cast<std::int32_t>(master_.read(id, 0x2022, sub));
    const Formats& formats = fixed_.formats();
    joint.highest = to_raw(joints_of(model)[j].tau_limit, formats[Quantity::torque]);
    joint.lowest = -joint.highest;
    joint.per_mille =
        TorqueScale::of(formats[Quantity::torque], static_cast<std::int32_t>(master_.read(id, 0x2040, sub)));
  }
}

CanDrives::~CanDrives() {
  try {
    stop();
  } catch (const std::exception&) {
    // The bus is gone: the nodes see that themselves.
  }
}

void CanDrives::stop() {
  if (!std::exchange(runs_, false)) return;
  for (const Node& node : nodes_) master_.command(canopen::NmtCommand::enter_pre_operational, node.id);
}

std::vector<std::uint8_t> CanDrives::nodes() const {
  std::vector<std::uint8_t> ids;
  for (const Node& node : nodes_) ids.push_back(node.id);
  return ids;
}

/// An error passive controller hears nobody, since it runs at another bit rate or is alone.
void CanDrives::no_answer(const std::string& who) {
  can::Bus& bus = master_.bus();
  if (const std::string trouble = bus.trouble(); !trouble.empty()) throw InputError(who + ": " + trouble);
  throw InputError(
      fmt::format("{}: check power, termination, bit rate (`ip -details link show {}`) and id (`candump {},700:780` "
                  "shows who is there; --nodes takes other ids)",
                  who, bus.name(), bus.name()));
}

void CanDrives::identify(Node& node) {
  if (master_.read(node.id, 0x1018, 2) != dictionary::product_code)
    throw InputError(
        fmt::format("node {} is no fxdyn drive node (product code {:08x}): name those that are with --nodes", node.id,
                    master_.read(node.id, 0x1018, 2)));
  node.board = master_.read_text(node.id, 0x1009, 0);
  node.version = master_.read_text(node.id, 0x100A, 0);
  node.crc = master_.read(node.id, dictionary::tables, 1);
  node.outputs = master_.read(node.id, dictionary::tables, 5);
}

void CanDrives::check(const Node& node) {
  // what programs image and tables, and what programs tables alone
  constexpr const char* image =
      "cmake --preset BOARD -DFXDYN_TABLES=$PWD/DIR/tables.hpp && cmake --build --preset BOARD --target flash (Linux: "
      "toolchains/build_node.sh DIR/tables.hpp OUT)";
  constexpr const char* page =
      "cmake --build --preset BOARD --target flash-tables (Linux: fxdyn_node --tables DIR/tables.bin)";
  const std::uint32_t layout = master_.read(node.id, dictionary::tables, 2);
  const std::uint32_t all = all_joints(model_);
  if (master_.read(node.id, dictionary::tables, 3) == 0)
    throw InputError(fmt::format("node {}: its tables are damaged (CRC): flash them again, {}", node.id, page));
  if (const std::uint32_t joints = master_.read(node.id, dictionary::tables, 4);
      joints != robot_of(model_).size() || (node.outputs & ~all) != 0)
    throw InputError(fmt::format("node {}: its image is for a robot of {} joints, the model has {}: {}", node.id,
                                 joints, robot_of(model_).size(), image));
  // Its page may be that of its own joints, or the whole robot's of which it puts out some (fxdyn_node --joint).
  const FixedModel own(model_, formats_of(model_), node.outputs), whole(model_, formats_of(model_), all);
  const bool is_own = layout == own.layout_hash();
  if (!is_own && layout != whole.layout_hash())
    throw InputError(fmt::format("node {}: its image was built for another model (layout {:08x}, expected {:08x}): {}",
                                 node.id, layout, own.layout_hash(), image));
  const std::uint32_t crc = (is_own ? own : whole).crc();
  if (node.crc == crc) return;
  const auto slot = static_cast<UpdateSlot>(
      std::min(master_.read(node.id, dictionary::tables, 8), static_cast<std::uint32_t>(UpdateSlot::unreadable)));
  if (is_refused(slot))
    throw InputError(fmt::format("node {}: refuses the page in its slot for updates, which is {}: {}", node.id,
                                 name_of(slot), slot >= UpdateSlot::damaged ? page : image));
  throw InputError(
      fmt::format("node {}: holds other tables (CRC {:08x}, expected {:08x}): {}", node.id, node.crc, crc, page));
}

void CanDrives::restart() {
  if (lockstep_) lost_ += lockstep_->statistics().missing + lockstep_->statistics().late;
  runs_ = true;
  for (const Node& node : nodes_) {
    master_.reset(node.id, start_time);
    wait_for_zero_torque(node);
    master_.use_lockstep(node.id, patience);
    if (heartbeat_of_ != 0)
      master_.write(node.id, 0x1016, 1, std::uint32_t{heartbeat_of_} << 16 | can::Guard::consumer_ms, 4);
    master_.write(node.id, 0x2013, 0, 1, 1);
    if (fd_) use_fd(node);
  }
  const auto ramp = static_cast<std::int32_t>(master_.read(nodes_.front().id, 0x2010, 0));
  for (Joint& joint : joints_) {
    const std::int32_t limit = std::max({-joint.lowest, joint.highest, std::int32_t{1}});
    joint.steps = {.ramp = ramp > 0 ? (limit - 1) / ramp + 1 : limit, .following = limit};
    joint.output = {};
  }
  for (const Node& node : nodes_) {
    master_.command(canopen::NmtCommand::start, node.id);
    master_.wait_for(node.id, canopen::NmtState::operational, start_time);
  }
  fixed_.reset();
  since_restart_ = 0;
  lockstep_ = std::make_unique<can::Lockstep>(
      master_, can::Lockstep::Options{.joints = joints_.size(), .expect = {}, .fd = fd_, .timeout = torque_time});
}

void CanDrives::use_fd(const Node& node) {
  try {
    master_.write(node.id, 0x2030, 0, 1, 1);
  } catch (const can::SdoAbort&) {
    throw InputError(
        fmt::format("node {} has no CAN FD: replay without --fd (Linux: start it with fxdyn_node --fd)", node.id));
  }
}

/// A reset takes the torque to zero by its ramp: what is left of it would be the next run's first torque.
void CanDrives::wait_for_zero_torque(const Node& node) {
  const can::Duration end = master_.bus().now() + start_time;
  for (std::size_t j = 0; j < joints_.size(); ++j) {
    if ((node.outputs >> j & 1U) == 0) continue;
    while (master_.read(node.id, 0x2111, static_cast<std::uint8_t>(j + 1)) != 0) {
      if (master_.bus().now() > end)
        throw can::NodeError(
            fmt::format("node {}: the torque of joint {} does not go to zero after a reset", node.id, j + 1));
    }
  }
  // Less than half a mN m may be left, for one more tick of the node.
  master_.listen(10ms);
}

CanDrives::Tick CanDrives::tick(const Eigen::VectorXd& q, const Eigen::VectorXd& dq, const Eigen::VectorXd& ddq) {
  const Formats& formats = fixed_.formats();
  std::vector<WireSetpoint> wire(joints_.size());
  std::vector<std::int32_t> words;
  for (std::size_t j = 0; j < joints_.size(); ++j) {
    const auto i = static_cast<Eigen::Index>(j);
    const Joint& joint = joints_[j];
    wire[j] = {to_raw(q[i], formats[Quantity::position]),
               to_share(to_raw(dq[i], formats[Quantity::velocity]), joint.velocity),
               to_share(to_raw(ddq[i], formats[Quantity::acceleration]), joint.acceleration)};
    wire[j].of_tick(since_restart_ % 2 != 0);
    words.insert(words.end(),
                 {wire[j].q, from_share(wire[j].dq, joint.velocity), from_share(wire[j].ddq, joint.acceleration)});
  }
  Saturations ignored;
  const std::vector<std::int32_t> model = fixed_.tick(words, ignored);
  const can::Duration begin = master_.bus().now();
  const auto& torques = lockstep_->tick(wire);
  const can::Duration took = master_.bus().now() - begin;
  round_trips_.add(took);
  busy_s_ += std::chrono::duration<double>(took).count();

  Tick out;
  out.equal = true;
  bool enabled = true;
  for (std::size_t j = 0; j < joints_.size(); ++j) {
    Joint& joint = joints_[j];
    std::uint8_t status = torque_status::fresh | torque_status::enabled;
    if (joint.output.follow(model[j], joint.steps)) status |= torque_status::step_limited;
    if (!joint.output.is_following()) status |= torque_status::ramping;
    const std::int32_t raw = joint.output.value();
    if (raw == joint.lowest || raw == joint.highest) status |= torque_status::at_limit;
    if (!torques[j]) {
      out.equal = false;
      out.torque.push_back(std::numeric_limits<double>::quiet_NaN());
      continue;
    }
    if (since_restart_ == 0) joint.first_count = torques[j]->tick;
    const WireTorque expected{to_per_mille(raw, joint.per_mille), to_milli(raw, formats[Quantity::torque]),
                              static_cast<std::uint8_t>(joint.first_count + since_restart_), status};
    out.equal = out.equal && *torques[j] == expected;
    out.torque.push_back(1e-3 * torques[j]->milli);
    enabled = enabled && (torques[j]->status & torque_status::enabled) != 0;
  }
  ++since_restart_;
  ++ticks_;
  equal_ticks_ += out.equal ? 1 : 0;
  disabled_ticks_ += enabled ? 0 : 1;
  return out;
}

DriveReport CanDrives::report() {
  const auto ms = [&](double share) { return 1e-6 * static_cast<double>(round_trips_.quantile(share).count()); };
  DriveReport out{ticks_, equal_ticks_, disabled_ticks_, 0, ms(0.5), ms(0.99), ms(1), 0, {}};
  for (const Node& node : nodes_) {
    DriveReport::Node one{node.id, node.board, node.version, node.crc, {}, 0, {}};
    for (std::size_t j = 0; j < joints_.size(); ++j) {
      if ((node.outputs >> j & 1U) != 0) one.joints.push_back(j);
    }
    for (const dictionary::Described& described : dictionary::described) {
      if (described.entry.index != dictionary::counter_record) continue;
      one.counters[described.name] = master_.read(node.id, described.entry.index, described.entry.sub_index);
    }
    one.most_cost_of_a_tick = master_.read(node.id, dictionary::cost_record, 4);
    out.nodes.push_back(std::move(one));
  }
  out.frames_lost =
      lost_ + (lockstep_ ? lockstep_->statistics().missing + lockstep_->statistics().late : 0) + master_.bus().lost();
  out.ticks_per_second = busy_s_ > 0 ? static_cast<double>(ticks_) / busy_s_ : 0;
  return out;
}

json to_json(const DriveReport& report) {
  json nodes = json::array();
  for (const DriveReport::Node& node : report.nodes) {
    json driven = json::array();
    for (const std::size_t joint : node.joints) driven.push_back(joint + 1);
    nodes.push_back({{"id", node.id},
                     {"board", node.board},
                     {"version", node.version},
                     {"tables_crc", node.tables_crc},
                     {"joints", driven},
                     {"most_cost_of_a_tick", node.most_cost_of_a_tick},
                     {"counters", node.counters}});
  }
  return {{"ticks", report.ticks},
          {"equal_ticks", report.equal_ticks},
          {"disabled_ticks", report.disabled_ticks},
          {"frames_lost", report.frames_lost},
          {"round_trip_ms", {{"p50", report.p50_ms}, {"p99", report.p99_ms}, {"max", report.max_ms}}},
          {"ticks_per_second", report.ticks_per_second},
          {"nodes", nodes}};
}

}  // namespace fxdyn
