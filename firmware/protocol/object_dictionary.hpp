#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

#include "firmware/protocol/canopen.hpp"
#include "model/wrapping.hpp"

// The object dictionary of a drive node, in one list. The SDO server reads it; EDS and DBC are printed from it
// (host_tools/dictionary). Joint j is sub-index j of an array and index offset j - 1 of a PDO, whether the node puts
// out its torque or not.

namespace fxdyn::dictionary {

/// Index of the data type's definition (CiA 301, 7.4.7.1).
enum class Type : std::uint8_t {
  boolean = 0x01,
  integer8 = 0x02,
  integer16 = 0x03,
  integer32 = 0x04,
  unsigned8 = 0x05,
  unsigned16 = 0x06,
  unsigned32 = 0x07,
  visible_string = 0x09,
};
inline constexpr std::size_t longest_string = 32;

/// Bytes of a value; of a string, the most it holds.
constexpr std::size_t size_of(Type type) {
  switch (type) {
    case Type::boolean:
    case Type::integer8:
    case Type::unsigned8:
      return 1;
    case Type::integer16:
    case Type::unsigned16:
      return 2;
    case Type::integer32:
    case Type::unsigned32:
      return 4;
    case Type::visible_string:
      return longest_string;
  }
  return 0;
}
constexpr bool is_signed(Type type) {
  return type == Type::integer8 || type == Type::integer16 || type == Type::integer32;
}

enum class Access : std::uint8_t { constant, read, read_write };

/// How often an entry stands in the dictionary.
enum class Times : std::uint8_t {
  one,         ///< once
  each_joint,  ///< at consecutive indices, one for each joint of the robot
  each_output  ///< the same for the joints whose torque this node puts out
};

/// What an entry shows. Items: joints, counters, ..., counted from 0.
enum class Variable : std::uint8_t {
  device_type,
  error_register,
  error_count,
  error_field,
  sync_id,
  cycle_period,
  device_name,
  hardware_version,
  software_version,
  emergency_id,
  emergency_inhibit,
  consumer_heartbeat,
  producer_heartbeat,
  vendor,
  product,
  revision,
  serial_number,
  error_behaviour,
  sdo_request_id,
  sdo_answer_id,
  setpoint_id,
  torque_id,
  pdo_type,
  setpoint_mapping,
  torque_mapping,
  tables_crc,
  layout_hash,
  tables_valid,
  joints,
  outputs,
  page,
  sequence,
  update_slot,
  counter,
  cost,
  cost_unit,
  label,
  ramp_ticks,
  step_limit,
  tolerated_ticks,
  tick_parity,
  patience,
  fractional_bits,
  velocity_limit,
  acceleration_limit,
  lower_position,
  upper_position,
  can_fd,
  rated_torque,
  lower_torque,
  upper_torque,
  setpoint_position,
  setpoint_velocity,
  setpoint_acceleration,
  torque_per_mille,
  torque_milli,
  tick_count,
  torque_status,
};

/// What is counted since start-up: the items of 0x2001, sub-index = item + 1. They wrap.
enum class Counter : std::uint8_t {
  ticks,                ///< computed from fresh setpoints
  stale_ticks,          ///< all others
  overdue_syncs,        ///< of these, by the node's own timer
  missing_setpoints,    ///< that were not there at SYNC
  duplicate_setpoints,  ///< second ones within a tick
  malformed_setpoints,  ///< wrong length, or remote frames
  implausible_setpoints,
  malformed_frames,  ///< other services
  saturations,       ///< of the model's arithmetic and limits
  limited_steps,     ///< torque steps that 0x2011 cut
  lost_received,     ///< frames, by overrun of the controller
  lost_sent,         ///< frames, overtaken by a newer one or refused
  bus_offs,
  id_collisions,  ///< frames under this node's own identifiers
  lost_heartbeats,
  sdo_aborts,
  foreign_frames,  ///< identifiers that nothing here wants
  watchdog_resets,
  nmt_resets,
  mixed_setpoints,  ///< ticks with setpoints of odd and of even ticks (0x2013)
};
inline constexpr std::size_t counters = static_cast<std::size_t>(Counter::mixed_setpoints) + 1;

/// Cost of a tick, in what the board's cycle counter counts: the items of 0x2002.
enum class Cost : std::uint8_t {
  model,           ///< Model::tick alone, last time
  most_model,      ///< .. and its most
  everything,      ///< all that happened from the end of one tick to the end of the next
  most_everything  ///< .. and its most
};
inline constexpr std::size_t costs = 4;

inline constexpr std::size_t consumers = 2;     ///< heartbeats that a node watches
inline constexpr std::size_t error_fields = 8;  ///< history of 0x1003

/// Values after a reset; the EDS tells the same.
namespace defaults {
inline constexpr std::uint32_t heartbeat_ms = 100, emergency_inhibit_100us = 100, ramp_ticks = 50, tolerated_ticks = 1,
                               patience_ms = 100;
/// 0x1029:1. 1: communication errors don't change the NMT state, since they ramp the torque to zero anyway.
inline constexpr std::uint32_t error_behaviour = 1;
}  // namespace defaults

/// 0x1006 where it is not 0: the tables' tick to 1 %, since they hold for no other.
constexpr std::uint32_t shortest_period_us(std::uint32_t tick_us) { return tick_us - tick_us / 100; }
constexpr std::uint32_t longest_period_us(std::uint32_t tick_us) { return tick_us + tick_us / 100; }

inline constexpr const char* device_name = "fxdyn drive node";
inline constexpr std::uint32_t product_code = 0x3144'5846;  ///< "FXD1"
inline constexpr std::uint16_t first_setpoint_record = 0x1400, first_setpoint_mapping = 0x1600,
                               first_torque_record = 0x1800, first_torque_mapping = 0x1A00, tables = 0x2000,
                               counter_record = 0x2001, cost_record = 0x2002;

struct Entry {
  std::uint16_t index = 0;
  std::uint8_t sub_index = 0;
  /// 0: the entry alone. Else an array: sub-indices sub_index .. sub_index + array - 1; `array_of_joints`: one each.
  std::uint8_t array = 0;
  Times times = Times::one;
  Type type = Type::unsigned32;
  Access access = Access::read;
  Variable variable{};
  /// What may be written, as numbers of the entry's type.
  std::int64_t lowest = 0, highest = 0xFFFF'FFFF;
};
inline constexpr std::uint8_t array_of_joints = 0xFF;

/// An entry's default value: none (the tables or the board say), a number, or a number plus the node's or joint's
/// number.
enum class Default : std::uint8_t { none, number, plus_node, plus_joint };

/// An entry with what only people and tools read.
struct Described {
  Entry entry;
  const char* object;  ///< name of the object
  const char* name;    ///< name of the entry; of an array, of each element
  const char* unit = "";
  Default kind = Default::none;
  std::uint32_t value = 0;
  bool mappable = false;  ///< part of a PDO
};

namespace detail {
inline constexpr auto u8 = Type::unsigned8, u16 = Type::unsigned16, u32 = Type::unsigned32, i32 = Type::integer32;
inline constexpr auto ro = Access::read, rw = Access::read_write, fixed = Access::constant;
inline constexpr auto once = Times::one, per_joint = Times::each_joint, per_output = Times::each_output;
inline constexpr std::uint8_t joints = array_of_joints;
using V = Variable;

constexpr Described one(std::uint16_t index, Type type, Access access, V variable, const char* name,
                        const char* unit = "", Default kind = Default::none, std::uint32_t value = 0) {
  return {{index, 0, 0, once, type, access, variable}, name, name, unit, kind, value};
}
constexpr Described member(std::uint16_t index, std::uint8_t sub, Type type, Access access, V variable,
                           const char* object, const char* name, const char* unit = "", Default kind = Default::none,
                           std::uint32_t value = 0, Times times = once) {
  return {{index, sub, 0, times, type, access, variable}, object, name, unit, kind, value};
}
constexpr Described array(std::uint16_t index, std::uint8_t count, Type type, Access access, V variable,
                          const char* object, const char* name, const char* unit = "", Default kind = Default::none,
                          std::uint32_t value = 0) {
  return {{index, 1, count, once, type, access, variable}, object, name, unit, kind, value};
}
constexpr Described within(Described described, std::int64_t lowest, std::int64_t highest) {
  described.entry.lowest = lowest;
  described.entry.highest = highest;
  return described;
}
constexpr Described mapped(Described described) {
  described.mappable = true;
  return described;
}
constexpr auto number = Default::number;
}  // namespace detail

inline constexpr auto described = [] {
  using namespace detail;  // NOLINT: this list alone
  const auto counter = [](Counter item, const char* name) {
    return member(0x2001, static_cast<std::uint8_t>(static_cast<int>(item) + 1), u32, ro, V::counter, "Counters", name,
                  "", number, 0);
  };
  const auto setpoint = [](std::uint8_t sub, Type type, Access access, V variable, const char* name, Default kind,
                           std::uint32_t value) {
    return member(0x1400, sub, type, access, variable, "RPDO communication parameter", name, "", kind, value,
                  per_joint);
  };
  const auto torque = [](std::uint8_t sub, Type type, Access access, V variable, const char* name, Default kind,
                         std::uint32_t value) {
    return member(0x1800, sub, type, access, variable, "TPDO communication parameter", name, "", kind, value,
                  per_output);
  };
  const auto setpoint_map = [](std::uint8_t sub, const char* name) {
    return member(0x1600, sub, u32, fixed, V::setpoint_mapping, "RPDO mapping parameter", name, "", Default::none, 0,
                  per_joint);
  };
  const auto torque_map = [](std::uint8_t sub, const char* name) {
    return member(0x1A00, sub, u32, fixed, V::torque_mapping, "TPDO mapping parameter", name, "", Default::none, 0,
                  per_output);
  };
  return std::array{
      // Communication profile, CiA 301 7.5.2
      one(0x1000, u32, fixed, V::device_type, "Device type", "", number, 0),
      one(0x1001, u8, ro, V::error_register, "Error register"),
      within(member(0x1003, 0, u8, rw, V::error_count, "Pre-defined error field", "Number of errors", "", number, 0), 0,
             0),
      array(0x1003, error_fields, u32, ro, V::error_field, "Pre-defined error field", "Standard error field"),
      one(0x1005, u32, rw, V::sync_id, "COB-ID SYNC message", "", number, canopen::sync_id),
      one(0x1006, u32, rw, V::cycle_period, "Communication cycle period", "us"),
      one(0x1008, Type::visible_string, fixed, V::device_name, "Manufacturer device name"),
      one(0x1009, Type::visible_string, fixed, V::hardware_version, "Manufacturer hardware version"),
      one(0x100A, Type::visible_string, fixed, V::software_version, "Manufacturer software version"),
      one(0x1014, u32, ro, V::emergency_id, "COB-ID EMCY", "", Default::plus_node, canopen::emergency_id),
      within(one(0x1015, u16, rw, V::emergency_inhibit, "Inhibit time EMCY", "100 us", number,
                 defaults::emergency_inhibit_100us),
             0, 0xFFFF),
      array(0x1016, consumers, u32, rw, V::consumer_heartbeat, "Consumer heartbeat time", "Consumer heartbeat time",
            "node id * 65536 + ms", number, 0),
      within(
          one(0x1017, u16, rw, V::producer_heartbeat, "Producer heartbeat time", "ms", number, defaults::heartbeat_ms),
          0, 0xFFFF),
      member(0x1018, 1, u32, fixed, V::vendor, "Identity object", "Vendor-ID", "", number, 0),
      member(0x1018, 2, u32, fixed, V::product, "Identity object", "Product code", "", number, product_code),
      member(0x1018, 3, u32, fixed, V::revision, "Identity object", "Revision number"),
      member(0x1018, 4, u32, fixed, V::serial_number, "Identity object", "Serial number"),
      within(array(0x1029, 1, u8, rw, V::error_behaviour, "Error behaviour", "Communication error", "", number,
                   defaults::error_behaviour),
             0, 2),
      member(0x1200, 1, u32, fixed, V::sdo_request_id, "SDO server parameter", "COB-ID client to server", "",
             Default::plus_node, canopen::sdo_request_id),
      member(0x1200, 2, u32, fixed, V::sdo_answer_id, "SDO server parameter", "COB-ID server to client", "",
             Default::plus_node, canopen::sdo_answer_id),
      setpoint(1, u32, rw, V::setpoint_id, "COB-ID used by RPDO", Default::plus_joint, canopen::setpoint_id),
      setpoint(2, u8, fixed, V::pdo_type, "Transmission type", number, 1),
      setpoint_map(1, "Position"),
      setpoint_map(2, "Velocity"),
      setpoint_map(3, "Acceleration"),
      torque(1, u32, rw, V::torque_id, "COB-ID used by TPDO", Default::plus_joint,
             canopen::cob_no_remote | canopen::torque_id),
      torque(2, u8, fixed, V::pdo_type, "Transmission type", number, 1),
      torque_map(1, "Torque per mille of rated"),
      torque_map(2, "Torque"),
      torque_map(3, "Tick count"),
      torque_map(4, "Torque status"),

      // The maker's own
      member(0x2000, 1, u32, ro, V::tables_crc, "Tables", "CRC-32 of the parameters"),
      member(0x2000, 2, u32, ro, V::layout_hash, "Tables", "Layout hash"),
      member(0x2000, 3, Type::boolean, ro, V::tables_valid, "Tables", "Valid"),
      member(0x2000, 4, u8, ro, V::joints, "Tables", "Joints of the robot"),
      member(0x2000, 5, u32, ro, V::outputs, "Tables", "Joints whose torque this node puts out, a bit each"),
      member(0x2000, 6, u8, ro, V::page, "Tables", "Page: 0 built in, 1 update"),
      member(0x2000, 7, u32, ro, V::sequence, "Tables", "Sequence number"),
      member(0x2000, 8, u8, ro, V::update_slot, "Tables",
             "Slot for updates: 0 empty, 1 used, 2 same, refused: 3 older, 4 other origin, 5 other layout, 6 damaged, "
             "7 unreadable"),
      counter(Counter::ticks, "Fresh ticks"),
      counter(Counter::stale_ticks, "Stale ticks"),
      counter(Counter::overdue_syncs, "Stale ticks since SYNC was overdue"),
      counter(Counter::missing_setpoints, "Setpoints missing at SYNC"),
      counter(Counter::duplicate_setpoints, "Duplicate setpoints"),
      counter(Counter::malformed_setpoints, "Malformed setpoints"),
      counter(Counter::implausible_setpoints, "Implausible setpoints"),
      counter(Counter::malformed_frames, "Other malformed frames"),
      counter(Counter::saturations, "Saturations of the model"),
      counter(Counter::limited_steps, "Torque steps cut"),
      counter(Counter::lost_received, "Received frames lost"),
      counter(Counter::lost_sent, "Frames not sent"),
      counter(Counter::bus_offs, "Bus-offs"),
      counter(Counter::id_collisions, "Frames under own identifiers"),
      counter(Counter::lost_heartbeats, "Heartbeats lost"),
      counter(Counter::sdo_aborts, "SDO transfers aborted"),
      counter(Counter::foreign_frames, "Foreign frames"),
      counter(Counter::watchdog_resets, "Start-ups after a watchdog reset"),
      counter(Counter::nmt_resets, "Resets by NMT"),
      counter(Counter::mixed_setpoints, "Ticks with setpoints of two ticks"),
      member(0x2002, 1, u32, ro, V::cost, "Cost of a tick", "Model, last"),
      member(0x2002, 2, u32, ro, V::cost, "Cost of a tick", "Model, most"),
      member(0x2002, 3, u32, ro, V::cost, "Cost of a tick", "Everything, last"),
      member(0x2002, 4, u32, ro, V::cost, "Cost of a tick", "Everything, most"),
      member(0x2002, 5, Type::visible_string, fixed, V::cost_unit, "Cost of a tick", "Unit"),
      one(0x2003, Type::visible_string, rw, V::label, "Label"),
      within(one(0x2010, u16, rw, V::ramp_ticks, "Ticks of a ramp over the torque limit", "ticks", number,
                 defaults::ramp_ticks),
             0, 0xFFFF),
      within(array(0x2011, joints, i32, rw, V::step_limit, "Largest torque step", "Joint", "mN*m | mN"), 1,
             0x7FFF'FFFF),
      within(
          one(0x2012, u8, rw, V::tolerated_ticks, "Stale ticks tolerated", "ticks", number, defaults::tolerated_ticks),
          0, 0xFF),
      within(one(0x2013, u8, rw, V::tick_parity, "Lowest bit of a setpoint's acceleration is the tick's parity", "",
                 number, 0),
             0, 1),
      within(one(0x2014, u16, rw, V::patience, "Time without SYNC after which torque goes, where 0x1006 is 0", "ms",
                 number, defaults::patience_ms),
             1, 60'000),
      member(0x2020, 1, u8, fixed, V::fractional_bits, "Fractional bits", "Position"),
      member(0x2020, 2, u8, fixed, V::fractional_bits, "Fractional bits", "Velocity"),
      member(0x2020, 3, u8, fixed, V::fractional_bits, "Fractional bits", "Acceleration"),
      member(0x2020, 4, u8, fixed, V::fractional_bits, "Fractional bits", "Torque"),
      array(0x2021, joints, i32, ro, V::velocity_limit, "Velocity of 32768", "Joint", "raw"),
      array(0x2022, joints, i32, ro, V::acceleration_limit, "Acceleration of 32768", "Joint", "raw"),
      array(0x2023, joints, i32, ro, V::lower_position, "Lower position limit", "Joint", "raw"),
      array(0x2024, joints, i32, ro, V::upper_position, "Upper position limit", "Joint", "raw"),
      within(one(0x2030, u8, rw, V::can_fd, "CAN FD: all setpoints in one frame", "", number, 0), 0, 1),
      array(0x2040, joints, i32, fixed, V::rated_torque, "Rated torque", "Joint", "mN*m | mN"),
      array(0x2041, joints, i32, ro, V::lower_torque, "Lower torque limit", "Joint", "mN*m | mN"),
      array(0x2042, joints, i32, ro, V::upper_torque, "Upper torque limit", "Joint", "mN*m | mN"),

      // Process data
      mapped(array(0x2100, joints, i32, ro, V::setpoint_position, "Setpoint position", "Joint", "raw")),
      mapped(array(0x2101, joints, Type::integer16, ro, V::setpoint_velocity, "Setpoint velocity", "Joint",
                   "limit / 32768")),
      mapped(array(0x2102, joints, Type::integer16, ro, V::setpoint_acceleration, "Setpoint acceleration", "Joint",
                   "limit / 32768")),
      mapped(array(0x2110, joints, Type::integer16, ro, V::torque_per_mille, "Torque of rated", "Joint", "per mille")),
      mapped(array(0x2111, joints, i32, ro, V::torque_milli, "Torque", "Joint", "mN*m | mN")),
      mapped(array(0x2112, joints, u8, ro, V::tick_count, "Tick count", "Joint")),
      mapped(array(0x2113, joints, u8, ro, V::torque_status, "Torque status", "Joint")),
  };
}();

/// The list as the firmware holds it, without the texts.
inline constexpr auto entries = [] {
  std::array<Entry, described.size()> list{};
  for (std::size_t i = 0; i < list.size(); ++i) list[i] = described[i].entry;
  return list;
}();

/// Mapping parameter (7.5.2.36): what stands at place `sub_index` of joint's setpoint or torque, index, sub-index,
/// bits.
constexpr std::uint32_t mapping(bool torque, std::size_t sub_index, std::size_t joint) {
  constexpr std::array<std::uint32_t, 3> setpoints{0x2100'0020, 0x2101'0010, 0x2102'0010};
  constexpr std::array<std::uint32_t, 4> torques{0x2110'0010, 0x2111'0020, 0x2112'0008, 0x2113'0008};
  return (torque ? torques[sub_index - 1] : setpoints[sub_index - 1]) | static_cast<std::uint32_t>(joint + 1) << 8;
}

/// Which joints a dictionary is for.
struct Extent {
  std::size_t joints = 1;
  std::uint32_t outputs = 1;  ///< bit i: joint i+1

  constexpr std::size_t length(const Entry& entry) const {
    return entry.array == array_of_joints ? joints : entry.array;
  }
  /// Whether an entry that stands at consecutive indices stands at `offset` too.
  constexpr bool stands_at(const Entry& entry, std::size_t offset) const {
    if (entry.times == Times::one) return offset == 0;
    return offset < joints && (entry.times == Times::each_joint || (outputs >> offset & 1U) != 0);
  }
};

/// One entry at one place. `entry` null: the number of sub-indices, which records and arrays have at sub-index 0.
struct Object {
  const Entry* entry = nullptr;
  std::uint8_t item = 0;  ///< joint, counter, .. from 0
  std::uint8_t highest_sub_index = 0;
  std::uint8_t sub_index = 0;

  constexpr bool readable() const { return true; }
  constexpr bool writable() const { return entry != nullptr && entry->access == Access::read_write; }
  constexpr Type type() const { return entry != nullptr ? entry->type : Type::unsigned8; }
  constexpr bool has_fixed_size() const { return type() != Type::visible_string; }
  constexpr std::size_t size() const { return size_of(type()); }
};

constexpr canopen::Abort find(const Extent& extent, std::uint16_t index, std::uint8_t sub_index, Object& object) {
  bool index_exists = false;
  std::size_t highest = 0;
  for (const Entry& entry : entries) {
    const std::size_t offset = wrapping_subtract(std::size_t{index}, entry.index);  // huge where the index is smaller
    if (!extent.stands_at(entry, offset)) continue;
    index_exists = true;
    const std::size_t last = entry.array == 0 ? entry.sub_index : extent.length(entry);
    if (sub_index >= entry.sub_index && sub_index <= last) {
      const std::size_t item = entry.times != Times::one ? offset : (sub_index == 0 ? 0U : sub_index - 1U);
      object = {&entry, static_cast<std::uint8_t>(item), 0, sub_index};
      return canopen::Abort::none;
    }
    highest = std::max(highest, last);
  }
  if (!index_exists) return canopen::Abort::no_object;
  if (sub_index != 0) return canopen::Abort::no_sub_index;
  object = {nullptr, 0, static_cast<std::uint8_t>(highest), 0};
  return canopen::Abort::none;
}

}  // namespace fxdyn::dictionary
