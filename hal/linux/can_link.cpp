#include "hal/linux/can_link.hpp"

#include <linux/can.h>
#include <linux/can/netlink.h>
#include <linux/if_link.h>
#include <linux/rtnetlink.h>
#include <net/if.h>
#include <net/if_arp.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>

namespace fxdyn::hal::linux {
namespace {

/// A request to rtnetlink about one interface: header, ifinfomsg and attributes.
class Request {
 public:
  Request(std::uint16_t type, std::uint16_t flags, int index) {
    header().nlmsg_len = NLMSG_LENGTH(sizeof(ifinfomsg));
    header().nlmsg_type = type;
    header().nlmsg_flags = static_cast<std::uint16_t>(NLM_F_REQUEST | flags);
    auto& info = *static_cast<ifinfomsg*>(NLMSG_DATA(&header()));
    info.ifi_family = AF_UNSPEC;
    info.ifi_index = index;
  }
  /// Adds an attribute; with no data one that holds others, to be closed by end().
  rtattr* add(std::uint16_t type, const void* data = nullptr, std::size_t size = 0) {
    auto* attribute = reinterpret_cast<rtattr*>(buffer_.data() + NLMSG_ALIGN(header().nlmsg_len));
    attribute->rta_type = type;
    attribute->rta_len = static_cast<std::uint16_t>(RTA_LENGTH(size));
    if (size > 0) std::memcpy(RTA_DATA(attribute), data, size);
    header().nlmsg_len = NLMSG_ALIGN(header().nlmsg_len) + RTA_ALIGN(attribute->rta_len);
    return attribute;
  }
  void end(rtattr* outer) {
    outer->rta_len = static_cast<std::uint16_t>(buffer_.data() + header().nlmsg_len - reinterpret_cast<char*>(outer));
  }
  /// Sends it and reads the first message of the answer; errno.
  int exchange(std::array<char, 16384>& answer, ssize_t& size) {
    const int socket = ::socket(AF_NETLINK, SOCK_RAW | SOCK_CLOEXEC, NETLINK_ROUTE);
    if (socket < 0) return errno;
    int error = 0;
    if (::send(socket, buffer_.data(), header().nlmsg_len, 0) < 0 ||
        (size = ::recv(socket, answer.data(), answer.size(), 0)) < static_cast<ssize_t>(sizeof(nlmsghdr))) {
      error = errno != 0 ? errno : EIO;
    }
    ::close(socket);
    if (error != 0) return error;
    const auto& reply = *reinterpret_cast<nlmsghdr*>(answer.data());
    return reply.nlmsg_type == NLMSG_ERROR ? -static_cast<nlmsgerr*>(NLMSG_DATA(&reply))->error : 0;
  }

 private:
  nlmsghdr& header() { return *reinterpret_cast<nlmsghdr*>(buffer_.data()); }
  alignas(nlmsghdr) std::array<char, 256> buffer_{};
};

/// Calls visit(type, data, size) for each attribute in a stretch of memory.
template <class Visit>
void each_attribute(const void* memory, std::size_t size, Visit&& visit) {
  const auto* attribute = static_cast<const rtattr*>(memory);
  for (auto left = static_cast<int>(size); RTA_OK(attribute, left); attribute = RTA_NEXT(attribute, left)) {
    visit(attribute->rta_type & NLA_TYPE_MASK, static_cast<const void*>(RTA_DATA(attribute)), RTA_PAYLOAD(attribute));
  }
}

template <class T>
T value_of(const void* data, std::size_t size) {
  T value{};
  std::memcpy(&value, data, size < sizeof value ? size : sizeof value);
  return value;
}

void read_can_attribute(int type, const void* data, std::size_t size, CanLink& link) {
  switch (type) {
    case IFLA_CAN_STATE: {
      const auto state = value_of<std::uint32_t>(data, size);
      link.controlled = true;
      link.state = state >= CAN_STATE_BUS_OFF && state != CAN_STATE_STOPPED && state != CAN_STATE_SLEEPING
                       ? CanState::bus_off
                   : state == CAN_STATE_ERROR_PASSIVE ? CanState::passive
                                                      : CanState::active;
      break;
    }
    case IFLA_CAN_BITTIMING:
      link.bit_rate = value_of<can_bittiming>(data, size).bitrate;
      break;
    case IFLA_CAN_DATA_BITTIMING:
      link.data_bit_rate = value_of<can_bittiming>(data, size).bitrate;
      break;
    case IFLA_CAN_RESTART_MS:
      link.restart_ms = value_of<std::uint32_t>(data, size);
      break;
    case IFLA_CAN_BERR_COUNTER: {
      const auto counters = value_of<can_berr_counter>(data, size);
      link.transmit_errors = static_cast<std::uint8_t>(counters.txerr > 255 ? 255 : counters.txerr);
      link.receive_errors = static_cast<std::uint8_t>(counters.rxerr > 255 ? 255 : counters.rxerr);
      break;
    }
    default:
      break;
  }
}

int index_of(std::string_view interface) {
  std::array<char, IFNAMSIZ> name{};
  if (interface.size() >= name.size()) return 0;
  interface.copy(name.data(), interface.size());
  return static_cast<int>(::if_nametoindex(name.data()));
}

}  // namespace

int query_link(std::string_view interface, CanLink& link) {
  link = {};
  const int index = index_of(interface);
  if (index == 0) return ENODEV;
  link.exists = true;
  Request request(RTM_GETLINK, 0, index);
  alignas(nlmsghdr) std::array<char, 16384> answer;
  ssize_t size = 0;
  if (const int error = request.exchange(answer, size); error != 0) return error;
  const auto& reply = *reinterpret_cast<nlmsghdr*>(answer.data());
  const auto& info = *static_cast<ifinfomsg*>(NLMSG_DATA(&reply));
  link.can = info.ifi_type == ARPHRD_CAN;
  link.up = (info.ifi_flags & IFF_UP) != 0;
  each_attribute(
      IFLA_RTA(&info), reply.nlmsg_len - NLMSG_LENGTH(sizeof info), [&](int type, const void* data, std::size_t bytes) {
        if (type == IFLA_MTU) link.fd = value_of<std::uint32_t>(data, bytes) >= CANFD_MTU;
        if (type != IFLA_LINKINFO) return;
        each_attribute(data, bytes, [&](int inner, const void* inner_data, std::size_t inner_bytes) {
          if (inner != IFLA_INFO_DATA) return;
          each_attribute(inner_data, inner_bytes, [&](int field, const void* field_data, std::size_t field_bytes) {
            read_can_attribute(field, field_data, field_bytes, link);
          });
        });
      });
  return 0;
}

int restart_link(std::string_view interface) {
  const int index = index_of(interface);
  if (index == 0) return ENODEV;
  Request request(RTM_NEWLINK, NLM_F_ACK, index);
  rtattr* const info = request.add(IFLA_LINKINFO);
  request.add(IFLA_INFO_KIND, "can", 3);
  rtattr* const data = request.add(IFLA_INFO_DATA);
  const std::uint32_t yes = 1;
  request.add(IFLA_CAN_RESTART, &yes, sizeof yes);
  request.end(data);
  request.end(info);
  alignas(nlmsghdr) std::array<char, 16384> answer;
  ssize_t size = 0;
  return request.exchange(answer, size);
}

}  // namespace fxdyn::hal::linux
