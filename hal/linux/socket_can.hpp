#pragma once

#include <linux/can.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "hal/can.hpp"
#include "hal/linux/can_link.hpp"

namespace fxdyn::hal::linux {

/// Why a CAN interface could not be opened. explain() has the line for people.
enum class CanOpenError : std::uint8_t {
  none,
  no_can,        ///< the kernel has no CAN
  no_interface,  ///< no interface of that name
  not_can,       ///< one that is no CAN interface
  down,          ///< it has not been started
  not_fd,        ///< CAN FD was asked for and it can't
  permission,    ///< sockets of this kind are not allowed here
  system,        ///< anything else: see `number`
};
struct CanOpenResult {
  CanOpenError error = CanOpenError::none;
  int number = 0;  ///< errno
  explicit operator bool() const { return error == CanOpenError::none; }
};

/// One line that says what is wrong with `interface` and the command that puts it right.
std::string explain(CanOpenResult result, std::string_view interface);
/// The same for a controller that is error passive or off the bus; empty where nothing is wrong.
std::string explain(const CanErrors& errors, std::string_view interface, std::uint32_t bit_rate);

/// Kernel filters for frames with 11 bits whose identifier is in the range: one for each aligned power of two in it.
std::vector<can_filter> filters_of(IdRange range);

/// Raw socket (linux/can/raw.h) on one interface, non-blocking. Knows of bytes only; SocketCan gives it its frames.
class CanSocket {
 public:
  CanSocket() = default;
  ~CanSocket() { close(); }
  CanSocket(const CanSocket&) = delete;
  CanSocket& operator=(const CanSocket&) = delete;

  /// `filters`: what the kernel lets through, everything where empty. `fd`: frames of CAN FD as well.
  [[nodiscard]] CanOpenResult open(std::string_view interface, bool fd, std::span<const can_filter> filters = {});
  /// Lets these through beside the filters that it was opened with; without any of those everything comes anyway.
  void listen(std::span<const IdRange> ranges);
  void close();
  Status send(const canfd_frame& frame, bool fd);
  /// Several classic frames with one system call: how many went. Fewer: as send() of the next one would say.
  std::size_t send(std::span<const can_frame> frames);
  /// Takes up to `batch` frames from the kernel at once.
  Status receive(canfd_frame& frame, bool& fd);
  /// From the error frames that receive() has met.
  CanErrors errors();
  /// Leaves bus-off: by the kernel's own timer where the interface has `restart-ms`, by netlink with CAP_NET_ADMIN;
  /// failed without either, and restart_error() is EPERM.
  Status restart();

  int descriptor() const { return socket_; }  ///< to poll for input after receive() was busy; -1: closed
  int restart_error() const { return restart_error_; }
  /// errno of the last call that failed: ENETDOWN, ENODEV (unplugged). It is kept until it is asked for.
  int take_failure() { return std::exchange(failure_, 0); }
  /// When the kernel took the last received frame from the device [ns since 1970, CLOCK_REALTIME].
  std::int64_t received_ns() const { return received_ns_; }
  const std::string& interface() const { return interface_; }

 private:
  Status failed();
  void read_error_frame(const canfd_frame& frame);
  Status fetch();

  static constexpr std::size_t batch = 16;
  struct Received {
    canfd_frame frame;
    std::size_t size;
    std::int64_t ns;
    std::uint32_t lost;
  };
  std::array<Received, batch> received_;
  std::size_t next_ = 0, end_ = 0;  ///< of received_
  int socket_ = -1;
  int restart_error_ = 0, failure_ = 0;
  std::int64_t restarted_ns_ = 0;
  std::int64_t received_ns_ = 0;
  std::string interface_;
  std::vector<can_filter> filters_;
  CanErrors errors_{};
};

/// hal::CanBus on SocketCAN. With FdFrame the interface has to be CAN FD capable, unless it is opened for classic
/// frames, which go over it as well.
template <class Frame_>
class SocketCan : public CanSocket {
 public:
  using Frame = Frame_;
  [[nodiscard]] CanOpenResult open(std::string_view interface, std::span<const can_filter> filters = {},
                                   bool fd = Frame::most_bytes > CAN_MAX_DLEN) {
    return CanSocket::open(interface, fd, filters);
  }
  Status send(const Frame& frame) {
    canfd_frame out{};
    out.can_id = frame.id | (frame.extended ? CAN_EFF_FLAG : 0U) | (frame.remote ? CAN_RTR_FLAG : 0U);
    out.len = static_cast<__u8>(std::min<std::size_t>(frame.size, Frame::most_bytes));
    out.flags = frame.fd ? CANFD_BRS : 0;
    std::copy_n(frame.data.begin(), out.len, out.data);
    return CanSocket::send(out, frame.fd);
  }
  Status receive(Frame& frame) {
    canfd_frame in;
    bool in_is_fd = false;
    const Status status = CanSocket::receive(in, in_is_fd);
    if (status != Status::ok) return status;
    frame.extended = (in.can_id & CAN_EFF_FLAG) != 0;
    frame.id = in.can_id & (frame.extended ? CAN_EFF_MASK : CAN_SFF_MASK);
    frame.remote = (in.can_id & CAN_RTR_FLAG) != 0;
    frame.fd = in_is_fd;
    frame.size = static_cast<std::uint8_t>(std::min<std::size_t>(in.len, Frame::most_bytes));
    std::copy_n(in.data, frame.size, frame.data.begin());
    return status;
  }
};
static_assert(FilteringCanBus<SocketCan<ClassicFrame>> && FilteringCanBus<SocketCan<FdFrame>>);

}  // namespace fxdyn::hal::linux
