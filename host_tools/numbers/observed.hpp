#pragma once

#include <array>
#include <cmath>
#include <compare>

#include "host_tools/numbers/formats.hpp"
#include "model/math.hpp"
#include "model/numbers.hpp"

// Double precision that remembers the largest magnitude every quantity took: running the model in it over logs and
// corner states tells which ranges the formats have to hold. The same templates of model/, no second copy of a formula.

namespace fxdyn {

struct Ranges {
  std::array<double, quantity_count> number{}, coefficient{};
  double mass = 0, first_moment = 0, second_moment = 0;

  void see(Kind kind, double x) {
    double& seen = at(kind);
    seen = std::fmax(seen, std::fabs(x));
  }
  double& at(Kind kind) {
    switch (kind.group) {
      case Kind::number:
        return number[static_cast<std::size_t>(kind.quantity)];
      case Kind::coefficient:
        return coefficient[static_cast<std::size_t>(kind.quantity)];
      case Kind::mass:
        return mass;
      case Kind::first_moment:
        return first_moment;
      case Kind::second_moment:
        return second_moment;
    }
    return mass;
  }
  double operator[](Quantity quantity) const { return number[static_cast<std::size_t>(quantity)]; }
};

inline thread_local Ranges* current_ranges = nullptr;

struct ObservedWide {
  double value = 0;
  friend ObservedWide operator+(ObservedWide a, ObservedWide b) { return {a.value + b.value}; }
  friend ObservedWide operator-(ObservedWide a, ObservedWide b) { return {a.value - b.value}; }
  friend ObservedWide operator-(ObservedWide a) { return {-a.value}; }
};

template <Kind kind>
struct Observed {
  double value = 0;
  template <Kind other>
  friend ObservedWide operator*(Observed a, Observed<other> b) {
    return {a.value * b.value};
  }
  friend ObservedWide operator+(Observed a, Observed b) { return {a.value + b.value}; }
  friend ObservedWide operator-(Observed a, Observed b) { return {a.value - b.value}; }
  friend ObservedWide operator-(Observed a) { return {-a.value}; }
  friend auto operator<=>(Observed, Observed) = default;
};

inline ObservedWide align(ObservedWide x, ObservedWide) { return x; }
template <Kind kind>
ObservedWide align(Observed<kind> x, ObservedWide) {
  return {x.value};
}

struct ObservedNumbers {
  template <Quantity quantity>
  using Of = Observed<Kind{Kind::number, quantity}>;
  template <Quantity quantity>
  using Coefficient = Observed<Kind{Kind::coefficient, quantity}>;
  using Mass = Observed<Kind{Kind::mass}>;
  using FirstMoment = Observed<Kind{Kind::first_moment}>;
  using SecondMoment = Observed<Kind{Kind::second_moment}>;
  using TorqueSum = ObservedWide;
  using Word = double;

  template <class T>
  static T load(Word word) {
    return {word};
  }
  static TorqueSum no_torque() { return {}; }
  static Of<Quantity::unit> one() { return {1}; }

  template <class T>
  static T narrow(ObservedWide x, Saturations&) {
    return see(T{x.value});
  }
  template <class T>
  static T proven_narrow(ObservedWide x) {
    return see(T{x.value});
  }
  template <class T>
  static T clamp(ObservedWide x) {
    return {x.value};
  }
  template <class T, Kind kind>
  static T convert(Observed<kind> x, Saturations&) {
    return see(T{x.value});
  }

 private:
  template <Kind kind>
  static Observed<kind> see(Observed<kind> x) {
    current_ranges->see(kind, x.value);
    return x;
  }
};

template <Kind kind>
SineCosine<ObservedNumbers::Of<Quantity::unit>> sin_cos(Observed<kind> q) {
  return {{std::sin(q.value)}, {std::cos(q.value)}};
}
inline SineCosine<ObservedNumbers::Of<Quantity::unit>> sin_cos_turns(ObservedWide turns) {
  const auto result = sin_cos_turns(turns.value);
  return {{result.sine}, {result.cosine}};
}
inline ObservedNumbers::Of<Quantity::unit> tanh_of(ObservedNumbers::Of<Quantity::argument> x) {
  return {std::tanh(x.value)};
}
inline ObservedNumbers::Of<Quantity::unit> exp_negative(ObservedNumbers::Of<Quantity::argument> x) {
  return {std::exp(-x.value)};
}
inline ObservedNumbers::Of<Quantity::argument> asinh_of(ObservedNumbers::Of<Quantity::ratio> x) {
  return {std::asinh(x.value)};
}
template <Kind kind>
Observed<kind> magnitude(Observed<kind> x) {
  return {std::fabs(x.value)};
}
template <Kind kind>
ObservedNumbers::Of<Quantity::unit> sign_of(Observed<kind> x) {
  return {sign_of(x.value)};
}
template <Kind kind>
Observed<kind> clipping(Observed<kind> x, Observed<kind> limit) {
  return {clipping(x.value, limit.value)};
}
inline WholeAndRest<ObservedNumbers::Of<Quantity::unit>> split_count(ObservedNumbers::Of<Quantity::count> x) {
  const auto parts = split_count(x.value);
  return {parts.whole, {parts.rest}};
}

}  // namespace fxdyn
