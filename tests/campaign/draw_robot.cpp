#include <fmt/format.h>
#include <fmt/ranges.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <string_view>

#include "host_tools/support/random.hpp"
#include "tests/campaign/case.hpp"

namespace fxdyn::campaign {
namespace {

using Eigen::Vector3d;

/// Axes of the joints with the arm stretched out along its links: x, y, z turn, X, Y, Z slide. All joints' frames are
/// parallel in that pose.
struct Kind {
  std::string_view name, axes;
};
constexpr Kind kinds[] = {
    {"pendulum", "yy"},  {"table", "zz"},    {"pan_tilt", "zy"},     {"planar", "yyy"},        {"arm", "zyy"},
    {"gantry", "XYZ"},   {"scara", "zzZz"},  {"palletizer", "zyyy"}, {"gantry_wrist", "XYZz"}, {"planar_four", "zzzz"},
    {"welder", "zyyxy"}, {"puma", "zyyxyx"}, {"cobot", "zyyyzy"},    {"rail", "Yzyyxyx"},      {"seven", "zyzyzyz"}};

struct Link {
  Vector3d step, com;  ///< to the next joint, to the centre of mass, in the joint's frame [m]
  double mass = 0;     ///< [kg]
  Vector3d inertia;    ///< about the centre of mass [kg m^2]
};

bool slides(char axis) { return axis < 'a'; }
Vector3d direction(char axis) {
  const char lower = static_cast<char>(axis | 0x20);
  return Vector3d::Unit(lower - 'x');
}

Link draw_link(double length, double mass, Random& random) {
  Link link;
  // Out or up, a little to the side.
  const bool up = random.uniform() < 0.4;
  link.step = Vector3d(up ? 0.0 : length, random.uniform(-0.1, 0.1) * length, up ? length : 0.2 * length);
  link.com = random.uniform(0.3, 0.6) * link.step;
  for (double& x : link.com) x += random.uniform(-0.06, 0.06) * length;
  link.mass = mass;
  const double thick = random.uniform(0.15, 0.3) * length;
  const Vector3d size = link.step.cwiseAbs().cwiseMax(thick);
  link.inertia = mass / 12 *
                 Vector3d(size.y() * size.y() + size.z() * size.z(), size.x() * size.x() + size.z() * size.z(),
                          size.x() * size.x() + size.y() * size.y());
  return link;
}

std::string vector_text(const Vector3d& v) { return fmt::format("{:.5f} {:.5f} {:.5f}", v.x(), v.y(), v.z()); }

std::string urdf_of(const Kind& kind, const std::vector<Link>& links, const TestRobot& robot, Random& random) {
  std::string text = fmt::format("<?xml version=\"1.0\"?>\n<robot name=\"{}\">\n  <link name=\"base\"/>\n", kind.name);
  for (std::size_t j = 0; j < links.size(); ++j) {
    const Link& l = links[j];
    text += fmt::format(
        "  <link name=\"link_{}\"><inertial><origin xyz=\"{}\"/><mass value=\"{:.5f}\"/>"
        "<inertia ixx=\"{:.6g}\" iyy=\"{:.6g}\" izz=\"{:.6g}\" ixy=\"0\" ixz=\"0\" iyz=\"0\"/></inertial></link>\n",
        j + 1, vector_text(l.com), l.mass, l.inertia.x(), l.inertia.y(), l.inertia.z());
  }
  for (std::size_t j = 0; j < links.size(); ++j) {
    const char axis = kind.axes[j];
    const double half = slides(axis) ? random.uniform(0.15, 0.6) : random.uniform(1.2, 2.9);
    const double speed = slides(axis) ? random.uniform(0.5, 1.5) : random.uniform(1.5, 5);
    text += fmt::format(
        "  <joint name=\"axis_{0}\" type=\"{1}\"><parent link=\"{2}\"/><child link=\"link_{0}\"/><origin xyz=\"{3}\"/>"
        "<axis xyz=\"{4}\"/><limit lower=\"{5:.3f}\" upper=\"{6:.3f}\" velocity=\"{7:.3f}\" "
        "effort=\"{8:.3f}\"/></joint>\n",
        j + 1, slides(axis) ? "prismatic" : "revolute", j == 0 ? "base" : fmt::format("link_{}", j),
        vector_text(j == 0 ? Vector3d(0, 0, 0.2) : links[j - 1].step), vector_text(direction(axis)), -half, half, speed,
        robot.rated_torque[j]);
  }
  return text + "</robot>\n";
}

}  // namespace

TestRobot draw_robot(std::uint64_t seed) {
  Random random(seed * 104729 + 17);
  const Kind& kind = kinds[random.next() % std::size(kinds)];
  const std::size_t n = kind.axes.size();
  TestRobot robot;
  robot.name = fmt::format("{}_{}", kind.name, seed);
  const double whole = std::pow(10.0, random.uniform(0.6, 2)), reach = 0.35 * std::cbrt(whole);  // kg, m
  std::vector<Link> links;
  for (std::size_t j = 0; j < n; ++j) {
    const double share = std::pow(0.55, static_cast<double>(j)) * random.uniform(0.7, 1.4);
    links.push_back(draw_link(reach / static_cast<double>(std::min<std::size_t>(n, 4)) * (j < 4 ? 1.0 : 0.4),
                              std::max(0.45 * whole * share, 0.02 * whole), random));
  }
  std::vector<Vector3d> place(n, Vector3d::Zero());
  for (std::size_t j = 1; j < n; ++j) place[j] = place[j - 1] + links[j - 1].step;
  // A drive is chosen by what it has to hold and to accelerate.
  double whole_torque = 0;  // N*m
  for (std::size_t j = 0; j < n; ++j) {
    const Vector3d axis = direction(kind.axes[j]);
    double weight = 0, moment = 0, inertia = 0;
    for (std::size_t k = j; k < n; ++k) {
      const Vector3d arm = place[k] + links[k].com - place[j];
      weight += links[k].mass;
      moment += links[k].mass * 9.81 * arm.norm();
      inertia += links[k].mass * axis.cross(arm).squaredNorm() + links[k].inertia.dot(axis.cwiseAbs2());
    }
    const bool linear = slides(kind.axes[j]);
    const double moved = linear ? weight : inertia, rotor = moved * random.uniform(0.15, 0.7);
    double rated = linear ? 1.5 * 9.81 * weight : std::max(0.5 * moment, 8 * (inertia + rotor));
    // The smallest drive of a series is not a thousand times smaller than its largest.
    if (!linear && whole_torque > 0) rated = std::max(rated, 0.03 * whole_torque);
    if (!linear) whole_torque = std::max(whole_torque, rated);
    robot.rated_torque.push_back(rated);
    robot.acceleration.push_back(std::clamp(0.35 * rated / (moved + rotor), linear ? 2.0 : 4.0, linear ? 8.0 : 30.0));
    const double speed = linear ? 0.8 : 2.5;
    robot.coulomb.push_back(rated * random.uniform(0.02, 0.08));
    robot.viscous.push_back(rated / speed * random.uniform(0.02, 0.08));
    robot.width.push_back(speed * std::pow(10.0, random.uniform(-3.2, -1.8)));
    robot.offset.push_back(rated * random.uniform(-0.01, 0.01));
    robot.rotor_inertia.push_back(rotor);
  }
  const double mounted = random.uniform();  // floor, wall, ceiling, some slope
  if (mounted > 0.9) {
    robot.gravity = {0, -9.81 * std::sin(0.6), -9.81 * std::cos(0.6)};
  } else if (mounted > 0.8) {
    robot.gravity = {0, 0, 9.81};
  } else if (mounted > 0.7) {
    robot.gravity = {-9.81, 0, 0};
  }
  robot.urdf_text = urdf_of(kind, links, robot, random);
  return robot;
}

}  // namespace fxdyn::campaign
