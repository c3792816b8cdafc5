#pragma once

#include <cstddef>

#include "host_tools/support/vectors.hpp"
#include "model/math.hpp"
#include "model/numbers.hpp"

namespace fxdyn {

/// The same quantity of `count` samples. Aligned here: of a vector type GCC forgets it where the processor may lack it.
template <int count>
struct alignas(8 * count) Lanes {
  typename Vector<count>::Double x{};

  [[gnu::always_inline]] friend Lanes operator+(Lanes a, Lanes b) { return {a.x + b.x}; }
  [[gnu::always_inline]] friend Lanes operator-(Lanes a, Lanes b) { return {a.x - b.x}; }
  [[gnu::always_inline]] friend Lanes operator*(Lanes a, Lanes b) { return {a.x * b.x}; }
  [[gnu::always_inline]] friend Lanes operator-(Lanes a) { return {-a.x}; }
  [[gnu::always_inline]] friend Lanes align(Lanes a, Lanes) { return a; }
  [[gnu::always_inline]] friend SineCosine<Lanes> sin_cos(Lanes a) {
    SineCosine<Lanes> out;
    for (int i = 0; i < count; ++i) {
      const SineCosine<double> one = sin_cos(double{a.x[i]});
      out.sine.x[i] = one.sine;
      out.cosine.x[i] = one.cosine;
    }
    return out;
  }
};

/// Number system of the rigid body on the host: double precision, `count` samples at once. Each sample gets the bits
/// that Real gives it.
template <int count>
struct SideBySide {
  template <Quantity>
  using Of = Lanes<count>;
  using Mass = Lanes<count>;
  using FirstMoment = Lanes<count>;
  using SecondMoment = Lanes<count>;

  /// All samples have it. (0 + x would turn -0 into 0.)
  [[gnu::always_inline]] static Lanes<count> all(double x) { return {x - typename Vector<count>::Double{}}; }
  template <class T>
  [[gnu::always_inline]] static Lanes<count> proven_narrow(Lanes<count> x) {
    return x;
  }
  template <class T>
  [[gnu::always_inline]] static Lanes<count> convert(Lanes<count> x) {
    return x;
  }
  template <class T, class U>
  [[gnu::always_inline]] static Vector3<T> turned(const Vector3<T>& v, U, U) {
    return v;
  }
  template <class T>
  static NoLength rounded_length(NoLength, double) {
    return {};
  }
};

}  // namespace fxdyn
