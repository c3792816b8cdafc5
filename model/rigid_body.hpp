#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

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
  Length<N> a{};                     ///< along x [m]
  Length<N> d{};                     ///< along z [m], for prismatic joints at q = 0
  Unit<N> cos_theta{}, sin_theta{};  ///< rotation about z, for revolute joints at q = 0
};

/// The ten inertial parameters in the order of the regressor's columns.
template <class N>
struct LinkInertia {
  typename N::Mass m{};
  Vector3<typename N::FirstMoment> h;
  typename N::SecondMoment xx{}, yy{}, zz{}, xy{}, xz{}, yz{};
};
inline constexpr std::size_t parameters_per_link = 10;

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
constexpr void rotate(Unit<N> cosine, Unit<N> sine, T& u, T& v, Saturations& saturations) {
  const T turned = N::template narrow<T>(cosine * u - sine * v, saturations);
  v = N::template narrow<T>(sine * u + cosine * v, saturations);
  u = turned;
}

/// R v: from frame i to frame i-1.
template <class N, class T>
constexpr Vector3<T> to_parent(const LinkGeometry<N>& link, const LinkMotion<N>& motion, Vector3<T> v,
                               Saturations& saturations) {
  rotate<N>(motion.cos_theta, motion.sin_theta, v.x, v.y, saturations);
  rotate<N>(link.cos_alpha, link.sin_alpha, v.y, v.z, saturations);
  return v;
}

/// R^T v: from frame i-1 to frame i. Turning backwards is turning with the two axes swapped.
template <class N, class T>
constexpr Vector3<T> to_child(const LinkGeometry<N>& link, const LinkMotion<N>& motion, Vector3<T> v,
                              Saturations& saturations) {
  rotate<N>(link.cos_alpha, link.sin_alpha, v.z, v.y, saturations);
  rotate<N>(motion.cos_theta, motion.sin_theta, v.y, v.x, saturations);
  return v;
}

template <class N, class T, class W>
constexpr Vector3<T> narrow(const Vector3<W>& v, Saturations& saturations) {
  return {N::template narrow<T>(v.x, saturations), N::template narrow<T>(v.y, saturations),
          N::template narrow<T>(v.z, saturations)};
}

/// K = [omega_dot]x + [omega]x [omega]x = [omega_dot]x + omega omega^T - |omega|^2 1
template <class N>
constexpr Matrix3<Acceleration<N>> acceleration_matrix(const Vector3<Velocity<N>>& w,
                                                       const Vector3<Acceleration<N>>& wd, Saturations& saturations) {
  const auto entry = [&](auto wide) { return N::template narrow<Acceleration<N>>(wide, saturations); };
  const auto xx = w.x * w.x, yy = w.y * w.y, zz = w.z * w.z;
  const auto xy = w.x * w.y, xz = w.x * w.z, yz = w.y * w.z;
  const auto dot = align(wd, Vector3<decltype(xx)>{xx, yy, zz});
  return {{entry(-(yy + zz)), entry(xy - dot.z), entry(xz + dot.y)},
          {entry(xy + dot.z), entry(-(xx + zz)), entry(yz - dot.x)},
          {entry(xz - dot.y), entry(yz + dot.x), entry(-(xx + yy))}};
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
template <class N>
constexpr LinkMotion<N> link_motion(const LinkGeometry<N>& link, const LinkMotion<N>& parent,
                                    const JointState<N>& joint, Saturations& saturations) {
  using V = Velocity<N>;
  using W = Acceleration<N>;
  using A = LinearAcceleration<N>;
  LinkMotion<N> out;

  Length<N> d = link.d;
  if (link.type == JointType::revolute) {
    const auto turn = sin_cos(joint.q);
    out.cos_theta = N::template narrow<Unit<N>>(turn.cosine * link.cos_theta - turn.sine * link.sin_theta, saturations);
    out.sin_theta = N::template narrow<Unit<N>>(turn.sine * link.cos_theta + turn.cosine * link.sin_theta, saturations);
  } else {
    out.cos_theta = link.cos_theta;
    out.sin_theta = link.sin_theta;
    d = N::template narrow<Length<N>>(d + N::template convert<Length<N>>(joint.q, saturations), saturations);
  }
  out.p = {link.a, N::template narrow<Length<N>>(-(d * link.sin_alpha), saturations),
           N::template narrow<Length<N>>(d * link.cos_alpha, saturations)};

  const auto kp = parent.k * out.p;
  out.a = detail::to_child<N>(link, out, detail::narrow<N, A>(align(parent.a, kp) + kp, saturations), saturations);
  out.omega = detail::to_child<N>(link, out, parent.omega, saturations);
  out.omega_dot = detail::to_child<N>(link, out, parent.omega_dot, saturations);
  if (link.type == JointType::revolute) {
    const auto turn_x = out.omega.y * joint.dq, turn_y = -(out.omega.x * joint.dq);
    out.omega_dot = {N::template narrow<W>(align(out.omega_dot.x, turn_x) + turn_x, saturations),
                     N::template narrow<W>(align(out.omega_dot.y, turn_y) + turn_y, saturations),
                     N::template narrow<W>(out.omega_dot.z + joint.ddq, saturations)};
    out.omega.z = N::template narrow<V>(out.omega.z + joint.dq, saturations);
  } else {
    const auto coriolis_x = out.omega.y * joint.dq + out.omega.y * joint.dq;
    const auto coriolis_y = -(out.omega.x * joint.dq) - out.omega.x * joint.dq;
    out.a = {N::template narrow<A>(align(out.a.x, coriolis_x) + coriolis_x, saturations),
             N::template narrow<A>(align(out.a.y, coriolis_y) + coriolis_y, saturations),
             N::template narrow<A>(out.a.z + N::template convert<A>(joint.ddq, saturations), saturations)};
  }
  out.k = detail::acceleration_matrix<N>(out.omega, out.omega_dot, saturations);
  return out;
}

/// Newton and Euler in one: the integral of (a + K r) dm and of r x (a + K r) dm,
///   force = m a + K h,  moment = h x a + axial(K J),  axial(A) = (A_zy - A_yz, A_xz - A_zx, A_yx - A_xy).
template <class N>
constexpr Wrench<N> link_wrench(const LinkInertia<N>& link, const LinkMotion<N>& motion, Saturations& saturations) {
  using SecondMoment = typename N::SecondMoment;
  const Vector3<SecondMoment> jx{link.xx, link.xy, link.xz}, jy{link.xy, link.yy, link.yz},
      jz{link.xz, link.yz, link.zz};
  const auto& k = motion.k;
  const auto lever = cross(link.h, motion.a);
  return {detail::narrow<N, Force<N>>(scale(link.m, motion.a) + k * link.h, saturations),
          detail::narrow<N, Torque<N>>(Vector3<decltype(lever.x)>{lever.x + (dot(k.z, jy) - dot(k.y, jz)),
                                                                  lever.y + (dot(k.x, jz) - dot(k.z, jx)),
                                                                  lever.z + (dot(k.y, jx) - dot(k.x, jy))},
                                       saturations)};
}

/// Inward step: adds the wrench on link i to the one on link i-1.
template <class N>
constexpr void add_to_parent(Wrench<N>& parent, const Wrench<N>& child, const LinkGeometry<N>& link,
                             const LinkMotion<N>& motion, Saturations& saturations) {
  const auto force = detail::to_parent<N>(link, motion, child.force, saturations);
  const auto moment = detail::to_parent<N>(link, motion, child.moment, saturations);
  const auto lever = cross(motion.p, force);
  parent.force = detail::narrow<N, Force<N>>(parent.force + force, saturations);
  parent.moment = detail::narrow<N, Torque<N>>(align(parent.moment, lever) + align(moment, lever) + lever, saturations);
}

/// The wrench's component along the joint's axis: what the drive has to give [N*m | N].
template <class N>
constexpr Torque<N> joint_torque(const LinkGeometry<N>& link, const Wrench<N>& wrench, Saturations& saturations) {
  if (link.type == JointType::revolute) return wrench.moment.z;
  return N::template convert<Torque<N>>(wrench.force.z, saturations);
}

/// tau = M(q) ddq + C(q, dq) dq + g(q). All spans have one element a joint; `motions` and `wrenches` are scratch memory
/// of the caller. Total: out-of-range values saturate and are counted.
template <class N, std::size_t n>
constexpr void rnea(std::span<const LinkGeometry<N>, n> geometry, std::span<const LinkInertia<N>, n> inertia,
                    const Vector3<LinearAcceleration<N>>& up, std::span<const JointState<N>, n> joints,
                    std::span<LinkMotion<N>, n> motions, std::span<Wrench<N>, n> wrenches, std::span<Torque<N>, n> tau,
                    Saturations& saturations) {
  const std::size_t count = geometry.size();
  const LinkMotion<N> base = base_motion<N>(up);
  for (std::size_t i = 0; i < count; ++i) {
    motions[i] = link_motion<N>(geometry[i], i == 0 ? base : motions[i - 1], joints[i], saturations);
    wrenches[i] = link_wrench<N>(inertia[i], motions[i], saturations);
  }
  for (std::size_t i = count; i-- > 0;) {
    tau[i] = joint_torque<N>(geometry[i], wrenches[i], saturations);
    if (i > 0) add_to_parent<N>(wrenches[i - 1], wrenches[i], geometry[i], motions[i], saturations);
  }
}

}  // namespace fxdyn
