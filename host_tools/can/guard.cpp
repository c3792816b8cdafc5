#include "host_tools/can/guard.hpp"

#include <poll.h>
#include <signal.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>

#include "firmware/protocol/canopen.hpp"

namespace fxdyn::can {
namespace {

constexpr std::array signals{SIGINT, SIGTERM, SIGHUP};

// What the handler needs, since it may neither lock nor allocate: the frames are ready before it is installed.
std::array<can_frame, canopen::largest_node_id> stop_frames;
volatile sig_atomic_t stop_count = 0, stop_socket = -1;
std::array<struct sigaction, signals.size()> previous;

/// Stops the nodes, and lets the signal do then what it did before. send() and poll() are safe in handlers
/// (signal-safety(7)).
void stop_nodes(int number) {
  constexpr int tries = 1000;  // of 1 ms: the interface's queue may be full
  for (int i = 0; i < stop_count; ++i) {
    const auto& frame = stop_frames[static_cast<std::size_t>(i)];
    for (int n = 0; n < tries && ::send(stop_socket, &frame, sizeof frame, MSG_DONTWAIT) < 0; ++n)
      static_cast<void>(::poll(nullptr, 0, 1));
  }
  for (std::size_t i = 0; i < signals.size(); ++i) {
    if (signals[i] == number) ::sigaction(number, &previous[i], nullptr);
  }
  ::raise(number);
}

}  // namespace

Guard::Guard(const std::string& interface, std::uint8_t master) {
  const can_filter nothing{CAN_INV_FILTER, 0};  // a filter that every frame passes, inverted
  if (const auto result = socket_.open(interface, std::span{&nothing, 1}); !result)
    throw BusError(hal::linux::explain(result, interface));
  thread_ = std::thread([this, master] { beat(master); });
}

Guard::~Guard() {
  if (stop_socket == socket_.descriptor()) {
    for (std::size_t i = 0; i < signals.size(); ++i) ::sigaction(signals[i], &previous[i], nullptr);
    stop_count = 0;
    stop_socket = -1;
  }
  {
    const std::lock_guard lock(mutex_);
    ended_ = true;
  }
  end_.notify_one();
  thread_.join();
}

void Guard::stop_by_signals(std::span<const std::uint8_t> nodes) {
  for (std::size_t i = 0; i < nodes.size() && i < stop_frames.size(); ++i) {
    stop_frames[i] = {};
    stop_frames[i].can_id = canopen::nmt_id;
    stop_frames[i].len = 2;
    stop_frames[i].data[0] = static_cast<std::uint8_t>(canopen::NmtCommand::enter_pre_operational);
    stop_frames[i].data[1] = nodes[i];
  }
  stop_socket = socket_.descriptor();
  stop_count = static_cast<sig_atomic_t>(std::min(nodes.size(), stop_frames.size()));
  for (std::size_t i = 0; i < signals.size(); ++i) {
    struct sigaction action {};
    action.sa_handler = stop_nodes;
    for (const int other : signals) ::sigaddset(&action.sa_mask, other);
    ::sigaction(signals[i], nullptr, &previous[i]);
    // a signal that is ignored (nohup, a shell's background job) stays so
    if (previous[i].sa_handler != SIG_IGN) ::sigaction(signals[i], &action, nullptr);
  }
}

void Guard::beat(std::uint8_t master) {
  hal::ClassicFrame frame{.id = canopen::heartbeat_id + master, .size = 1};
  frame.data[0] = static_cast<std::uint8_t>(canopen::NmtState::operational);
  std::unique_lock lock(mutex_);
  // one that finds no room is made up for by the next
  do static_cast<void>(socket_.send(frame));
  while (!end_.wait_for(lock, heartbeat_period, [this] { return ended_; }));
}

}  // namespace fxdyn::can
