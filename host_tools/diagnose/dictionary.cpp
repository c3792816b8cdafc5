#include <algorithm>
#include <cmath>

#include "host_tools/diagnose/base_parameters.hpp"
#include "host_tools/diagnose/search.hpp"
#include "host_tools/effects/effects.hpp"
#include "host_tools/effects/joint_fit.hpp"
#include "host_tools/support/parallel.hpp"

namespace fxdyn::diagnosis {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Shapes to try for an effect: one list a shape parameter.
std::vector<std::vector<double>> grids(const EffectInfo& info, const Linearised& problem, MotionScales s) {
  std::vector<std::vector<double>> out;
  for (const ParameterInfo& shape : info.shape) {
    const auto [least, most] = shape_limits(problem.models(), s.joint, info, shape);
    s.upper = most;
    out.emplace_back();
    for (const double value : shape.values.tried(s)) out.back().push_back(std::clamp(value, least, most));
  }
  return out;
}

}  // namespace

MotionScales scales_of(const Linearised& problem, std::size_t joint) {
  MotionScales s;
  const LogColumns& columns = problem.log_columns();
  const JointType type = columns.joint_of_robot(joint).type;
  const auto alike = [&](std::size_t other) { return columns.joint_of_robot(other).type == type; };
  s.turns = type == JointType::revolute;
  s.joint = static_cast<unsigned>(joint);
  s.joints = static_cast<unsigned>(problem.joints());
  s.like_previous = joint > 0 && alike(joint - 1);
  s.like_next = joint + 1 < problem.joints() && alike(joint + 1);
  s.sign_width = columns.joint(joint).sign_width;
  const auto j = static_cast<Index>(joint);
  double lower = 1e300, upper = -1e300, last = 0;
  for (std::size_t l = 0; l < problem.logs().size(); ++l) {
    const SessionLog& entry = problem.logs()[l];
    if (entry.healthy || !entry.fits) continue;
    const Index first = entry.log.first, count = entry.log.last - first;
    const auto inside = [&](const MatrixXd& m) { return m.col(j).segment(first, count); };
    s.speed = std::max(s.speed, inside(problem.motion(l).dq).cwiseAbs().maxCoeff());
    lower = std::min(lower, inside(problem.motion(l).q).minCoeff());
    upper = std::max(upper, inside(problem.motion(l).q).maxCoeff());
    s.torque = std::max(s.torque, inside(problem.robot_columns(l).torque()).cwiseAbs().maxCoeff());
    s.structural = std::max(s.structural, inside(problem.robot_columns(l).structural()).cwiseAbs().maxCoeff());
    last = std::max(last, entry.age_s + entry.log.step_s * static_cast<double>(entry.log.samples()));
  }
  s.lowest = lower;
  s.range = upper - lower;
  s.seconds = last;
  return s;
}

int searched_shape(const EffectCandidate& candidate) { return find_effect(candidate.effect)->refined_shape(); }

std::vector<Group> dictionary(const Linearised& problem, const std::vector<EffectCandidate>& skip) {
  std::vector<Group> out;
  const std::size_t n = problem.joints();
  std::vector<std::shared_ptr<const Rotor>> rotors(n);
  std::vector<double> inertia(n);
  std::vector<const MatrixXd*> positions;
  for (std::size_t l = 0; l < problem.logs().size(); ++l) positions.push_back(&problem.motion(l).q);
  for (std::size_t j = 0; j < n; ++j) {
    const VectorXd in_base = hidden_rotor(problem.log_columns().current(), j);
    if (in_base.size() == 0) continue;
    inertia[j] = least_inertia(problem.log_columns().current(), j, positions);
    rotors[j] = std::make_shared<const Rotor>(Rotor{.joint = j, .in_base = in_base, .most = inertia[j]});
  }
  for (const EffectInfo& info : effect_infos()) {
    if (!info.sought() || info.of_spectrum()) continue;
    if (info.needs_peers && n < 2) continue;
    for (std::size_t j = 0; j < (info.acts_on == ActsOn::body ? 1 : n); ++j) {
      const bool skipped = std::any_of(skip.begin(), skip.end(), [&](const EffectCandidate& c) {
        return c.effect == info.name && (info.acts_on == ActsOn::body || c.joint == j);
      });
      if (skipped) continue;
      const MotionScales s = scales_of(problem, j);
      if (info.needs_revolute && !s.turns) continue;
      if (s.seconds < info.shortest_session_s) continue;
      const auto values = grids(info, problem, s);
      const auto shapes = combinations(values);
      const int searched = info.refined_shape();
      const double continuous =
          searched >= 0 ? static_cast<double>(values[static_cast<std::size_t>(searched)].size()) : 0;
      for (const auto& shape : shapes) {  // none where the joint has no mate
        Group group;
        group.candidate = {std::string(info.name), j, shape};
        group.on_body = info.acts_on == ActsOn::body;
        // A share that is 1 by definition is not free.
        group.nonlinear = (searched >= 0) - info.share;
        group.log_grid = std::log(std::max(
            1.0, static_cast<double>(shapes.size()) / std::max(1.0, continuous) * std::max(1.0, 0.5 * continuous)));
        for (const ParameterInfo& p : info.linear) group.lower.push_back(p.lower);
        if (info.separates_rotor()) group.rotor = rotors[j];
        out.push_back(group);
        if (!group.rotor || inertia[j] == 0) continue;
        // Refined once it is among the best; a column of an effect with two shapes costs more tries.
        const std::vector<double> shares =
            info.shape.size() > 1 ? std::vector<double>{0.5} : std::vector<double>{0.3, 0.6, 0.9};
        ++group.nonlinear;
        group.log_grid += std::log(1.0 + static_cast<double>(shares.size()));
        for (const double share : shares) {
          group.rotor_inertia = share * inertia[j];
          out.push_back(group);
        }
      }
    }
  }
  return out;
}

std::vector<EffectCandidate> curves_over_parts(const EffectInfo& info, std::size_t joint, std::size_t of,
                                               const MotionScales& scales, int parts) {
  std::vector<EffectCandidate> out;
  std::vector<double> first;
  if (info.needs_peers) first.push_back(static_cast<double>(of + 1));
  const std::size_t i = first.size();
  const double from = info.shape[i].values.tried(scales)[0], span = info.shape[i + 1].values.tried(scales)[0];
  const double length = span / parts;
  for (int half = 0; length >= info.shape[i + 1].lower && half <= 2 * (parts - 1); ++half) {
    out.push_back({std::string(info.name), joint, first});
    out.back().shape.insert(out.back().shape.end(), {from + half * length / 2, length});
  }
  return out;
}

}  // namespace fxdyn::diagnosis
