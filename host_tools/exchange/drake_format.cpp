#include <fmt/format.h>
#include <tinyxml.h>

#include <cmath>
#include <cstdlib>
#include <map>

#include "host_tools/effects/evaluator.hpp"
#include "host_tools/effects/model_parts.hpp"
#include "host_tools/exchange/formats.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/files.hpp"

// A URDF as Drake's MultibodyPlant reads it (multibody/parsing/detail_urdf_parser.cc of commit 007f5fc): <dynamics
// damping>, no dry friction; the rotor is in the <actuator> of a SimpleTransmission, and counts with the square of
// drake:gear_ratio. A transmission whose joint has an effort limit of 0 is skipped.

namespace fxdyn {
namespace {

const char* const rotor = "drake:rotor_inertia";
const char* const gear = "drake:gear_ratio";

TiXmlElement& added(TiXmlElement& to, const char* element) {
  return *to.InsertEndChild(TiXmlElement(element))->ToElement();
}

std::string name_of(const TiXmlElement& element) {
  const char* name = element.Attribute("name");
  return name == nullptr ? "" : name;
}

double number_or(const TiXmlElement* element, const char* attribute, double otherwise) {
  const char* text = element == nullptr ? nullptr : element->Attribute(attribute);
  return text == nullptr ? otherwise : std::strtod(text, nullptr);
}

/// Name of the joint that the transmission moves; empty: it has none.
std::string joint_of(const TiXmlElement& transmission) {
  const TiXmlElement* joint = transmission.FirstChildElement("joint");
  return joint == nullptr ? "" : name_of(*joint);
}

void set_effort(TiXmlElement& joint, double effort) {
  TiXmlElement* limit = joint.FirstChildElement("limit");
  if (limit == nullptr) return;  // as much as one likes
  if (effort > 0)
    limit->SetAttribute("effort", fmt::format("{:.17g}", effort));
  else if (!(number_or(limit, "effort", 0) > 0))
    limit->RemoveAttribute("effort");
}

void add_transmission(TiXmlElement& root, const std::string& joint, double armature) {
  TiXmlElement& transmission = added(root, "transmission");
  transmission.SetAttribute("name", joint + "_transmission");
  added(transmission, "type").InsertEndChild(TiXmlText("SimpleTransmission"));
  added(transmission, "joint").SetAttribute("name", joint);
  TiXmlElement& actuator = added(transmission, "actuator");
  actuator.SetAttribute("name", joint);
  added(actuator, rotor).SetAttribute("value", fmt::format("{:.17g}", armature));
  added(actuator, gear).SetAttribute("value", "1");
}

/// The URDF's own transmissions of these joints: Drake would add a second actuator.
void remove_transmissions(TiXmlElement& root, const SimpleRobot& robot) {
  for (TiXmlElement *e = root.FirstChildElement("transmission"), *next = nullptr; e != nullptr; e = next) {
    next = e->NextSiblingElement("transmission");
    for (const Joint& joint : robot.robot.joints) {
      if (joint_of(*e) != joint.name) continue;
      root.RemoveChild(e);
      break;
    }
  }
}

TiXmlElement& parsed(TiXmlDocument& document, const std::filesystem::path& file) {
  document.Parse(read_file(file).c_str(), nullptr, TIXML_ENCODING_UTF8);
  TiXmlElement* root = document.FirstChildElement("robot");
  if (document.Error() || root == nullptr) throw DataError(fmt::format("{}: can't be read as XML", file.string()));
  return *root;
}

/// What the transmissions add to each joint's inertia.
std::map<std::string, double> rotors_of(const TiXmlElement& root) {
  std::map<std::string, double> out;
  for (const TiXmlElement* e = root.FirstChildElement("transmission"); e; e = e->NextSiblingElement("transmission")) {
    const TiXmlElement *type = e->FirstChildElement("type"), *actuator = e->FirstChildElement("actuator");
    const bool simple = type != nullptr && type->GetText() != nullptr &&
                        std::string(type->GetText()).find("SimpleTransmission") != std::string::npos;
    if (!simple || actuator == nullptr) continue;
    const double ratio = number_or(actuator->FirstChildElement(gear), "value", 1);
    out[joint_of(*e)] += ratio * ratio * number_or(actuator->FirstChildElement(rotor), "value", 0);
  }
  return out;
}

}  // namespace

void write_drake(const SimpleRobot& robot, const std::filesystem::path& file) {
  write_urdf_dynamics(robot, file);
  TiXmlDocument document;
  TiXmlElement& root = parsed(document, file);
  root.SetAttribute("xmlns:drake", "http://drake.mit.edu");
  remove_transmissions(root, robot);
  for (std::size_t j = 0; j < robot.joints.size(); ++j) {
    const std::string& name = robot.robot.joints[j].name;
    for (TiXmlElement* e = root.FirstChildElement("joint"); e != nullptr; e = e->NextSiblingElement("joint"))
      if (name_of(*e) == name) set_effort(*e, robot.joints[j].effort);
    add_transmission(root, name, robot.joints[j].armature);
  }
  TiXmlPrinter printer;
  printer.SetIndent("  ");
  document.Accept(&printer);
  write_file(file, printer.CStr());
}

ReplayedTorque replay_drake(const std::filesystem::path& file, const IdentifiedModel& expected,
                            const MotionRows& motion, double step_s) {
  SimpleRobot found;
  found.robot = read_urdf(file);
  TiXmlDocument document;
  const TiXmlElement& root = parsed(document, file);
  std::map<std::string, double> rotors = rotors_of(root), damping;
  for (const TiXmlElement* e = root.FirstChildElement("joint"); e != nullptr; e = e->NextSiblingElement("joint")) {
    damping[name_of(*e)] = number_or(e->FirstChildElement("dynamics"), "damping", 0);
    if (number_or(e->FirstChildElement("limit"), "effort", HUGE_VAL) <= 0) rotors.erase(name_of(*e));
  }
  for (std::size_t j = 0; j < robot_of(expected).size(); ++j) {
    const std::string& name = robot_of(expected).joints[j].name;
    if (found.robot.size() != robot_of(expected).size() || found.robot.joints[j].name != name)
      throw DataError(fmt::format("{}: joint {} is not '{}'", file.string(), j + 1, name));
    found.joints.push_back({damping[name], 0, rotors[name], 0});
  }
  ReplayedTorque out;
  out.tau = predict(as_model(found, expected), motion.q, motion.dq, motion.ddq, step_s);
  out.sliding.setOnes(motion.dq.rows(), motion.dq.cols());  // nothing sticks
  return out;
}

}  // namespace fxdyn
