#include "host_tools/excite/nominal.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "host_tools/effects/effects.hpp"
#include "host_tools/effects/evaluator.hpp"
#include "host_tools/effects/identified_model.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/random.hpp"

namespace fxdyn {
namespace {

constexpr double friction_share = 0.03, width_share = 0.005, gravity_share = 0.3;
constexpr double last_rod_m = 0.1, default_kg_per_m = 10;

void check(const std::vector<double>& values, std::size_t joints, std::string_view what) {
  if (values.size() != joints)
    throw InputError(fmt::format("{}: {} values for {} joints", what, values.size(), joints));
  for (const double value : values) {
    if (!(value > 0)) throw InputError(fmt::format("{}: {} is not positive", what, value));
  }
}

/// Effects that follow the load.
std::vector<std::string_view> load_dependent_effects() {
  std::vector<std::string_view> names;
  for (const EffectInfo& info : effect_infos()) {
    const bool follows = info.needs_structural || info.needs_total || info.acts_on == ActsOn::position;
    if (follows) names.push_back(info.name);
  }
  return names;
}

/// A slender rod from the link's origin to the next joint's.
Inertial rod(const Robot& robot, std::size_t link, double kg_per_m) {
  Eigen::Vector3d end = Eigen::Vector3d::UnitX() * last_rod_m;
  if (link + 1 < robot.size()) end = robot.joints[link + 1].origin.translation();
  if (end.norm() < 1e-3) end = Eigen::Vector3d::UnitX() * last_rod_m;  // axes that meet
  Inertial body;
  body.mass = kg_per_m * end.norm();
  body.centre = end / 2;
  body.tensor = body.mass / 12 * (end.squaredNorm() * Eigen::Matrix3d::Identity() - end * end.transpose());
  return body;
}

/// Largest share of rated torque that gravity takes at any joint, over random poses.
double largest_gravity(const IdentifiedModel& model) {
  constexpr Eigen::Index poses = 200;
  const auto n = static_cast<Eigen::Index>(model.robot.size());
  Random random(1);
  Eigen::MatrixXd q(poses, n);
  for (Eigen::Index k = 0; k < poses; ++k) {
    for (Eigen::Index j = 0; j < n; ++j) {
      const auto& limits = model.robot.joints[static_cast<std::size_t>(j)].limits;
      const bool bounded = limits && limits->upper > limits->lower;
      q(k, j) =
          bounded ? random.uniform(limits->lower, limits->upper) : random.uniform(-std::numbers::pi, std::numbers::pi);
    }
  }
  const Eigen::MatrixXd still = Eigen::MatrixXd::Zero(poses, n);
  const Eigen::MatrixXd tau = predict(model, q, still, still, model.tick_s);
  double most = 0;
  for (Eigen::Index j = 0; j < n; ++j) {
    most = std::max(most, tau.col(j).cwiseAbs().maxCoeff() / model.joints[static_cast<std::size_t>(j)].rated_torque);
  }
  return most;
}

}  // namespace

NominalModel nominal_from_urdf(const Robot& robot, const std::vector<double>& rated_torque,
                               const std::vector<double>& velocity) {
  const std::size_t n = robot.size();
  check(rated_torque, n, "rated torque");
  check(velocity, n, "velocity limit");
  NominalModel out;
  IdentifiedModel& model = out.model;
  model.robot = robot;
  model.joints.resize(n);
  for (std::size_t j = 0; j < n; ++j) {
    JointFit& joint = model.joints[j];
    joint.rated_torque = rated_torque[j];
    joint.sign_width = width_share * velocity[j];
  }
  out.assumptions.push_back(
      fmt::format("friction: Coulomb {:.0f} % of rated torque, viscous {:.0f} % at the velocity limit",
                  100 * friction_share, 100 * friction_share));

  const DhChain chain = to_dh(robot);
  const auto missing = static_cast<std::size_t>(
      std::count_if(robot.joints.begin(), robot.joints.end(), [](const Joint& joint) { return !joint.inertial; }));
  const auto set_inertia = [&](double kg_per_m) {
    model.inertia.clear();
    for (std::size_t j = 0; j < n; ++j) {
      const Joint& joint = robot.joints[j];
      model.inertia.push_back(missing == n     ? to_link_inertia(rod(robot, j, kg_per_m), chain.urdf_in_dh[j])
                              : joint.inertial ? to_link_inertia(*joint.inertial, chain.urdf_in_dh[j])
                                               : LinkInertia<Real>{});
    }
  };
  set_inertia(default_kg_per_m);
  if (missing == n) {
    const double gravity = largest_gravity(model);
    if (gravity > 0) set_inertia(default_kg_per_m * gravity_share / gravity);
    out.assumptions.emplace_back(fmt::format(
        "the URDF has no inertias: generic ones stand in, so what depends on load ({}) is an orientation only",
        fmt::join(load_dependent_effects(), ", ")));
  } else if (missing > 0) {
    out.assumptions.push_back(fmt::format("{} links of the URDF have no inertia and count as massless", missing));
  }
  for (std::size_t j = 0; j < n; ++j) {
    JointSeries fastest;
    fastest.q = fastest.ddq = Eigen::VectorXd::Zero(1);
    fastest.dq = Eigen::VectorXd::Constant(1, velocity[j]);
    for (const EffectInfo& info : effect_infos()) {
      if (!info.nominal || !info.friction || info.has_constant) continue;  // an offset may have either sign
      const double phi = effect_columns(info.name, {}, model.joints[j].sign_width, fastest)(0, 0);
      EffectFit fit;
      fit.effect = info.name;
      fit.linear = {friction_share * rated_torque[j] / phi};
      model.joints[j].effects.push_back(std::move(fit));
    }
  }
  return out;
}

}  // namespace fxdyn
