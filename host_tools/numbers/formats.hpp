#pragma once

#include <array>
#include <cstdint>

#include "model/quantity.hpp"

namespace fxdyn {

/// The formats of one exported model, as fractional bits: what the generated `Formats` struct states at compile time.
struct Formats {
  std::array<int, quantity_count> quantity{};
  int force_sum = 0, torque_sum = 0;

  int operator[](Quantity q) const { return quantity[static_cast<std::size_t>(q)]; }
  int& operator[](Quantity q) { return quantity[static_cast<std::size_t>(q)]; }
};

/// What a stored number is: a quantity, a coefficient that multiplies one, or an inertial parameter.
struct Kind {
  enum Group : std::uint8_t { number, coefficient, mass, first_moment, second_moment } group = number;
  Quantity quantity = Quantity::unit;
  friend constexpr bool operator==(Kind, Kind) = default;
};

/// Fractional bits of a kind; the rules are those of FixedNumbers (model/numbers.hpp), which a test compares.
inline int bits_of(const Formats& formats, Kind kind) {
  const int a = formats[Quantity::linear_acceleration], w = formats[Quantity::acceleration];
  switch (kind.group) {
    case Kind::number:
      return formats[kind.quantity];
    case Kind::coefficient:
      return formats.torque_sum - formats[kind.quantity];
    case Kind::mass:
      return formats.force_sum - a;
    case Kind::first_moment:
      return formats.force_sum - w;
    case Kind::second_moment:
      return formats.force_sum - 2 * w + a;
  }
  return 0;
}

}  // namespace fxdyn
