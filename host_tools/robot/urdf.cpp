#include <console_bridge/console.h>
#include <fmt/format.h>
#include <tinyxml.h>
#include <urdf_parser/urdf_parser.h>

#include <Eigen/Eigenvalues>
#include <Eigen/SVD>
#include <cmath>
#include <fstream>
#include <iterator>

#include "host_tools/robot/robot.hpp"
#include "host_tools/robot/urdf_checks.hpp"
#include "host_tools/support/error.hpp"

namespace fxdyn {
namespace {

/// Keeps what urdfdom would print on stderr: its first error is the cause.
class FirstError : public console_bridge::OutputHandler {
 public:
  FirstError() : level_(console_bridge::getLogLevel()) {
    console_bridge::setLogLevel(console_bridge::CONSOLE_BRIDGE_LOG_ERROR);
    console_bridge::useOutputHandler(this);
  }
  ~FirstError() override {
    console_bridge::restorePreviousOutputHandler();
    console_bridge::setLogLevel(level_);
  }
  FirstError(const FirstError&) = delete;
  FirstError& operator=(const FirstError&) = delete;

  void log(const std::string& text, console_bridge::LogLevel level, const char*, int) override {
    if (level == console_bridge::CONSOLE_BRIDGE_LOG_ERROR && text_.empty()) text_ = text;
  }
  std::string text() const {
    std::string line = text_.empty() ? "not a valid robot description" : text_;
    for (char& c : line) {
      if (c == '\n') c = ' ';
    }
    return line;
  }

 private:
  console_bridge::LogLevel level_;
  std::string text_;
};

std::string read_text(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  if (!stream || std::filesystem::is_directory(file)) {
    throw InputError(fmt::format("{}: can't be read; check the path of the URDF", file.string()));
  }
  return {std::istreambuf_iterator<char>(stream), {}};
}

/// The file as XML, for line numbers: urdfdom does not keep them.
class Lines {
 public:
  Lines(const std::string& file, const std::string& text) : file_(file) {
    document_.Parse(text.c_str(), nullptr, TIXML_ENCODING_UTF8);
    if (document_.Error()) {
      throw InputError(
          fmt::format("{}:{}: malformed XML: {}", file, std::max(document_.ErrorRow(), 1), document_.ErrorDesc()));
    }
    check_urdf(document_, file);
  }

  /// What urdfdom gets to read.
  std::string completed(const std::string& text) const {
    TiXmlDocument document = document_;
    if (!complete_limits(document)) return text;
    TiXmlPrinter printer;
    document.Accept(&printer);
    return printer.CStr();
  }

  /// "file:line: " of the joint or link that urdfdom's complaint names in brackets or quotes; else "file: ".
  std::string place_of(const std::string& complaint) const {
    for (const char* element : {"joint", "link"}) {
      for (const TiXmlElement* e = root()->FirstChildElement(element); e; e = e->NextSiblingElement(element)) {
        const char* name = e->Attribute("name");
        if (name == nullptr) continue;
        for (const char* quotes : {"[{}]", "'{}'", "`{}'", "\"{}\""}) {
          if (complaint.find(fmt::format(fmt::runtime(quotes), name)) != std::string::npos)
            return fmt::format("{}:{}: {} '{}': ", file_, e->Row(), element, name);
        }
      }
    }
    return file_ + ": ";
  }

  /// "file:line: joint 'name'"
  std::string at(const char* element, const std::string& name) const {
    for (const TiXmlElement* e = root()->FirstChildElement(element); e; e = e->NextSiblingElement(element)) {
      const char* attribute = e->Attribute("name");
      if (attribute && name == attribute) return fmt::format("{}:{}: {} '{}'", file_, e->Row(), element, name);
    }
    return fmt::format("{}: {} '{}'", file_, element, name);
  }

 private:
  const TiXmlElement* root() const { return document_.FirstChildElement("robot"); }
  std::string file_;
  TiXmlDocument document_;
};

/// URDF files give right angles with few digits (1.5708). Taken literally, parallel axes would meet kilometres away, so
/// entries of rotations and axes below this become zero (and 1.5708 becomes pi / 2).
constexpr double rounding = 1e-5;

Eigen::Matrix3d without_rounding(const Eigen::Matrix3d& rotation) {
  const Eigen::Matrix3d cleaned = (rotation.array().abs() < rounding).select(0.0, rotation);
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(cleaned, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Eigen::Matrix3d nearest = svd.matrixU() * svd.matrixV().transpose();
  return (nearest.array().abs() < 1e-15).select(0.0, nearest);
}

Eigen::Isometry3d to_pose(const urdf::Pose& pose, bool clean) {
  const auto& r = pose.rotation;
  const Eigen::Matrix3d rotation = Eigen::Quaterniond(r.w, r.x, r.y, r.z).normalized().toRotationMatrix();
  Eigen::Isometry3d result = Eigen::Isometry3d::Identity();
  result.linear() = clean ? without_rounding(rotation) : rotation;
  result.translation() = Eigen::Vector3d(pose.position.x, pose.position.y, pose.position.z);
  return result;
}

/// Adds a body, given in a frame with the pose `pose`.
void add(std::optional<Inertial>& sum, const Inertial& body, const Eigen::Isometry3d& pose) {
  if (!sum) sum.emplace();
  const Eigen::Vector3d centre = pose * body.centre;
  const double mass = sum->mass + body.mass;
  const Eigen::Vector3d common =
      mass > 0 ? Eigen::Vector3d((sum->mass * sum->centre + body.mass * centre) / mass) : Eigen::Vector3d::Zero();
  const auto about = [&common](double m, const Eigen::Vector3d& c, const Eigen::Matrix3d& tensor) {
    const Eigen::Vector3d r = c - common;
    return Eigen::Matrix3d(tensor + m * (r.squaredNorm() * Eigen::Matrix3d::Identity() - r * r.transpose()));
  };
  sum->tensor = about(sum->mass, sum->centre, sum->tensor) +
                about(body.mass, centre, pose.linear() * body.tensor * pose.linear().transpose());
  sum->mass = mass;
  sum->centre = common;
}

class Reader {
 public:
  explicit Reader(const std::filesystem::path& file)
      : file_(file.string()), text_(read_text(file)), lines_(file_, text_) {}

  Robot read() {
    parse();
    robot_.name = model_->getName();
    urdf::LinkConstSharedPtr link = model_->getRoot();
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();  // of `link` in the last moving link
    while (const urdf::JointSharedPtr next = next_joint(*link)) {
      pose = pose * to_pose(next->parent_to_joint_origin_transform, true);
      link = child(*next);
      if (moves(*next)) {
        add_joint(*next, pose);
        pose.setIdentity();
      }
    }
    if (robot_.joints.empty()) {
      throw InputError(file_ + ": no moving joint; at least one revolute, continuous or prismatic joint is needed");
    }
    return robot_;
  }

 private:
  void parse() {
    const FirstError errors;
    try {
      model_ = urdf::parseURDF(lines_.completed(text_));
    } catch (const std::exception& error) {
      throw InputError(fmt::format("{}not a valid URDF: {}", lines_.place_of(error.what()), error.what()));
    }
    if (!model_) throw InputError(fmt::format("{}not a valid URDF: {}", lines_.place_of(errors.text()), errors.text()));
  }

  static bool moves(const urdf::Joint& joint) { return joint.type != urdf::Joint::FIXED; }
  urdf::LinkConstSharedPtr child(const urdf::Joint& joint) const { return model_->getLink(joint.child_link_name); }

  bool carries_motion(const urdf::Joint& joint) const {
    if (moves(joint)) return true;
    for (const auto& next : child(joint)->child_joints) {
      if (carries_motion(*next)) return true;
    }
    return false;
  }

  /// The one child joint that leads to further motion, null at the end of the chain.
  urdf::JointSharedPtr next_joint(const urdf::Link& link) const {
    urdf::JointSharedPtr next;
    for (const auto& joint : link.child_joints) {
      if (!carries_motion(*joint)) continue;
      if (next) {
        throw InputError(
            fmt::format("{}: the chain branches into joints '{}' and '{}'; make the joints of one branch fixed",
                        lines_.at("link", link.name), next->name, joint->name));
      }
      next = joint;
    }
    return next;
  }

  void add_joint(const urdf::Joint& source, const Eigen::Isometry3d& origin) {
    const std::string where = lines_.at("joint", source.name);
    Joint joint;
    joint.name = source.name;
    joint.link = source.child_link_name;
    joint.origin = origin;
    switch (source.type) {
      case urdf::Joint::REVOLUTE:
        break;
      case urdf::Joint::CONTINUOUS:
        joint.continuous = true;
        break;
      case urdf::Joint::PRISMATIC:
        joint.type = JointType::prismatic;
        break;
      default:
        throw InputError(where + ": type not supported; use revolute, continuous, prismatic or fixed");
    }
    if (source.mimic) throw InputError(where + ": mimic joints are not supported; make it fixed");
    joint.axis = axis(source, where);
    if (source.limits) {
      joint.limits = Limits{source.limits->lower, source.limits->upper, source.limits->velocity, source.limits->effort};
    }
    add_bodies(joint, *child(source), Eigen::Isometry3d::Identity());
    if (joint.inertial && joint.inertial->mass == 0) joint.inertial.reset();  // only dummy bodies
    robot_.joints.push_back(joint);
  }

  static Eigen::Vector3d axis(const urdf::Joint& source, const std::string& where) {
    const Eigen::Vector3d axis(source.axis.x, source.axis.y, source.axis.z);
    const double length = axis.norm();
    if (!std::isfinite(length) || length < 1e-6) {
      throw InputError(where + ": axis has no length; give its direction, as in <axis xyz=\"0 0 1\"/>");
    }
    const Eigen::Vector3d unit = axis / length;
    return Eigen::Vector3d((unit.array().abs() < rounding).select(0.0, unit)).normalized();
  }

  /// The bodies and frames of a link and of all that is fixed to it.
  void add_bodies(Joint& joint, const urdf::Link& link, const Eigen::Isometry3d& pose) const {
    if (link.inertial) {
      const urdf::Inertial& body = *link.inertial;
      const Eigen::Isometry3d frame = to_pose(body.origin, false);
      Inertial inertial;
      inertial.mass = body.mass;
      inertial.tensor << body.ixx, body.ixy, body.ixz, body.ixy, body.iyy, body.iyz, body.ixz, body.iyz, body.izz;
      check(inertial, link.name);
      add(joint.inertial, inertial, pose * frame);
    }
    for (const auto& next : link.child_joints) {
      if (moves(*next)) continue;
      const Eigen::Isometry3d frame = pose * to_pose(next->parent_to_joint_origin_transform, true);
      joint.fixed_frames.push_back(frame.translation());
      add_bodies(joint, *child(*next), frame);
    }
  }

  void check(const Inertial& body, const std::string& link) const {
    if (body.mass == 0 && body.tensor.isZero(0)) return;  // a dummy link
    if (!(body.mass > 0) || !std::isfinite(body.mass) || !body.tensor.allFinite()) {
      throw InputError(lines_.at("link", link) + ": mass is not positive; correct or remove its <inertial>");
    }
    const Eigen::Vector3d moments = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(body.tensor).eigenvalues();
    if (moments.minCoeff() < -1e-9 * moments.cwiseAbs().maxCoeff()) {
      throw InputError(lines_.at("link", link) + ": inertia tensor is not positive; correct or remove its <inertial>");
    }
  }

  std::string file_, text_;
  Lines lines_;
  urdf::ModelInterfaceSharedPtr model_;
  Robot robot_;
};

}  // namespace

Robot read_urdf(const std::filesystem::path& file) { return Reader(file).read(); }

}  // namespace fxdyn
