#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <vector>

#include "firmware/replay_node.hpp"
#include "hal/fake/clock.hpp"
#include "hal/fake/serial.hpp"

namespace fxdyn {
namespace {

struct Number {
  std::int32_t raw = 0;
};

/// tau = gain q + dq - ddq + number of ticks since reset; one saturation for each negative q.
struct StubModel {
  static constexpr std::size_t joints = 2, outputs = 2;
  static constexpr std::uint32_t outputs_mask = 3;
  struct Setpoints {
    Number q[joints], dq[joints], ddq[joints];
  };
  struct Parameters {
    std::int32_t gain = 0;
  };
  struct State {
    std::int32_t ticks = 0;
  };
  struct Torques {
    Number tau[outputs];
    Number& operator[](int i) { return tau[i]; }
  };
  static Torques tick(const Parameters& parameters, State& state, const Setpoints& inputs,
                      Saturations& saturations) noexcept {
    Torques tau;
    ++state.ticks;
    for (int j = 0; j < 2; ++j) {
      tau[j].raw = parameters.gain * inputs.q[j].raw + inputs.dq[j].raw - inputs.ddq[j].raw + state.ticks;
      saturations.count += inputs.q[j].raw < 0 ? 1 : 0;
    }
    return tau;
  }
};

class ReplayNodeTest : public ::testing::Test {
 protected:
  using Node = ReplayNode<StubModel, hal::fake::Serial, hal::fake::CycleCounter>;
  using Words = std::vector<std::uint32_t>;
  struct Message {
    serial::Type type;
    Words words;
    bool operator==(const Message&) const = default;
  };

  hal::fake::Serial port;
  hal::fake::CycleCounter counter;
  StubModel::Parameters parameters{10};
  Node node{port, counter, parameters, {0x1234, 0x5678, true}};

  static std::vector<std::uint8_t> bytes(serial::Type type, const Words& payload) {
    std::vector<std::uint8_t> frame(serial::frame_bytes(payload.size()));
    serial::encode(type, payload, frame);
    return frame;
  }
  void receive(const std::vector<std::uint8_t>& frame) {
    port.incoming.insert(port.incoming.end(), frame.begin(), frame.end());
  }
  std::vector<Message> sent() {
    serial::FrameReader<serial::largest_payload> reader;
    serial::Frame<serial::largest_payload> frame;
    std::vector<Message> messages;
    for (const std::uint8_t byte : port.outgoing) {
      reader.push(std::span{&byte, 1});
      while (reader.next(frame)) messages.push_back({frame.type, {frame.payload().begin(), frame.payload().end()}});
    }
    EXPECT_EQ(reader.corrupt_frames(), 0U);
    port.outgoing.clear();
    return messages;
  }
  std::vector<Message> answers(serial::Type type, const Words& payload) {
    receive(bytes(type, payload));
    EXPECT_FALSE(node.poll());
    return sent();
  }
};

TEST_F(ReplayNodeTest, HelloTellsIdentity) {
  EXPECT_EQ(answers(serial::Type::hello, {}),
            (std::vector{Message{serial::Type::identity, {serial::protocol_version, 2, 0x1234, 0x5678, 0, 0, 3}}}));
}

TEST_F(ReplayNodeTest, TickAnswersSequenceTorquesSaturationsCycles) {
  const auto minus = [](std::int32_t x) { return static_cast<std::uint32_t>(x); };
  EXPECT_EQ(answers(serial::Type::tick, {7, 1, 2, 3, minus(-5), 0, 1}),
            (std::vector{Message{serial::Type::torque, {7, 10 + 2 - 3 + 1, minus(-50 - 1 + 1), 1, 1000}}}));
  // saturations are those of one tick
  EXPECT_EQ(answers(serial::Type::tick, {8, 0, 0, 0, 0, 0, 0}),
            (std::vector{Message{serial::Type::torque, {8, 2, 2, 0, 2000}}}));
}

TEST_F(ReplayNodeTest, ResetForgets) {
  answers(serial::Type::tick, {1, 0, 0, 0, 0, 0, 0});
  EXPECT_EQ(answers(serial::Type::reset, {}), (std::vector{Message{serial::Type::reset_done, {}}}));
  EXPECT_EQ(answers(serial::Type::tick, {2, 0, 0, 0, 0, 0, 0}).at(0).words.at(1), 1U);
}

TEST_F(ReplayNodeTest, InvalidTablesAreToldAndNeverComputedWith) {
  Node locked(port, counter, parameters, {0x1234, 0x5678, false});
  receive(bytes(serial::Type::hello, {}));
  receive(bytes(serial::Type::tick, {3, 0, 0, 0, 0, 0, 0}));
  EXPECT_FALSE(locked.poll());
  EXPECT_EQ(
      sent(),
      (std::vector{Message{serial::Type::identity, {serial::protocol_version, 2, 0x1234, 0x5678, 1, 0, 3}},
                   Message{serial::Type::refused, {3, static_cast<std::uint32_t>(serial::Refusal::tables_invalid)}}}));
}

TEST_F(ReplayNodeTest, WrongLengthAndUnknownTypeAreRefused) {
  EXPECT_EQ(
      answers(serial::Type::tick, {3, 0, 0, 0}),
      (std::vector{Message{serial::Type::refused, {3, static_cast<std::uint32_t>(serial::Refusal::wrong_length)}}}));
  EXPECT_EQ(
      answers(static_cast<serial::Type>(0x55), {}),
      (std::vector{Message{serial::Type::refused, {0, static_cast<std::uint32_t>(serial::Refusal::unknown_type)}}}));
}

TEST_F(ReplayNodeTest, CorruptTickGetsNoAnswerAndIsCounted) {
  auto damaged = bytes(serial::Type::tick, {1, 0, 0, 0, 0, 0, 0});
  damaged[9] ^= 0x10;
  receive(damaged);
  EXPECT_FALSE(node.poll());
  EXPECT_TRUE(port.outgoing.empty());
  EXPECT_EQ(answers(serial::Type::hello, {}).at(0).words.at(5), 1U);
  // nor has it moved the state
  EXPECT_EQ(answers(serial::Type::tick, {2, 0, 0, 0, 0, 0, 0}).at(0).words.at(1), 1U);
}

TEST_F(ReplayNodeTest, SlowPortGetsEveryReplyWhole) {
  port.write_limit = 3;
  for (std::uint32_t k = 1; k <= 5; ++k) receive(bytes(serial::Type::tick, {k, 0, 0, 0, 0, 0, 0}));
  int polls = 0;
  while (node.poll()) ASSERT_LT(++polls, 1000);
  const auto messages = sent();
  ASSERT_EQ(messages.size(), 5U);
  for (std::uint32_t k = 1; k <= 5; ++k) EXPECT_EQ(messages[k - 1].words.at(0), k);
}

}  // namespace
}  // namespace fxdyn
