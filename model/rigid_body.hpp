#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <tuple>
#include <utility>

#include "model/math.hpp"
#include "model/numbers.hpp"
#include "model/vector.hpp"

// Rigid-body inverse dynamics of a serial chain: one recursive Newton-Euler algorithm (RNEA), used by the simulator,
// the regressor and the firmware.
//
// Frames: modified Denavit-Hartenberg (Craig, Introduction to Robotics, ch. 3). Frame i is fixed to link i, its z axis
// is joint axis i, R_i = Rx(alpha) Rz(theta) turns vectors of frame i into frame i-1, p_i = (a, -d sin(alpha), d
// cos(alpha)) is the origin of frame i in frame i-1. Revolute: theta = q + offset. Prismatic: d = q + offset.
//
// Inertial parameters of a link, ten, in its own frame and about its origin: mass m [kg], first moment h = m c [kg m],
// second moment J = integral of r r^T dm [kg m^2]. They are the entries of the pseudo-inertia matrix (Wensing, Kim,
// Slotine, "Linear matrix inequalities for physically consistent inertial parameter identification", RA-L 2018); the
// inertia tensor is I = tr(J) 1 - J. Torque is linear in them, so they may be base parameters (Y_b beta = Y [beta; 0]).

namespace fxdyn {

enum class JointType : std::int32_t { revolute, prismatic };

/// Constants of the transform from link i-1 to link i.
template <class N>
struct LinkGeometry {
  JointType type = JointType::revolute;
  Unit<N> cos_alpha{}, sin_alpha{};  ///< twist about x
  Vector3<Length<N>> p;              ///< origin of frame i in frame i-1, for prismatic joints at q = 0 [m]
  Position<N> theta{};               ///< rotation about z at q = 0 [rad]
};

/// The ten inertial parameters in the order of the regressor's columns.
template <class N>
struct LinkInertia {
  typename N::Mass m{};
  Vector3<typename N::FirstMoment> h;
  typename N::SecondMoment xx{}, yy{}, zz{}, xy{}, xz{}, yz{};
};
inline constexpr std::size_t parameters_per_link = 10;

// What the code knows of a link beforehand. The functions below take a link's shape as an object: `AnyLink` knows
// nothing (the host, where the robot is read from a file), a `Link<...>` is a type written into the tables, and what it
// says is zero or a right angle is not computed. The bits are the same: what is left out is exact.

enum class Twist : std::uint8_t { any, none, quarter, minus_quarter };  ///< alpha: 0, 90 or -90 degrees

struct AnyLink {
  template <class N>
  static constexpr bool revolute(const LinkGeometry<N>& link) {
    return link.type == JointType::revolute;
  }
  static constexpr Twist twist = Twist::any;
  template <class V>
  static constexpr const V& offset(const V& p) {
    return p;
  }
  template <class N>
  static constexpr const LinkInertia<N>& inertia(const LinkInertia<N>& body) {
    return body;
  }
};

/// @tparam offsets bit k: component k of p may be other than zero
/// @tparam parameters bit k: inertial parameter k may be other than zero (base parameters leave many at zero)
template <JointType type_, Twist twist_ = Twist::any, unsigned offsets = 7, unsigned parameters = 0x3ff>
struct Link {
  static constexpr JointType type = type_;
  static constexpr Twist twist = twist_;
  static constexpr std::int32_t code =
      static_cast<std::int32_t>(type) | static_cast<std::int32_t>(twist) << 1 | offsets << 3 | parameters << 6;
  template <class N>
  static constexpr bool revolute(const LinkGeometry<N>&) {
    return type == JointType::revolute;
  }
  template <class V>
  static constexpr V offset(const V& p) {
    return {used<offsets, 0>(p.x), used<offsets, 1>(p.y), used<offsets, 2>(p.z)};
  }
  template <class N>
  static constexpr LinkInertia<N> inertia(const LinkInertia<N>& b) {
    return {
        used<parameters, 0>(b.m),  {used<parameters, 1>(b.h.x), used<parameters, 2>(b.h.y), used<parameters, 3>(b.h.z)},
        used<parameters, 4>(b.xx), used<parameters, 5>(b.yy),
        used<parameters, 6>(b.zz), used<parameters, 7>(b.xy),
        used<parameters, 8>(b.xz), used<parameters, 9>(b.yz)};
  }

 private:
  template <unsigned mask, unsigned bit, class T>
  static constexpr T used(const T& x) {
    if constexpr ((mask >> bit & 1U) != 0) return x;
    return {};
  }
};

template <class N>
struct JointState {
  Position<N> q{};
  Velocity<N> dq{};
  Acceleration<N> ddq{};
};

/// Force and moment about the frame's origin, in the link's frame.
template <class N>
struct Wrench {
  Vector3<Force<N>> force;
  Vector3<Torque<N>> moment;
};

/// Motion of link i in its own frame, and the transform to link i-1.
template <class N>
struct LinkMotion {
  Unit<N> cos_theta{}, sin_theta{};
  Vector3<Length<N>> p;
  Vector3<Velocity<N>> omega;          ///< angular velocity
  Vector3<Acceleration<N>> omega_dot;  ///< angular acceleration
  Vector3<LinearAcceleration<N>> a;    ///< acceleration of the origin minus gravity
  Matrix3<Acceleration<N>> k;          ///< [omega_dot]x + [omega]x [omega]x: the point r accelerates by a + K r
};

namespace detail {

template <class N, class T>
constexpr void rotate(Unit<N> cosine, Unit<N> sine, T& u, T& v) {
  const T turned = N::template proven_narrow<T>(cosine * u - sine * v);
  v = N::template proven_narrow<T>(sine * u + cosine * v);
  u = turned;
}

/// Turns (y, z) by alpha (forward) or -alpha.
template <class N, bool forward, class Shape, class T>
constexpr void twist(Shape, const LinkGeometry<N>& link, T& y, T& z) {
  constexpr Twist angle = Shape::twist;
  if constexpr (angle == Twist::none) return;
  if constexpr (angle == Twist::any) {
    // turning backwards is turning with the two axes swapped
    if constexpr (forward) rotate<N>(link.cos_alpha, link.sin_alpha, y, z);
    if constexpr (!forward) rotate<N>(link.cos_alpha, link.sin_alpha, z, y);
  } else {
    const T old = y;
    if constexpr ((angle == Twist::quarter) == forward) {
      y = N::template proven_narrow<T>(-z);
      z = old;
    } else {
      y = z;
      z = N::template proven_narrow<T>(-old);
    }
  }
}

/// R v: from frame i to frame i-1.
template <class N, class Shape, class T>
constexpr Vector3<T> to_parent(Shape shape, const LinkGeometry<N>& link, const LinkMotion<N>& motion, Vector3<T> v) {
  v.length = length_of(v);
  rotate<N>(motion.cos_theta, motion.sin_theta, v.x, v.y);
  v = N::turned(v, motion.cos_theta, motion.sin_theta);
  twist<N, true>(shape, link, v.y, v.z);
  return N::turned(v, link.cos_alpha, link.sin_alpha);
}

/// R^T v: from frame i-1 to frame i.
template <class N, class Shape, class T>
constexpr Vector3<T> to_child(Shape shape, const LinkGeometry<N>& link, const LinkMotion<N>& motion, Vector3<T> v) {
  v.length = length_of(v);
  twist<N, false>(shape, link, v.y, v.z);
  v = N::turned(v, link.cos_alpha, link.sin_alpha);
  rotate<N>(motion.cos_theta, motion.sin_theta, v.y, v.x);
  return N::turned(v, motion.cos_theta, motion.sin_theta);
}

/// K = [omega_dot]x + [omega]x [omega]x = [omega_dot]x + omega omega^T - |omega|^2 1
template <class N>
constexpr Matrix3<Acceleration<N>> acceleration_matrix(const Vector3<Velocity<N>>& w,
                                                       const Vector3<Acceleration<N>>& wd) {
  const auto entry = [](auto wide) { return N::template proven_narrow<Acceleration<N>>(wide); };
  const auto xx = entry(square(w.x)), yy = entry(square(w.y)), zz = entry(square(w.z));
  const auto xy = entry(w.x * w.y), xz = entry(w.x * w.z), yz = entry(w.y * w.z);
  return {{entry(-(yy + zz)), entry(xy - wd.z), entry(xz + wd.y)},
          {entry(xy + wd.z), entry(-(xx + zz)), entry(yz - wd.x)},
          {entry(xz - wd.y), entry(yz + wd.x), entry(-(xx + yy))},
          // products rounded before they are added: up to one unit in the diagonal, half a unit elsewhere
          N::template rounded_length<Acceleration<N>>(length_of(wd) + length_of(w) * length_of(w), 2.13)};
}

}  // namespace detail

/// The base at rest. `up` is minus the gravity vector in the frame that joint 1's alpha, a and d refer to [m/s^2]: a
/// base that accelerates upwards gives every link its weight.
template <class N>
constexpr LinkMotion<N> base_motion(const Vector3<LinearAcceleration<N>>& up) {
  LinkMotion<N> base;
  base.a = up;
  return base;
}

/// Outward step: motion of link i from that of link i-1 (Craig, Eqs. 6.45-6.49, with K for the quadratic terms):
///   omega_i = R^T omega_{i-1} + dq z,  omega_dot_i = R^T omega_dot_{i-1} + R^T omega_{i-1} x dq z + ddq z   (revolute)
///   a_i = R^T (a_{i-1} + K_{i-1} p_i)  [+ 2 omega_i x dq z + ddq z for a prismatic joint]
template <class N, class Shape>
constexpr LinkMotion<N> link_motion(Shape shape, const LinkGeometry<N>& link, const LinkMotion<N>& parent,
                                    const JointState<N>& joint) {
  using V = Velocity<N>;
  using W = Acceleration<N>;
  using A = LinearAcceleration<N>;
  const bool revolute = shape.revolute(link);
  LinkMotion<N> out;

  out.p = shape.offset(link.p);
  if (!revolute) {
    const auto slide = N::template convert<Length<N>>(joint.q);
    const auto py = slide * link.sin_alpha, pz = slide * link.cos_alpha;
    out.p.y = N::template proven_narrow<Length<N>>(align(out.p.y, py) - py);
    out.p.z = N::template proven_narrow<Length<N>>(align(out.p.z, pz) + pz);
    out.p.length = {};
  }
  const auto turn = sin_cos(revolute ? N::template proven_narrow<Position<N>>(link.theta + joint.q) : link.theta);
  out.cos_theta = turn.cosine;
  out.sin_theta = turn.sine;

  const auto kp = parent.k * out.p;
  out.a = detail::to_child<N>(shape, link, out, proven_narrow<N, A>(align(parent.a, kp) + kp));
  out.omega = detail::to_child<N>(shape, link, out, parent.omega);
  out.omega_dot = detail::to_child<N>(shape, link, out, parent.omega_dot);
  if (revolute) {
    const Vector3<V> spin{{}, {}, joint.dq};
    const Vector3<W> spin_up{{}, {}, joint.ddq};
    const auto turning = cross(out.omega, spin);
    out.omega_dot = proven_narrow<N, W>(align(proven_narrow<N, W>(out.omega_dot + spin_up), turning) + turning);
    out.omega = proven_narrow<N, V>(out.omega + spin);
  } else {
    const Vector3<V> spin{{}, {}, joint.dq};
    const Vector3<A> push{{}, {}, N::template convert<A>(joint.ddq)};
    const auto coriolis = cross(out.omega, spin) + cross(out.omega, spin);
    out.a = proven_narrow<N, A>(align(proven_narrow<N, A>(out.a + push), coriolis) + coriolis);
  }
  out.k = detail::acceleration_matrix<N>(out.omega, out.omega_dot);
  return out;
}

/// Newton and Euler in one: the integral of (a + K r) dm and of r x (a + K r) dm,
///   force = m a + K h,  moment = h x a + axial(K J),  axial(A) = (A_zy - A_yz, A_xz - A_zx, A_yx - A_xy).
template <class N, class Shape>
constexpr Wrench<N> link_wrench(Shape shape, const LinkInertia<N>& any, const LinkMotion<N>& motion) {
  const LinkInertia<N>& link = shape.inertia(any);
  using SecondMoment = typename N::SecondMoment;
  const Vector3<SecondMoment> jx{link.xx, link.xy, link.xz}, jy{link.xy, link.yy, link.yz},
      jz{link.xz, link.yz, link.zz};
  const auto& k = motion.k;
  const auto lever = cross(link.h, motion.a);
  using Sum = Vector3<decltype(lever.x)>;
  const Sum axial{dot(k.z, jy) - dot(k.y, jz), dot(k.x, jz) - dot(k.z, jx), dot(k.y, jx) - dot(k.x, jy)};
  return {proven_narrow<N, Force<N>>(scale(link.m, motion.a) + k * link.h), proven_narrow<N, Torque<N>>(lever + axial)};
}

/// Inward step: adds the wrench on link i to the one on link i-1.
template <class N, class Shape>
constexpr void add_to_parent(Shape shape, Wrench<N>& parent, const Wrench<N>& child, const LinkGeometry<N>& link,
                             const LinkMotion<N>& motion) {
  const auto force = detail::to_parent<N>(shape, link, motion, child.force);
  const auto moment = detail::to_parent<N>(shape, link, motion, child.moment);
  const auto lever = cross(motion.p, force);
  parent.force = proven_narrow<N, Force<N>>(parent.force + force);
  parent.moment =
      proven_narrow<N, Torque<N>>(align(proven_narrow<N, Torque<N>>(parent.moment + moment), lever) + lever);
}

/// The wrench's component along the joint's axis: what the drive has to give [N*m | N].
template <class N, class Shape>
constexpr Torque<N> joint_torque(Shape shape, const LinkGeometry<N>& link, const Wrench<N>& wrench) {
  if (shape.revolute(link)) return wrench.moment.z;
  return N::template convert<Torque<N>>(wrench.force.z);
}

/// tau = M(q) ddq + C(q, dq) dq + g(q). All spans have one element a joint; `motions` and `wrenches` are scratch memory
/// of the caller. The states must be within the limits for which the formats were proven.
template <class N, std::size_t n>
constexpr void rnea(std::span<const LinkGeometry<N>, n> geometry, std::span<const LinkInertia<N>, n> inertia,
                    const Vector3<LinearAcceleration<N>>& up, std::span<const JointState<N>, n> joints,
                    std::span<LinkMotion<N>, n> motions, std::span<Wrench<N>, n> wrenches,
                    std::span<Torque<N>, n> tau) {
  const std::size_t count = geometry.size();
  const LinkMotion<N> base = base_motion<N>(up);
  for (std::size_t i = 0; i < count; ++i) {
    motions[i] = link_motion<N>(AnyLink{}, geometry[i], i == 0 ? base : motions[i - 1], joints[i]);
    wrenches[i] = link_wrench<N>(AnyLink{}, inertia[i], motions[i]);
  }
  for (std::size_t i = count; i > 0;) {
    --i;
    tau[i] = joint_torque<N>(AnyLink{}, geometry[i], wrenches[i]);
    if (i > 0) add_to_parent<N>(AnyLink{}, wrenches[i - 1], wrenches[i], geometry[i], motions[i]);
  }
}

/// The same with the links' shapes known: `Links` are Link<...>, unrolled. Writes the torques of joints first .. n-1
/// only; wrenches of links before `first` are not computed.
template <class N, std::size_t first, class... Links>
constexpr void rnea_of(const std::array<LinkGeometry<N>, sizeof...(Links)>& geometry,
                       const std::array<LinkInertia<N>, sizeof...(Links)>& inertia,
                       const Vector3<LinearAcceleration<N>>& up,
                       const std::array<JointState<N>, sizeof...(Links)>& joints,
                       std::array<Torque<N>, sizeof...(Links)>& tau) {
  constexpr std::size_t n = sizeof...(Links);
  std::array<LinkMotion<N>, n> motions;
  std::array<Wrench<N>, n> wrenches;
  const LinkMotion<N> base = base_motion<N>(up);
  const auto outward = [&]<std::size_t i, class Shape>() {
    motions[i] = link_motion<N>(Shape{}, geometry[i], i == 0 ? base : motions[i == 0 ? 0 : i - 1], joints[i]);
    if constexpr (i >= first) wrenches[i] = link_wrench<N>(Shape{}, inertia[i], motions[i]);
  };
  const auto inward = [&]<std::size_t i, class Shape>() {
    if constexpr (i >= first) {
      tau[i] = joint_torque<N>(Shape{}, geometry[i], wrenches[i]);
      if constexpr (i > first) add_to_parent<N>(Shape{}, wrenches[i - 1], wrenches[i], geometry[i], motions[i]);
    }
  };
  using Shapes = std::tuple<Links...>;
  [&]<std::size_t... i>(std::index_sequence<i...>) {
    (outward.template operator()<i, std::tuple_element_t<i, Shapes>>(), ...);
    (inward.template operator()<n - 1 - i, std::tuple_element_t<n - 1 - i, Shapes>>(), ...);
  }
  (std::make_index_sequence<n>{});
}

}  // namespace fxdyn
