#include <fmt/format.h>
#include <tinyxml.h>
#include <urdf_parser/urdf_parser.h>

#include <algorithm>
#include <cmath>

#include "host_tools/effects/evaluator.hpp"
#include "host_tools/effects/model_parts.hpp"
#include "host_tools/exchange/formats.hpp"
#include "host_tools/robot/urdf_checks.hpp"
#include "host_tools/robot/write_urdf.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/files.hpp"
#include "host_tools/support/temporary_folder.hpp"

namespace fxdyn {
namespace {

TiXmlElement* joint_named(TiXmlElement* root, const std::string& name) {
  for (TiXmlElement* e = root->FirstChildElement("joint"); e != nullptr; e = e->NextSiblingElement("joint")) {
    const char* found = e->Attribute("name");
    if (found != nullptr && name == found) return e;
  }
  return nullptr;
}

void set_dynamics(TiXmlElement& joint, const SimpleJoint& said) {
  TiXmlElement* dynamics = joint.FirstChildElement("dynamics");
  if (dynamics == nullptr) dynamics = joint.InsertEndChild(TiXmlElement("dynamics"))->ToElement();
  dynamics->SetAttribute("damping", fmt::format("{:.17g}", said.damping));
  dynamics->SetAttribute("friction", fmt::format("{:.17g}", said.friction));
}

}  // namespace

void write_urdf_dynamics(const SimpleRobot& robot, const std::filesystem::path& file) {
  const DhChain chain = to_dh(robot.robot);
  std::vector<LinkInertia<Real>> inertia;
  for (std::size_t j = 0; j < robot.joints.size(); ++j)
    inertia.push_back(to_link_inertia(*robot.robot.joints[j].inertial, chain.urdf_in_dh[j]));
  const TemporaryFolder temporary;
  const std::filesystem::path bodies = temporary.path() / "bodies.urdf";
  write_urdf(robot.urdf, bodies, robot.robot, chain, inertia);
  TiXmlDocument document;
  document.Parse(read_file(bodies).c_str(), nullptr, TIXML_ENCODING_UTF8);
  TiXmlElement* root = document.FirstChildElement("robot");
  if (document.Error() || root == nullptr)
    throw InputError(fmt::format("{}: can't be read as XML; run `fxdyn check`", robot.urdf.string()));
  complete_limits(document);  // urdfdom asks for them
  for (std::size_t j = 0; j < robot.joints.size(); ++j) {
    TiXmlElement* joint = joint_named(root, robot.robot.joints[j].name);
    if (joint == nullptr) {
      throw InputError(
          fmt::format("{}: no joint '{}'; is this the robot's URDF?", robot.urdf.string(), robot.robot.joints[j].name));
    }
    set_dynamics(*joint, robot.joints[j]);
  }
  TiXmlPrinter printer;
  printer.SetIndent("  ");
  document.Accept(&printer);
  write_file(file, printer.CStr());
}

ReplayedTorque replay_urdf(const std::filesystem::path& file, const IdentifiedModel& expected, const MotionRows& motion,
                           double step_s) {
  SimpleRobot found;
  found.robot = read_urdf(file);
  const urdf::ModelInterfaceSharedPtr model = urdf::parseURDF(read_file(file));
  if (!model) throw DataError(fmt::format("{}: urdfdom does not read it", file.string()));
  for (std::size_t j = 0; j < robot_of(expected).size(); ++j) {
    const std::string& name = robot_of(expected).joints[j].name;
    if (found.robot.size() != robot_of(expected).size() || found.robot.joints[j].name != name)
      throw DataError(fmt::format("{}: joint {} is not '{}'", file.string(), j + 1, name));
    const auto dynamics = model->getJoint(name)->dynamics;
    found.joints.push_back(dynamics ? SimpleJoint{dynamics->damping, dynamics->friction, 0, 0} : SimpleJoint{});
  }
  ReplayedTorque out;
  out.tau = predict(as_model(found, expected), motion.q, motion.dq, motion.ddq, step_s);
  out.sliding = (motion.dq.array() != 0).cast<double>();
  return out;
}

}  // namespace fxdyn
