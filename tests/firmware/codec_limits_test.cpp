// The numbers of setpoint_codec.hpp, slow_division.hpp and serial_protocol.hpp at the ends of their ranges.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <iterator>
#include <limits>
#include <utility>

#include "firmware/drive_node.hpp"
#include "firmware/emergency.hpp"
#include "firmware/protocol/canopen.hpp"
#include "firmware/protocol/object_dictionary.hpp"
#include "firmware/protocol/serial_protocol.hpp"
#include "firmware/protocol/setpoint_codec.hpp"
#include "firmware/slow_division.hpp"

namespace fxdyn {
namespace {

constexpr std::int32_t least = std::numeric_limits<std::int32_t>::min(),
                       most = std::numeric_limits<std::int32_t>::max();

TEST(CodecLimits, AShareIsOfTheLargerEndAndOfOneAtLeast) {
  EXPECT_EQ(whole_share(0, 0), 1);
  EXPECT_EQ(whole_share(-1, 0), 1);
  EXPECT_EQ(whole_share(-2, 1), 2);
  EXPECT_EQ(whole_share(-1, 3), 3);
  EXPECT_EQ(whole_share(5, 3), 3);
  EXPECT_EQ(whole_share(-most, 0), most);
  EXPECT_EQ(whole_share(least, 0), most) << "its negative has no place";
  EXPECT_EQ(whole_share(least + 2, 0), most - 1);
}

// What stands in a standard or in somebody else's program: tests that use the names would follow a change.
TEST(NumbersOnTheWire, AreThoseOfCia301) {
  using canopen::Abort;
  using canopen::NmtCommand;
  using canopen::NmtState;
  const auto command = [](NmtCommand c) { return static_cast<unsigned>(c); };
  EXPECT_EQ(command(NmtCommand::start), 1U);
  EXPECT_EQ(command(NmtCommand::stop), 2U);
  EXPECT_EQ(command(NmtCommand::enter_pre_operational), 128U);
  EXPECT_EQ(command(NmtCommand::reset_node), 129U);
  EXPECT_EQ(command(NmtCommand::reset_communication), 130U);
  const auto state = [](NmtState s) { return static_cast<unsigned>(s); };
  EXPECT_EQ(state(NmtState::initialising), 0U);
  EXPECT_EQ(state(NmtState::stopped), 4U);
  EXPECT_EQ(state(NmtState::operational), 5U);
  EXPECT_EQ(state(NmtState::pre_operational), 127U);
  const std::pair<Abort, std::uint32_t> aborts[] = {{Abort::toggle_bit, 0x0503'0000},
                                                    {Abort::timed_out, 0x0504'0000},
                                                    {Abort::unknown_command, 0x0504'0001},
                                                    {Abort::write_only, 0x0601'0001},
                                                    {Abort::read_only, 0x0601'0002},
                                                    {Abort::no_object, 0x0602'0000},
                                                    {Abort::wrong_length, 0x0607'0010},
                                                    {Abort::too_long, 0x0607'0012},
                                                    {Abort::too_short, 0x0607'0013},
                                                    {Abort::no_sub_index, 0x0609'0011},
                                                    {Abort::invalid_value, 0x0609'0030},
                                                    {Abort::too_high, 0x0609'0031},
                                                    {Abort::too_low, 0x0609'0032},
                                                    {Abort::incompatible, 0x0604'0043},
                                                    {Abort::device_state, 0x0800'0022},
                                                    {Abort::no_data, 0x0800'0024},
                                                    {Abort::none, 0}};
  for (const auto& [abort, number] : aborts) EXPECT_EQ(static_cast<std::uint32_t>(abort), number) << std::hex << number;
}

TEST(NumbersOnTheWire, EmergenciesHaveTheirCodesAndBits) {
  struct Expected {
    Error error;
    std::uint16_t code;
    std::uint8_t bits;
    bool event;
  };
  const Expected expected[] = {{Error::hardware, 0x5000, 0x01, false},
                               {Error::tables, 0x6320, 0x01, false},
                               {Error::update_refused, 0x6320, 0x01, true},
                               {Error::watchdog_reset, 0x6010, 0x01, true},
                               {Error::id_collision, 0x8150, 0x11, true},
                               {Error::heartbeat_lost, 0x8130, 0x11, false},
                               {Error::recovered_from_bus_off, 0x8140, 0x11, true},
                               {Error::error_passive, 0x8120, 0x11, false},
                               {Error::overrun, 0x8110, 0x11, true},
                               {Error::pdo_length, 0x8210, 0x11, true},
                               {Error::sync_length, 0x8240, 0x11, true},
                               {Error::setpoints_stale, 0x8250, 0x11, false},
                               {Error::sync_rate, 0x8700, 0x11, false}};
  ASSERT_EQ(std::size(expected), error_kinds.size());
  for (const Expected& e : expected) {
    const ErrorKind& kind = error_kinds[static_cast<std::size_t>(e.error)];
    EXPECT_EQ(kind.code, e.code);
    EXPECT_EQ(kind.register_, e.bits) << std::hex << e.code;
    EXPECT_EQ(kind.event, e.event) << std::hex << e.code;
  }
  EXPECT_EQ(ErrorLog::history_size, 8U) << "of object 0x1003";
}

// CiA 301, 7.5.2: a master finds them by their numbers.
TEST(NumbersOnTheWire, ObjectsOfTheStandardHaveItsPlaces) {
  using enum dictionary::Variable;
  struct Place {
    dictionary::Variable variable;
    std::uint16_t index;
    std::uint8_t sub_index;
  };
  const Place places[] = {{device_type, 0x1000, 0},
                          {error_register, 0x1001, 0},
                          {error_count, 0x1003, 0},
                          {error_field, 0x1003, 1},
                          {sync_id, 0x1005, 0},
                          {cycle_period, 0x1006, 0},
                          {device_name, 0x1008, 0},
                          {hardware_version, 0x1009, 0},
                          {software_version, 0x100A, 0},
                          {emergency_id, 0x1014, 0},
                          {emergency_inhibit, 0x1015, 0},
                          {consumer_heartbeat, 0x1016, 1},
                          {producer_heartbeat, 0x1017, 0},
                          {vendor, 0x1018, 1},
                          {product, 0x1018, 2},
                          {revision, 0x1018, 3},
                          {serial_number, 0x1018, 4},
                          {error_behaviour, 0x1029, 1},
                          {sdo_request_id, 0x1200, 1},
                          {sdo_answer_id, 0x1200, 2},
                          {setpoint_id, 0x1400, 1},
                          {pdo_type, 0x1400, 2},
                          {setpoint_mapping, 0x1600, 1},
                          {setpoint_mapping, 0x1600, 2},
                          {setpoint_mapping, 0x1600, 3},
                          {torque_id, 0x1800, 1},
                          {pdo_type, 0x1800, 2},
                          {torque_mapping, 0x1A00, 1},
                          {torque_mapping, 0x1A00, 2},
                          {torque_mapping, 0x1A00, 3},
                          {torque_mapping, 0x1A00, 4}};
  const auto count = [](auto&& is) {
    return std::count_if(dictionary::entries.begin(), dictionary::entries.end(), is);
  };
  for (const Place& place : places) {
    EXPECT_EQ(count([&](const dictionary::Entry& entry) {
                return entry.variable == place.variable && entry.index == place.index &&
                       entry.sub_index == place.sub_index;
              }),
              1)
        << std::hex << place.index << " " << int{place.sub_index};
  }
  EXPECT_EQ(count([](const dictionary::Entry& entry) { return entry.index < 0x2000; }), std::ssize(places));
}

TEST(NumbersOnTheWire, WhatMayBeWrittenIsBounded) {
  struct Bounds {
    std::uint16_t index;
    std::int64_t lowest, highest;
  };
  const Bounds bounds[] = {{0x1003, 0, 0},      {0x1015, 0, 65535},      {0x1017, 0, 65535}, {0x1029, 0, 2},
                           {0x2010, 0, 65535},  {0x2011, 1, 2147483647}, {0x2012, 0, 255},   {0x2013, 0, 1},
                           {0x2014, 1, 60'000}, {0x2030, 0, 1}};
  for (const Bounds& expected : bounds) {
    const auto* entry = std::find_if(dictionary::entries.begin(), dictionary::entries.end(), [&](const auto& e) {
      return e.index == expected.index && e.access == dictionary::Access::read_write;
    });
    ASSERT_NE(entry, dictionary::entries.end()) << std::hex << expected.index;
    EXPECT_EQ(entry->lowest, expected.lowest) << std::hex << expected.index;
    EXPECT_EQ(entry->highest, expected.highest) << std::hex << expected.index;
  }
}

TEST(NumbersOnTheWire, IdentifiersHaveTheirBits) {
  EXPECT_EQ(canopen::cob_invalid, 0x8000'0000U);
  EXPECT_EQ(canopen::cob_no_remote, 0x4000'0000U);
  EXPECT_EQ(canopen::cob_extended, 0x2000'0000U);
  EXPECT_EQ(canopen::cob_identifier, 0x7FFU);
}

TEST(NumbersOnTheWire, AreThoseOfTheSerialProtocol) {
  EXPECT_EQ(serial::sync, (std::array<std::uint8_t, 2>{0xA5, 0x5F}));
  const auto type = [](serial::Type t) { return static_cast<unsigned>(t); };
  EXPECT_EQ(type(serial::Type::hello), 1U);
  EXPECT_EQ(type(serial::Type::tick), 2U);
  EXPECT_EQ(type(serial::Type::reset), 3U);
  EXPECT_EQ(type(serial::Type::identity), 0x81U);
  EXPECT_EQ(type(serial::Type::torque), 0x82U);
  EXPECT_EQ(type(serial::Type::reset_done), 0x83U);
  EXPECT_EQ(type(serial::Type::refused), 0x84U);
}

TEST(NumbersOnTheWire, FailedPartsAreBitsOfTheGuide) {
  EXPECT_EQ(hardware_part::can, 1);
  EXPECT_EQ(hardware_part::wake_up_timer, 2);
  EXPECT_EQ(hardware_part::watchdog, 4);
  EXPECT_EQ(hardware_part::crystal, 8);
}

TEST(CodecLimits, ThePeriodMayBeAHundredthOfTheTickOff) {
  EXPECT_EQ(dictionary::longest_period_us(10'000), 10'100U);
  EXPECT_EQ(dictionary::longest_period_us(2000), 2020U);
  EXPECT_EQ(dictionary::shortest_period_us(10'000), 9900U);
}

TEST(CodecLimits, SharesRoundHalfUpAndSaturate) {
  EXPECT_EQ(from_share(1, 1 << 14), 1) << "a half";
  EXPECT_EQ(from_share(1, (1 << 14) - 1), 0);
  EXPECT_EQ(from_share(-1, 1 << 14), 0) << "minus a half";
  EXPECT_EQ(from_share(-32768, most), -most);
  EXPECT_EQ(to_share(1, 65536), 1) << "a half";
  EXPECT_EQ(to_share(-1, 65536), 0) << "minus a half";
  EXPECT_EQ(to_share(-3, 65536), -1) << "minus one and a half";
  EXPECT_EQ(to_share(-2, 65536), -1);
  EXPECT_EQ(to_share(100, 100), 32767);
  EXPECT_EQ(to_share(-100, 100), -32768);
  EXPECT_EQ(to_share(most, 1), 32767);
  EXPECT_EQ(to_share(least, 1), -32768);
}

TEST(CodecLimits, PerMilleAndMilliSaturateAtTheirWidth) {
  constexpr TorqueScale unit = TorqueScale::of(20, 1000);  // 1 N m rated: 1000 per mille of 2^20
  EXPECT_EQ(to_per_mille(1 << 20, unit), 1000);
  EXPECT_EQ(to_per_mille(-(1 << 20), unit), -1000);
  EXPECT_EQ(to_per_mille(most, TorqueScale::of(10, 1000)), 32767);
  EXPECT_EQ(to_per_mille(least, TorqueScale::of(10, 1000)), -32768);
  EXPECT_EQ(to_per_mille(524, unit), 0) << ".4997";
  EXPECT_EQ(to_per_mille(525, unit), 1) << ".5007";
  for (const std::int32_t rated : {0, -5, 1}) {
    EXPECT_EQ(TorqueScale::of(20, rated).factor, TorqueScale::of(20, 1).factor) << "never divided by nothing";
  }
  EXPECT_EQ(to_milli(1 << 20, 20), 1000);
  EXPECT_EQ(to_milli(most, 5), most);
  EXPECT_EQ(to_milli(least, 5), least);
}

// The product with a raw torque of 32 bits has to stay within 64: no shift above 62, however small the factor.
TEST(CodecLimits, AScaleOfPerMilleShiftsBy62AtMost) {
  const TorqueScale fine = TorqueScale::of(30, 0x7FFF'FFFF);
  EXPECT_EQ(fine.shift, 62);
  EXPECT_EQ(fine.factor, 2'000'000);  // 10^6 2^32 / 2^31
  EXPECT_EQ(TorqueScale::of(20, 0x7FFF'FFFF).shift, 62);
  EXPECT_EQ(TorqueScale::of(19, 0x7FFF'FFFF).shift, 19 + 42);
}

TEST(CodecLimits, TheTickIsTheLowestBitOfTheAcceleration) {
  WireSetpoint setpoint{.q = 1, .dq = 2, .ddq = -3};
  setpoint.of_tick(false);
  EXPECT_EQ(setpoint.ddq, -4);
  EXPECT_FALSE(setpoint.is_odd());
  setpoint.of_tick(true);
  EXPECT_EQ(setpoint.ddq, -3);
  EXPECT_TRUE(setpoint.is_odd());
  EXPECT_EQ(setpoint.dq, 2);
}

TEST(CodecLimits, TheStatusBitsStandAsOnTheWire) {
  using namespace torque_status;  // NOLINT: these five
  EXPECT_EQ((std::array<int, 5>{fresh, ramping, step_limited, at_limit, enabled}),
            (std::array{0x01, 0x02, 0x04, 0x08, 0x10}));
}

TEST(CodecLimits, QuotientsOfAllWidths) {
  for (const std::uint64_t a : {std::uint64_t{0}, std::uint64_t{1}, std::uint64_t{7}, std::uint64_t{0xFFFF'FFFF},
                                std::uint64_t{0x8000'0000'0000'0000}, ~std::uint64_t{0}}) {
    for (const std::uint32_t b : {1U, 2U, 3U, 7U, 0x8000'0000U, 0xFFFF'FFFFU}) {
      EXPECT_EQ(slow_quotient(a, b), a / b) << a << " / " << b;
    }
  }
}

TEST(CodecLimits, AReaderStartsInStepAndTellsWhatItHolds) {
  serial::FrameReader<2> reader;
  EXPECT_EQ(reader.space(), serial::frame_bytes(2));
  EXPECT_EQ(reader.corrupt_frames(), 0U);
  reader.push(std::array<std::uint8_t, 3>{serial::sync[0], serial::sync[1], 0});
  EXPECT_EQ(reader.space(), serial::frame_bytes(2) - 3);
  serial::Frame<2> frame;
  EXPECT_FALSE(reader.next(frame));
  EXPECT_EQ(reader.corrupt_frames(), 0U) << "the beginning of a frame is no damage";
  reader.push(std::array<std::uint8_t, 1>{3});
  EXPECT_FALSE(reader.next(frame));
  EXPECT_EQ(reader.corrupt_frames(), 1U) << "longer than any that it takes";
}

}  // namespace
}  // namespace fxdyn
