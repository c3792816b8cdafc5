#include "host_tools/excite/limits.hpp"

#include <fmt/format.h>

#include <cmath>
#include <limits>
#include <numbers>

#include "host_tools/effects/evaluator.hpp"
#include "host_tools/effects/identified_model.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/random.hpp"

namespace fxdyn {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
/// Acceleration limit where none is given: full speed within this time [s].
constexpr double ramp_s = 0.5;

std::string unit(const Joint& joint, const char* suffix) { return std::string(joint.position_unit()) + suffix; }

}  // namespace

MotionLimits motion_limits(const Project& project) {
  const LimitSettings& given = project.limits;
  const auto n = static_cast<Eigen::Index>(project.robot.size());
  MotionLimits out;
  out.box = given.box;
  out.lower.resize(n);
  out.upper.resize(n);
  out.velocity.resize(n);
  out.acceleration.resize(n);
  out.torque.resize(n);
  for (Eigen::Index j = 0; j < n; ++j) {
    const auto i = static_cast<std::size_t>(j);
    const Joint& joint = project.robot.joints[i];
    const Limits urdf = joint.limits.value_or(Limits{});
    const auto fail = [&](const std::string& what, const std::string& key) {
      throw InputError(
          fmt::format("{}: joint '{}': {}; add [limits] {}", project.file.string(), joint.name, what, key));
    };
    if (!given.position.empty()) {
      out.lower[j] = given.position[i][0];
      out.upper[j] = given.position[i][1];
    } else if (joint.continuous) {
      out.upper[j] = std::numbers::pi;
      out.lower[j] = -std::numbers::pi;
      out.notes.push_back(fmt::format("joint '{}' turns without end: kept within -pi .. pi", joint.name));
    } else {
      if (!joint.limits) fail("no position limits", "position");
      if (!(urdf.lower < urdf.upper))
        fail(
            fmt::format("its position limits {} .. {} {} leave no room", urdf.lower, urdf.upper, joint.position_unit()),
            "position");
      out.lower[j] = urdf.lower;
      out.upper[j] = urdf.upper;
    }
    out.velocity[j] = given.velocity.empty() ? urdf.velocity : given.velocity[i];
    if (!(out.velocity[j] > 0)) fail("no velocity limit", "velocity");
    out.acceleration[j] = given.acceleration.empty() ? out.velocity[j] / ramp_s : given.acceleration[i];
    // Too slow to go anywhere in a period: the plan would take hours, and show nothing of the joint.
    const double least = 0.02 * (out.upper[j] - out.lower[j]), period = project.excite.period_s;
    const auto too_slow = [&](const char* key, double value, const char* per) {
      throw InputError(
          fmt::format("{}: joint '{}': limits.{} of {:.3g} {}{} lets it cover less than 2 % of its range in {} s; "
                      "raise it or [excite] period_s",
                      project.file.string(), joint.name, key, value, joint.position_unit(), per, period));
    };
    if (out.velocity[j] * period < least) too_slow("velocity", out.velocity[j], "/s");
    if (out.acceleration[j] * period * period / 16 < least) too_slow("acceleration", out.acceleration[j], "/s^2");
    const double effort = given.torque.empty() ? urdf.effort : given.torque[i];
    out.torque[j] = effort > 0 ? effort : infinity;
  }
  if (given.acceleration.empty()) {
    out.notes.push_back(
        fmt::format("no acceleration limit given: full speed within {} s assumed ([limits] acceleration)", ramp_s));
  }
  if (!out.torque.allFinite()) out.notes.push_back("a joint without a torque limit: not checked ([limits] torque)");
  return out;
}

std::optional<IdentifiedModel> torque_model(const Project& project, const std::filesystem::path& directory,
                                            std::vector<std::string>& notes) {
  const std::size_t n = project.robot.size();
  if (const auto file = directory / "model.json"; std::filesystem::exists(file)) {
    IdentifiedModel model = read_model(file);
    bool same = model.robot.size() == n;
    for (std::size_t i = 0; same && i < n; ++i)
      same = model.robot.joints[i].name == project.robot.joints[i].name &&
             model.robot.joints[i].origin.isApprox(project.robot.joints[i].origin, 1e-9);
    if (!same) {
      throw InputError(
          fmt::format("{}: a model of another robot than the project's; choose another --out", file.string()));
    }
    notes.push_back("torques from the identified model.json");
    return model;
  }
  IdentifiedModel model;
  model.robot = project.robot;
  model.joints.resize(n);
  const DhChain chain = to_dh(project.robot);
  for (std::size_t i = 0; i < n; ++i) {
    const Joint& joint = project.robot.joints[i];
    if (!joint.inertial) {
      notes.push_back(fmt::format(
          "torque limits not checked: link '{}' has no inertia in the URDF, and there is no model.json", joint.link));
      return std::nullopt;
    }
    model.inertia.push_back(to_link_inertia(*joint.inertial, chain.urdf_in_dh[i]));
  }
  notes.push_back("torques from the URDF's inertias, without friction");
  return model;
}

LimitCheck::LimitCheck(const Robot& robot, MotionLimits limits, std::optional<IdentifiedModel> model, double margin)
    : robot_(robot),
      limits_(std::move(limits)),
      model_(model ? std::make_shared<const IdentifiedModel>(*std::move(model)) : nullptr),
      margin_(margin) {
  const Eigen::VectorXd range = limits_.upper - limits_.lower;
  lower_ = limits_.lower + 0.5 * margin * range;
  upper_ = limits_.upper - 0.5 * margin * range;
  for (const Joint& joint : robot_.joints) {
    point_links_.insert(point_links_.end(), 1 + joint.fixed_frames.size(), joint.link);
  }
  if (!limits_.box) return;
  // A frame on the first axis never moves: it takes no margin, but must be inside.
  Random random(1);
  Eigen::VectorXd q(range.size());
  Eigen::Matrix3Xd least, most;
  for (int pose = 0; pose < 20; ++pose) {
    for (Eigen::Index j = 0; j < q.size(); ++j) q[j] = random.uniform(limits_.lower[j], limits_.upper[j]);
    const Eigen::Matrix3Xd points = link_origins(robot_, q);
    least = pose == 0 ? points : least.cwiseMin(points).eval();
    most = pose == 0 ? points : most.cwiseMax(points).eval();
  }
  for (Eigen::Index k = 0; k < least.cols(); ++k) {
    if ((most.col(k) - least.col(k)).maxCoeff() > 1e-9) {
      moving_.push_back(k);
      continue;
    }
    const Eigen::Vector3d point = least.col(k);
    if ((point.array() < (*limits_.box)[0].array() - 1e-9).any() ||
        (point.array() > (*limits_.box)[1].array() + 1e-9).any()) {
      throw InputError(
          fmt::format("limits.box: the frame of link '{}' stands still at ({:.3g}, {:.3g}, {:.3g}) m, "
                      "outside the box; enlarge the box",
                      point_links_[static_cast<std::size_t>(k)], point.x(), point.y(), point.z()));
    }
  }
}

LimitCheck::Extent LimitCheck::extent(const Motion& motion) const {
  Extent out;
  out.at.col(0).setConstant(infinity);
  out.at.col(1).setConstant(-infinity);
  out.point.setZero();
  for (Eigen::Index k = 0; k < motion.q.rows(); ++k) {
    const Eigen::Matrix3Xd points = link_origins(robot_, motion.q.row(k).transpose());
    for (const Eigen::Index point : moving_) {
      for (Eigen::Index axis = 0; axis < 3; ++axis) {
        const double x = points(axis, point);
        if (x < out.at(axis, 0)) {
          out.at(axis, 0) = x;
          out.point(axis, 0) = point;
        }
        if (x > out.at(axis, 1)) {
          out.at(axis, 1) = x;
          out.point(axis, 1) = point;
        }
      }
    }
  }
  return out;
}

template <class Visit>
void LimitCheck::each_excess(const Motion& motion, double extra, Visit&& visit) const {
  if (model_) {
    const Eigen::MatrixXd tau = predict(*model_, motion.q, motion.dq, motion.ddq, motion.step_s);
    for (Eigen::Index j = 0; j < tau.cols(); ++j) {
      const double most = tau.col(j).cwiseAbs().maxCoeff();
      const double share = most / limits_.torque[j] - (1 - margin_ - extra);
      visit(share, [&] {
        const Joint& joint = robot_.joints[static_cast<std::size_t>(j)];
        return fmt::format("limits.torque of joint '{}': {:.4g} {} of {:.4g}", joint.name, most, joint.torque_unit(),
                           limits_.torque[j]);
      });
    }
  }
  if (limits_.box && !moving_.empty()) {
    const Extent at = extent(motion);
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      const double low = (*limits_.box)[0][axis], high = (*limits_.box)[1][axis];
      const auto name = [&](Eigen::Index side) {
        return fmt::format("limits.box: link '{}' at {} = {:.3g} m",
                           point_links_[static_cast<std::size_t>(at.point(axis, side))], "xyz"[axis],
                           at.at(axis, side));
      };
      const double kept = 0.5 * (margin_ + extra);
      visit((low - at.at(axis, 0)) / (high - low) + kept, [&] { return name(0); });
      visit((at.at(axis, 1) - high) / (high - low) + kept, [&] { return name(1); });
    }
  }
}

double LimitCheck::violation(const Motion& motion, double extra) const {
  double sum = 0;
  each_excess(motion, extra, [&](double share, auto&&) { sum += std::max(0.0, share); });
  return sum;
}

std::string LimitCheck::worst(const Motion& motion, double extra) const {
  double most = 0;
  std::string name;
  each_excess(motion, extra, [&](double share, auto&& describe) {
    if (share > most) {
      most = share;
      name = describe();
    }
  });
  return name;
}

std::vector<Usage> LimitCheck::usage(const std::vector<Motion>& motions) const {
  std::vector<Usage> out;
  const auto n = static_cast<Eigen::Index>(robot_.size());
  std::vector<Eigen::MatrixXd> torques;
  if (model_) {
    for (const Motion& m : motions) torques.push_back(predict(*model_, m.q, m.dq, m.ddq, m.step_s));
  }
  const auto range = [&](auto&& get) {
    double low = infinity, high = -infinity;
    for (std::size_t i = 0; i < motions.size(); ++i) {
      low = std::min(low, get(i).minCoeff());
      high = std::max(high, get(i).maxCoeff());
    }
    return std::pair(low, high);
  };
  const auto symmetric = [&](const std::string& limit, const std::string& unit, const Joint& joint, double value,
                             std::pair<double, double> used) {
    const double most = std::max(-used.first, used.second);
    out.push_back({limit, unit, joint.name, used.first, used.second, -value, value, 1 - most / value});
  };
  for (Eigen::Index j = 0; j < n; ++j) {
    const Joint& joint = robot_.joints[static_cast<std::size_t>(j)];
    const auto [low, high] = range([&](std::size_t i) { return motions[i].q.col(j); });
    const double lower = limits_.lower[j], upper = limits_.upper[j];
    out.push_back({"position", joint.position_unit(), joint.name, low, high, lower, upper,
                   std::min(low - lower, upper - high) / (upper - lower)});
    symmetric("velocity", unit(joint, "/s"), joint, limits_.velocity[j],
              range([&](std::size_t i) { return motions[i].dq.col(j); }));
    symmetric("acceleration", unit(joint, "/s^2"), joint, limits_.acceleration[j],
              range([&](std::size_t i) { return motions[i].ddq.col(j); }));
    if (model_ && std::isfinite(limits_.torque[j])) {
      symmetric("torque", joint.torque_unit(), joint, limits_.torque[j],
                range([&](std::size_t i) { return torques[i].col(j); }));
    }
  }
  if (!limits_.box || moving_.empty()) return out;
  Eigen::Matrix<double, 3, 2> at;
  Eigen::Matrix<Eigen::Index, 3, 2> point;
  for (std::size_t i = 0; i < motions.size(); ++i) {
    const Extent one = extent(motions[i]);
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      for (Eigen::Index side = 0; side < 2; ++side) {
        const bool beyond = side == 0 ? one.at(axis, side) < at(axis, side) : one.at(axis, side) > at(axis, side);
        if (i > 0 && !beyond) continue;
        at(axis, side) = one.at(axis, side);
        point(axis, side) = one.point(axis, side);
      }
    }
  }
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    const double lower = (*limits_.box)[0][axis], upper = (*limits_.box)[1][axis];
    const double below = at(axis, 0) - lower, above = upper - at(axis, 1);
    const Eigen::Index nearest = point(axis, below < above ? 0 : 1);
    out.push_back({fmt::format("box {}", "xyz"[axis]), "m", point_links_[static_cast<std::size_t>(nearest)],
                   at(axis, 0), at(axis, 1), lower, upper, std::min(below, above) / (upper - lower)});
  }
  return out;
}

LimitCheck limit_check(const Project& project, const std::filesystem::path& directory,
                       std::vector<std::string>& notes) {
  MotionLimits limits = motion_limits(project);
  notes.insert(notes.end(), limits.notes.begin(), limits.notes.end());
  auto model = torque_model(project, directory, notes);
  return {project.robot, std::move(limits), std::move(model), project.excite.margin};
}

Eigen::VectorXd sign_widths(const Project& project, const std::filesystem::path& directory) {
  Eigen::VectorXd widths =
      Eigen::VectorXd::Constant(static_cast<Eigen::Index>(project.robot.size()), JointFit{}.sign_width);
  if (const auto file = directory / "model.json"; std::filesystem::exists(file)) {
    const IdentifiedModel model = read_model(file);
    for (Eigen::Index j = 0; j < widths.size(); ++j) widths[j] = model.joints[static_cast<std::size_t>(j)].sign_width;
  }
  return widths;
}

}  // namespace fxdyn
