#pragma once

#include <cmath>
#include <concepts>

#include "model/fixed.hpp"
#include "model/vector.hpp"

// A number system says which type stands for which quantity, so that every formula of the model is written once.
//
//   a * b, a + b, a - b, -a
//     widen and are exact (for Real: double)
//   align(x, w)
//     x in the format of the accumulator w
//   N::proven_narrow<T>(w)
//     w as a stored number of type T, rounded half up, no check: the export has proven that it fits (host_tools/export)
//   N::narrow<T>(w, s)
//     the same, saturated and counted in s: for what no proof covers
//   N::narrow_counted<T>(w, s)
//     the same; a tick in which it saturates is counted and no longer within the proven error
//   N::clamp<T>(w)
//     the same where saturation is meant, not counted
//   N::convert<T>(x)
//     a stored number as another quantity of the same unit (a prismatic joint's q is a length), proven to fit
//   N::turned(v, c, s)
//     v, that was just turned with cosine c and sine s; bounding systems cut its components down to its length
//   N::rounded_length<T>(l, units)
//     length of a vector whose components were narrowed to T; how long their rounding can be, in units of T
//   N::narrow_between<T>(w, a, b)
//     proven_narrow of w, that lies between a and b
//   N::narrow_relaxed<T>(w, state, target, share)
//     proven_narrow of w = state + share (target - state), the state's next value
//   N::Word, N::load<T>(word)
//     how parameters are stored in tables, and one of them as a number
//
// Coefficients (N::Coefficient<Q>) multiply a number of quantity Q to give a torque; their format follows from that of
// Q, so that products of a sum need no shifts.

namespace fxdyn {

/// Double precision; narrowing is the identity.
struct Real {
  template <Quantity>
  using Of = double;
  template <Quantity>
  using Coefficient = double;
  using Mass = double;
  using FirstMoment = double;
  using SecondMoment = double;
  using TorqueSum = double;
  template <Quantity>
  using DeflectionCoefficient = double;
  using DeflectionSum = double;
  using Word = double;
  static constexpr bool packed = false;
  using NodeArgument = double;

  template <class T>
  static constexpr T load(Word word) {
    return word;
  }
  static constexpr TorqueSum no_torque() { return 0; }
  static constexpr DeflectionSum no_deflection() { return 0; }
  static constexpr double feature(double x) { return x < -1 ? -1 : (x > 1 ? 1 : x); }
  template <class Activation>
  static double activation(double x) {
    return Activation::of(x);
  }
  static constexpr double node_coefficient(double word, int) { return word; }
  static constexpr double one() { return 1; }
  template <class T>
  static constexpr T narrow(double x, Saturations&) {
    return x;
  }
  template <class T>
  static constexpr T narrow_counted(double x, Saturations&) {
    return x;
  }
  template <class T>
  static constexpr T proven_narrow(double x) {
    return x;
  }
  template <class T>
  static constexpr T clamp(double x) {
    return x;
  }
  template <class T>
  static constexpr T convert(double x) {
    return x;
  }
  template <class T, class U>
  static constexpr Vector3<T> turned(const Vector3<T>& v, U, U) {
    return v;
  }
  template <class T>
  static constexpr NoLength rounded_length(NoLength, double) {
    return {};
  }
  template <class T>
  static constexpr T narrow_between(double x, T, T) {
    return x;
  }
  template <class T>
  static constexpr T narrow_relaxed(double x, T, T, double) {
    return x;
  }
};

/// Fixed point with formats known at compile time. `Formats` is a generated struct of static constexpr int: one
/// member per name in `quantity_names` without common_bits(), `force_sum` (fractional bits of the sums that give
/// forces), `torque_sum` (of the sum of all contributions to a joint's torque) and `deflection_sum` (the same of its
/// deflection).
template <class Formats>
struct FixedNumbers {
  static constexpr int bits(Quantity quantity) {
    switch (quantity) {
      case Quantity::position:
        return Formats::position;
      case Quantity::velocity:
        return Formats::velocity;
      case Quantity::acceleration:
        return Formats::acceleration;
      case Quantity::linear_acceleration:
        return Formats::linear_acceleration;
      case Quantity::length:
        return Formats::length;
      case Quantity::force:
        return Formats::force;
      case Quantity::torque:
        return Formats::torque;
      case Quantity::inverse_velocity:
        return Formats::inverse_velocity;
      case Quantity::inverse_path:
        return Formats::inverse_path;
      case Quantity::weight:
        return Formats::weight;
      case Quantity::velocity_squared:
        return Formats::velocity_squared;
      case Quantity::velocity_cubed:
        return Formats::velocity_cubed;
      case Quantity::inverse_position:
        return Formats::inverse_position;
      case Quantity::inverse_torque:
        return Formats::inverse_torque;
      default:
        return common_bits(quantity);
    }
  }

  template <Quantity quantity>
  using Of = Fixed<bits(quantity)>;
  template <Quantity quantity>
  using Coefficient = Fixed<Formats::torque_sum - bits(quantity)>;
  // m * a, K * h and h x a, K * J meet in common sums: that fixes the formats of the inertial parameters.
  using Mass = Fixed<Formats::force_sum - Formats::linear_acceleration>;
  using FirstMoment = Fixed<Formats::force_sum - Formats::acceleration>;
  using SecondMoment = Fixed<Formats::force_sum - 2 * Formats::acceleration + Formats::linear_acceleration>;
  using TorqueSum = Wide<Formats::torque_sum>;
  template <Quantity quantity>
  using DeflectionCoefficient = Fixed<Formats::deflection_sum - bits(quantity)>;
  using DeflectionSum = Wide<Formats::deflection_sum>;
  using Word = std::int32_t;
  /// BLS: two int16 a word, the kernels of dense.hpp.
  static constexpr bool packed = true;
  using NodeArgument = std::int32_t;
  static constexpr int weight_bits() { return Formats::weight; }

  template <class T>
  static constexpr T load(Word word) {
    return {word};
  }
  static constexpr TorqueSum no_torque() { return {}; }
  static constexpr DeflectionSum no_deflection() { return {}; }
  /// A BLS input, saturated to 16 bits.
  template <int bits>
  static constexpr Of<Quantity::feature> feature(Wide<bits> x) {
    return {raw::saturate_to<16>(raw::proven_narrow<bits - small_bits>(x.raw))};
  }
  /// An output of the BLS: 64-bit sum of coefficients (`bits` fractional bits) times activations.
  template <int bits>
  static constexpr TorqueSum node_sum(std::int64_t sum, std::integral_constant<int, bits>) {
    return align(Wide<bits + small_bits>{sum}, TorqueSum{});
  }
  static constexpr Fixed<unit_bits> one() { return {1 << unit_bits}; }
  template <class Hash>
  static constexpr void hash_formats(Hash& hash) {
    for (std::size_t i = 0; i < quantity_count; ++i) hash.add(bits(static_cast<Quantity>(i)));
    hash.add(Formats::force_sum);
    hash.add(Formats::torque_sum);
    hash.add(Formats::deflection_sum);
  }

  template <class T, int bits>
  static constexpr T narrow(Wide<bits> x, Saturations& saturations) {
    static_assert(bits >= T::bits, "narrowing to a finer format");
    std::uint32_t outside = 0;
    const T result{raw::narrow(x.raw, bits - T::bits, outside)};
    saturations.count += outside;
    return result;
  }
  template <class T, int bits>
  static constexpr T narrow_counted(Wide<bits> x, Saturations& saturations) {
    return narrow<T>(x, saturations);
  }
  template <class T, int bits>
  static constexpr T proven_narrow(Wide<bits> x) {
    static_assert(bits >= T::bits, "narrowing to a finer format");
    return {raw::proven_narrow<bits - T::bits>(x.raw)};
  }
  template <class T, int bits>
  static constexpr T clamp(Wide<bits> x) {
    static_assert(bits >= T::bits, "narrowing to a finer format");
    return {raw::clamp<bits - T::bits>(x.raw)};
  }
  template <class T, int bits>
  static constexpr T convert(Fixed<bits> x) {
    if constexpr (bits >= T::bits)
      return {raw::proven_narrow<bits - T::bits>(x.raw)};
    else
      return {static_cast<std::int32_t>(wrapping_shift_left(static_cast<std::uint32_t>(x.raw), T::bits - bits))};
  }
  template <class T, class U>
  static constexpr Vector3<T> turned(const Vector3<T>& v, U, U) {
    return v;
  }
  template <class T>
  static constexpr NoLength rounded_length(NoLength, double) {
    return {};
  }
  template <class T, int bits>
  static constexpr T narrow_between(Wide<bits> x, T, T) {
    return proven_narrow<T>(x);
  }
  template <class T, int bits>
  static constexpr T narrow_relaxed(Wide<bits> x, T, T, Of<Quantity::unit>) {
    return proven_narrow<T>(x);
  }
};

/// The names that formulas use.
template <class N>
using Position = typename N::template Of<Quantity::position>;
template <class N>
using Velocity = typename N::template Of<Quantity::velocity>;
template <class N>
using Acceleration = typename N::template Of<Quantity::acceleration>;
template <class N>
using LinearAcceleration = typename N::template Of<Quantity::linear_acceleration>;
template <class N>
using Length = typename N::template Of<Quantity::length>;
template <class N>
using Force = typename N::template Of<Quantity::force>;
template <class N>
using Torque = typename N::template Of<Quantity::torque>;
template <class N>
using Unit = typename N::template Of<Quantity::unit>;
template <class N>
using Argument = typename N::template Of<Quantity::argument>;
template <class N>
using Ratio = typename N::template Of<Quantity::ratio>;
template <class N>
using InverseVelocity = typename N::template Of<Quantity::inverse_velocity>;
template <class N>
using InversePath = typename N::template Of<Quantity::inverse_path>;
template <class N>
using Weight = typename N::template Of<Quantity::weight>;
template <class N>
using VelocitySquared = typename N::template Of<Quantity::velocity_squared>;
template <class N>
using VelocityCubed = typename N::template Of<Quantity::velocity_cubed>;
template <class N>
using InversePosition = typename N::template Of<Quantity::inverse_position>;
template <class N>
using InverseTorque = typename N::template Of<Quantity::inverse_torque>;
template <class N>
using Feature = typename N::template Of<Quantity::feature>;
template <class N>
using Activation = typename N::template Of<Quantity::activation>;
template <class N>
using Count = typename N::template Of<Quantity::count>;

template <class N>
concept NumberSystem = requires(Velocity<N> v, Unit<N> u, Saturations& saturations) {
  { N::template narrow<Torque<N>>(typename N::TorqueSum{}, saturations) } -> std::same_as<Torque<N>>;
  { N::template clamp<Argument<N>>(v * InverseVelocity<N>{}) } -> std::same_as<Argument<N>>;
  { typename N::template Coefficient<Quantity::unit>{} * u } -> std::same_as<typename N::TorqueSum>;
};
static_assert(NumberSystem<Real>);

}  // namespace fxdyn
