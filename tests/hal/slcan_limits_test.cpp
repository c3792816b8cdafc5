// SLCAN at its limits: the longest line, the last digit, the last place of queue and buffers.

#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <string>

#include "hal/fake/serial.hpp"
#include "hal/slcan.hpp"
#include "tests/hal/slcan_text.hpp"

namespace fxdyn::hal {
namespace {

using test::bytes;
using test::line_of;

struct SlcanLimits : testing::Test {
  fake::Serial port;
  SlcanBus<fake::Serial> bus{port};
  void feed(const std::string& text) { port.incoming.insert(port.incoming.end(), text.begin(), text.end()); }
  std::string said() {
    const std::string text(port.outgoing.begin(), port.outgoing.end());
    port.outgoing.clear();
    return text;
  }
  int received() {
    ClassicFrame frame;
    int count = 0;
    while (bus.receive(frame) == Status::ok) ++count;
    return count;
  }
};

TEST(SlcanText, ADigitIsADigitAndNothingBesideIs) {
  const std::string digits = "0123456789ABCDEFabcdef";
  for (int c = 0; c < 256; ++c) {
    const char text = static_cast<char>(c);
    const std::size_t at = digits.find(text);
    const bool is_digit = at != std::string::npos;
    const auto value = static_cast<std::uint32_t>(at < 16 ? at : at - 6);
    ClassicFrame frame;
    EXPECT_EQ(slcan::decode(bytes(std::string("t12") + text + "0"), frame), is_digit) << c;
    if (is_digit) {
      EXPECT_EQ(frame.id, 0x120 + value);
    }
    for (const std::string& data : {std::string{'0', text}, std::string{text, '0'}}) {
      EXPECT_EQ(slcan::decode(bytes("t1231" + data), frame), is_digit) << c;
      if (is_digit) {
        EXPECT_EQ(frame.data[0], data[1] == text ? value : value << 4);
      }
    }
    const bool is_length = is_digit && value <= 8;
    EXPECT_EQ(slcan::decode(bytes(std::string("r123") + text), frame), is_length) << c;
    if (is_length) {
      EXPECT_EQ(frame.size, value);
    }
  }
}

TEST(SlcanText, TheLargestIdentifiersAndLengths) {
  ClassicFrame frame;
  EXPECT_TRUE(slcan::decode(bytes("t7FF0"), frame));
  EXPECT_EQ(frame.id, 0x7ffU);
  EXPECT_FALSE(slcan::decode(bytes("t8000"), frame));
  EXPECT_TRUE(slcan::decode(bytes("T1FFFFFFF80011223344556677"), frame));
  EXPECT_EQ(frame.id, 0x1fff'ffffU);
  EXPECT_EQ(frame.data, (std::array<std::uint8_t, 8>{0x00, 0x11, 0x22, 0x33, 0x44, 0x55, 0x66, 0x77}));
  EXPECT_FALSE(slcan::decode(bytes("T200000000"), frame));
  EXPECT_TRUE(slcan::is_valid({.id = 0x7ff, .size = 8}));
  EXPECT_FALSE(slcan::is_valid({.id = 0x2000'0000, .extended = true}));
  const ClassicFrame longest{.id = 0x1fff'ffff, .extended = true, .size = 8, .data = {0, 1, 2, 3, 4, 5, 6, 7}};
  EXPECT_EQ(line_of(longest), "T1FFFFFFF80001020304050607\r");
  EXPECT_EQ(line_of(longest).size(), slcan::longest_line);
}

TEST_F(SlcanLimits, AfterNoiseWithoutAnEndFramesComeAgain) {
  feed(std::string(10'000, 'x'));
  EXPECT_EQ(received(), 0);
  feed("\rt1230\r");
  EXPECT_EQ(received(), 1);
  EXPECT_EQ(bus.errors().lost, 1U);
}

TEST_F(SlcanLimits, TheLongestLineIsAFrameAndOneByteMoreIsLost) {
  const std::string longest = "T1FFFFFFF80011223344556677";
  for (int i = 0; i < 20; ++i) {  // at every place of the buffer
    feed(longest + "\r");
    EXPECT_EQ(received(), 1);
    feed(longest.substr(0, 20));
    EXPECT_EQ(received(), 0);
    feed(longest.substr(20) + "\r" + std::string(static_cast<std::size_t>(i), '\r'));
    EXPECT_EQ(received(), 1);
  }
  EXPECT_EQ(bus.errors().lost, 0U);
  EXPECT_EQ(said(), "");
  feed(longest + "0\r");
  EXPECT_EQ(received(), 0);
  EXPECT_EQ(bus.errors().lost, 1U);
  EXPECT_EQ(said(), "") << "no command either: nothing is answered";
  for (const char c : longest + "0") {
    feed({c});
    EXPECT_EQ(received(), 0);
  }
  feed("t1230\r");  // the rest of that line, not one of its own
  EXPECT_EQ(received(), 0);
  EXPECT_EQ(bus.errors().lost, 2U);
  feed("t1230\r");
  EXPECT_EQ(received(), 1);
  EXPECT_EQ(bus.errors().lost, 2U);
}

TEST_F(SlcanLimits, SixteenFramesWaitInTheirOrder) {
  port.write_limit = 0;
  std::string expected;
  std::uint32_t id = 0;
  for (int round = 0; round < 5; ++round) {
    for (int i = 0; i < 16; ++i, ++id) {
      ASSERT_EQ(bus.send({.id = id}), Status::ok) << i;
      expected += line_of({.id = id});
    }
    EXPECT_EQ(bus.send({.id = 0x7ff}), Status::busy);
    EXPECT_FALSE(bus.idle());
    EXPECT_EQ(bus.send({.id = id}), Status::ok) << "idle() has begun with the first one's text";
    expected += line_of({.id = id++});
    port.write_limit = 1000;
    EXPECT_TRUE(bus.idle());
    EXPECT_EQ(said(), expected);
    expected.clear();
    port.write_limit = 0;
    // a round begins at another place of the queue
    ASSERT_EQ(bus.send({.id = id}), Status::ok);
    port.write_limit = 1000;
    EXPECT_TRUE(bus.idle());
    EXPECT_EQ(said(), line_of({.id = id++}));
    port.write_limit = 0;
  }
}

TEST_F(SlcanLimits, ReceivingSendsWhatWaits) {
  EXPECT_EQ(bus.send({.id = 0x181}), Status::ok);
  EXPECT_EQ(received(), 0);
  EXPECT_EQ(said(), "t1810\r");
  EXPECT_TRUE(bus.idle());
}

TEST_F(SlcanLimits, AnswersThatFindNoRoomAreDroppedWhole) {
  port.write_limit = 0;
  for (int i = 0; i < 12; ++i) feed("V\r");  // ten of six bytes fit into 64
  feed("O\rO\rO\rO\rO\r");                   // and four of one
  EXPECT_EQ(received(), 0);
  port.write_limit = 1000;
  EXPECT_TRUE(bus.idle());
  std::string expected;
  for (int i = 0; i < 10; ++i) expected += "V1013\r";
  EXPECT_EQ(said(), expected + "\r\r\r\r");
}

TEST_F(SlcanLimits, WhatAClosedChannelRefusesIsNotLost) {
  feed("C\rt1230\rO\r");
  EXPECT_EQ(received(), 0);
  EXPECT_EQ(said(), "\r\a\r");
  EXPECT_EQ(bus.errors().lost, 0U);
  EXPECT_EQ(bus.errors().transmit, 0);
  EXPECT_EQ(bus.errors().receive, 0);
  EXPECT_EQ(bus.errors().state, CanState::active);
  EXPECT_EQ(bus.restart(), Status::ok);
}

}  // namespace
}  // namespace fxdyn::hal
