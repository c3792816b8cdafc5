#pragma once

#include <Eigen/Dense>
#include <filesystem>
#include <random>

#include "host_tools/robot/robot.hpp"

namespace fxdyn::test {

inline const std::filesystem::path puma560 = std::filesystem::path(FXDYN_SOURCE_DIR) / "host_tools/demo/puma560.urdf";

/// Random serial chains: half of the rotations by right angles, half of the offsets along one axis or zero, so that
/// parallel, coincident and intersecting axes are all common.
class Chains {
 public:
  explicit Chains(unsigned seed) : generator_(seed) {}

  double uniform(double low, double high) { return std::uniform_real_distribution<double>(low, high)(generator_); }
  bool coin() { return uniform(0, 1) < 0.5; }
  Eigen::Vector3d vector(double size) { return {uniform(-size, size), uniform(-size, size), uniform(-size, size)}; }
  Eigen::VectorXd joints(std::size_t n, double size) {
    Eigen::VectorXd values(static_cast<Eigen::Index>(n));
    for (double& value : values) value = uniform(-size, size);
    return values;
  }

  Robot robot(std::size_t n, bool with_prismatic = true) {
    Robot robot;
    robot.gravity = vector(9.81);
    for (std::size_t i = 0; i < n; ++i) {
      Joint joint;
      joint.name = "joint_" + std::to_string(i + 1);
      joint.type = with_prismatic && uniform(0, 1) < 0.3 ? JointType::prismatic : JointType::revolute;
      joint.origin.linear() = rotation();
      joint.origin.translation() = offset();
      joint.axis = coin() ? direction() : vector(1).normalized();
      joint.inertial = inertial();
      robot.joints.push_back(joint);
    }
    return robot;
  }

  Inertial inertial() {
    Inertial body;
    body.mass = uniform(0.1, 20);
    body.centre = vector(0.3);
    Eigen::Matrix3d second = Eigen::Matrix3d::Zero();  // of a cloud of points, so it is a possible body
    for (int k = 0; k < 6; ++k) {
      const Eigen::Vector3d r = vector(0.2);
      second += body.mass / 6 * r * r.transpose();
    }
    body.tensor = second.trace() * Eigen::Matrix3d::Identity() - second;
    return body;
  }

 private:
  Eigen::Vector3d direction() {
    Eigen::Vector3d axis = Eigen::Vector3d::Zero();
    axis[static_cast<int>(uniform(0, 3))] = coin() ? 1 : -1;
    return axis;
  }
  Eigen::Matrix3d rotation() {
    if (coin()) return Eigen::AngleAxisd(uniform(-3, 3), vector(1).normalized()).toRotationMatrix();
    const Eigen::Vector3d x = direction();
    Eigen::Vector3d y = direction();
    while (std::abs(x.dot(y)) > 0.5) y = direction();
    Eigen::Matrix3d matrix;
    matrix << x, y, x.cross(y);
    return matrix;
  }
  Eigen::Vector3d offset() {
    if (coin()) return vector(0.5);
    return coin() ? Eigen::Vector3d(direction() * uniform(0.1, 0.6)) : Eigen::Vector3d(Eigen::Vector3d::Zero());
  }

  std::mt19937 generator_;
};

/// Poses of all links' URDF frames in the base, straight from the definition of a joint.
inline std::vector<Eigen::Isometry3d> poses(const Robot& robot, const Eigen::VectorXd& q) {
  std::vector<Eigen::Isometry3d> result;
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  for (std::size_t i = 0; i < robot.size(); ++i) {
    const Joint& joint = robot.joints[i];
    const double position = q[static_cast<Eigen::Index>(i)];
    pose = pose * joint.origin;
    if (joint.type == JointType::revolute) {
      pose = pose * Eigen::AngleAxisd(position, joint.axis);
    } else {
      pose = pose * Eigen::Translation3d(position * joint.axis);
    }
    result.push_back(pose);
  }
  return result;
}

/// Inverse dynamics through the frames and parameters of the model.
inline Eigen::VectorXd torques(const Robot& robot, const Eigen::VectorXd& q, const Eigen::VectorXd& dq,
                               const Eigen::VectorXd& ddq) {
  const std::size_t n = robot.size();
  const DhChain chain = to_dh(robot);
  std::vector<LinkInertia<Real>> inertia;
  std::vector<JointState<Real>> joints;
  for (std::size_t i = 0; i < n; ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    inertia.push_back(to_link_inertia(robot.joints[i].inertial.value_or(Inertial{}), chain.urdf_in_dh[i]));
    joints.push_back({q[k], dq[k], ddq[k]});
  }
  std::vector<LinkMotion<Real>> motions(n);
  std::vector<Wrench<Real>> wrenches(n);
  std::vector<double> tau(n);
  rnea<Real, std::dynamic_extent>(chain.links, inertia, {chain.up.x(), chain.up.y(), chain.up.z()}, joints, motions,
                                  wrenches, tau);
  return Eigen::Map<const Eigen::VectorXd>(tau.data(), static_cast<Eigen::Index>(n));
}

}  // namespace fxdyn::test
