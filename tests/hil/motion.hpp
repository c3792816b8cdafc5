#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <random>
#include <vector>

#include "firmware/protocol/setpoint_codec.hpp"
#include "firmware/protocol/torque_output.hpp"
#include "model/joint_model.hpp"

namespace fxdyn::hil {

/// A tick's setpoints as the model takes them from the wire.
template <class Model>
typename Model::Setpoints model_input(const typename Model::Parameters& parameters,
                                      const std::vector<WireSetpoint>& setpoints) {
  typename Model::Setpoints input;
  for (std::size_t j = 0; j < Model::joints; ++j) {
    const auto i = static_cast<int>(j);
    const auto& limits = parameters.constants[j].limits;
    input.q[i].raw = setpoints[j].q;
    input.dq[i].raw = from_share(setpoints[j].dq, whole_share(limits.dq_lower.raw, limits.dq_upper.raw));
    input.ddq[i].raw = from_share(setpoints[j].ddq, whole_share(limits.ddq_lower.raw, limits.ddq_upper.raw));
  }
  return input;
}

/// Setpoints within the joints' limits for as many ticks as one likes, the same for the same seed. Half a second of
/// smooth motion and half a second of random velocities and accelerations along a random walk in turn: what a robot
/// does, and what drives the arithmetic into its corners. They carry the tick's parity (object 0x2013).
template <class Model>
class Motion {
 public:
  Motion(const typename Model::Parameters& parameters, double tick_s, unsigned seed)
      : parameters_(parameters), tick_s_(tick_s), random_(seed) {
    for (std::size_t j = 0; j < Model::joints; ++j) q_[j] = middle(j);
  }

  std::vector<WireSetpoint> next() {
    std::vector<WireSetpoint> setpoints(Model::joints);
    const bool rough = count_ / 250 % 2 == 1;
    for (std::size_t j = 0; j < Model::joints; ++j) setpoints[j] = rough ? rough_step(j) : smooth_step(j);
    for (WireSetpoint& setpoint : setpoints) setpoint.of_tick(count_ % 2 != 0);
    ++count_;
    return setpoints;
  }

 private:
  using N = typename Model::Numbers;
  static constexpr double radian = static_cast<double>(std::int64_t{1} << Position<N>::bits);
  static constexpr double velocity = static_cast<double>(std::int64_t{1} << Velocity<N>::bits);
  const auto& limits(std::size_t j) const { return parameters_.constants[j].limits; }
  double middle(std::size_t j) const {
    return 0.5 * (static_cast<double>(limits(j).q_lower.raw) + limits(j).q_upper.raw);
  }
  /// [raw position per tick]
  double fastest(std::size_t j) const {
    return whole_share(limits(j).dq_lower.raw, limits(j).dq_upper.raw) / velocity * radian * tick_s_;
  }
  double draw(double from, double to) { return std::uniform_real_distribution<double>(from, to)(random_); }

  WireSetpoint smooth_step(std::size_t j) {
    // a joint's own frequency, and from the middle of its range towards one end and back
    const double omega = 2 * std::numbers::pi * (0.4 + 0.13 * static_cast<double>(j));
    const double phase = omega * tick_s_ * static_cast<double>(count_);
    const double target = middle(j) + 0.3 * (limits(j).q_upper.raw - middle(j)) * std::sin(phase);
    q_[j] += std::clamp(target - q_[j], -fastest(j), fastest(j));
    return {static_cast<std::int32_t>(q_[j]), static_cast<std::int16_t>(30000 * std::cos(phase)),
            static_cast<std::int16_t>(-20000 * std::sin(phase))};
  }
  WireSetpoint rough_step(std::size_t j) {
    q_[j] = std::clamp(q_[j] + draw(-fastest(j), fastest(j)), double{1} * limits(j).q_lower.raw,
                       double{1} * limits(j).q_upper.raw);
    return {static_cast<std::int32_t>(q_[j]), static_cast<std::int16_t>(draw(-32768, 32767)),
            static_cast<std::int16_t>(draw(-32768, 32767))};
  }

  const typename Model::Parameters& parameters_;
  double tick_s_;
  std::mt19937 random_;
  std::array<double, Model::joints> q_{};
  std::uint64_t count_ = 0;
};

/// The torque frames that a node has to answer with: Model::tick of the same tables, and the ramp from zero after the
/// start.
template <class Model>
class Expected {
 public:
  Expected(const typename Model::Parameters& parameters, const std::array<std::int32_t, Model::joints>& rated,
           std::int32_t ramp_ticks)
      : parameters_(parameters), rated_(rated) {
    static_assert(Model::outputs == Model::joints);
    for (std::size_t j = 0; j < Model::joints; ++j) {
      const std::int32_t limit = whole_share(limits(j).tau_lower.raw, limits(j).tau_upper.raw);
      steps_[j] = {.ramp = (limit - 1) / ramp_ticks + 1, .following = limit};
    }
  }

  /// One fresh tick of an enabled node. The tick count starts at `count`.
  std::array<WireTorque, Model::joints> tick(const std::vector<WireSetpoint>& setpoints, std::uint8_t count) {
    Saturations saturations;
    const auto model = Model::tick(parameters_, state_, model_input<Model>(parameters_, setpoints), saturations);
    std::array<WireTorque, Model::joints> wire;
    for (std::size_t j = 0; j < Model::joints; ++j) {
      std::uint8_t status = torque_status::fresh | torque_status::enabled;
      if (torques_[j].follow(model[static_cast<int>(j)].raw, steps_[j])) status |= torque_status::step_limited;
      const std::int32_t raw = torques_[j].value();
      if (!torques_[j].is_following()) status |= torque_status::ramping;
      if (raw == limits(j).tau_lower.raw || raw == limits(j).tau_upper.raw) status |= torque_status::at_limit;
      wire[j] = {to_per_mille(raw, rated_.scale[j]), to_milli<Torque<typename Model::Numbers>::bits>(raw), count,
                 status};
    }
    return wire;
  }

 private:
  const auto& limits(std::size_t j) const { return parameters_.constants[j].limits; }
  const typename Model::Parameters& parameters_;
  RatedTorques<Model> rated_;
  typename Model::State state_{};
  std::array<TorqueOutput, Model::joints> torques_{};
  std::array<TorqueSteps, Model::joints> steps_{};
};

}  // namespace fxdyn::hil
