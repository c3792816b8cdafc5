#pragma once

#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <span>
#include <string>
#include <thread>

#include "hal/linux/socket_can.hpp"
#include "host_tools/can/bus.hpp"

namespace fxdyn::can {

/// Sees to it that drives do not outlive the process that moves them. While it lives, a thread of its own sends the
/// master's heartbeat, however long the process computes: it ends with the process, whatever ends that. SIGINT, SIGTERM
/// and SIGHUP take the guarded nodes to pre-operational before they end the process. One at a time in a process.
class Guard {
 public:
  static constexpr Duration heartbeat_period = std::chrono::milliseconds(250);
  /// What nodes should wait for a heartbeat (object 0x1016) [ms]: eight periods, so that a busy machine is no dead one.
  static constexpr std::uint16_t consumer_ms = 2000;

  /// @param master node id of the heartbeat, 1 .. 127, that no node has
  /// @throws BusError
  Guard(const std::string& interface, std::uint8_t master);
  ~Guard();
  Guard(const Guard&) = delete;
  Guard& operator=(const Guard&) = delete;

  /// From here on these nodes are stopped by the signals.
  void stop_by_signals(std::span<const std::uint8_t> nodes);

 private:
  void beat(std::uint8_t master);

  hal::linux::SocketCan<hal::ClassicFrame> socket_;
  std::mutex mutex_;
  std::condition_variable end_;
  bool ended_ = false;
  std::thread thread_;
};

}  // namespace fxdyn::can
