#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <string>

#include "hal/fake/serial.hpp"
#include "hal/slcan.hpp"
#include "tests/hal/slcan_text.hpp"

namespace fxdyn::hal {
namespace {

using test::bytes;
using test::line_of;

void feed(fake::Serial& port, const std::string& text) {
  port.incoming.insert(port.incoming.end(), text.begin(), text.end());
}
std::string said(fake::Serial& port) {
  const std::string text(port.outgoing.begin(), port.outgoing.end());
  port.outgoing.clear();
  return text;
}
bool same(const ClassicFrame& a, const ClassicFrame& b) {
  return a.id == b.id && a.extended == b.extended && a.remote == b.remote && a.fd == b.fd && a.size == b.size &&
         a.data == b.data;
}
ClassicFrame some_frame() {
  ClassicFrame frame;
  frame.extended = *rc::gen::arbitrary<bool>();
  frame.remote = *rc::gen::arbitrary<bool>();
  frame.id = *rc::gen::inRange<std::uint32_t>(0, frame.extended ? 0x2000'0000 : 0x800);
  frame.size = *rc::gen::inRange<std::uint8_t>(0, 9);
  for (std::size_t i = 0; !frame.remote && i < frame.size; ++i) frame.data[i] = *rc::gen::arbitrary<std::uint8_t>();
  return frame;
}

TEST(Slcan, LinesAsTheManualHasThem) {
  EXPECT_EQ(line_of({.id = 0x181, .size = 2, .data = {0xab, 0x01}}), "t1812AB01\r");
  EXPECT_EQ(line_of({.id = 0x80}), "t0800\r");
  EXPECT_EQ(line_of({.id = 0x1234567, .extended = true, .size = 1, .data = {9}}), "T01234567109\r");
  EXPECT_EQ(line_of({.id = 0x701, .remote = true}), "r7010\r");
  EXPECT_EQ(line_of({.id = 0x1fffffff, .extended = true, .remote = true, .size = 8}), "R1FFFFFFF8\r");
  EXPECT_EQ(line_of({.id = 1, .fd = true}), "");
  EXPECT_EQ(line_of({.id = 0x800}), "");
  EXPECT_EQ(line_of({.id = 1, .size = 9}), "");
}

TEST(Slcan, WhatIsNoFrameIsRefused) {
  for (const char* line : {"", "t", "t12", "t8001", "t80000", "t1239001122334455667788", "t12320", "t1232AB0",
                           "t1232AB0G", "t1230AB", "r123200", "T200000000", "x1230", "t12x0", "T123456780 "}) {
    ClassicFrame frame{.id = 42};
    EXPECT_FALSE(slcan::decode(bytes(line), frame)) << line;
    EXPECT_EQ(frame.id, 42U) << line;
  }
  ClassicFrame frame;
  EXPECT_TRUE(slcan::decode(bytes("t1232ab0c"), frame));  // Linux and others write either case
  EXPECT_EQ(frame.data[1], 0x0c);
}

RC_GTEST_PROP(Slcan, EveryFrameComesBack, ()) {
  const ClassicFrame frame = some_frame();
  const std::string line = line_of(frame);
  RC_ASSERT(line.size() > 1U && line.size() <= slcan::longest_line);
  ClassicFrame read;
  RC_ASSERT(slcan::decode(bytes(line.substr(0, line.size() - 1)), read));
  RC_ASSERT(same(read, frame));
}

RC_GTEST_PROP(Slcan, NoLineIsReadAsAFrameThatItIsNot, (const std::string& noise)) {
  // Whatever decodes is written as the same line again, but for the case of its digits.
  ClassicFrame frame;
  if (!slcan::decode(bytes(noise), frame)) return;
  std::string upper = noise;
  for (std::size_t i = 1; i < upper.size(); ++i)
    upper[i] = static_cast<char>(std::toupper(static_cast<unsigned char>(upper[i])));
  RC_ASSERT(line_of(frame) == upper + "\r");
}

RC_GTEST_PROP(SlcanBus, FramesAmidNoiseAndInAnyPiecesArrive, ()) {
  fake::Serial port;
  SlcanBus bus(port);
  std::vector<ClassicFrame> sent, received;
  std::string stream;
  const int count = *rc::gen::inRange(0, 20);
  for (int i = 0; i < count; ++i) {
    // Noise has no CR of its own and no command that closes the channel: it ends where the next CR stands.
    for (const auto c : *rc::gen::container<std::string>(rc::gen::element('x', '0', 'z', '\n', '\xff'))) stream += c;
    stream += '\r';
    sent.push_back(some_frame());
    stream += line_of(sent.back());
  }
  for (std::size_t at = 0; at < stream.size();) {
    const auto piece = *rc::gen::inRange<std::size_t>(1, 50);
    feed(port, stream.substr(at, piece));
    at += piece;
    ClassicFrame frame;
    while (bus.receive(frame) == Status::ok) received.push_back(frame);
  }
  RC_ASSERT(received.size() == sent.size());
  for (std::size_t i = 0; i < sent.size(); ++i) RC_ASSERT(same(received[i], sent[i]));
}

RC_GTEST_PROP(SlcanBus, AnyBytesDoNoHarm, (const std::vector<std::uint8_t>& noise)) {
  fake::Serial port;
  SlcanBus bus(port);
  port.incoming.assign(noise.begin(), noise.end());
  ClassicFrame frame;
  int frames = 0;
  while (bus.receive(frame) == Status::ok) ++frames;
  RC_ASSERT(port.incoming.empty());
  // After the next CR it hears again.
  feed(port, "\rO\r\rt1231AA\r");
  while (bus.receive(frame) == Status::ok) ++frames;
  RC_ASSERT(frame.id == 0x123U && frame.data[0] == 0xaa);
}

TEST(SlcanBus, AnswersLikeAnAdapter) {
  fake::Serial port;
  SlcanBus bus(port);
  ClassicFrame frame;
  feed(port, "\r\rC\rS8\rO\rV\rN\rF\r");
  EXPECT_EQ(bus.receive(frame), Status::busy);
  EXPECT_EQ(said(port), "\r\r\rV1013\rNFXDN\rF00\r");
  feed(port, "Z1\r");
  EXPECT_EQ(bus.receive(frame), Status::busy);
  EXPECT_EQ(said(port), "\a");
  EXPECT_EQ(bus.errors().lost, 1U);
}

TEST(SlcanBus, AClosedChannelCarriesNothing) {
  fake::Serial port;
  SlcanBus bus(port);
  ClassicFrame frame;
  feed(port, "C\rt1230\r");
  EXPECT_EQ(bus.receive(frame), Status::busy);
  EXPECT_EQ(said(port), "\r\a");
  EXPECT_EQ(bus.send({.id = 1}), Status::busy);
  feed(port, "O\rt1230\r");
  EXPECT_EQ(bus.receive(frame), Status::ok);
  EXPECT_EQ(bus.send({.id = 1}), Status::ok);
  EXPECT_TRUE(bus.idle());
  EXPECT_EQ(said(port), "\rt0010\r");
}

TEST(SlcanBus, ALineTooLongIsDroppedAsAWhole) {
  fake::Serial port;
  SlcanBus bus(port);
  ClassicFrame frame;
  feed(port, std::string(40, 't') + "1230\rt0420\r");
  ASSERT_EQ(bus.receive(frame), Status::ok);
  EXPECT_EQ(frame.id, 0x42U);
  EXPECT_EQ(bus.errors().lost, 1U);
}

TEST(SlcanBus, AFullPortMakesItBusyAndLosesNothing) {
  fake::Serial port;
  SlcanBus bus(port);
  port.write_limit = 0;
  int queued = 0;
  const ClassicFrame frame{.id = 0x181, .size = 8, .data = {1, 2, 3, 4, 5, 6, 7, 8}};
  while (bus.send(frame) == Status::ok) ++queued;
  EXPECT_GE(queued, 12);
  EXPECT_FALSE(bus.idle());
  port.write_limit = 7;
  while (!bus.idle()) {}
  std::string expected;
  for (int i = 0; i < queued; ++i) expected += line_of(frame);
  EXPECT_EQ(said(port), expected);
  EXPECT_EQ(bus.send({.id = 1, .fd = true}), Status::failed);
}

}  // namespace
}  // namespace fxdyn::hal
