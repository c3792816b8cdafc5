#include "tests/campaign/draw.hpp"

#include <cmath>
#include <numbers>

#include "host_tools/effects/effects.hpp"
#include "host_tools/effects/identified_model.hpp"
#include "host_tools/support/error.hpp"

namespace fxdyn::campaign {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

/// A gear that gives more than this is broken in another way, and its column is far from linear.
constexpr double largest_deflection = 0.05;  // rad, a tenth of it in m

double log_uniform(Random& random, double lower, double upper) {
  return lower * std::pow(upper / lower, random.uniform());
}
double sign(Random& random) { return random.uniform() < 0.5 ? -1 : 1; }

/// Every linear parameter grows with the size.
std::function<EffectFit(double)> linear(const std::string& effect, std::vector<double> shape,
                                        std::vector<double> direction) {
  return [=](double size) {
    EffectFit fit{effect, shape, direction, {}, {}, true};
    for (double& value : fit.linear) value *= size;
    return fit;
  };
}

bool within_bounds(const EffectFit& fit) {
  const EffectInfo& info = *find_effect(fit.effect);
  const auto inside = [](const std::vector<double>& values, std::span<const ParameterInfo> infos) {
    for (std::size_t i = 0; i < values.size(); ++i) {
      if (!(values[i] >= infos[i].lower && values[i] <= infos[i].upper)) return false;
    }
    return true;
  };
  return inside(fit.shape, info.shape) && inside(fit.linear, info.linear);
}

std::vector<MatrixXd> deflections(const Plan& plan, const IdentifiedModel& model) {
  std::vector<MatrixXd> all;
  for (const Motion& motion : plan.motions) {
    MatrixXd deflection;
    torque_of(model, motion, &deflection);
    all.push_back(deflection);
  }
  return all;
}

/// measure(size) grows with the size: the size at which it is `target`.
template <class Measure>
std::optional<double> size_for(double target, const Drawn& drawn, Measure&& measure) {
  double lower = 0, upper = drawn.largest, size = std::min(drawn.typical, drawn.largest);
  for (int i = 0; i < 40; ++i) {
    const double now = measure(size);
    if (std::fabs(now / target - 1) < 0.005) return size;
    (now < target ? lower : upper) = size;
    if (now < target && size >= drawn.largest * (1 - 1e-9)) return {};
    // Most effects are proportional to their size: one step arrives. Where it leads out of the bracket, halve that.
    const double next = now > 0 ? size * target / now : upper;
    const bool proportional = i < 8 && next > lower && next < upper;
    size = proportional ? next : (upper > 1e3 * size ? 10 * size : (lower + upper) / 2);
    if (i < 8 && next >= drawn.largest) size = drawn.largest;
  }
  return {};
}

/// The model with the effect, or nothing where gear or parameters leave what is possible.
std::optional<EffectFit> possible(const Drawn& drawn, std::optional<double> size, const Plan& plan) {
  if (!size) return {};
  EffectFit fit = drawn.at(*size);
  if (!within_bounds(fit)) return {};
  if (drawn.joint && find_effect(fit.effect)->acts_on == ActsOn::position) {
    const auto j = static_cast<Index>(*drawn.joint);
    const bool turns = plan.healthy.robot.joints[*drawn.joint].type == JointType::revolute;
    for (const MatrixXd& deflection : deflections(plan, with_effect(plan.healthy, drawn.joint, fit))) {
      if (deflection.col(j).cwiseAbs().maxCoeff() > largest_deflection * (turns ? 1 : 0.1)) return {};
    }
  }
  return fit;
}

}  // namespace

std::optional<Drawn> draw(const std::string& effect, std::size_t joint, const Plan& plan, Random& random) {
  const EffectInfo* info = find_effect(effect);
  if (info == nullptr) throw InputError("the campaign asks for an unknown effect: " + effect);
  const auto j = static_cast<Index>(joint);
  const JointFit& healthy = plan.healthy.joints[joint];
  const double rated = healthy.rated_torque, speed = plan.largest_velocity[j];
  const bool turns = plan.healthy.robot.joints[joint].type == JointType::revolute;
  constexpr double unlimited = 1e9;
  Drawn drawn{effect, joint, {}, 0.01, unlimited};
  const auto all = [&](std::vector<double> shape, std::vector<double> direction) {
    drawn.at = linear(effect, std::move(shape), std::move(direction));
    return drawn;
  };
  // Coulomb and viscous part of comparable weight, of one sign
  const auto friction = [&](double velocity) {
    return std::vector{rated * random.uniform(0.3, 1), rated / velocity * random.uniform(0.3, 1)};
  };
  const auto wave = [&](double amplitude) {
    const double phase = random.uniform(0, 2 * std::numbers::pi);
    return std::vector{amplitude * std::cos(phase), amplitude * std::sin(phase)};
  };
  if (effect == "stribeck") return all({speed * log_uniform(random, 0.01, 0.1)}, {rated});
  if (effect == "soft_knee") return all({speed * log_uniform(random, 0.03, 0.15)}, {rated});
  if (effect == "presliding")
    return all({turns ? log_uniform(random, 1e-3, 8e-3) : log_uniform(random, 3e-5, 3e-4)}, {rated});
  if (effect == "asymmetric_friction") {
    auto direction = friction(speed);
    const double way = sign(random);
    for (double& value : direction) value *= way;
    return all({}, direction);
  }
  if (effect == "viscous_quadratic") return all({}, {sign(random) * rated / (speed * speed)});
  if (effect == "viscous_cubic") return all({}, {sign(random) * rated / (speed * speed * speed)});
  if (effect == "load_friction") return all({}, {1});
  if (effect == "torque_gain") return all({}, {sign(random)});
  if (effect == "ripple")
    return all({turns ? log_uniform(random, 3, 150) : log_uniform(random, 100, 3000)}, wave(rated));
  if (effect == "spring") {
    const double low = plan.range(j, 0), high = plan.range(j, 1), stiffness = rated / (high - low);
    return all({}, {stiffness, -stiffness * (low + (high - low) * random.uniform(0.2, 0.8))});
  }
  if (effect == "gravity_compensator") {
    if (!turns) return {};
    return all({}, wave(rated));
  }
  if (effect == "friction_drift") {
    const double way = sign(random), time = log_uniform(random, 20, 200);
    return all({time}, {way * healthy.find("coulomb")->linear[0] * random.uniform(0.3, 1),
                        way * healthy.find("viscous")->linear[0] * random.uniform(0.3, 1)});
  }
  if (effect == "saturation") {
    const double peak = plan.largest_torque[j];
    drawn.at = [=](double size) { return EffectFit{effect, {peak * (1 - size)}, {1}, {}, {}, true}; };
    drawn.typical = 0.3;
    drawn.largest = 0.95;
    return drawn;
  }
  if (effect == "delay") {
    drawn.at = [=](double size) { return EffectFit{effect, {size}, {1}, {}, {}, true}; };
    drawn.typical = 0.004;
    drawn.largest = plan.longest_delay_s;
    return drawn;
  }
  if (effect == "joint_coupling" || effect == "motor_coupling") {
    const std::size_t n = plan.joints();
    std::size_t other = 0;
    if (effect == "joint_coupling") {
      other = (joint + 1 + random.next() % (n - 1)) % n;
    } else {  // gears are shared by neighbours that turn
      other = joint == 0 || (joint + 1 < n && random.uniform() < 0.5) ? joint + 1 : joint - 1;
      if (!turns || plan.healthy.robot.joints[other].type != JointType::revolute) return {};
    }
    const double peer_speed = plan.largest_velocity[static_cast<Index>(other)], index = static_cast<double>(other + 1);
    auto direction = friction(peer_speed);
    if (effect == "joint_coupling") return all({index}, direction);
    const double ratio = sign(random) * random.uniform(0.5, 1.5);
    direction.push_back(rated / plan.motions.front().ddq.col(static_cast<Index>(other)).cwiseAbs().maxCoeff() *
                        random.uniform(0.1, 0.5));
    return all({index, ratio, 0.01 * speed * random.uniform(0.5, 2)}, direction);
  }
  if (effect == "payload") {
    const std::vector com{random.uniform(-0.1, 0.1), random.uniform(-0.1, 0.1), random.uniform(0.02, 0.15)};
    drawn.joint.reset();
    drawn.at = [=](double size) { return EffectFit{effect, {}, {size, com[0], com[1], com[2]}, {}, {}, true}; };
    drawn.typical = 1;
    return drawn;
  }
  if (effect == "gravity_tilt") {
    drawn.joint.reset();
    drawn.at = linear(effect, {}, wave(1));
    drawn.largest = 0.3;
    return drawn;
  }
  if (effect == "elasticity") return all({log_uniform(random, 5e-4, 5e-3)}, {1e-3 / rated});
  if (effect == "backlash") return all({plan.largest_structural[j] * log_uniform(random, 0.02, 0.1)}, {1e-3});
  if (effect == "eccentricity") {
    if (!turns) return {};
    return all({}, wave(1e-3));
  }
  throw InputError("the campaign can't draw the effect " + effect);
}

std::optional<EffectFit> scaled(const Drawn& drawn, double share, const Plan& plan) {
  return possible(drawn,
                  size_for(share, drawn,
                           [&](double size) {
                             const auto model = with_effect(plan.healthy, drawn.joint, drawn.at(size));
                             return shares_of_rated(plan, torque_change(plan, model)).maxCoeff();
                           }),
                  plan);
}

std::optional<EffectFit> scaled_to_deflection(const Drawn& drawn, double deflection, const Plan& plan) {
  const auto j = static_cast<Index>(*drawn.joint);
  return possible(drawn,
                  size_for(deflection, drawn,
                           [&](double size) {
                             double power = 0, mean = 0, samples = 0;
                             for (const MatrixXd& piece :
                                  deflections(plan, with_effect(plan.healthy, drawn.joint, drawn.at(size)))) {
                               power += piece.col(j).squaredNorm();
                               mean += piece.col(j).sum();
                               samples += static_cast<double>(piece.rows());
                             }
                             return std::sqrt(std::max(0.0, power / samples - std::pow(mean / samples, 2)));
                           }),
                  plan);
}

}  // namespace fxdyn::campaign
