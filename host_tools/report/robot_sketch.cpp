#include "host_tools/report/robot_sketch.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "host_tools/page/page.hpp"

namespace fxdyn {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double width = 380, height = 400, margin = 34;  ///< of the picture [px]

/// The chain in one pose, base frame [m].
struct Chain {
  std::vector<Vector3d> joints, axes;  ///< a joint's origin and the direction of its axis
  Vector3d tip = Vector3d::Zero();  ///< the farthest frame fixed to the last link; the last joint where there is none
};

Chain chain_at(const Robot& robot, const Eigen::VectorXd& q) {
  Chain out;
  Isometry3d pose = Isometry3d::Identity();
  for (std::size_t j = 0; j < robot.size(); ++j) {
    const Joint& joint = robot.joints[j];
    pose = pose * joint.origin;
    out.joints.push_back(pose.translation());
    out.axes.push_back(pose.linear() * joint.axis);
    const double angle = q[static_cast<Eigen::Index>(j)];
    if (joint.type == JointType::revolute)
      pose.rotate(Eigen::AngleAxisd(angle, joint.axis));
    else
      pose.translate(angle * joint.axis);
  }
  out.tip = pose.translation();
  if (!robot.joints.empty()) {
    for (const Vector3d& frame : robot.joints.back().fixed_frames) {
      if (frame.norm() > (out.tip - pose.translation()).norm()) out.tip = pose * frame;
    }
  }
  return out;
}

/// Seen from the front right, a little from above; y grows downwards.
Vector2d seen(const Vector3d& point) {
  constexpr double around = 0.6, above = 0.35;  // [rad]
  const double right = std::cos(around) * point.x() + std::sin(around) * point.y();
  const double away = -std::sin(around) * point.x() + std::cos(around) * point.y();
  return {right, -(std::cos(above) * point.z() + std::sin(above) * away)};
}

/// All joints bent by `bend` [rad], every second one the other way; prismatic ones half out; within the limits.
Eigen::VectorXd bent(const Robot& robot, double bend) {
  Eigen::VectorXd q(static_cast<Eigen::Index>(robot.size()));
  for (std::size_t j = 0; j < robot.size(); ++j) {
    const Joint& joint = robot.joints[j];
    const bool limited = joint.limits && joint.limits->upper > joint.limits->lower && !joint.continuous;
    double& at = q[static_cast<Eigen::Index>(j)];
    at = j % 2 == 0 ? bend : -bend;
    if (joint.type == JointType::prismatic) at = limited ? (joint.limits->lower + joint.limits->upper) / 2 : 0;
    if (limited) at = std::clamp(at, joint.limits->lower, joint.limits->upper);
  }
  return q;
}

/// The smallest distance between joints that are not at one place, as seen, beside the size of the picture.
double spread(const Chain& chain) {
  double nearest = std::numeric_limits<double>::infinity(), size = 0;
  for (std::size_t i = 0; i < chain.joints.size(); ++i) {
    for (std::size_t k = 0; k < i; ++k) {
      const double apart = (seen(chain.joints[i]) - seen(chain.joints[k])).norm();
      size = std::max(size, apart);
      if ((chain.joints[i] - chain.joints[k]).norm() > 1e-6) nearest = std::min(nearest, apart);
    }
  }
  return size > 0 && std::isfinite(nearest) ? nearest / size : 0;
}

Chain clearest(const Robot& robot) {
  Chain best = chain_at(robot, bent(robot, 0));
  for (const double bend : {0.4, -0.4, 0.8, -0.8, 1.2, -1.2}) {
    Chain other = chain_at(robot, bent(robot, bend));
    if (spread(other) > 1.1 * spread(best)) best = std::move(other);  // only where it is clearly better
  }
  return best;
}

/// From metres to the picture's pixels.
struct Frame {
  double scale = 1;
  Vector2d shift = Vector2d::Zero();
  Vector2d operator()(const Vector3d& point) const { return scale * seen(point) + shift; }
};

Frame frame_of(const Chain& chain) {
  Vector2d low = seen(Vector3d::Zero()), high = low;
  const auto take = [&](const Vector3d& point) {
    low = low.cwiseMin(seen(point));
    high = high.cwiseMax(seen(point));
  };
  for (const Vector3d& joint : chain.joints) take(joint);
  take(chain.tip);
  const Vector2d size = (high - low).cwiseMax(1e-9);
  Frame out;
  out.scale = std::min((width - 2 * margin) / size.x(), (height - 2 * margin) / size.y());
  out.shift = Vector2d(width, height) / 2 - out.scale * (low + high) / 2;
  return out;
}

/// Where the discs stand: at their joints, or beside where another one is in the way.
std::vector<Vector2d> places_of(const std::vector<Vector2d>& joints, double radius) {
  std::vector<Vector2d> out;
  const auto is_free = [&](const Vector2d& place) {
    if (place.x() < radius || place.x() > width - radius || place.y() < radius || place.y() > height - radius)
      return false;
    return std::none_of(out.begin(), out.end(),
                        [&](const Vector2d& other) { return (other - place).norm() < 2.2 * radius; });
  };
  for (const Vector2d& joint : joints) {
    Vector2d place = joint;
    constexpr int directions = 12, rings = 12;
    for (int k = 0; !is_free(place) && k < directions * rings; ++k) {
      const double angle = 2 * std::numbers::pi * (k % directions) / directions;
      const double distance = radius * (2.3 + k / directions);
      place = joint + distance * Vector2d(std::cos(angle), std::sin(angle));
    }
    out.push_back(place);
  }
  return out;
}

std::string line(const Vector2d& from, const Vector2d& to, const char* kind) {
  return fmt::format("<line class=\"{}\" x1=\"{:.1f}\" y1=\"{:.1f}\" x2=\"{:.1f}\" y2=\"{:.1f}\"/>\n", kind, from.x(),
                     from.y(), to.x(), to.y());
}

std::string disc(const Joint& joint, const JointAnswer& answer, std::size_t number, const Vector2d& at, double radius) {
  const char* kind = answer.mood == Mood::unknown ? "unknown" : css_class(answer.mood);
  const std::string shape =
      joint.type == JointType::revolute
          ? fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"{:.1f}\"/>", at.x(), at.y(), radius)
          : fmt::format("<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\"/>", at.x() - radius,
                        at.y() - radius, 2 * radius, 2 * radius);
  return fmt::format(
      "<g class=\"disc {}\"><title>{}: {}</title>{}<text x=\"{:.1f}\" y=\"{:.1f}\" "
      "font-size=\"{:.1f}\">{}</text></g>\n",
      kind, page::escape(answer.name), in_words(answer.mood), shape, at.x(), at.y() + 0.36 * radius, 1.1 * radius,
      number);
}

}  // namespace

std::string robot_sketch(const Robot& robot, const std::vector<JointAnswer>& answers) {
  if (robot.joints.empty()) return "";
  const Chain chain = clearest(robot);
  const Frame frame = frame_of(chain);
  const double radius = robot.size() <= 8 ? 13 : std::max(6.0, 13 * std::sqrt(8.0 / static_cast<double>(robot.size())));
  std::vector<Vector2d> joints;
  for (const Vector3d& joint : chain.joints) joints.push_back(frame(joint));
  const std::vector<Vector2d> places = places_of(joints, radius);

  const Vector2d base = frame(Vector3d::Zero());
  std::string out = fmt::format(
      "<svg class=\"sketch\" role=\"img\" viewBox=\"0 0 {:.0f} {:.0f}\"><title>Sketch of {}: its {} joints, coloured "
      "by what is left of their error</title>\n",
      width, height, page::escape(robot.name), robot.size());
  out += line(base - Vector2d(28, 0), base + Vector2d(28, 0), "ground");
  Vector2d last = base;
  for (const Vector2d& joint : joints) {
    out += line(last, joint, "link");
    last = joint;
  }
  out += line(last, frame(chain.tip), "link");
  for (std::size_t j = 0; j < joints.size(); ++j) {
    const Vector2d along = seen(chain.axes[j]) * 2 * radius;
    out += line(joints[j] - along, joints[j] + along, "axis");
    if (places[j] != joints[j]) out += line(joints[j], places[j], "leader");
  }
  for (std::size_t j = 0; j < joints.size(); ++j) out += disc(robot.joints[j], answers[j], j + 1, places[j], radius);
  return out + "</svg>\n";
}

}  // namespace fxdyn
