#pragma once

#include <algorithm>
#include <array>
#include <cstdlib>
#include <deque>
#include <limits>
#include <vector>

#include "tests/hil/motion.hpp"

namespace fxdyn::hil {

/// The campaign's motion, and how far the torques of a node that misses none of it step: what a fault may not make
/// much larger.
template <class Model>
class Undisturbed {
 public:
  /// Ticks of the motion that a step is compared with: before it, longer than any effect remembers ticks (16, the
  /// delay's) and than a short ramp; and after it.
  static constexpr std::size_t ticks_before = 24, ticks_after = 8;

  Undisturbed(const typename Model::Parameters& parameters, const std::array<TorqueSteps, Model::joints>& steps,
              double tick_s, unsigned seed)
      : parameters_(parameters), motion_(parameters, tick_s, seed), steps_(steps) {
    while (ticks_.size() <= ticks_after) append();
  }

  /// The setpoints of the motion's next tick.
  const std::vector<WireSetpoint>& next() {
    append();
    if (now_ < ticks_before)
      ++now_;
    else
      ticks_.pop_front();
    return ticks_[now_].setpoints;
  }
  /// What the node has taken in that tick, which may be not the motion's; `anew`: as its first, nothing remembered.
  void taken(const std::vector<WireSetpoint>& setpoints, bool anew) {
    const bool same = std::equal(setpoints.begin(), setpoints.end(), ticks_[now_].setpoints.begin(), is_same);
    ticks_[now_].setpoints = setpoints;
    if (anew) begin_anew(now_);
    if (anew || !same) {
      for (std::size_t i = now_; i < ticks_.size(); ++i) compute(i);
    }
  }
  /// Largest step of joint j's torque around that tick [mN*m | mN].
  std::int64_t largest_step(std::size_t j) const {
    std::int64_t largest = 0;
    for (const Tick& tick : ticks_) largest = std::max(largest, tick.step[j]);
    return largest;
  }

 private:
  static constexpr std::size_t joints = Model::joints;
  static constexpr int bits = Torque<typename Model::Numbers>::bits;
  struct Moment {
    typename Model::State state{};
    std::array<TorqueOutput, joints> torques{};
  };
  struct Tick {
    std::vector<WireSetpoint> setpoints;
    Moment before, after;
    std::array<std::int64_t, joints> step{};
    bool begins = false;
  };
  static bool is_same(const WireSetpoint& a, const WireSetpoint& b) {
    return a.q == b.q && a.dq == b.dq && a.ddq == b.ddq;
  }

  void append() {
    ticks_.push_back({motion_.next(), {}, {}, {}, false});
    compute(ticks_.size() - 1);
  }
  typename Model::Torques model(Tick& tick) const {
    Saturations ignored;
    tick.after = tick.before;
    return Model::tick(parameters_, tick.after.state, model_input<Model>(parameters_, tick.setpoints), ignored);
  }
  void compute(std::size_t i) {
    Tick& tick = ticks_[i];
    if (i > 0 && !tick.begins) tick.before = ticks_[i - 1].after;
    const auto torques = model(tick);
    for (std::size_t j = 0; j < joints; ++j) {
      TorqueOutput& torque = tick.after.torques[j];
      const std::int32_t before = to_milli<bits>(torque.value());
      torque.follow(torques[static_cast<int>(j)].raw, steps_[j]);
      tick.step[j] = std::abs(std::int64_t{to_milli<bits>(torque.value())} - before);
    }
  }
  /// Without a ramp: its torque is the model's from the beginning.
  void begin_anew(std::size_t i) {
    Tick& tick = ticks_[i];
    tick.before = {};
    tick.begins = true;
    const auto torques = model(tick);
    constexpr std::int32_t any = std::numeric_limits<std::int32_t>::max();
    for (std::size_t j = 0; j < joints; ++j)
      tick.before.torques[j].follow(torques[static_cast<int>(j)].raw, {any, any});
  }

  const typename Model::Parameters& parameters_;
  Motion<Model> motion_;
  std::array<TorqueSteps, joints> steps_;
  std::deque<Tick> ticks_;
  std::size_t now_ = 0;  ///< of ticks_
};

}  // namespace fxdyn::hil
