#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

namespace fxdyn {

/// The physical quantities that the model computes with. A number system assigns one scalar type to each of them; for
/// fixed point that is one format (number of fractional bits). Revolute and prismatic joints share the joint-side
/// quantities: rad or m, N*m or N.
enum class Quantity : std::uint8_t {
  position,             ///< joint position [rad | m]
  velocity,             ///< joint or angular velocity [rad/s | m/s]
  acceleration,         ///< joint or angular acceleration [rad/s^2 | m/s^2], and products of two angular velocities
  linear_acceleration,  ///< acceleration of a frame origin, gravity included [m/s^2]
  length,               ///< kinematic lengths [m]
  force,                ///< forces between links [N]
  torque,               ///< joint torque, moments between links [N*m | N]
  unit,                 ///< sine, cosine, tanh, presliding state: |x| <= 1 [-]
  argument,             ///< argument of tanh and exp; saturated at the ends of its format by design [-]
  ratio,                ///< velocity in units of a fraction of its maximum, argument of asinh [-]
  inverse_velocity,     ///< 1 / width of a velocity-dependent effect [s/rad | s/m]
  inverse_path,         ///< time step / presliding distance [s/rad | s/m]
  weight,               ///< BLS weights in front of the activation, 16 bits [-]
  velocity_squared,     ///< dq |dq| [rad^2/s^2 | m^2/s^2]
  velocity_cubed,       ///< dq^3 [rad^3/s^3 | m^3/s^3]
  inverse_position,     ///< turns per unit of position [1/rad | 1/m]
  inverse_torque,       ///< 1 / width of a load-dependent effect [1/(N*m) | 1/N]
  count,                ///< ticks, and indices of joints [-]
  feature,              ///< BLS input, 16 bits, saturated at +-1 by design [-]
  activation,           ///< BLS node, 16 bits, |x| <= 1 [-]
};
inline constexpr std::size_t quantity_count = 20;

inline constexpr std::array<std::string_view, quantity_count> quantity_names{"position",         "velocity",
                                                                             "acceleration",     "linear_acceleration",
                                                                             "length",           "force",
                                                                             "torque",           "unit",
                                                                             "argument",         "ratio",
                                                                             "inverse_velocity", "inverse_path",
                                                                             "weight",           "velocity_squared",
                                                                             "velocity_cubed",   "inverse_position",
                                                                             "inverse_torque",   "count",
                                                                             "feature",          "activation"};

/// Fractional bits that are the same for every robot: quantities without a unit have a known range.
inline constexpr int unit_bits = 30;      ///< [-2, 2)
inline constexpr int argument_bits = 27;  ///< [-16, 16); tanh is flat beyond 8
inline constexpr int ratio_bits = 24;     ///< [-128, 128)
inline constexpr int count_bits = 16;     ///< [-32768, 32768)
inline constexpr int small_bits = 15;     ///< features and activations, int16: [-1, 1)

/// Fractional bits of a quantity whose format is the same for every robot, else 0.
constexpr int common_bits(Quantity quantity) {
  switch (quantity) {
    case Quantity::unit:
      return unit_bits;
    case Quantity::argument:
      return argument_bits;
    case Quantity::ratio:
      return ratio_bits;
    case Quantity::count:
      return count_bits;
    case Quantity::feature:
    case Quantity::activation:
      return small_bits;
    default:
      return 0;
  }
}

}  // namespace fxdyn
