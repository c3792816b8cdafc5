#include "hal/linux/socket_can.hpp"

#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <linux/errqueue.h>
#include <linux/net_tstamp.h>
#include <net/if.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include <array>
#include <bit>
#include <cerrno>
#include <cstring>

namespace fxdyn::hal::linux {
namespace {

/// Room for some thousand frames, about a second of a full bus, so that a process that is kept waiting loses none.
constexpr int receive_buffer_bytes = 4 << 20;
constexpr std::int64_t restart_interval_ns = 10'000'000;

template <class T>
bool set(int socket, int level, int name, const T& value) {
  return ::setsockopt(socket, level, name, &value, sizeof value) == 0;
}

CanOpenError error_of(int number) {
  switch (number) {
    case EAFNOSUPPORT:
    case EPROTONOSUPPORT:
      return CanOpenError::no_can;
    case ENODEV:
      return CanOpenError::no_interface;
    case ENETDOWN:
      return CanOpenError::down;
    case EPERM:
    case EACCES:
      return CanOpenError::permission;
    default:
      return CanOpenError::system;
  }
}

bool set_filters(int socket, const std::vector<can_filter>& filters) {
  return ::setsockopt(socket, SOL_CAN_RAW, CAN_RAW_FILTER, filters.data(),
                      static_cast<socklen_t>(filters.size() * sizeof(can_filter))) == 0;
}

}  // namespace

std::vector<can_filter> filters_of(IdRange range) {
  std::vector<can_filter> filters;
  for (std::uint32_t first = range.first; first <= range.last;) {
    std::uint32_t size = first == 0 ? CAN_SFF_MASK + 1 : 1U << std::countr_zero(first);
    while (size > range.last - first + 1) size /= 2;
    filters.push_back({first, CAN_EFF_FLAG | (CAN_SFF_MASK & ~(size - 1))});
    first += size;
  }
  return filters;
}

CanOpenResult CanSocket::open(std::string_view interface, bool fd, std::span<const can_filter> filters) {
  close();
  interface_ = interface;
  filters_.assign(filters.begin(), filters.end());
  const auto failed = [this](CanOpenError error, int number) {
    close();
    return CanOpenResult{error, number};
  };
  socket_ = ::socket(AF_CAN, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, CAN_RAW);
  if (socket_ < 0) return failed(error_of(errno), errno);
  CanLink link;
  if (const int number = query_link(interface, link); number != 0) return failed(error_of(number), number);
  if (!link.can) return failed(CanOpenError::not_can, ENODEV);
  if (fd && !link.fd) return failed(CanOpenError::not_fd, EINVAL);
  if (!link.up) return failed(CanOpenError::down, ENETDOWN);

  const int yes = 1;
  const can_err_mask_t every_error = CAN_ERR_MASK;
  const int timestamps = SOF_TIMESTAMPING_RX_SOFTWARE | SOF_TIMESTAMPING_SOFTWARE;
  if ((fd && !set(socket_, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, yes)) ||
      !set(socket_, SOL_CAN_RAW, CAN_RAW_ERR_FILTER, every_error) || !set(socket_, SOL_SOCKET, SO_RXQ_OVFL, yes) ||
      !set(socket_, SOL_SOCKET, SO_TIMESTAMPING, timestamps) ||
      (!filters_.empty() && !set_filters(socket_, filters_))) {
    return failed(error_of(errno), errno);
  }
  // beyond net.core.rmem_max only with CAP_NET_ADMIN; a smaller buffer works as well
  if (!set(socket_, SOL_SOCKET, SO_RCVBUFFORCE, receive_buffer_bytes)) {
    [[maybe_unused]] const bool kept = set(socket_, SOL_SOCKET, SO_RCVBUF, receive_buffer_bytes);
  }

  sockaddr_can address{};
  address.can_family = AF_CAN;
  address.can_ifindex = static_cast<int>(::if_nametoindex(interface_.c_str()));
  if (::bind(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
    return failed(error_of(errno), errno);
  }
  errors_ = {.state = link.state, .transmit = link.transmit_errors, .receive = link.receive_errors, .lost = 0};
  return {};
}

void CanSocket::listen(std::span<const IdRange> ranges) {
  if (filters_.empty()) return;
  std::vector<can_filter> all = filters_;
  for (const IdRange range : ranges) {
    const std::vector<can_filter> more = filters_of(range);
    all.insert(all.end(), more.begin(), more.end());
  }
  if (!set_filters(socket_, all)) failure_ = errno;
}

void CanSocket::close() {
  if (socket_ >= 0) ::close(socket_);
  socket_ = -1;
  next_ = end_ = 0;
}

Status CanSocket::send(const canfd_frame& frame, bool fd) {
  // While a controller is off the bus the kernel takes frames and drops them.
  if (errors_.state == CanState::bus_off) return Status::failed;
  // A classic frame has the layout of an FD one, only shorter (linux/can.h).
  const std::size_t size = fd ? CANFD_MTU : CAN_MTU;
  ssize_t written = 0;
  do {
    written = ::write(socket_, &frame, size);
  } while (written < 0 && errno == EINTR);
  if (written == static_cast<ssize_t>(size)) return Status::ok;
  return errno == EAGAIN || errno == ENOBUFS ? Status::busy : failed();
}

std::size_t CanSocket::send(std::span<const can_frame> frames) {
  if (errors_.state == CanState::bus_off) return 0;
  std::array<iovec, batch> parts;
  std::array<mmsghdr, batch> messages{};
  const std::size_t count = std::min(frames.size(), batch);
  for (std::size_t i = 0; i < count; ++i) {
    parts[i] = {const_cast<can_frame*>(&frames[i]), sizeof frames[i]};  // sendmmsg only reads it
    messages[i].msg_hdr.msg_iov = &parts[i];
    messages[i].msg_hdr.msg_iovlen = 1;
  }
  const int sent = ::sendmmsg(socket_, messages.data(), static_cast<unsigned>(count), 0);
  return sent > 0 ? static_cast<std::size_t>(sent) : 0;
}

Status CanSocket::fetch() {
  constexpr std::size_t control_bytes = CMSG_SPACE(sizeof(scm_timestamping)) + CMSG_SPACE(sizeof(std::uint32_t));
  alignas(cmsghdr) std::array<std::array<char, control_bytes>, batch> control;
  std::array<iovec, batch> parts;
  std::array<mmsghdr, batch> messages{};
  for (std::size_t i = 0; i < batch; ++i) {
    parts[i] = {&received_[i].frame, sizeof received_[i].frame};
    messages[i].msg_hdr.msg_iov = &parts[i];
    messages[i].msg_hdr.msg_iovlen = 1;
    messages[i].msg_hdr.msg_control = control[i].data();
    messages[i].msg_hdr.msg_controllen = control_bytes;
  }
  int count = 0;
  do {
    count = ::recvmmsg(socket_, messages.data(), batch, MSG_DONTWAIT, nullptr);
  } while (count < 0 && errno == EINTR);
  if (count < 0) return errno == EAGAIN ? Status::busy : failed();
  next_ = 0;
  end_ = static_cast<std::size_t>(count);
  for (std::size_t i = 0; i < end_; ++i) {
    received_[i].size = messages[i].msg_len;
    received_[i].lost = i > 0 ? received_[i - 1].lost : errors_.lost;
    msghdr& message = messages[i].msg_hdr;
    for (cmsghdr* part = CMSG_FIRSTHDR(&message); part != nullptr; part = CMSG_NXTHDR(&message, part)) {
      if (part->cmsg_level != SOL_SOCKET) continue;
      if (part->cmsg_type == SO_RXQ_OVFL) std::memcpy(&received_[i].lost, CMSG_DATA(part), sizeof received_[i].lost);
      if (part->cmsg_type == SO_TIMESTAMPING) {
        scm_timestamping times;
        std::memcpy(&times, CMSG_DATA(part), sizeof times);
        received_[i].ns = times.ts[0].tv_sec * 1'000'000'000LL + times.ts[0].tv_nsec;
      }
    }
  }
  return Status::ok;
}

Status CanSocket::receive(canfd_frame& frame, bool& fd) {
  for (;;) {
    if (next_ == end_) {
      if (const Status status = fetch(); status != Status::ok) return status;
    }
    const Received& received = received_[next_++];
    if (received.size != CAN_MTU && received.size != CANFD_MTU) return Status::failed;
    errors_.lost = received.lost;
    received_ns_ = received.ns;
    if ((received.frame.can_id & CAN_ERR_FLAG) != 0) {
      read_error_frame(received.frame);
      continue;
    }
    frame = received.frame;
    fd = received.size == CANFD_MTU;
    return Status::ok;
  }
}

void CanSocket::read_error_frame(const canfd_frame& frame) {
  if ((frame.can_id & CAN_ERR_BUSOFF) != 0) errors_.state = CanState::bus_off;
  if ((frame.can_id & CAN_ERR_RESTARTED) != 0) errors_.state = CanState::active;
  if ((frame.can_id & CAN_ERR_CRTL) != 0 && errors_.state != CanState::bus_off) {
    if ((frame.data[1] & (CAN_ERR_CRTL_RX_PASSIVE | CAN_ERR_CRTL_TX_PASSIVE)) != 0) errors_.state = CanState::passive;
    if ((frame.data[1] & (CAN_ERR_CRTL_ACTIVE | CAN_ERR_CRTL_RX_WARNING | CAN_ERR_CRTL_TX_WARNING)) != 0)
      errors_.state = CanState::active;
  }
  if ((frame.can_id & CAN_ERR_CNT) != 0) {
    errors_.transmit = frame.data[6];
    errors_.receive = frame.data[7];
  }
}

CanErrors CanSocket::errors() { return errors_; }

Status CanSocket::failed() {
  failure_ = errno;
  return Status::failed;
}

Status CanSocket::restart() {
  timespec time{};
  ::clock_gettime(CLOCK_MONOTONIC, &time);
  const std::int64_t now = time.tv_sec * 1'000'000'000LL + time.tv_nsec;
  if (now - restarted_ns_ < restart_interval_ns) return restart_error_ == 0 ? Status::busy : Status::failed;
  restarted_ns_ = now;
  CanLink link;
  restart_error_ = query_link(interface_, link);
  if (restart_error_ != 0) return Status::failed;
  if (link.state != CanState::bus_off) {
    errors_.state = link.state;
    return Status::ok;
  }
  if (link.restart_ms > 0) return Status::busy;
  restart_error_ = restart_link(interface_);
  // EBUSY, EINVAL: it has restarted meanwhile
  return restart_error_ == 0 || restart_error_ == EBUSY || restart_error_ == EINVAL ? Status::busy : Status::failed;
}

std::string explain(CanOpenResult result, std::string_view interface) {
  const std::string name(interface);
  switch (result.error) {
    case CanOpenError::none:
      return {};
    case CanOpenError::no_can:
      return "this kernel has no CAN sockets: modprobe can_raw";
    case CanOpenError::no_interface:
      return "no interface " + name + ": `ip -br link show type can` lists them; a virtual one: sudo ip link add " +
             name + " type vcan && sudo ip link set " + name + " up";
    case CanOpenError::not_can:
      return name + " is no CAN interface: `ip -br link show type can` lists them";
    case CanOpenError::down:
      return name + " is down: sudo ip link set " + name +
             " up type can bitrate 1000000 (a virtual one: sudo ip link set " + name + " up)";
    case CanOpenError::not_fd:
      return name + " carries no CAN FD frames: sudo ip link set " + name + " down && sudo ip link set " + name +
             " up type can bitrate 1000000 dbitrate 2000000 fd on (a virtual one: sudo ip link set " + name +
             " mtu 72)";
    case CanOpenError::permission:
      return "no permission for CAN sockets on " + name +
             ": run it with sudo, or sudo setcap cap_net_raw+ep on the program";
    case CanOpenError::system:
      break;
  }
  return name + ": " + std::strerror(result.number);
}

std::string explain(const CanErrors& errors, std::string_view interface, std::uint32_t bit_rate) {
  if (errors.state == CanState::active) return {};
  const std::string name(interface), rate = std::to_string(bit_rate);
  if (errors.state == CanState::passive) {
    return name + " is error passive (" + std::to_string(errors.transmit) + " transmit, " +
           std::to_string(errors.receive) +
           " receive errors): no other node, no terminator, or not the bit rate of the bus, here " + rate +
           ": sudo ip link set " + name + " down && sudo ip link set " + name + " up type can bitrate 1000000";
  }
  return name + " is off the bus: sudo ip link set " + name + " type can restart (by itself: sudo ip link set " + name +
         " down && sudo ip link set " + name + " up type can restart-ms 100)";
}

}  // namespace fxdyn::hal::linux
