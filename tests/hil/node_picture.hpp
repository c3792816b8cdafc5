#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstdlib>
#include <vector>

#include "firmware/protocol/object_dictionary.hpp"
#include "host_tools/can/bus.hpp"
#include "tests/hil/motion.hpp"

namespace fxdyn::hil {

/// What a node makes of the setpoints and SYNCs that reach it, as docs/guide/node-behaviour.md says: which ticks are
/// fresh, what it counts, and the model beside it.
template <class Model>
class NodePicture {
 public:
  using Counter = dictionary::Counter;
  using Counts = std::array<std::uint32_t, dictionary::counters>;
  static constexpr std::size_t joints = Model::joints;

  /// `watched`: SYNC has a period, 0x1006 is not 0.
  NodePicture(const typename Model::Parameters& parameters, can::Duration tick, std::uint32_t ramp_ticks, bool watched)
      : parameters_(parameters),
        tick_(tick),
        longest_gap_(dictionary::defaults::tolerated_ticks + ramp_ticks),
        watched_(watched) {
    waiting_.resize(joints);
  }

  Counts counts{};
  void expect(Counter counter, std::uint32_t times = 1) { counts[static_cast<std::size_t>(counter)] += times; }
  const typename Model::Torques& torques() const { return torques_; }
  /// What the last fresh tick took, and whether it was the first of a node that remembers nothing.
  const std::vector<WireSetpoint>& taken() const { return last_; }
  bool began() const { return began_; }
  /// Stale ticks in a row.
  std::uint32_t stale() const { return stale_; }
  /// Until it forgets and its own timer rests.
  std::uint32_t own_ticks_left() const { return longest_gap_ + 1 - stale_; }

  void setpoint(std::size_t j, const WireSetpoint& setpoint) {
    if (arrivals_[j]++ != 0) expect(Counter::duplicate_setpoints);
    waiting_[j] = setpoint;
  }
  /// 0x1006 or 0x2014 was written: the time-outs begin anew.
  void drop_setpoints() {
    arrivals_ = {};
    own_ticks_ = 0;
  }
  void leave_operation() {
    drop_setpoints();
    stale_ = elapsed_ = 0;
    has_last_ = false;
    state_ = {};
  }
  /// SYNC is overdue: half a period after its time, then a tick at a time. When it was due counts, not when it was
  /// done.
  void own_tick() {
    expect(Counter::overdue_syncs);
    own_ = own_ticks_ == 0 ? sync_ + tick_ + tick_ / 2 : own_ + tick_;
    ++own_ticks_;
    stale_tick();
  }
  /// True: the tick is fresh.
  bool sync(can::Duration now) {
    const std::uint32_t periods = periods_since_sync(now);
    const bool at_once = watched_ && own_ticks_ == 0 && now - sync_ < tick_ / 4;
    elapsed_ += at_once ? 0 : periods;
    sync_ = now;
    const bool fresh = accept(periods);
    drop_setpoints();
    if (fresh) {
      compute();
    } else
      stale_tick();
    return fresh;
  }

 private:
  using N = typename Model::Numbers;

  std::uint32_t periods_since_sync(can::Duration now) const {
    if (!watched_ || own_ticks_ == 0) return 1;
    return own_ticks_ + (now - own_ < tick_ / 4 ? 0U : 1U);
  }

  bool accept(std::uint32_t periods) {
    std::uint32_t missing = 0;
    for (const std::uint32_t arrivals : arrivals_)
      missing += arrivals == 0 || (watched_ && own_ticks_ != 0 && arrivals != periods) ? 1 : 0;
    expect(Counter::missing_setpoints, missing);
    if (missing != 0) return false;
    const bool odd = waiting_[0].is_odd();
    if (std::any_of(waiting_.begin(), waiting_.end(), [&](const auto& setpoint) { return setpoint.is_odd() != odd; })) {
      expect(Counter::mixed_setpoints);
      return false;
    }
    const std::uint32_t implausible = implausible_setpoints();
    expect(Counter::implausible_setpoints, implausible);
    return implausible == 0;
  }

  /// q jumps by no more than twice what the velocity limit allows since the last good setpoints.
  std::uint32_t implausible_setpoints() const {
    if (!has_last_) return 0;
    std::uint32_t count = 0;
    for (std::size_t j = 0; j < joints; ++j) {
      const auto& limits = parameters_.constants[j].limits;
      const std::int64_t per_second = whole_share(limits.dq_lower.raw, limits.dq_upper.raw);
      const std::int64_t ticks_per_second = parameters_.ticks_per_second.raw;
      const std::int64_t most = ((per_second << (Position<N>::bits + 17 - Velocity<N>::bits)) / ticks_per_second + 1) *
                                std::max(elapsed_, 1U);
      count += std::abs(std::int64_t{waiting_[j].q} - last_[j].q) > most ? 1 : 0;
    }
    return count;
  }

  void compute() {
    Saturations saturations;
    if (elapsed_ > 1) Model::skip(parameters_, state_, elapsed_ - 1, saturations);
    torques_ = Model::tick(parameters_, state_, model_input<Model>(parameters_, waiting_), saturations);
    expect(Counter::ticks);
    expect(Counter::saturations, saturations.count);
    began_ = !has_last_;
    last_ = waiting_;
    has_last_ = true;
    stale_ = elapsed_ = 0;
  }

  /// After `tolerated` and a ramp of them the node forgets where it was.
  void stale_tick() {
    expect(Counter::stale_ticks);
    if (++stale_ <= longest_gap_) return;
    drop_setpoints();
    elapsed_ = 0;
    has_last_ = false;
    state_ = {};
  }

  const typename Model::Parameters& parameters_;
  can::Duration tick_, own_{}, sync_ = -tick_ * 10;  ///< own_: when the last own tick was due
  std::uint32_t longest_gap_;
  bool watched_;
  std::array<std::uint32_t, joints> arrivals_{};  ///< of setpoints since the last SYNC
  std::vector<WireSetpoint> waiting_, last_;
  bool has_last_ = false, began_ = false;
  std::uint32_t stale_ = 0, own_ticks_ = 0, elapsed_ = 0;
  typename Model::State state_{};
  typename Model::Torques torques_{};
};

}  // namespace fxdyn::hil
