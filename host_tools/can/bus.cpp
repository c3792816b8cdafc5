#include "host_tools/can/bus.hpp"

#include <poll.h>
#include <time.h>

#include <algorithm>
#include <array>

namespace fxdyn::can {
namespace {

constexpr Duration longest_wait_for_room = std::chrono::seconds(2);

/// True: the socket is ready. ppoll: milliseconds are too coarse here.
bool wait(int descriptor, short events, Duration timeout) {
  pollfd one{descriptor, events, 0};
  const auto ns = timeout.count() > 0 ? timeout.count() : 0;
  const timespec limit{ns / 1'000'000'000, ns % 1'000'000'000};
  return ::ppoll(&one, 1, &limit, nullptr) > 0;
}

}  // namespace

SocketBus::SocketBus(const std::string& interface, bool fd) {
  if (const auto result = socket_.open(interface, {}, fd); !result) {
    throw BusError(hal::linux::explain(result, interface));
  }
}

Duration SocketBus::now() const {
  timespec t{};
  ::clock_gettime(CLOCK_MONOTONIC, &t);
  return std::chrono::seconds(t.tv_sec) + Duration(t.tv_nsec);
}

void SocketBus::send(const Frame& frame) {
  const Duration begin = now();
  for (;;) {
    hal::Status status = socket_.send(frame);
    if (status == hal::Status::ok) return;
    // The kernel may restart the controller, or have done so already.
    if (socket_.errors().state == hal::CanState::bus_off) status = socket_.restart();
    if (status == hal::Status::failed || now() - begin > longest_wait_for_room) fail();
    // A full queue of the interface (ENOBUFS) can't be polled for.
    const timespec pause{0, 100'000};
    ::nanosleep(&pause, nullptr);
  }
}

void SocketBus::send_all(std::span<const Frame> frames) {
  std::array<can_frame, 16> classic{};
  std::size_t count = 0;
  while (count < std::min(frames.size(), classic.size()) && !frames[count].fd && !frames[count].extended &&
         !frames[count].remote) {
    const Frame& frame = frames[count];
    classic[count].can_id = frame.id;
    classic[count].len = frame.size;
    std::copy_n(frame.data.begin(), frame.size, classic[count].data);
    ++count;
  }
  const std::size_t sent = socket_.hal::linux::CanSocket::send(std::span{classic}.first(count));
  for (const Frame& frame : frames.subspan(sent)) send(frame);
}

bool SocketBus::receive(Frame& frame, Duration timeout) {
  hal::Status status = socket_.receive(frame);
  if (status == hal::Status::busy) {
    if (!wait(socket_.descriptor(), POLLIN, timeout)) return false;
    status = socket_.receive(frame);
  }
  if (status == hal::Status::failed) fail();
  lost_ = socket_.errors().lost;
  return status == hal::Status::ok;
}

std::string SocketBus::trouble() {
  hal::CanErrors errors = socket_.errors();
  hal::linux::CanLink link;
  // Error frames say when the state changes, so what it was before the socket was opened only the controller knows.
  if (hal::linux::query_link(socket_.interface(), link) == 0 && link.controlled)
    errors = {link.state, link.transmit_errors, link.receive_errors, errors.lost};
  return hal::linux::explain(errors, socket_.interface(), link.bit_rate);
}

void SocketBus::fail() {
  hal::linux::CanLink link;
  const int number = hal::linux::query_link(socket_.interface(), link);
  std::string why = trouble();
  if (number != 0) {
    why = hal::linux::explain({hal::linux::CanOpenError::no_interface, number}, socket_.interface());
  } else if (!link.up) {
    why = hal::linux::explain({hal::linux::CanOpenError::down, 0}, socket_.interface());
  } else if (why.empty()) {
    why = socket_.interface() +
          ": frames do not leave: no other node acknowledges them; check the wiring, the terminators and the bit rate, "
          "here " +
          std::to_string(link.bit_rate) + ": ip -details -statistics link show " + socket_.interface();
  }
  throw BusError(why);
}

}  // namespace fxdyn::can
