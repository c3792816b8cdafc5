#pragma once

#include <cstdint>
#include <string_view>

#include "hal/can.hpp"

namespace fxdyn::hal::linux {

/// What the kernel knows of a CAN interface (rtnetlink, linux/can/netlink.h). Virtual ones have neither a bit rate nor
/// states: they stay `active` and `controlled` is false.
struct CanLink {
  bool exists = false;
  bool can = false;  ///< an interface of type CAN, and not an Ethernet card
  bool up = false;
  bool fd = false;          ///< frames of 64 bytes (MTU 72)
  bool controlled = false;  ///< a controller is behind it
  CanState state = CanState::active;
  std::uint32_t bit_rate = 0, data_bit_rate = 0;  ///< [bit/s]
  std::uint32_t restart_ms = 0;                   ///< how long the kernel leaves it off the bus; 0: for ever
  std::uint8_t transmit_errors = 0, receive_errors = 0;
};

/// errno, 0 on success.
int query_link(std::string_view interface, CanLink& link);

/// Makes the kernel restart a controller that is off the bus (IFLA_CAN_RESTART): as `ip link set can0 type can
/// restart`. Needs CAP_NET_ADMIN. Returns errno, 0 on success, EPERM without the capability.
int restart_link(std::string_view interface);

}  // namespace fxdyn::hal::linux
