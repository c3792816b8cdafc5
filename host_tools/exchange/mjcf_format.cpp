#include <fmt/format.h>
#include <mujoco/mujoco.h>

#include <array>
#include <cmath>
#include <memory>

#include "host_tools/effects/model_parts.hpp"
#include "host_tools/exchange/formats.hpp"
#include "host_tools/exchange/xml_text.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/files.hpp"

namespace fxdyn {
namespace {

/// MuJoCo's dry friction is a soft constraint that follows the velocity with this time constant. The shortest that
/// MuJoCo lets pass is twice the time step, whose default is 0.002 s (its documentation, "Solver parameters") [s].
constexpr double friction_time_s = 0.004;

std::string body_start(const Joint& joint) {
  const Eigen::Quaterniond turn(joint.origin.linear());
  const Inertial& body = *joint.inertial;
  const Eigen::Matrix3d& t = body.tensor;
  return fmt::format(
      "<body name={} pos=\"{}\" quat=\"{:.17g} {:.17g} {:.17g} {:.17g}\">\n<inertial pos=\"{}\" mass=\"{:.17g}\" "
      "fullinertia=\"{:.17g} {:.17g} {:.17g} {:.17g} {:.17g} {:.17g}\"/>\n",
      quoted(joint.link), numbers(joint.origin.translation()), turn.w(), turn.x(), turn.y(), turn.z(),
      numbers(body.centre), body.mass, t(0, 0), t(1, 1), t(2, 2), t(0, 1), t(0, 2), t(1, 2));
}

std::string joint_tag(const Joint& joint, const SimpleJoint& said) {
  std::string out = fmt::format("<joint name={} type=\"{}\" axis=\"{}\" damping=\"{:.17g}\" armature=\"{:.17g}\"",
                                quoted(joint.name), joint.type == JointType::revolute ? "hinge" : "slide",
                                numbers(joint.axis), said.damping, said.armature);
  if (said.friction > 0)
    out += fmt::format(" frictionloss=\"{:.17g}\" solreffriction=\"{:g} 1\"", said.friction, friction_time_s);
  if (joint.limits && !joint.continuous && joint.limits->lower < joint.limits->upper)
    out += fmt::format(" limited=\"true\" range=\"{:.17g} {:.17g}\"", joint.limits->lower, joint.limits->upper);
  return out + "/>\n";
}

std::string motor_tag(const Joint& joint, const SimpleJoint& said) {
  std::string out = fmt::format("<motor name={0} joint={0}", quoted(joint.name));
  if (said.effort > 0)
    out += fmt::format(" ctrllimited=\"true\" ctrlrange=\"{:.17g} {:.17g}\"", -said.effort, said.effort);
  return out + "/>\n";
}

using ModelPointer = std::unique_ptr<mjModel, void (*)(mjModel*)>;
using DataPointer = std::unique_ptr<mjData, void (*)(mjData*)>;

ModelPointer load(const std::filesystem::path& file) {
  mju_user_warning = [](const char*) {};  // would write a file where the program runs
  std::array<char, 500> error{};
  ModelPointer model(mj_loadXML(file.c_str(), nullptr, error.data(), static_cast<int>(error.size())), mj_deleteModel);
  if (!model) {
    std::string line = error.data();
    for (char& c : line) c = c == '\n' ? ' ' : c;
    throw DataError(fmt::format("{}: MuJoCo does not take this robot: {}", file.string(), line));
  }
  return model;
}

/// MuJoCo's index of each joint's velocity.
std::vector<int> dofs_of(const mjModel& model, const Robot& robot, const std::filesystem::path& file) {
  std::vector<int> out;
  for (const Joint& joint : robot.joints) {
    const int id = mj_name2id(&model, mjOBJ_JOINT, joint.name.c_str());
    if (id < 0 || model.nv != static_cast<int>(robot.size()))
      throw DataError(fmt::format("{}: joint '{}' is not in it, or others are", file.string(), joint.name));
    out.push_back(model.jnt_dofadr[id]);
  }
  return out;
}

/// 1: dry friction is at its limit and against the motion; it is 0 where it sticks.
void mark_sliding(const mjModel& model, const mjData& data, Eigen::VectorXd& sliding) {
  for (int row = 0; row < data.nefc; ++row) {
    if (data.efc_type[row] != mjCNSTR_FRICTION_DOF) continue;
    const int dof = data.efc_id[row];
    const bool at_limit =
        data.efc_state[row] == mjCNSTRSTATE_LINEARNEG || data.efc_state[row] == mjCNSTRSTATE_LINEARPOS;
    const bool against = data.efc_force[row] * data.qvel[dof] < 0;
    sliding[dof] = at_limit && against && model.dof_frictionloss[dof] > 0 ? 1 : 0;
  }
}

}  // namespace

void write_mjcf(const SimpleRobot& robot, const std::filesystem::path& file) {
  const Robot& chain = robot.robot;
  std::string text = fmt::format(
      "<mujoco model={}>\n<!-- Written by fxdyn. Joints: damping [N m s/rad], frictionloss [N m], armature [kg m^2], "
      "at "
      "the output of the gear. -->\n<compiler angle=\"radian\"/>\n<option gravity=\"{}\"/>\n<worldbody>\n",
      quoted(chain.name), numbers(chain.gravity));
  for (std::size_t j = 0; j < chain.size(); ++j)
    text += body_start(chain.joints[j]) + joint_tag(chain.joints[j], robot.joints[j]);
  for (std::size_t j = 0; j < chain.size(); ++j) text += "</body>\n";
  text += "</worldbody>\n<actuator>\n";
  for (std::size_t j = 0; j < chain.size(); ++j) text += motor_tag(chain.joints[j], robot.joints[j]);
  write_file(file, text + "</actuator>\n</mujoco>\n");
}

ReplayedTorque replay_mjcf(const std::filesystem::path& file, const IdentifiedModel& expected, const MotionRows& motion,
                           double /*step_s*/) {
  const ModelPointer model = load(file);
  const std::vector<int> dofs = dofs_of(*model, robot_of(expected), file);
  model->opt.disableflags |= mjDSBL_LIMIT;  // a log that touches a stop says nothing of friction
  const DataPointer data(mj_makeData(model.get()), mj_deleteData);
  const Eigen::Index n = motion.q.cols();
  ReplayedTorque out{Eigen::MatrixXd(motion.q.rows(), n), Eigen::MatrixXd(motion.q.rows(), n)};
  for (Eigen::Index k = 0; k < motion.q.rows(); ++k) {
    for (Eigen::Index j = 0; j < n; ++j) {
      const int dof = dofs[static_cast<std::size_t>(j)];  // hinges and slides: positions are numbered alike
      data->qpos[dof] = motion.q(k, j);
      data->qvel[dof] = motion.dq(k, j);
      data->qacc[dof] = motion.ddq(k, j);
    }
    mj_inverse(model.get(), data.get());
    Eigen::VectorXd sliding = Eigen::VectorXd::Ones(n);
    mark_sliding(*model, *data, sliding);
    for (Eigen::Index j = 0; j < n; ++j) {
      const int dof = dofs[static_cast<std::size_t>(j)];
      out.tau(k, j) = data->qfrc_inverse[dof];
      out.sliding(k, j) = sliding[dof];
    }
  }
  return out;
}

}  // namespace fxdyn
