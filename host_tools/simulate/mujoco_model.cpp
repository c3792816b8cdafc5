#include "host_tools/simulate/mujoco_model.hpp"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <array>
#include <cstring>

#include "host_tools/effects/model_parts.hpp"
#include "host_tools/support/error.hpp"

namespace fxdyn {
namespace {

std::string xyz(const Eigen::Vector3d& v) { return fmt::format("{:.17g} {:.17g} {:.17g}", v.x(), v.y(), v.z()); }

double linear(const JointFit& joint, std::string_view effect, std::size_t i) {
  const EffectFit* fit = joint.find(effect);
  return fit == nullptr ? 0 : fit->linear[i];
}

bool gear_moves(const JointFit& joint) {
  return joint.find("elasticity") != nullptr || joint.find("backlash") != nullptr;
}

std::string joint_tag(const Joint& joint, const std::string& attributes) {
  return fmt::format("<joint type=\"{}\" axis=\"{}\"{}/>\n", joint.type == JointType::revolute ? "hinge" : "slide",
                     xyz(joint.axis), attributes);
}

/// What of the joint's physics is the drive's own in MuJoCo: armature, damping, a spring, dry friction. The friction's
/// reference is as quick as the step allows: it is a soft constraint on a + b v, b = 2 / time constant, so that it
/// changes its sign at v = -a / b instead of 0 (about 1 mrad/s at 8 rad/s^2).
std::string drive(const JointFit& joint, double step_s) {
  std::string text = fmt::format(" armature=\"{:.17g}\" damping=\"{:.17g}\"", linear(joint, "rotor_inertia", 0),
                                 linear(joint, "viscous", 0));
  const double friction = coulomb_share(joint).own;
  if (friction > 0) {
    text += fmt::format(" frictionloss=\"{:.17g}\" solreffriction=\"{:.17g} 1\" solimpfriction=\"0.95 0.95 0.001\"",
                        friction, 2 * step_s);
  }
  const double stiffness = linear(joint, "spring", 0);
  if (stiffness > 0) {
    text +=
        fmt::format(" stiffness=\"{:.17g}\" springref=\"{:.17g}\"", stiffness, -linear(joint, "spring", 1) / stiffness);
  }
  return text;
}

std::string gear(const JointFit& joint) {
  const EffectFit* elasticity = joint.find("elasticity");
  if (elasticity == nullptr || !(elasticity->linear[0] > 0)) return {};
  const double stiffness = 1 / elasticity->linear[0];
  return fmt::format(" stiffness=\"{:.17g}\" damping=\"{:.17g}\"", stiffness, stiffness * elasticity->shape[0]);
}

Eigen::Vector3d gravity(const IdentifiedModel& plant) {
  Eigen::Vector3d g = robot_of(plant).gravity;
  for (const EffectFit& fit : body_of(plant)) {
    if (fit.effect != "gravity_tilt") continue;
    g = Eigen::AngleAxisd(fit.linear[1], Eigen::Vector3d::UnitY()) *
        (Eigen::AngleAxisd(fit.linear[0], Eigen::Vector3d::UnitX()) * g);
  }
  return g;
}

/// The last link's body with the loads fixed to it.
Inertial loaded(Inertial body, const std::vector<EffectFit>& effects) {
  for (const EffectFit& fit : effects) {
    if (fit.effect != "payload" || !(fit.linear[0] > 0)) continue;
    const double mass = fit.linear[0];
    const Eigen::Vector3d at(fit.linear[1], fit.linear[2], fit.linear[3]), apart = at - body.centre;
    // two masses about their common centre: the reduced mass at their distance
    const double reduced = body.mass * mass / (body.mass + mass);
    body.tensor += reduced * (apart.squaredNorm() * Eigen::Matrix3d::Identity() - apart * apart.transpose());
    body.centre += mass / (body.mass + mass) * apart;
    body.mass += mass;
  }
  return body;
}

/// Its own reading of the tensor would balance moments that miss the triangle inequality, as published ones do.
void set_body(mjModel& model, int id, const Inertial& body) {
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(body.tensor);
  Eigen::Matrix3d frame = axes.eigenvectors();
  if (frame.determinant() < 0) frame.col(0) *= -1;
  const Eigen::Quaterniond turn(frame);
  model.body_mass[id] = body.mass;
  for (int k = 0; k < 3; ++k) {
    model.body_ipos[3 * id + k] = body.centre[k];
    model.body_inertia[3 * id + k] = axes.eigenvalues()[k];
  }
  const std::array<double, 4> wxyz{turn.w(), turn.x(), turn.y(), turn.z()};
  std::copy(wxyz.begin(), wxyz.end(), model.body_iquat + 4 * id);
  model.body_sameframe[id] = 0;
}

mjModel* load(const std::string& xml) {
  const auto files = std::make_unique<mjVFS>();
  mju_user_warning = [](const char*) {};  // would write a file where the program runs; the step checks what happened
  mj_defaultVFS(files.get());
  const char* name = "robot.xml";
  mj_makeEmptyFileVFS(files.get(), name, static_cast<int>(xml.size()));
  std::memcpy(files->filedata[mj_findFileVFS(files.get(), name)], xml.data(), xml.size());
  std::array<char, 500> error{};
  mjModel* model = mj_loadXML(name, files.get(), error.data(), static_cast<int>(error.size()));
  mj_deleteVFS(files.get());
  if (model == nullptr) throw InputError(fmt::format("plant \"mujoco\" can't take this robot: {}", error.data()));
  return model;
}

}  // namespace

CoulombShare coulomb_share(const JointFit& joint) {
  // where friction builds up over a distance, that share of it is no Coulomb friction
  const EffectFit* lugre = joint.find("lugre");
  const double of_lugre = lugre != nullptr ? lugre->shape[2] * lugre->linear[0] : 0;
  double of_slip = 0;
  if (const EffectFit* slip = joint.find("maxwell_slip")) {
    for (const double force : slip->linear) of_slip += force;
  }
  const double left = linear(joint, "coulomb", 0) - linear(joint, "presliding", 0) - of_lugre - of_slip;
  return {std::max(left, 0.0), std::min(left, 0.0)};
}

MujocoModel::MujocoModel(const IdentifiedModel& plant, const Options& options) {
  const std::size_t n = robot_of(plant).size();
  std::string xml = fmt::format(
      "<mujoco><compiler angle=\"radian\"/><option timestep=\"{:.17g}\" gravity=\"{}\" integrator=\"implicit\"/>\n"
      "<worldbody>\n",
      options.step_s, xyz(gravity(plant)));
  int at = 0;
  for (std::size_t i = 0; i < n; ++i) {
    const Joint& joint = robot_of(plant).joints[i];
    const Eigen::Quaterniond turn(joint.origin.linear());
    xml += fmt::format("<body pos=\"{}\" quat=\"{:.17g} {:.17g} {:.17g} {:.17g}\">\n", xyz(joint.origin.translation()),
                       turn.w(), turn.x(), turn.y(), turn.z());
    // a body of its own would need a mass between motor and gear: both joints move the link's
    xml += "<inertial pos=\"0 0 0\" mass=\"1\" diaginertia=\"1 1 1\"/>\n";
    const JointFit& fit = joints_of(plant)[i];
    motor.push_back(at++);
    xml += joint_tag(joint, options.bare ? std::string() : drive(fit, options.step_s));
    const bool two = !options.bare && gear_moves(fit);
    gear.push_back(two ? at++ : -1);
    if (two) xml += joint_tag(joint, options.gears ? fxdyn::gear(fit) : std::string());
  }
  for (std::size_t i = 0; i < n; ++i) xml += "</body>";
  xml += "</worldbody></mujoco>\n";
  model.reset(load(xml));
  for (std::size_t i = 0; i < n; ++i) {
    Inertial body = robot_of(plant).joints[i].inertial.value_or(Inertial{});
    if (i + 1 == n) body = loaded(body, body_of(plant));
    set_body(*model, static_cast<int>(i) + 1, body);
  }
  data.reset(mj_makeData(model.get()));
  mj_setConst(model.get(), data.get());
}

}  // namespace fxdyn
