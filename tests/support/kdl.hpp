#pragma once

#include <kdl/chain.hpp>

#include "host_tools/robot/robot.hpp"

namespace fxdyn::test {

inline KDL::Vector to_kdl(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

inline KDL::Chain to_kdl(const Robot& robot) {
  KDL::Chain chain;
  for (const Joint& joint : robot.joints) {
    const Eigen::Matrix3d r = joint.origin.linear();
    const Inertial body = joint.inertial.value_or(Inertial{});
    const auto& i = body.tensor;
    const auto type = joint.type == JointType::revolute ? KDL::Joint::RotAxis : KDL::Joint::TransAxis;
    chain.addSegment(KDL::Segment(
        joint.name,
        KDL::Joint(joint.name, to_kdl(joint.origin.translation()), to_kdl(Eigen::Vector3d(r * joint.axis)), type),
        KDL::Frame(KDL::Rotation(r(0, 0), r(0, 1), r(0, 2), r(1, 0), r(1, 1), r(1, 2), r(2, 0), r(2, 1), r(2, 2)),
                   to_kdl(joint.origin.translation())),
        KDL::RigidBodyInertia(body.mass, to_kdl(body.centre),
                              KDL::RotationalInertia(i(0, 0), i(1, 1), i(2, 2), i(0, 1), i(0, 2), i(1, 2)))));
  }
  return chain;
}

}  // namespace fxdyn::test
