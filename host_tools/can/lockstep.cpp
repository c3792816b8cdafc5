#include "host_tools/can/lockstep.hpp"

#include <algorithm>
#include <cmath>

namespace fxdyn::can {
Duration RoundTrips::quantile(double share) const {
  if (times_.empty()) return {};
  auto times = times_;
  const auto rank = static_cast<std::ptrdiff_t>(std::ceil(share * static_cast<double>(times.size()))) - 1;
  const auto at = times.begin() + std::clamp<std::ptrdiff_t>(rank, 0, std::ssize(times) - 1);
  std::nth_element(times.begin(), at, times.end());
  return *at;
}

Lockstep::Lockstep(Master& master, Options options)
    : master_(master), options_(std::move(options)), torques_(options_.joints) {
  if (options_.expect.empty()) {
    for (std::size_t joint = 1; joint <= options_.joints; ++joint)
      options_.expect.push_back(static_cast<std::uint8_t>(joint));
  }
}

void Lockstep::send_setpoints_and_sync(std::span<const WireSetpoint> setpoints) {
  frames_.clear();
  if (options_.fd) {
    Frame& frame = frames_.emplace_back(
        Frame{.id = canopen::setpoint_id + 1,
              .fd = true,
              .size = static_cast<std::uint8_t>(hal::fd_length(WireSetpoint::bytes * setpoints.size()))});
    for (std::size_t j = 0; j < setpoints.size(); ++j) setpoints[j].store(&frame.data[WireSetpoint::bytes * j]);
  } else {
    for (std::size_t j = 0; j < setpoints.size(); ++j) {
      Frame& frame = frames_.emplace_back(
          Frame{.id = canopen::setpoint_id + 1 + static_cast<std::uint32_t>(j), .size = WireSetpoint::bytes});
      setpoints[j].store(frame.data.data());
    }
  }
  frames_.push_back({.id = canopen::sync_id});
  master_.bus().send_all(frames_);
}

/// True: the frame is a torque. Of several joints in one FD frame, the node's own is the first.
bool Lockstep::take(const Frame& frame) {
  const std::uint32_t first = frame.id - canopen::torque_id;
  if (frame.extended || frame.remote || first < 1 || first > options_.joints || frame.size < WireTorque::bytes)
    return false;
  for (std::size_t at = 0; at + WireTorque::bytes <= frame.size && first + at / WireTorque::bytes <= options_.joints;
       at += WireTorque::bytes) {
    const std::size_t joint = first + at / WireTorque::bytes;
    if (std::find(options_.expect.begin(), options_.expect.end(), joint) == options_.expect.end()) continue;
    auto& torque = torques_[joint - 1];
    if (waiting_ == 0 || torque) {
      ++statistics_.late;
      continue;
    }
    torque = WireTorque::load(&frame.data[at]);
    --waiting_;
  }
  return true;
}

const std::vector<std::optional<WireTorque>>& Lockstep::tick(std::span<const WireSetpoint> setpoints) {
  Bus& bus = master_.bus();
  Frame frame;
  // What came between the ticks belongs to none.
  while (bus.receive(frame, {})) {
    if (!take(frame)) master_.dispatch(frame);
  }
  std::fill(torques_.begin(), torques_.end(), std::nullopt);
  const Duration begin = bus.now();
  if (!begin_) begin_ = begin;
  waiting_ = options_.expect.size();
  send_setpoints_and_sync(setpoints);
  const Duration end = bus.now() + options_.timeout;
  while (waiting_ > 0) {
    const Duration left = end - bus.now();
    if (left.count() <= 0) break;
    if (bus.receive(frame, left) && !take(frame)) master_.dispatch(frame);
  }
  const Duration now = bus.now();
  ++statistics_.ticks;
  statistics_.time = now - *begin_;
  if (waiting_ == 0) {
    statistics_.round_trips.add(now - begin);
  } else {
    ++statistics_.incomplete;
    statistics_.missing += waiting_;
    waiting_ = 0;
  }
  return torques_;
}

}  // namespace fxdyn::can
