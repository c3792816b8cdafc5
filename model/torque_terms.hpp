#pragma once

#include <algorithm>
#include <cmath>

#include "model/joint_model.hpp"

// The feedforward torque of a table page term by term, for programs that ask for one state at a time in any order:
// planners, computed torque on a PC. A drive calls RobotModel::tick() instead.

namespace fxdyn {

/// What effects remember has settled when the torque stands still while the state is held.
struct SettledTorque {
  /// A state is held no longer than that: 1 s at 2 ms. A presliding path of 5 mrad settles while the joint is faster
  /// than 20 mrad/s.
  static constexpr int most_ticks = 500;
  /// So many equal torques stand still: the differences of a deflection take four ticks (Deflection).
  static constexpr int equal_ticks = 5;
};

/// Terms of `Model`'s torque tau(q, dq, ddq) in double precision [rad | m, SI; N*m | N; joint side of the gearbox]:
///   gravity g(q) = tau(q, 0, 0), with springs and offsets
///   inertia M(q), column i = (tau(q, 0, a e_i) - tau(q, 0, -a e_i)) / 2a
///   Coriolis c(q, dq) = (tau(q, dq, 0) + tau(q, -dq, 0)) / 2 - g(q), what the velocity's sign does not change
///   friction f(dq) = (tau(r, dq, 0) - tau(r, -dq, 0)) / 2, what it turns, at the middle r of the joints' ranges
/// Friction that depends on the position or the load differs from f elsewhere. tau - f(dq) therefore has what is left
/// of it, and torque_without_friction() + friction() is tau, exactly.
///
/// The tables have to be those of a whole robot. What effects remember is taken as settled: the state is held until
/// the torque stands still (SettledTorque). Total: states beyond the limits are limited and counted.
template <class Model>
class TorqueTerms {
 public:
  static constexpr int joints = static_cast<int>(Model::joints);
  static_assert(Model::outputs == Model::joints, "these tables are of a drive: take those of the whole robot");
  using Column = Eigen::Matrix<double, joints, 1>;
  using Matrix = Eigen::Matrix<double, joints, joints>;

  explicit TorqueTerms(const typename Model::Parameters& parameters) : parameters_(&parameters) {}

  Column torque(const Column& q, const Column& dq, const Column& ddq, Saturations& saturations) const {
    const typename Model::Setpoints setpoints = as_raw(q, dq, ddq);
    typename Model::State state{};
    typename Model::Torques tau = Model::tick(*parameters_, state, setpoints, saturations);
    for (int tick = 1, equal = 1; tick < SettledTorque::most_ticks && equal < SettledTorque::equal_ticks; ++tick) {
      Saturations again;  // one state counts once
      const typename Model::Torques next = Model::tick(*parameters_, state, setpoints, again);
      equal = next == tau ? equal + 1 : 1;
      tau = next;
    }
    Column out;
    for (int i = 0; i < joints; ++i) out[i] = to_double(tau[i]);
    return out;
  }
  Column gravity(const Column& q, Saturations& saturations) const {
    return torque(q, Column::Zero(), Column::Zero(), saturations);
  }
  Column coriolis(const Column& q, const Column& dq, Saturations& saturations) const {
    const Column zero = Column::Zero();
    return (torque(q, dq, zero, saturations) + torque(q, -dq, zero, saturations)) / 2 - gravity(q, saturations);
  }
  Column friction(const Column& dq, Saturations& saturations) const {
    const Column zero = Column::Zero(), middle = middle_of_ranges();
    return (torque(middle, dq, zero, saturations) - torque(middle, -dq, zero, saturations)) / 2;
  }
  Matrix inertia(const Column& q, Saturations& saturations) const {
    Matrix out;
    const Column zero = Column::Zero();
    for (int i = 0; i < joints; ++i) {
      const auto& limits = parameters_->constants[static_cast<std::size_t>(i)].limits;
      const double largest = std::min(to_double(limits.ddq_upper), -to_double(limits.ddq_lower));
      const Column ddq = largest * Column::Unit(i);
      out.col(i) = (torque(q, zero, ddq, saturations) - torque(q, zero, -ddq, saturations)) / (2 * largest);
    }
    return out;
  }
  Column torque_without_friction(const Column& q, const Column& dq, const Column& ddq, Saturations& saturations) const {
    return torque(q, dq, ddq, saturations) - friction(dq, saturations);
  }
  /// Of the setpoints for which the formats were chosen.
  Column middle_of_ranges() const {
    Column out;
    for (int i = 0; i < joints; ++i) {
      const auto& limits = parameters_->constants[static_cast<std::size_t>(i)].limits;
      out[i] = (to_double(limits.q_lower) + to_double(limits.q_upper)) / 2;
    }
    return out;
  }

 private:
  template <int bits>
  static double to_double(Fixed<bits> x) {
    return std::ldexp(x.raw, -bits);
  }
  /// The nearest number of the format; counted limits follow in the tick. NaN: zero.
  template <int bits>
  static Fixed<bits> to_fixed(double x) {
    const double raw = std::nearbyint(std::ldexp(x, bits));
    if (std::isnan(raw)) return {0};
    return {static_cast<std::int32_t>(std::clamp<double>(raw, raw::min32, raw::max32))};
  }
  static typename Model::Setpoints as_raw(const Column& q, const Column& dq, const Column& ddq) {
    using N = typename Model::Numbers;
    typename Model::Setpoints out;
    for (int i = 0; i < joints; ++i) {
      out.q[i] = to_fixed<Position<N>::bits>(q[i]);
      out.dq[i] = to_fixed<Velocity<N>::bits>(dq[i]);
      out.ddq[i] = to_fixed<Acceleration<N>::bits>(ddq[i]);
    }
    return out;
  }

  const typename Model::Parameters* parameters_;
};

}  // namespace fxdyn
