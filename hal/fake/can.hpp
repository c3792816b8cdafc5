#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <optional>
#include <random>
#include <utility>
#include <vector>

#include "hal/can.hpp"
#include "hal/fake/clock.hpp"

// A CAN bus in memory: several controllers on one wire, and faults on demand. Frames arrive at once, in the order in
// which they were sent.

namespace fxdyn::hal::fake {

/// What can happen to one frame on the wire.
enum class CanFault : std::uint8_t {
  none,
  drop,
  duplicate,
  reorder,   ///< arrives behind the next frame
  delay,     ///< arrives CanWire::delay_us later
  truncate,  ///< loses 1 to all of its bytes
  flip       ///< one bit of the data, which the CRC did not notice
};

template <class Frame_>
class CanController;

template <class Frame>
class CanWire {
 public:
  explicit CanWire(const Clock& clock, std::uint32_t seed = 1) : random(seed), clock_(clock) {}
  CanWire(const CanWire&) = delete;
  CanWire& operator=(const CanWire&) = delete;

  /// Asked for the fault of every frame that is sent; empty: none.
  std::function<CanFault(const Frame&)> fault;
  std::uint32_t delay_us = 1000;
  /// What went over the wire since a test last looked, as it was sent and before any fault.
  std::vector<Frame> sent;
  std::mt19937 random;

  void attach(CanController<Frame>& controller) { controllers_.push_back(&controller); }

  void transmit(const CanController<Frame>* from, const Frame& frame) {
    sent.push_back(frame);
    Frame changed = frame;
    const CanFault what = fault ? fault(frame) : CanFault::none;
    std::optional<std::pair<const CanController<Frame>*, Frame>> held = std::exchange(held_, std::nullopt);
    switch (what) {
      case CanFault::drop:
        break;
      case CanFault::duplicate:
        deliver(from, frame);
        deliver(from, frame);
        break;
      case CanFault::reorder:
        held_ = {from, frame};
        break;
      case CanFault::delay:
        late_.push_back({clock_.elapsed_us() + delay_us, from, frame});
        break;
      case CanFault::truncate:
        if (frame.size > 0) changed.size = static_cast<std::uint8_t>(random() % frame.size);
        deliver(from, changed);
        break;
      case CanFault::flip:
        if (frame.size > 0) {
          const std::uint32_t bit = static_cast<std::uint32_t>(random()) % (8U * frame.size);
          changed.data[bit / 8] = static_cast<std::uint8_t>(changed.data[bit / 8] ^ 1U << bit % 8);
        }
        [[fallthrough]];
      case CanFault::none:
        deliver(from, changed);
    }
    if (held) deliver(held->first, held->second);
  }

  /// Delivers the delayed frames whose time has come.
  void deliver_due() {
    while (!late_.empty() && late_.front().due_us <= clock_.elapsed_us()) {
      const Late late = late_.front();
      late_.pop_front();
      deliver(late.from, late.frame);
    }
  }

 private:
  struct Late {
    std::uint64_t due_us = 0;
    const CanController<Frame>* from = nullptr;
    Frame frame{};
  };
  void deliver(const CanController<Frame>* from, const Frame& frame) {
    for (CanController<Frame>* controller : controllers_) {
      if (controller != from) controller->accept(frame);
    }
  }

  const Clock& clock_;
  std::vector<CanController<Frame>*> controllers_;
  std::optional<std::pair<const CanController<Frame>*, Frame>> held_;
  std::deque<Late> late_;
};

template <class Frame_>
class CanController {
 public:
  using Frame = Frame_;
  explicit CanController(CanWire<Frame>& wire) : wire_(wire) { wire.attach(*this); }
  CanController(const CanController&) = delete;
  CanController& operator=(const CanController&) = delete;

  std::size_t capacity = 1024;  ///< received frames it holds; more are lost
  int busy = 0;                 ///< so many more calls of send() find no room
  bool down = false;            ///< the interface is down: nothing works

  Status send(const Frame& frame) {
    if (down || errors_.state == CanState::bus_off) return Status::failed;
    if (busy > 0) {
      --busy;
      return Status::busy;
    }
    wire_.transmit(this, frame);
    return Status::ok;
  }
  Status receive(Frame& frame) {
    if (down) return Status::failed;
    wire_.deliver_due();
    if (waiting_.empty()) return Status::busy;
    frame = waiting_.front();
    waiting_.pop_front();
    return Status::ok;
  }
  CanErrors errors() const { return errors_; }
  Status restart() {
    if (errors_.state != CanState::bus_off) return Status::ok;
    if (restart_calls_ > 0) {
      --restart_calls_;
      return Status::busy;
    }
    errors_.state = CanState::active;
    errors_.transmit = 0;
    return Status::ok;
  }

  void accept(const Frame& frame) {
    if (down || errors_.state == CanState::bus_off) return;
    if (waiting_.size() >= capacity) {
      ++errors_.lost;
      return;
    }
    waiting_.push_back(frame);
  }
  /// 255 transmit errors; it takes `calls` of restart() to come back.
  void fall_off_the_bus(int calls) {
    errors_.state = CanState::bus_off;
    errors_.transmit = 255;
    restart_calls_ = calls;
    waiting_.clear();
  }
  void set_passive(bool passive) {
    errors_.state = passive ? CanState::passive : CanState::active;
    errors_.transmit = passive ? 128 : 0;
  }

 private:
  CanWire<Frame>& wire_;
  std::deque<Frame> waiting_;
  CanErrors errors_;
  int restart_calls_ = 0;
};
static_assert(CanBus<CanController<ClassicFrame>>);
static_assert(CanBus<CanController<FdFrame>>);

}  // namespace fxdyn::hal::fake
