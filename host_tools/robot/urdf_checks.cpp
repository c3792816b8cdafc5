#include "host_tools/robot/urdf_checks.hpp"

#include <fmt/format.h>
#include <tinyxml.h>

#include <cmath>
#include <cstdlib>
#include <sstream>
#include <string_view>
#include <vector>

#include "host_tools/support/error.hpp"

namespace fxdyn {
namespace {

/// Beyond what any arm has: between two moving joints, and as radius of gyration of a link [m]. Millimetres are above.
constexpr double longest_m = 10;
/// Of one link [kg]; grams are above.
constexpr double heaviest_kg = 20'000;
/// Angles of an origin [rad]: a turn, and some rounding. Degrees are above, but for a few.
constexpr double widest_rpy = 6.4;

std::string_view text_of(const TiXmlElement& element, const char* attribute) {
  const char* text = element.Attribute(attribute);
  return text == nullptr ? std::string_view() : std::string_view(text);
}

/// Numbers of an attribute; those that are none are urdfdom's to complain of.
std::vector<double> numbers(const TiXmlElement* element, const char* attribute) {
  std::vector<double> out;
  if (element == nullptr) return out;
  std::istringstream in{std::string(text_of(*element, attribute))};
  for (double value = 0; in >> value;) out.push_back(value);
  return out;
}

class Checker {
 public:
  Checker(const TiXmlElement& root, const std::string& file) : root_(root), file_(file) {}

  void run() const {
    refuse_macros(root_);
    if (root_.FirstChildElement("link") == nullptr) {
      for (const char* word : {"group", "group_state", "end_effector", "virtual_joint", "disable_collisions"}) {
        if (root_.FirstChildElement(word) != nullptr) {
          throw InputError(fmt::format("{}:{}: is an SRDF (<{}>, no <link>): name the URDF that belongs to it", file_,
                                       root_.FirstChildElement(word)->Row(), word));
        }
      }
    }
    for (const TiXmlElement* e = root_.FirstChildElement("joint"); e; e = e->NextSiblingElement("joint"))
      check_joint(*e);
    for (const TiXmlElement* e = root_.FirstChildElement("link"); e; e = e->NextSiblingElement("link")) check_link(*e);
  }

 private:
  std::string where(const TiXmlElement& at, const TiXmlElement& named) const {
    return fmt::format("{}:{}: {} '{}'", file_, at.Row(), named.Value(), text_of(named, "name"));
  }

  void refuse_macros(const TiXmlElement& element) const {
    bool macro = std::string_view(element.Value()).starts_with("xacro:");
    for (const TiXmlAttribute* a = element.FirstAttribute(); a != nullptr; a = a->Next()) {
      const std::string_view value = a->Value();
      macro = macro || value.find("${") != std::string_view::npos || value.find("$(") != std::string_view::npos;
    }
    if (macro) {
      throw InputError(fmt::format("{}:{}: is a xacro file, not yet a URDF: expand it, as in xacro {} > robot.urdf",
                                   file_, element.Row(), file_));
    }
    for (const TiXmlElement* e = element.FirstChildElement(); e; e = e->NextSiblingElement()) refuse_macros(*e);
  }

  void check_joint(const TiXmlElement& joint) const {
    const std::string_view type = text_of(joint, "type");
    if ((type == "revolute" || type == "prismatic") && joint.FirstChildElement("limit") == nullptr) {
      throw InputError(
          fmt::format("{}: is {} and has no <limit>; add its limits, as in <limit lower=\"-3\" upper=\"3\"/>"
                      "{}",
                      where(joint, joint), type, type == "revolute" ? ", or make it continuous" : ""));
    }
    for (const char* name : {"lower", "upper", "velocity", "effort"})
      check_number(joint.FirstChildElement("limit"), name, joint);
    const TiXmlElement* origin = joint.FirstChildElement("origin");
    check_angles(origin, joint);
    double squares = 0;
    for (const double x : numbers(origin, "xyz")) squares += x * x;
    // The first one's may be where the robot stands in a hall.
    if (std::sqrt(squares) > longest_m && !stands_on_root(joint)) {
      throw InputError(
          fmt::format("{}: origin is {:.4g} m from the joint before: millimetres? Lengths of a URDF are "
                      "metres: divide by 1000",
                      where(*origin, joint), std::sqrt(squares)));
    }
  }

  /// urdfdom says neither line nor joint.
  void check_number(const TiXmlElement* element, const char* attribute, const TiXmlElement& named) const {
    if (element == nullptr || element->Attribute(attribute) == nullptr) return;
    const std::string text = element->Attribute(attribute);
    char* end = nullptr;
    std::strtod(text.c_str(), &end);
    if (end != text.c_str() && *end == '\0') return;
    throw InputError(fmt::format("{}: {} = \"{}\" is no number", where(*element, named), attribute, text));
  }

  /// Whether the joint's parent is no other joint's child.
  bool stands_on_root(const TiXmlElement& joint) const {
    const TiXmlElement* parent = joint.FirstChildElement("parent");
    if (parent == nullptr) return true;
    for (const TiXmlElement* e = root_.FirstChildElement("joint"); e; e = e->NextSiblingElement("joint")) {
      const TiXmlElement* child = e->FirstChildElement("child");
      if (child != nullptr && text_of(*child, "link") == text_of(*parent, "link")) return false;
    }
    return true;
  }

  void check_angles(const TiXmlElement* origin, const TiXmlElement& named) const {
    for (const double angle : numbers(origin, "rpy")) {
      if (std::fabs(angle) <= widest_rpy) continue;
      throw InputError(fmt::format("{}: rpy has {:.4g}: degrees? Angles of a URDF are radians: multiply by pi/180",
                                   where(*origin, named), angle));
    }
  }

  void check_link(const TiXmlElement& link) const {
    const TiXmlElement* inertial = link.FirstChildElement("inertial");
    if (inertial == nullptr) return;
    check_angles(inertial->FirstChildElement("origin"), link);
    const TiXmlElement *mass = inertial->FirstChildElement("mass"), *tensor = inertial->FirstChildElement("inertia");
    const std::vector<double> kg = numbers(mass, "value");
    if (kg.empty() || !(kg[0] > 0)) return;
    if (kg[0] > heaviest_kg) {
      throw InputError(fmt::format("{}: has {:.4g} kg: grams? Masses of a URDF are kilograms: divide by 1000",
                                   where(*mass, link), kg[0]));
    }
    for (const char* moment : {"ixx", "iyy", "izz"}) {
      const std::vector<double> value = numbers(tensor, moment);
      if (value.empty() || !(std::sqrt(value[0] / kg[0]) > longest_m)) continue;
      throw InputError(
          fmt::format("{}: {} of {:.4g} kg m^2 at {:.4g} kg is {:.4g} m of radius: kg mm^2? Inertias of a "
                      "URDF are kg m^2: divide by 1e6",
                      where(*tensor, link), moment, value[0], kg[0], std::sqrt(value[0] / kg[0])));
    }
  }

  const TiXmlElement& root_;
  const std::string& file_;
};

}  // namespace

void check_urdf(const TiXmlDocument& document, const std::string& file) {
  const TiXmlElement* root = document.FirstChildElement("robot");
  if (root == nullptr) {
    const TiXmlElement* other = document.RootElement();
    const std::string_view name = other == nullptr ? "" : other->Value();
    std::string hint = "is this a URDF? (xacro files must be expanded first)";
    if (name == "sdf") hint = "this is SDF (Gazebo): name the robot's URDF";
    if (name == "mujoco") hint = "this is MJCF (MuJoCo): name the robot's URDF";
    if (name == "launch") hint = "this is a ROS launch file: name the robot's URDF";
    throw InputError(fmt::format("{}: no <robot> element; {}", file, hint));
  }
  Checker(*root, file).run();
}

bool complete_limits(TiXmlDocument& document) {
  bool completed = false;
  TiXmlElement* root = document.FirstChildElement("robot");
  for (TiXmlElement* e = root->FirstChildElement("joint"); e; e = e->NextSiblingElement("joint")) {
    TiXmlElement* limit = e->FirstChildElement("limit");
    if (limit == nullptr) continue;
    for (const char* name : {"effort", "velocity"}) {
      if (limit->Attribute(name) != nullptr) continue;
      limit->SetAttribute(name, "0");
      completed = true;
    }
  }
  return completed;
}

}  // namespace fxdyn
