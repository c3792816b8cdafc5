#pragma once

#include "model/fixed.hpp"

namespace fxdyn {

/// What a number system may know of a vector beyond its components: nothing, for numbers that are just computed with.
/// Bounding number systems (host_tools/numbers/bounded.hpp) keep the length here: turning a vector does not change it,
/// while a box around the turned components grows with every turn.
struct NoLength {
  friend constexpr NoLength operator+(NoLength, NoLength) { return {}; }
  friend constexpr NoLength operator*(NoLength, NoLength) { return {}; }
};
template <class T>
struct LengthOf {
  using type = NoLength;
};

/// Three components of one type. Products of two vectors have the (wider) type of the products of their components.
template <class T>
struct Vector3 {
  T x{}, y{}, z{};
  [[no_unique_address]] typename LengthOf<T>::type length{};
};

template <class T>
constexpr NoLength length_of(const T&) {
  return {};
}

template <class A, class B>
constexpr auto operator+(const Vector3<A>& a, const Vector3<B>& b) {
  return Vector3<decltype(a.x + b.x)>{a.x + b.x, a.y + b.y, a.z + b.z, length_of(a) + length_of(b)};
}

/// a x b
template <class A, class B>
constexpr auto cross(const Vector3<A>& a, const Vector3<B>& b) {
  using Product = decltype(a.x * b.x - a.x * b.x);
  return Vector3<Product>{a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x,
                          length_of(a) * length_of(b)};
}

/// scalar * vector
template <class S, class T>
constexpr auto scale(S s, const Vector3<T>& v) {
  return Vector3<decltype(s * v.x)>{s * v.x, s * v.y, s * v.z, length_of(s) * length_of(v)};
}

/// Componentwise align() (numbers.hpp).
template <class T, class W>
constexpr auto align(const Vector3<T>& v, const Vector3<W>& like) {
  return Vector3<decltype(align(v.x, like.x))>{align(v.x, like.x), align(v.y, like.y), align(v.z, like.z),
                                               length_of(v)};
}

/// Componentwise proven_narrow() (numbers.hpp): half a unit each, sqrt(3) / 2 of a unit together.
template <class N, class T, class W>
constexpr Vector3<T> proven_narrow(const Vector3<W>& v) {
  return {N::template proven_narrow<T>(v.x), N::template proven_narrow<T>(v.y), N::template proven_narrow<T>(v.z),
          N::template rounded_length<T>(length_of(v), 0.87)};
}

/// 3 x 3, row by row. `length`: the largest factor by which it stretches a vector.
template <class T>
struct Matrix3 {
  Vector3<T> x, y, z;
  [[no_unique_address]] typename LengthOf<T>::type length{};
};

template <class A, class B>
constexpr auto dot(const Vector3<A>& a, const Vector3<B>& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}

template <class A, class B>
constexpr auto operator*(const Matrix3<A>& m, const Vector3<B>& v) {
  return Vector3<decltype(dot(m.x, v))>{dot(m.x, v), dot(m.y, v), dot(m.z, v), m.length * length_of(v)};
}

}  // namespace fxdyn
