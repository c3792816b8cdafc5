#pragma once

#include <cstddef>
#include <cstdint>

// The numbers of CiA 301 (CANopen application layer and communication profile, version 4.2) that a drive node needs.

namespace fxdyn::canopen {

/// Function codes of the pre-defined connection set, to which a node's id is added (CiA 301, 7.3.3).
inline constexpr std::uint32_t nmt_id = 0x000, sync_id = 0x080, emergency_id = 0x080, torque_id = 0x180,
                               setpoint_id = 0x200, sdo_answer_id = 0x580, sdo_request_id = 0x600, heartbeat_id = 0x700;
inline constexpr std::uint32_t largest_node_id = 127;

/// Bits of a COB-ID above its identifier: PDO does not exist, no remote frames, 29-bit identifier (7.5.2.35).
inline constexpr std::uint32_t cob_invalid = 1U << 31, cob_no_remote = 1U << 30, cob_extended = 1U << 29;
inline constexpr std::uint32_t cob_identifier = 0x7FF;

/// Identifiers that no PDO, SYNC or EMCY may take (7.3.5, table "restricted CAN-IDs"). Of the SDO's and the heartbeat's
/// ranges also the first, which would belong to node 0.
constexpr bool is_restricted(std::uint32_t id) {
  return id <= 0x07F || (id >= 0x101 && id <= 0x180) || (id >= 0x580 && id <= 0x67F) || (id >= 0x6E0 && id <= 0x6FF) ||
         id >= 0x700;
}
/// What a heartbeat says (7.2.8.3.2.2).
enum class NmtState : std::uint8_t { initialising = 0x00, stopped = 0x04, operational = 0x05, pre_operational = 0x7F };

/// Command specifiers of NMT (7.2.8.3.1).
enum class NmtCommand : std::uint8_t {
  start = 0x01,
  stop = 0x02,
  enter_pre_operational = 0x80,
  reset_node = 0x81,
  reset_communication = 0x82,
};

/// Abort codes of SDO (7.2.4.3.17, table 22).
enum class Abort : std::uint32_t {
  none = 0,
  toggle_bit = 0x0503'0000,
  timed_out = 0x0504'0000,
  unknown_command = 0x0504'0001,
  write_only = 0x0601'0001,
  read_only = 0x0601'0002,
  no_object = 0x0602'0000,
  wrong_length = 0x0607'0010,
  too_long = 0x0607'0012,
  too_short = 0x0607'0013,
  no_sub_index = 0x0609'0011,
  invalid_value = 0x0609'0030,
  too_high = 0x0609'0031,
  too_low = 0x0609'0032,
  incompatible = 0x0604'0043,
  device_state = 0x0800'0022,
  no_data = 0x0800'0024,
};

/// Little endian, as everything on the bus.
template <std::size_t bytes>
constexpr void store(std::uint8_t* to, std::uint32_t value) {
  for (std::size_t i = 0; i < bytes; ++i) to[i] = static_cast<std::uint8_t>(value >> (8 * i));
}
template <std::size_t bytes>
constexpr std::uint32_t load(const std::uint8_t* from) {
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < bytes; ++i) value |= static_cast<std::uint32_t>(from[i]) << (8 * i);
  return value;
}

}  // namespace fxdyn::canopen
