#pragma once

namespace fxdyn {

/// Three components of one type. Products of two vectors have the (wider) type of the products of their components.
template <class T>
struct Vector3 {
  T x{}, y{}, z{};
};

template <class A, class B>
constexpr auto operator+(const Vector3<A>& a, const Vector3<B>& b) {
  return Vector3<decltype(a.x + b.x)>{a.x + b.x, a.y + b.y, a.z + b.z};
}

/// a x b
template <class A, class B>
constexpr auto cross(const Vector3<A>& a, const Vector3<B>& b) {
  using Product = decltype(a.x * b.x - a.x * b.x);
  return Vector3<Product>{a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

/// scalar * vector
template <class S, class T>
constexpr auto scale(S s, const Vector3<T>& v) {
  return Vector3<decltype(s * v.x)>{s * v.x, s * v.y, s * v.z};
}

/// Componentwise align() (numbers.hpp).
template <class T, class W>
constexpr auto align(const Vector3<T>& v, const Vector3<W>& like) {
  return Vector3<decltype(align(v.x, like.x))>{align(v.x, like.x), align(v.y, like.y), align(v.z, like.z)};
}

/// 3 x 3, row by row.
template <class T>
struct Matrix3 {
  Vector3<T> x, y, z;
};

template <class A, class B>
constexpr auto dot(const Vector3<A>& a, const Vector3<B>& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}

template <class A, class B>
constexpr auto operator*(const Matrix3<A>& m, const Vector3<B>& v) {
  return Vector3<decltype(dot(m.x, v))>{dot(m.x, v), dot(m.y, v), dot(m.z, v)};
}

}  // namespace fxdyn
