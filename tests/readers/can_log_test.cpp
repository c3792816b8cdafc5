// Logs of a CAN bus, as candump writes them.

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <zlib.h>
#include <zstd.h>

#include <array>
#include <string>

#include "firmware/protocol/setpoint_codec.hpp"
#include "host_tools/readers/log_reader.hpp"
#include "host_tools/support/error.hpp"
#include "tests/support/files.hpp"

namespace fxdyn {
namespace {

std::string hex(const std::array<std::uint8_t, 8>& bytes, std::size_t count = 8) {
  std::string out;
  for (std::size_t i = 0; i < count; ++i) out += fmt::format("{:02X}", bytes[i]);
  return out;
}
std::string line(double t, const std::string& frame) { return fmt::format("({:.6f}) can0 {}\n", t, frame); }

constexpr int ticks = 12;
double stamp(int tick) { return 1436509052.25 + 0.002 * tick; }

/// Two joints of fxdyn's node: the setpoints of a tick before its SYNC, the torques behind it.
std::string node_log(std::uint8_t status = 0x11) {
  std::string out;
  for (int k = 0; k < ticks; ++k) {
    std::array<std::uint8_t, 8> bytes{};
    for (int j = 1; j <= 2; ++j) {
      WireSetpoint{1000 * j + k, static_cast<std::int16_t>(-k), 7}.store(bytes.data());
      out += line(stamp(k) - 0.0005, fmt::format("20{}#{}", j, hex(bytes)));
    }
    out += line(stamp(k), "080#");
    for (int j = 1; j <= 2; ++j) {
      WireTorque{5, -1500 * j - k, static_cast<std::uint8_t>(250 + k), k == 3 ? status : std::uint8_t{0x11}}.store(
          bytes.data());
      out += line(stamp(k) + 0.0004, fmt::format("18{}#{}", j, hex(bytes)));
    }
    out += line(stamp(k) + 0.0009, "701#05");
  }
  return out;
}

RecordedLog recorded_on_bus(const std::string& text, const LogFormat& format = {}, std::size_t joints = 2) {
  const std::filesystem::path file = test::write("bus.log", text);
  EXPECT_EQ(reader_of(file).name, "candump");
  return reader_of(file).read({file, joints, format});
}
std::string complaint(const std::string& text, const LogFormat& format = {}) {
  try {
    recorded_on_bus(text, format);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(CanLog, OfTheNodeHasSetpointsOfATickBesideItsTorque) {
  const RecordedLog recorded = recorded_on_bus(node_log());
  const Log& log = recorded.log;
  ASSERT_EQ(log.samples(), ticks);
  EXPECT_NEAR(recorded.first_t, stamp(0), 1e-6);
  EXPECT_NEAR(recorded.last_t, stamp(ticks - 1), 1e-6);
  for (int k = 0; k < ticks; ++k) {
    EXPECT_EQ(log.q(k, 1), 2000 + k);
    EXPECT_DOUBLE_EQ(log.tau(k, 1), -3.0 - 0.001 * k);
  }
  EXPECT_EQ(log.dq.size(), 0);
  EXPECT_NE(log.time_note.find("no measurement"), std::string::npos);
}

TEST(CanLog, TicksThatAreNotTheModelsAreLeftOutAndTold) {
  for (const std::uint8_t status : std::initializer_list<std::uint8_t>{0x10, 0x01, 0x13}) {
    const Log log = recorded_on_bus(node_log(status)).log;
    EXPECT_EQ(log.samples(), ticks - 1);
    EXPECT_NE(log.time_note.find("1 ticks left out"), std::string::npos) << log.time_note;
  }
}

TEST(CanLog, OtherNumbersAreNamedByTheirFrame) {
  LogFormat format;
  format.joint_columns["q"] = {"201.i32.0", "202.i32.0"};
  format.joint_columns["dq"] = {"201.i16.4", "202.i16.4"};
  format.joint_columns["tau"] = {"181.i16.0", "182.u8.7"};
  const Log log = recorded_on_bus(node_log(), format).log;
  EXPECT_EQ(log.dq(4, 0), -4);
  EXPECT_EQ(log.tau(4, 0), 5);
  EXPECT_EQ(log.tau(4, 1), 0x11);
}

/// Drives of CiA 402: position and torque sampled at the SYNC before them.
std::string drives_log(int lost = -1) {
  std::string out;
  for (int k = 0; k < ticks; ++k) {
    out += line(stamp(k), "080#");
    for (int j = 3; j <= 4; ++j) {
      std::array<std::uint8_t, 8> bytes{};
      WireSetpoint{-100 * j - k, static_cast<std::int16_t>(-10 * j - k), 0}.store(bytes.data());
      if (k != lost) out += line(stamp(k) + 0.0003, fmt::format("18{}#{}", j, hex(bytes, 6)));
    }
  }
  return out;
}

TEST(CanLog, OfDrivesIsInTheOrderOfTheirNodes) {
  const Log log = recorded_on_bus(drives_log()).log;
  ASSERT_EQ(log.samples(), ticks);
  EXPECT_EQ(log.q(5, 0), -305);
  EXPECT_EQ(log.q(5, 1), -405);
  EXPECT_EQ(log.tau(5, 1), -45);
}

TEST(CanLog, ASyncWithoutAllFramesIsNoRow) {
  const Log log = recorded_on_bus(drives_log(4)).log;
  EXPECT_EQ(log.samples(), ticks - 1);
  EXPECT_NEAR(log.t[4], stamp(5), 1e-6);
}

TEST(CanLog, TheLongFormIsTheSame) {
  std::string text;
  for (int k = 0; k < ticks; ++k) {
    text += fmt::format(" ({:.6f})  can0  080   [0] \n", stamp(k));
    text += fmt::format(" ({:.6f})  can0  181   [6]  0{:X} 00 00 00 FF FF   '......'\n", stamp(k) + 0.0002, k);
    text += fmt::format(" ({:.6f})  can0  182   [6]  00 01 00 00 02 00\n", stamp(k) + 0.0003);
    text += fmt::format(" ({:.6f})  can0  183   [8]  remote request\n", stamp(k) + 0.0004);
  }
  const Log log = recorded_on_bus(text).log;
  ASSERT_EQ(log.samples(), ticks);
  EXPECT_EQ(log.q(9, 0), 9);
  EXPECT_EQ(log.tau(9, 0), -1);
  EXPECT_EQ(log.q(9, 1), 256);
  EXPECT_EQ(log.tau(9, 1), 2);
}

TEST(CanLog, PackedByGzipOrZstdItIsTheSame) {
  const std::string text = node_log();
  const Log plain = recorded_on_bus(text).log;
  const auto gzip = test::folder() / "bus.log.gz";
  gzFile out = ::gzopen(gzip.c_str(), "wb");
  ASSERT_EQ(::gzwrite(out, text.data(), static_cast<unsigned>(text.size())), static_cast<int>(text.size()));
  ::gzclose(out);
  std::string packed(::ZSTD_compressBound(text.size()), '\0');
  packed.resize(::ZSTD_compress(packed.data(), packed.size(), text.data(), text.size(), 1));
  for (const std::filesystem::path& file : {gzip, test::write("bus.log.zst", packed)}) {
    ASSERT_EQ(reader_of(file).name, "candump") << file;
    const Log log = reader_of(file).read({file, 2, {}}).log;
    EXPECT_TRUE(log.t == plain.t) << file;
    EXPECT_TRUE(log.tau == plain.tau) << file;
  }
}

TEST(CanLog, FramesOfCanFdAndErrorsAreUnderstood) {
  std::string text;
  for (int k = 0; k < ticks; ++k) {
    text += line(stamp(k), "080#") + line(stamp(k), "20000004#0001000000000000") + line(stamp(k), "182#R");
    text += line(stamp(k) + 0.0001, "181##1" + std::string(24, '0') + "0A000000");
  }
  LogFormat format;
  format.joint_columns["q"] = {"181.i32.12"};
  format.joint_columns["tau"] = {"181.u16.0"};
  const Log log = recorded_on_bus(text, format, 1).log;
  EXPECT_EQ(log.q(2, 0), 10);
}

TEST(CanLog, ComplaintsNameLineAndCure) {
  EXPECT_NE(complaint(node_log() + "(1.0) can0 181#0").find("bus.log:73: '(1.0) can0 181#0' is no frame"),
            std::string::npos);
  std::string text = line(1, "181#000000000000") + line(2, "181#000000000000");
  EXPECT_NE(complaint(text).find("no SYNC (080) on this bus"), std::string::npos);
  EXPECT_NE(complaint(text).find("181 (6 bytes)"), std::string::npos);
  text = line(1, "080#") + line(1.1, "281#0000") + line(2, "080#") + line(2.1, "281#0000");
  EXPECT_NE(complaint(text).find("no frames 181 .. 1FF with position and torque"), std::string::npos);
  LogFormat format;
  format.joint_columns["q"] = {"181.i32.0", "182.i32.5"};
  EXPECT_NE(complaint(node_log(), format).find("'182.i32.5'"), std::string::npos) << complaint(node_log(), format);
}

TEST(CanLog, OtherTextIsNone) {
  const std::filesystem::path file = test::write("table.log", "t,q1,tau1\n0,1,2\n");
  EXPECT_EQ(reader_of(file).name, "csv");
}

}  // namespace
}  // namespace fxdyn
