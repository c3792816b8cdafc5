#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "firmware/protocol/canopen.hpp"
#include "host_tools/can/bus.hpp"

namespace fxdyn::can {

/// A node did not do what it was asked: no answer, an abort, another state. One line, with the node and what to look
/// at.
struct NodeError : std::runtime_error {
  using std::runtime_error::runtime_error;
};
/// The node's boot-up message came instead of an answer: it lost the request by its reset.
struct NodeRestarted : NodeError {
  using NodeError::NodeError;
};
/// An SDO transfer that the node aborted.
struct SdoAbort : NodeError {
  SdoAbort(const std::string& what, canopen::Abort reason) : NodeError(what), code(reason) {}
  canopen::Abort code;
};

struct Emergency {
  std::uint8_t node = 0;
  std::uint16_t code = 0;
  std::uint8_t error_register = 0;
  std::array<std::uint8_t, 5> detail{};
};

/// CANopen master (CiA 301) for a bus of drive nodes: NMT, SYNC, SDO client, heartbeats, EMCY. What comes while it
/// waits for something else is kept (heartbeats, emergencies) or given to `other`.
class Master {
 public:
  explicit Master(Bus& bus) : bus_(bus) {}

  Bus& bus() { return bus_; }
  Duration sdo_timeout = std::chrono::seconds(1);  ///< for each answer
  std::function<void(const Frame&)> other;

  void command(canopen::NmtCommand command, std::uint8_t node = 0);  ///< node 0: all
  void sync() { bus_.send({.id = canopen::sync_id}); }
  void heartbeat(std::uint8_t node, canopen::NmtState state);  ///< the master's own, for the nodes' heartbeat consumers

  std::vector<std::uint8_t> upload(std::uint8_t node, std::uint16_t index, std::uint8_t sub_index);
  void download(std::uint8_t node, std::uint16_t index, std::uint8_t sub_index, std::span<const std::uint8_t> bytes);
  /// Objects of up to four bytes, little endian.
  std::uint32_t read(std::uint8_t node, std::uint16_t index, std::uint8_t sub_index);
  std::string read_text(std::uint8_t node, std::uint16_t index, std::uint8_t sub_index);
  void write(std::uint8_t node, std::uint16_t index, std::uint8_t sub_index, std::uint32_t value, std::size_t bytes);
  /// The node takes SYNC at any rate (0x1006 = 0), as a host in lockstep sends it, and lets the torque go when none has
  /// come for `patience` (0x2014).
  void use_lockstep(std::uint8_t node, std::chrono::milliseconds patience);

  /// Takes what comes for so long.
  void listen(Duration time);
  /// Waits for a heartbeat (boot-up counts as `initialising`) of the node in this state; throws NodeError.
  void wait_for(std::uint8_t node, canopen::NmtState state, Duration timeout);
  /// NMT reset of a node; returns when it answers to SDO again; throws NodeError. A node that was just switched on may
  /// send the boot-up message of its start before it obeys the command, and a second one afterwards (CiA 301, 7.3.2.2:
  /// no SDO while it initialises).
  void reset(std::uint8_t node, Duration timeout);
  struct Heartbeat {
    canopen::NmtState state = canopen::NmtState::initialising;
    std::uint32_t count = 0;
    Duration last{};
  };
  const Heartbeat& heartbeat_of(std::uint8_t node) const { return heartbeats_[node & 127U]; }
  std::vector<Emergency> emergencies;  ///< all so far

  /// Keeps a heartbeat or an EMCY, or hands the frame to `other`.
  void dispatch(const Frame& frame);

 private:
  using Bytes = std::array<std::uint8_t, 8>;
  Bytes exchange(std::uint8_t node, const Bytes& request, std::uint16_t index, std::uint8_t sub_index);
  [[noreturn]] void protocol_error(std::uint8_t node, std::uint16_t index, std::uint8_t sub_index);

  Bus& bus_;
  std::array<Heartbeat, 128> heartbeats_{};
};

std::string to_text(canopen::NmtState state);

}  // namespace fxdyn::can
