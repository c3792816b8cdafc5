#include <dlfcn.h>
#include <fmt/format.h>

#include <cmath>
#include <set>

#include "host_tools/effects/evaluator.hpp"
#include "host_tools/effects/model_parts.hpp"
#include "host_tools/exchange/formats.hpp"
#include "host_tools/exchange/sdf_reader.hpp"
#include "host_tools/exchange/xml_text.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/files.hpp"

namespace fxdyn {
namespace {

constexpr const char* world = "world";

/// R = Rz(yaw) Ry(pitch) Rx(roll), SDF's and URDF's order [rad]. Exact at a pitch of 90 degrees too: there any yaw will
/// do, and the roll is taken for the yaw that was.
Eigen::Vector3d roll_pitch_yaw(const Eigen::Matrix3d& r) {
  const double yaw = std::atan2(r(1, 0), r(0, 0)), s = std::sin(yaw), c = std::cos(yaw);
  return {std::atan2(s * r(0, 2) - c * r(1, 2), c * r(1, 1) - s * r(0, 1)),
          std::atan2(-r(2, 0), std::hypot(r(0, 0), r(1, 0))), yaw};
}

std::string link_element(const Joint& joint, const std::string& parent) {
  const Inertial& body = *joint.inertial;
  const Eigen::Matrix3d& t = body.tensor;
  const std::string frame = parent == world ? "" : fmt::format(" relative_to={}", quoted(parent));
  return fmt::format(
      "<link name={}>\n<pose{}>{} {}</pose>\n<inertial>\n<pose>{} 0 0 0</pose>\n<mass>{:.17g}</mass>\n<inertia>"
      "<ixx>{:.17g}</ixx><iyy>{:.17g}</iyy><izz>{:.17g}</izz><ixy>{:.17g}</ixy><ixz>{:.17g}</ixz><iyz>{:.17g}</iyz>"
      "</inertia>\n</inertial>\n</link>\n",
      quoted(joint.link), frame, numbers(joint.origin.translation()), numbers(roll_pitch_yaw(joint.origin.linear())),
      numbers(body.centre), body.mass, t(0, 0), t(1, 1), t(2, 2), t(0, 1), t(0, 2), t(1, 2));
}

/// -1 is SDF's word for no limit of effort and velocity.
std::string limit_element(const Joint& joint, const SimpleJoint& said) {
  std::string out = "<limit>";
  if (joint.limits && !joint.continuous && joint.limits->lower < joint.limits->upper)
    out += fmt::format("<lower>{:.17g}</lower><upper>{:.17g}</upper>", joint.limits->lower, joint.limits->upper);
  const double speed = joint.limits && joint.limits->velocity > 0 ? joint.limits->velocity : -1;
  return out + fmt::format("<effort>{:.17g}</effort><velocity>{:.17g}</velocity></limit>",
                           said.effort > 0 ? said.effort : -1, speed);
}

std::string joint_element(const Joint& joint, const SimpleJoint& said, const std::string& parent) {
  const char* type = joint.type == JointType::prismatic ? "prismatic" : joint.continuous ? "continuous" : "revolute";
  return fmt::format(
      "<joint name={} type=\"{}\">\n<parent>{}</parent>\n<child>{}</child>\n<axis>\n<xyz>{}</xyz>\n"
      "<dynamics><damping>{:.17g}</damping><friction>{:.17g}</friction></dynamics>\n{}\n</axis>\n</joint>\n",
      quoted(joint.name), type, escaped(parent), escaped(joint.link), numbers(joint.axis), said.damping, said.friction,
      limit_element(joint, said));
}

/// Names that libsdformat refuses: one for two things, reserved ones, and those with its scope's sign.
/// @throws InputError
void check_names(const SimpleRobot& robot) {
  std::set<std::string> taken{world};
  const auto check = [&](const std::string& name, const char* what) {
    const bool reserved = name.starts_with("__") && name.ends_with("__");
    if (!name.empty() && !reserved && name.find("::") == std::string::npos && taken.insert(name).second) return;
    throw InputError(fmt::format(
        "{}: SDF can't have a {} '{}': every link and joint needs a name of its own, not \"world\", without "
        "\"::\" and \"__\" around it: rename it, then export again",
        robot.urdf.string(), what, name));
  };
  for (const Joint& joint : robot.robot.joints) {
    check(joint.link, "link");
    check(joint.name, "joint");
  }
}

/// Opened once, and for good; null: `why` says why not.
ReadSdf* sdf_reader(std::string& why) {
  static void* const library = dlopen(sdf_reader_library, RTLD_NOW | RTLD_LOCAL);
  void* const function = library == nullptr ? nullptr : dlsym(library, sdf_reader_function);
  if (function == nullptr) {
    const char* said = dlerror();
    why = said == nullptr ? sdf_reader_library : said;
  }
  return reinterpret_cast<ReadSdf*>(function);
}

}  // namespace

void write_sdf(const SimpleRobot& robot, const std::filesystem::path& file) {
  check_names(robot);
  const Robot& chain = robot.robot;
  std::string text = fmt::format(
      "<?xml version=\"1.0\"?>\n<sdf version=\"1.7\">\n<!-- Written by fxdyn. Joints: damping [N m s/rad], friction "
      "[N m], at the output of the gear. -->\n<model name={}>\n",
      quoted(chain.name));
  std::string parent = world;
  for (std::size_t j = 0; j < chain.size(); ++j) {
    text += link_element(chain.joints[j], parent) + joint_element(chain.joints[j], robot.joints[j], parent);
    parent = chain.joints[j].link;
  }
  write_file(file, text + "</model>\n</sdf>\n");
}

ReplayedTorque replay_sdf(const std::filesystem::path& file, const IdentifiedModel& expected, const MotionRows& motion,
                          double step_s) {
  std::vector<std::string> names;
  for (const Joint& joint : robot_of(expected).joints) names.push_back(joint.name);
  std::string why;
  ReadSdf* const reader = sdf_reader(why);
  if (reader == nullptr)
    throw DataError(fmt::format("an SDF can't be read back: {}: `fxdyn doctor` says what to install", why));
  SdfRobot read;
  reader(file, names, read);
  SimpleRobot found;
  found.robot = robot_of(expected);  // its gravity: that of a world is not in a model
  found.robot.joints = read.joints;
  found.joints = read.said;
  ReplayedTorque out;
  out.tau = predict(as_model(found, expected), motion.q, motion.dq, motion.ddq, step_s);
  out.sliding = (motion.dq.array() != 0).cast<double>();
  return out;
}

bool can_read_sdf() {
  std::string why;
  return sdf_reader(why) != nullptr;
}

}  // namespace fxdyn
