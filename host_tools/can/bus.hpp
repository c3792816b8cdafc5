#pragma once

#include <chrono>
#include <cstdint>
#include <span>
#include <stdexcept>
#include <string>

#include "hal/can.hpp"
#include "hal/linux/socket_can.hpp"

namespace fxdyn::can {

using Frame = hal::FdFrame;  ///< classic frames as well
using Duration = std::chrono::nanoseconds;

/// The bus can't be used: one line that says what to do.
struct BusError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// What a master needs of a bus: SocketCAN, or nodes in memory with a time of their own.
class Bus {
 public:
  virtual ~Bus() = default;
  virtual void send(const Frame& frame) = 0;  ///< waits for room
  virtual void send_all(std::span<const Frame> frames) {
    for (const Frame& frame : frames) send(frame);
  }
  /// False: none came within `timeout`.
  virtual bool receive(Frame& frame, Duration timeout) = 0;
  virtual Duration now() const = 0;        ///< of a clock that only runs forward
  virtual std::uint32_t lost() const = 0;  ///< received frames that were dropped on the way, as far as known
  virtual std::string name() const = 0;    ///< as commands take it: can0
  /// What is wrong with this end of the bus, with the command that puts it right: error passive, off the bus. Empty:
  /// nothing that is known.
  virtual std::string trouble() = 0;
};

/// Throws BusError where the interface can't be opened or goes away.
class SocketBus final : public Bus {
 public:
  explicit SocketBus(const std::string& interface, bool fd = false);
  void send(const Frame& frame) override;
  /// Classic data frames go with one system call: on a processor that is shared with the nodes, none of them is woken
  /// in between.
  void send_all(std::span<const Frame> frames) override;
  bool receive(Frame& frame, Duration timeout) override;
  Duration now() const override;
  std::uint32_t lost() const override { return lost_; }
  std::string name() const override { return socket_.interface(); }
  std::string trouble() override;

 private:
  [[noreturn]] void fail();
  hal::linux::SocketCan<Frame> socket_;
  std::uint32_t lost_ = 0;
};

}  // namespace fxdyn::can
