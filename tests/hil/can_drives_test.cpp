// CanDrives on a bus in memory with nodes that answer as they are told to: whose nodes it starts and stops, which
// images it takes, and what it says of each thing that can be wrong.

#include <gtest/gtest.h>

#include <algorithm>
#include <deque>
#include <map>
#include <nlohmann/json.hpp>

#include "firmware/protocol/object_dictionary.hpp"
#include "host_tools/effects/identified_model.hpp"
#include "host_tools/hil/can_replay.hpp"
#include "host_tools/robot/robot.hpp"
#include "host_tools/support/error.hpp"

namespace fxdyn {
namespace {

using canopen::NmtCommand;
using canopen::NmtState;

struct ScriptedNode {
  NmtState state = NmtState::pre_operational;
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> objects{};
  bool sends_torque = true;
  std::uint8_t torque_status = 0;
  bool has_fd = true;
  int late_resets = 0;  ///< so many requests are lost to a reset, since a boot-up message came before it
};

class ScriptedBus final : public can::Bus {
 public:
  std::map<std::uint8_t, ScriptedNode> nodes;
  std::string its_trouble;
  std::vector<std::pair<NmtCommand, std::uint8_t>> commands;  ///< of NMT

  void send(const can::Frame& frame) override {
    if (frame.id == canopen::nmt_id) {
      obey(static_cast<NmtCommand>(frame.data[0]), frame.data[1]);
    } else if (frame.id == canopen::sync_id) {
      for (auto& [id, node] : nodes) {
        if (node.state == NmtState::operational && node.sends_torque)
          waiting_.push_back({.id = canopen::torque_id + id,
                              .size = WireTorque::bytes,
                              .data = {0, 0, 0, 0, 0, 0, 0, node.torque_status}});
      }
    } else if (const auto node = nodes.find(static_cast<std::uint8_t>(frame.id - canopen::sdo_request_id));
               frame.id > canopen::sdo_request_id && frame.id < canopen::heartbeat_id && node != nodes.end()) {
      answer(node->first, node->second, frame);
    }
  }
  bool receive(can::Frame& frame, can::Duration timeout) override {
    if (waiting_.empty()) {
      now_ += timeout;
      return false;
    }
    frame = waiting_.front();
    waiting_.pop_front();
    return true;
  }
  can::Duration now() const override { return now_; }
  std::uint32_t lost() const override { return 0; }
  std::string name() const override { return "can7"; }
  std::string trouble() override { return its_trouble; }

 private:
  void heartbeat(std::uint8_t id, NmtState state) {
    waiting_.push_back({.id = canopen::heartbeat_id + id, .size = 1, .data = {static_cast<std::uint8_t>(state)}});
  }
  void obey(NmtCommand command, std::uint8_t who) {
    commands.emplace_back(command, who);
    for (auto& [id, node] : nodes) {
      if (who != 0 && who != id) continue;
      node.state = command == NmtCommand::start ? NmtState::operational : NmtState::pre_operational;
      heartbeat(id, command == NmtCommand::reset_node ? NmtState::initialising : node.state);
    }
  }
  void answer(std::uint8_t id, ScriptedNode& node, const can::Frame& request) {
    if (node.late_resets > 0) {
      --node.late_resets;
      heartbeat(id, NmtState::initialising);
      return;
    }
    can::Frame reply{.id = canopen::sdo_answer_id + id, .size = 8, .data = request.data};
    const std::pair object{canopen::load<2>(&request.data[1]), std::uint32_t{request.data[3]}};
    if ((request.data[0] & 0xE0U) == 0x20) {
      const bool refused = !node.has_fd && object.first == 0x2030;
      if (!refused) node.objects[object] = canopen::load<4>(&request.data[4]);
      reply.data[0] = refused ? 0x80 : 0x60;
    } else {
      reply.data[0] = 0x43;
      canopen::store<4>(&reply.data[4], node.objects[object]);
    }
    waiting_.push_back(reply);
  }

  std::deque<can::Frame> waiting_;
  can::Duration now_{};
};

class CanDrivesTest : public testing::Test {
 protected:
  CanDrivesTest() {
    model_.robot = read_urdf(FXDYN_SOURCE_DIR "/tests/support/elastic_arm/arm.urdf");
    const DhChain chain = to_dh(model_.robot);
    for (std::size_t j = 0; j < model_.robot.size(); ++j) {
      model_.inertia.push_back(
          to_link_inertia(model_.robot.joints[j].inertial.value_or(Inertial{}), chain.urdf_in_dh[j]));
      JointFit joint;
      joint.rated_torque = joint.tau_limit = 60;
      joint.sign_width = 0.03;
      joint.q_lower = -2;
      joint.q_upper = 2;
      joint.dq_limit = 2;
      joint.ddq_limit = 10;
      EffectFit viscous;
      viscous.effect = "viscous";
      viscous.linear = {1.5};
      joint.effects.push_back(viscous);
      model_.joints.push_back(joint);
    }
    model_.formats = choose_formats(model_);
  }

  /// A node whose page is the tables that a drive of the joints in `page` gets, and puts out those in `outputs`.
  ScriptedNode node(std::uint32_t outputs, std::uint32_t page) {
    const FixedModel fixed(model_, *model_.formats, page);
    ScriptedNode made;
    made.objects = {{{0x1018, 2}, dictionary::product_code},
                    {{dictionary::tables, 1}, fixed.crc()},
                    {{dictionary::tables, 2}, fixed.layout_hash()},
                    {{dictionary::tables, 3}, 1},
                    {{dictionary::tables, 4}, 2},
                    {{dictionary::tables, 5}, outputs},
                    {{dictionary::tables, 8}, static_cast<std::uint32_t>(UpdateSlot::empty)}};
    for (std::uint32_t j = 1; j <= 2; ++j) {
      for (const std::uint32_t index : {0x2021U, 0x2022U, 0x2040U}) made.objects[{index, j}] = 1000;
    }
    return made;
  }
  void two_nodes() {
    bus_.nodes[1] = node(1, 1);
    bus_.nodes[2] = node(2, 2);
  }
  std::string refused(const CanDrives::Settings& settings = {}) {
    try {
      CanDrives drives(bus_, model_, settings);
    } catch (const InputError& error) {
      return error.what();
    }
    return "taken";
  }
  std::vector<NmtState> states() const {
    std::vector<NmtState> all;
    for (const auto& [id, node] : bus_.nodes) all.push_back(node.state);
    return all;
  }
  void tick(CanDrives& drives) {
    const Eigen::VectorXd zero = Eigen::VectorXd::Zero(2);
    drives.tick(zero, zero, zero);
  }

  IdentifiedModel model_;
  ScriptedBus bus_;
};

TEST_F(CanDrivesTest, StartsItsOwnNodesAndStopsThem) {
  two_nodes();
  bus_.nodes[9] = {};
  {
    CanDrives drives(bus_, model_, {});
    EXPECT_EQ(drives.nodes(), (std::vector<std::uint8_t>{1, 2}));
    drives.restart();
    EXPECT_EQ(states(), (std::vector{NmtState::operational, NmtState::operational, NmtState::pre_operational}));
    tick(drives);
  }
  EXPECT_EQ(states(), std::vector(3, NmtState::pre_operational));
  for (const auto& [command, who] : bus_.commands) EXPECT_TRUE(who == 1 || who == 2) << int{who};
}

TEST_F(CanDrivesTest, StopsThemWhateverGoesWrong) {
  two_nodes();
  bus_.nodes[9].state = NmtState::operational;  // another master's
  try {
    CanDrives drives(bus_, model_, {});
    drives.restart();
    bus_.nodes[2].sends_torque = false;
    tick(drives);
    throw DataError("no torque came");
  } catch (const DataError&) {
    EXPECT_EQ(states(), (std::vector{NmtState::pre_operational, NmtState::pre_operational, NmtState::operational}));
  }
}

TEST_F(CanDrivesTest, DoesNotStopWhatItHasNotStarted) {
  two_nodes();
  bus_.nodes[1].state = NmtState::operational;
  { CanDrives drives(bus_, model_, {}); }
  EXPECT_TRUE(bus_.commands.empty());
}

TEST_F(CanDrivesTest, ANodeJustSwitchedOnIsAskedAgainAfterItsReset) {
  two_nodes();
  CanDrives drives(bus_, model_, {});
  bus_.nodes[1].late_resets = 1;
  drives.restart();
  EXPECT_EQ(states(), (std::vector{NmtState::operational, NmtState::operational}));
  EXPECT_EQ(bus_.nodes[1].late_resets, 0);
}

TEST_F(CanDrivesTest, ANodeThatRestartsAgainAndAgainIsNamed) {
  two_nodes();
  CanDrives drives(bus_, model_, {});
  bus_.nodes[2].late_resets = 1000;
  try {
    drives.restart();
    FAIL() << "a node that never answers was taken";
  } catch (const can::NodeRestarted& error) {
    EXPECT_NE(std::string(error.what()).find("node 2"), std::string::npos) << error.what();
    EXPECT_NE(std::string(error.what()).find("it restarted"), std::string::npos) << error.what();
  }
}

TEST_F(CanDrivesTest, NodesWatchTheHostsHeartbeat) {
  two_nodes();
  CanDrives drives(bus_, model_, {.nodes = {}, .master = 127});
  drives.restart();
  for (const std::uint8_t id : drives.nodes()) {
    const std::uint32_t consumer = bus_.nodes[id].objects[{0x1016, 1}];
    EXPECT_EQ(consumer >> 16, 127U);
    EXPECT_EQ(consumer & 0xFFFFU, 2000U);
  }
}

TEST_F(CanDrivesTest, TakesThePageOfItsJointsOrOfTheWholeRobot) {
  two_nodes();
  EXPECT_EQ(refused(), "taken");
  bus_.nodes[1] = node(1, 3);
  bus_.nodes[2] = node(2, 3);
  EXPECT_EQ(refused(), "taken");
  bus_.nodes.erase(2);
  bus_.nodes[1] = node(3, 3);
  EXPECT_EQ(refused(), "taken");
  // Each layout goes with its own parameters.
  bus_.nodes[1] = node(1, 3);
  bus_.nodes[2] = node(2, 2);
  bus_.nodes[1].objects[{dictionary::tables, 1}] = node(1, 1).objects[{dictionary::tables, 1}] ^ 1U;
  EXPECT_NE(refused().find("other tables"), std::string::npos) << refused();
  // The page of joint 2 is none for joint 1.
  bus_.nodes[1] = node(1, 2);
  EXPECT_NE(refused().find("another model"), std::string::npos) << refused();
}

/// One line that names all of these.
void expect_line(const std::string& line, const std::vector<std::string>& parts) {
  EXPECT_EQ(std::count(line.begin(), line.end(), '\n'), 0);
  for (const std::string& part : parts) EXPECT_NE(line.find(part), std::string::npos) << part << " in: " << line;
}

TEST_F(CanDrivesTest, SaysWhatToDo) {
  expect_line(refused(), {"no node answers", "ip -details link show can7", "candump can7", "--nodes"});
  expect_line(refused({.nodes = {5}}), {"node 5 does not answer", "candump can7"});
  // At a wrong bit rate nothing is heard, and the controller turns error passive.
  bus_.its_trouble = hal::linux::explain({hal::CanState::passive, 128, 0, 0}, "can7", 500'000);
  expect_line(refused(), {"no node answers", "error passive", "500000", "ip link set can7 up type can bitrate"});
  expect_line(refused({.nodes = {5}}), {"node 5", "error passive", "type can bitrate"});
  bus_.its_trouble.clear();

  bus_.nodes[1] = node(1, 1);
  expect_line(refused(), {"joint 2", "candump can7", "--nodes"});
  bus_.nodes[2] = node(1, 1);
  expect_line(refused(), {"node 2", "another node", "toolchains/build_node.sh"});
  bus_.nodes[2] = node(2, 2);
  const auto with = [&](std::uint32_t index, std::uint32_t sub, std::uint32_t value) {
    bus_.nodes[2] = node(2, 2);
    bus_.nodes[2].objects[{index, sub}] = value;
    return refused();
  };
  expect_line(with(0x1018, 2, 7), {"node 2 is no fxdyn drive node", "--nodes"});
  expect_line(with(dictionary::tables, 3, 0), {"damaged", "--target flash-tables"});
  expect_line(with(dictionary::tables, 4, 6), {"a robot of 6 joints", "--target flash", "toolchains/build_node.sh"});
  expect_line(with(dictionary::tables, 2, 1), {"another model", "--target flash", "toolchains/build_node.sh"});
  expect_line(with(dictionary::tables, 1, 1), {"other tables", "--target flash-tables"});
  const auto with_slot = [&](UpdateSlot slot) {
    two_nodes();
    bus_.nodes[2].objects[{dictionary::tables, 1}] ^= 1U;
    bus_.nodes[2].objects[{dictionary::tables, 8}] = static_cast<std::uint32_t>(slot);
    return refused();
  };
  expect_line(with_slot(UpdateSlot::same), {"other tables", "--target flash-tables"});
  expect_line(with_slot(UpdateSlot::older), {"refuses the page in its slot", "older than", "toolchains/build_node.sh"});
  expect_line(with_slot(UpdateSlot::other_origin), {"refuses", "of another model", "toolchains/build_node.sh"});
  expect_line(with_slot(UpdateSlot::unreadable), {"refuses", "unreadable", "--target flash-tables"});
}

TEST_F(CanDrivesTest, SaysWhichNodeHasNoFd) {
  two_nodes();
  bus_.nodes[2].has_fd = false;
  CanDrives::Settings settings;
  settings.fd = true;
  CanDrives drives(bus_, model_, settings);
  try {
    drives.restart();
    FAIL() << "taken";
  } catch (const InputError& error) {
    expect_line(error.what(), {"node 2", "without --fd", "fxdyn_node --fd"});
  }
}

TEST_F(CanDrivesTest, CountsTicksWithEnableLow) {
  two_nodes();
  for (auto& [id, node] : bus_.nodes) node.torque_status = torque_status::fresh | torque_status::enabled;
  CanDrives drives(bus_, model_, {});
  drives.restart();
  tick(drives);
  EXPECT_EQ(drives.report().disabled_ticks, 0U);
  bus_.nodes[2].torque_status = torque_status::fresh;
  tick(drives);
  tick(drives);
  EXPECT_EQ(drives.report().disabled_ticks, 2U);
}

}  // namespace
}  // namespace fxdyn
