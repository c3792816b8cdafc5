#include "host_tools/exchange/sdf_reader.hpp"

#include <fmt/format.h>

#include <cmath>
#include <cstdlib>
#include <optional>
#include <sdf/sdf.hh>

#include "host_tools/support/error.hpp"

namespace fxdyn {
namespace {

constexpr const char* world = "world";
constexpr double same_place = 1e-9;  // m; of the cosine of half the angle between two frames

/// libsdformat opens a log file in the user's home as soon as it is asked anything, and none where there is no home.
class NoHome {
 public:
  NoHome() {
    const char* home = std::getenv("HOME");
    if (home != nullptr) home_ = home;
    unsetenv("HOME");
  }
  ~NoHome() {
    if (home_) setenv("HOME", home_->c_str(), 1);
  }
  NoHome(const NoHome&) = delete;
  NoHome& operator=(const NoHome&) = delete;

 private:
  std::optional<std::string> home_;
};

[[noreturn]] void refuse(const std::filesystem::path& file, const std::string& why) {
  throw DataError(fmt::format("{}: {}", file.string(), why));
}

void require(const sdf::Errors& errors, const std::filesystem::path& file) {
  if (errors.empty()) return;
  std::string line = errors.front().Message();
  for (char& c : line) c = c == '\n' ? ' ' : c;
  refuse(file, "libsdformat does not take this robot: " + line);
}

Eigen::Vector3d vector(const ignition::math::Vector3d& v) { return {v.X(), v.Y(), v.Z()}; }

Eigen::Isometry3d pose(const ignition::math::Pose3d& p) {
  Eigen::Isometry3d out = Eigen::Isometry3d::Identity();
  out.translate(vector(p.Pos()));
  out.rotate(Eigen::Quaterniond(p.Rot().W(), p.Rot().X(), p.Rot().Y(), p.Rot().Z()));
  return out;
}

Inertial inertial_of(const sdf::Link& link) {
  const ignition::math::Inertiald& given = link.Inertial();
  const ignition::math::Matrix3d tensor = given.Moi();  // about the centre, in the link's axes
  Inertial out{given.MassMatrix().Mass(), vector(given.Pose().Pos()), {}};
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) out.tensor(i, k) = tensor(static_cast<std::size_t>(i), static_cast<std::size_t>(k));
  }
  return out;
}

Joint joint_of(const sdf::Model& model, const sdf::Joint& said, const std::filesystem::path& file) {
  const sdf::Link* link = model.LinkByName(said.ChildLinkName());
  if (link == nullptr) refuse(file, "joint '" + said.Name() + "' carries no link");
  Joint out;
  out.name = said.Name();
  out.link = link->Name();
  out.type = said.Type() == sdf::JointType::PRISMATIC ? JointType::prismatic : JointType::revolute;
  const bool first = said.ParentLinkName() == world;
  ignition::math::Pose3d origin, joint;
  require(link->SemanticPose().Resolve(origin, first ? "__model__" : said.ParentLinkName()), file);
  require(said.SemanticPose().Resolve(joint, link->Name()), file);
  if (joint.Pos().Length() > same_place || std::fabs(joint.Rot().W()) < 1 - same_place)
    refuse(file, "joint '" + out.name + "' is not at its link's origin");
  out.origin = pose(origin);
  ignition::math::Vector3d axis;
  require(said.Axis()->ResolveXyz(axis, link->Name()), file);
  out.axis = vector(axis);
  out.inertial = inertial_of(*link);
  return out;
}

}  // namespace

extern "C" void fxdyn_read_sdf(const std::filesystem::path& file, const std::vector<std::string>& joints,
                               SdfRobot& out) {
  const NoHome nowhere_to_log;
  sdf::Console::Instance()->SetQuiet(true);
  sdf::Root root;
  require(root.Load(file.string()), file);
  const sdf::Model* model = root.Model();
  if (model == nullptr || model->JointCount() != joints.size())
    refuse(file, fmt::format("holds no model of {} joints", joints.size()));
  std::string parent = world;
  for (std::size_t j = 0; j < joints.size(); ++j) {
    const sdf::Joint* joint = model->JointByName(joints[j]);
    if (joint == nullptr || joint->Axis() == nullptr || joint->ParentLinkName() != parent)
      refuse(file, fmt::format("joint {} is not '{}', or not where it was", j + 1, joints[j]));
    out.joints.push_back(joint_of(*model, *joint, file));
    out.said.push_back({joint->Axis()->Damping(), joint->Axis()->Friction(), 0, 0});
    parent = joint->ChildLinkName();
  }
}

}  // namespace fxdyn
