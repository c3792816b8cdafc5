#pragma once

#include <array>
#include <cstdint>

#include "model/dense.hpp"
#include "model/quantity.hpp"

namespace fxdyn {

/// The formats of one exported model, as fractional bits: what the generated `Formats` struct states at compile time.
struct Formats {
  std::array<int, quantity_count> quantity{};
  int force_sum = 0, torque_sum = 0, deflection_sum = 0;

  int operator[](Quantity q) const { return quantity[static_cast<std::size_t>(q)]; }
  int& operator[](Quantity q) { return quantity[static_cast<std::size_t>(q)]; }
  friend bool operator==(const Formats&, const Formats&) = default;
};

/// What a stored number is: a quantity, a coefficient that multiplies one, an inertial parameter, a number of the BLS.
struct Kind {
  enum Group : std::uint8_t {
    number,
    coefficient,             ///< of a torque
    deflection_coefficient,  ///< of a deflection
    mass,
    first_moment,
    second_moment,
    bias,  ///< of a BLS node
  } group = number;
  Quantity quantity = Quantity::unit;
  friend constexpr bool operator==(Kind, Kind) = default;
};
inline constexpr std::size_t group_count = Kind::bias + 1;

/// Fractional bits of a kind; the rules are those of FixedNumbers (model/numbers.hpp), which a test compares.
inline int bits_of(const Formats& formats, Kind kind) {
  const int a = formats[Quantity::linear_acceleration], w = formats[Quantity::acceleration];
  switch (kind.group) {
    case Kind::number:
      return formats[kind.quantity];
    case Kind::coefficient:
      return formats.torque_sum - formats[kind.quantity];
    case Kind::deflection_coefficient:
      return formats.deflection_sum - formats[kind.quantity];
    case Kind::mass:
      return formats.force_sum - a;
    case Kind::first_moment:
      return formats.force_sum - w;
    case Kind::second_moment:
      return formats.force_sum - 2 * w + a;
    case Kind::bias:
      return formats[Quantity::weight] + small_bits;
  }
  return 0;
}

}  // namespace fxdyn
