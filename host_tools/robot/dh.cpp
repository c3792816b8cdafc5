#include <cmath>

#include "host_tools/robot/robot.hpp"
#include "model/effects/payload.hpp"

namespace fxdyn {
namespace {

using Eigen::Isometry3d;
using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double parallel = 1e-7;     ///< sine of the angle below which two axes count as parallel
constexpr double touching = 1e-10;    ///< distance below which two axes count as intersecting [m]
constexpr double negligible = 1e-12;  ///< cosines, sines and lengths below this are rounding errors

/// A joint axis at q = 0 in the base frame.
struct Axis {
  Vector3d point, direction;
};

Vector3d unit_across(const Vector3d& vector, const Vector3d& direction) {
  return (vector - direction * direction.dot(vector)).normalized();
}

/// Any unit vector across `direction`, the frame's own x axis where possible.
Vector3d any_across(const Matrix3d& frame, const Vector3d& direction) {
  const Vector3d x = frame.col(0), y = frame.col(1);
  return unit_across(std::abs(x.dot(direction)) < 0.9 ? x : y, direction);
}

/// Common normal of two axes: unit vector from one to the other and its feet.
struct Normal {
  Vector3d x, foot, next_foot;
};

/// `origin` is where the normal of parallel axes starts, `x` its direction where they coincide.
Normal common_normal(const Axis& axis, const Axis& next, const Vector3d& origin, const Vector3d& x) {
  const Vector3d across = axis.direction.cross(next.direction);
  const double sine = across.norm();
  const Vector3d between = next.point - axis.point;
  if (sine > parallel) {
    const Vector3d unit = across / sine;
    const double s = between.cross(next.direction).dot(across) / (sine * sine);
    const double t = between.cross(axis.direction).dot(across) / (sine * sine);
    const double distance = between.dot(unit);
    return {distance < -touching ? Vector3d(-unit) : unit, axis.point + s * axis.direction,
            next.point + t * next.direction};
  }
  const Vector3d next_foot = next.point + next.direction * next.direction.dot(origin - next.point);
  const Vector3d normal = next_foot - origin;
  return {normal.norm() > touching ? unit_across(normal, axis.direction) : x, origin, next_foot};
}

Isometry3d make_frame(const Vector3d& x, const Vector3d& z, const Vector3d& origin) {
  Isometry3d frame = Isometry3d::Identity();
  frame.linear().col(0) = x;
  frame.linear().col(1) = z.cross(x);
  frame.linear().col(2) = z;
  frame.translation() = origin;
  return frame;
}

double snap_length(double x) { return std::abs(x) < negligible ? 0.0 : x; }

/// Cosine and sine as a point on the circle, exactly on an axis where it is meant to be.
void snap_angle(double& cosine, double& sine) {
  const double length = std::hypot(cosine, sine);
  cosine /= length;
  sine /= length;
  if (std::abs(cosine) < negligible) {
    cosine = 0;
    sine = std::copysign(1.0, sine);
  } else if (std::abs(sine) < negligible) {
    sine = 0;
    cosine = std::copysign(1.0, cosine);
  }
}

/// Parameters of the transform between two frames that follow the convention.
LinkGeometry<Real> geometry(JointType type, const Isometry3d& previous, const Isometry3d& frame) {
  const Vector3d x0 = previous.linear().col(0), z0 = previous.linear().col(2);
  const Vector3d x1 = frame.linear().col(0), z1 = frame.linear().col(2);
  LinkGeometry<Real> link;
  link.type = type;
  link.cos_alpha = z0.dot(z1);
  link.sin_alpha = z0.cross(z1).dot(x0);
  if (std::abs(link.sin_alpha) < parallel) link.sin_alpha = 0;
  double cos_theta = x0.dot(x1), sin_theta = x0.cross(x1).dot(z1);
  snap_angle(link.cos_alpha, link.sin_alpha);
  snap_angle(cos_theta, sin_theta);
  link.theta = std::atan2(sin_theta, cos_theta);
  const Vector3d between = frame.translation() - previous.translation();
  const double a = snap_length(between.dot(x0)), d = snap_length(between.dot(z1));
  link.p = {a, -d * link.sin_alpha, d * link.cos_alpha};
  return link;
}

}  // namespace

DhChain to_dh(const Robot& robot) {
  const std::size_t n = robot.size();
  DhChain chain;
  std::vector<Isometry3d> urdf(n);  // URDF frames at q = 0 in the base frame
  std::vector<Axis> axes(n);
  Isometry3d pose = Isometry3d::Identity();
  for (std::size_t i = 0; i < n; ++i) {
    pose = pose * robot.joints[i].origin;
    urdf[i] = pose;
    axes[i] = {pose.translation(), pose.linear() * robot.joints[i].axis};
  }

  Vector3d origin, x;  // of the frame before, carried over to this axis: d = 0 and theta = 0 where they are free
  Isometry3d previous = Isometry3d::Identity();
  for (std::size_t i = 0; i < n; ++i) {
    const Vector3d z = axes[i].direction;
    if (i == 0) {
      origin = axes[0].point;
      x = any_across(urdf[0].linear(), z);
    }
    Isometry3d frame = make_frame(x, z, origin);
    if (i + 1 < n) {
      const Normal normal = common_normal(axes[i], axes[i + 1], origin, x);
      frame = make_frame(normal.x, z, normal.foot);
      origin = normal.next_foot;
      x = unit_across(normal.x, axes[i + 1].direction);
    }
    if (i == 0) {
      previous = frame;
      chain.up = -(frame.linear().transpose() * robot.gravity);
    }
    chain.links.push_back(geometry(robot.joints[i].type, previous, frame));
    chain.urdf_in_dh.push_back(frame.inverse() * urdf[i]);
    previous = frame;
  }
  for (int k = 0; k < 3; ++k) chain.up[k] = snap_length(chain.up[k]);
  return chain;
}

Eigen::Matrix3Xd link_origins(const Robot& robot, const Eigen::VectorXd& q) {
  Eigen::Index points = 0;
  for (const Joint& joint : robot.joints) points += 1 + static_cast<Eigen::Index>(joint.fixed_frames.size());
  Eigen::Matrix3Xd origins(3, points);
  Isometry3d pose = Isometry3d::Identity();
  Eigen::Index next = 0;
  for (std::size_t i = 0; i < robot.size(); ++i) {
    const Joint& joint = robot.joints[i];
    const double position = q[static_cast<Eigen::Index>(i)];
    pose = pose * joint.origin;
    if (joint.type == JointType::revolute) {
      pose.rotate(Eigen::AngleAxisd(position, joint.axis));
    } else {
      pose.translate(position * joint.axis);
    }
    origins.col(next++) = pose.translation();
    for (const Vector3d& frame : joint.fixed_frames) origins.col(next++) = pose * frame;
  }
  return origins;
}

LinkInertia<Real> to_link_inertia(const Inertial& inertial, const Isometry3d& pose) {
  const Vector3d centre = pose * inertial.centre;
  const Matrix3d second = 0.5 * inertial.tensor.trace() * Matrix3d::Identity() - inertial.tensor;
  const Matrix3d j = pose.linear() * second * pose.linear().transpose() + inertial.mass * centre * centre.transpose();
  LinkInertia<Real> link;
  link.m = inertial.mass;
  link.h = {inertial.mass * centre.x(), inertial.mass * centre.y(), inertial.mass * centre.z()};
  link.xx = j(0, 0);
  link.yy = j(1, 1);
  link.zz = j(2, 2);
  link.xy = j(0, 1);
  link.xz = j(0, 2);
  link.yz = j(1, 2);
  return link;
}

Inertial to_inertial(const LinkInertia<Real>& link, const Isometry3d& pose) {
  Inertial inertial;
  inertial.mass = link.m;
  const Vector3d centre = Vector3d(link.h.x, link.h.y, link.h.z) / link.m;
  inertial.centre = pose.inverse() * centre;
  Matrix3d j;
  j << link.xx, link.xy, link.xz, link.xy, link.yy, link.yz, link.xz, link.yz, link.zz;
  const Matrix3d second = pose.linear().transpose() * (j - link.m * centre * centre.transpose()) * pose.linear();
  inertial.tensor = second.trace() * Matrix3d::Identity() - second;
  inertial.tensor = ((inertial.tensor + inertial.tensor.transpose()) / 2).eval();
  return inertial;
}

LinkInertia<Real> with_load(const LinkInertia<Real>& last, double mass, const Vector3d& com, const DhChain& chain) {
  const Vector3d r = chain.urdf_in_dh.back() * com;
  return Payload::add_to(last, mass, {r.x(), r.y(), r.z()});
}

}  // namespace fxdyn
