#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "firmware/protocol/setpoint_codec.hpp"
#include "host_tools/can/master.hpp"

namespace fxdyn::can {

/// Round-trip times of ticks, from the first setpoint's sending to the last torque's arrival.
class RoundTrips {
 public:
  void add(Duration time) { times_.push_back(time); }
  std::size_t count() const { return times_.size(); }
  /// The time that this share of the ticks did not exceed; zero where there were none.
  Duration quantile(double share) const;

 private:
  std::vector<Duration> times_;
};

/// Streams setpoints tick by tick: all setpoints, SYNC, then it waits for the torques of all `joints`. Joints count
/// from 1.
class Lockstep {
 public:
  struct Options {
    std::size_t joints = 6;            ///< whose setpoints are sent
    std::vector<std::uint8_t> expect;  ///< whose torques have to come; empty: all
    bool fd = false;                   ///< one frame with all setpoints, one with all torques of each node
    Duration timeout = std::chrono::milliseconds(500);
  };
  Lockstep(Master& master, Options options);

  /// One tick. A joint whose torque did not come within the timeout is empty.
  const std::vector<std::optional<WireTorque>>& tick(std::span<const WireSetpoint> setpoints);

  struct Statistics {
    std::uint64_t ticks = 0, incomplete = 0;
    std::uint64_t missing = 0;  ///< torque frames that did not come
    std::uint64_t late = 0;     ///< torque frames that came for no tick that waited
    RoundTrips round_trips;     ///< of complete ticks
    Duration time{};            ///< from the first tick's begin to the last one's end
    double ticks_per_second() const {
      return time.count() > 0 ? static_cast<double>(ticks) * 1e9 / static_cast<double>(time.count()) : 0;
    }
  };
  const Statistics& statistics() const { return statistics_; }

 private:
  void send_setpoints_and_sync(std::span<const WireSetpoint> setpoints);
  bool take(const Frame& frame);

  Master& master_;
  Options options_;
  std::vector<std::optional<WireTorque>> torques_;
  std::vector<Frame> frames_;  ///< of a tick
  std::size_t waiting_ = 0;
  std::optional<Duration> begin_;
  Statistics statistics_;
};

}  // namespace fxdyn::can
