// ranges_study [--robots N] [--seed S] [--lowest SHARE] [--highest SHARE]: how often the 90 % sets of `export --to
// isaaclab` hold the true numbers of a joint. Robots of one and two joints, drawn at random, whose logs the simulator's
// own sensors make: encoder steps and torque noise, no column of velocity or acceleration. Ends with 1 where the share
// is not in between.

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <array>

#include "host_tools/exchange/posterior.hpp"
#include "host_tools/identify/identify.hpp"
#include "host_tools/simulate/scenario.hpp"
#include "host_tools/simulate/sensors.hpp"
#include "host_tools/support/parallel.hpp"
#include "tests/support/pendulum.hpp"

namespace fxdyn {
namespace {

constexpr double duration_s = 12, width = 0.02, rated = 20;

/// Its numbers are the truth: nothing else of it is read.
IdentifiedModel drawn_robot(std::uint64_t seed) {
  Random random(seed);
  IdentifiedModel plant = test::model_of(test::pendulum(1 + seed % 2));
  for (std::size_t j = 0; j < plant.joints.size(); ++j) {
    JointFit& joint = plant.joints[j];
    joint.sign_width = width;
    joint.effects = {test::effect_fit("viscous", {}, {random.uniform(0.2, 2)}),
                     test::effect_fit("coulomb", {}, {random.uniform(0.3, 3)}),
                     test::effect_fit("offset", {}, {random.uniform(-0.5, 0.5)})};
    // the first joint's rotor is part of its link
    if (j > 0) joint.effects.push_back(test::effect_fit("rotor_inertia", {}, {random.uniform(0.05, 0.3)}));
  }
  return plant;
}

ProcessedLog recorded(const IdentifiedModel& plant, std::uint64_t seed) {
  Log log = test::exact_log(plant, Role::train, seed, duration_s);
  Scenario scenario;
  scenario.plant = plant;
  scenario.seed = seed;
  scenario.encoder_bits = 20;
  scenario.torque_noise = 0.01;
  for (JointFit& joint : scenario.plant.joints) joint.rated_torque = rated;
  measure(scenario, {}, log);
  log.dq.resize(0, 0);
  log.ddq.resize(0, 0);
  const FilterFit filter = choose_filter({log}, {});
  return process(std::move(log), filter);
}

/// The model as `identify` comes to it, but for the choice of effects.
IdentifiedModel identified(const Project& project, const IdentifiedModel& plant,
                           const std::vector<ProcessedLog>& logs) {
  std::vector<JointFit> design = plant.joints;
  for (JointFit& joint : design) joint.sign_width *= 1.2;  // is found
  Fitter fitter(plant.robot, logs, design);
  weigh(fitter, project.identify);
  fitter.polish();
  weigh(fitter, project.identify);
  IdentifiedModel model = fitter.to_model(fitter.fit());
  model.filter = logs.front().filter;
  return model;
}

struct Joints {
  std::size_t inside = 0, all = 0;
};

/// Joints of one robot whose true numbers lie in their set.
Joints judged(std::uint64_t seed) {
  const IdentifiedModel plant = drawn_robot(seed);
  const std::vector<ProcessedLog> logs{recorded(plant, seed)};
  Project project;
  project.robot = plant.robot;
  const IdentifiedModel model = identified(project, plant, logs);
  const std::vector<JointRange> ranges = joint_ranges(project, model, logs);
  Joints out;
  for (std::size_t j = 0; j < ranges.size(); ++j) {
    const auto true_number = [&](const char* effect) {
      const EffectFit* fit = plant.joints[j].find(effect);
      return fit == nullptr ? 0.0 : fit->linear[0];
    };
    const Eigen::Vector3d truth(true_number("viscous"), true_number("coulomb"), true_number("rotor_inertia"));
    const Eigen::Index numbers = truth[2] > 0 ? 3 : 2;
    const Eigen::VectorXd off = (ranges[j].mean - truth).head(numbers);
    const Eigen::MatrixXd known = ranges[j].covariance.topLeftCorner(numbers, numbers);
    const double distance = off.dot(known.ldlt().solve(off));
    out.inside += distance <= squared_radius_90(static_cast<std::size_t>(numbers), ranges[j].freedom) ? 1 : 0;
    ++out.all;
  }
  return out;
}

}  // namespace
}  // namespace fxdyn

int main(int argc, char** argv) {
  CLI::App app("How often the 90 % sets of a joint's numbers hold the true ones.");
  std::size_t robots = 1000;
  std::uint64_t seed = 13000;
  double lowest = 0.88, highest = 0.92;
  app.add_option("--robots", robots, "as many are drawn");
  app.add_option("--seed", seed, "of the first; 1000 .. 1999 and 10000 .. 12999 chose how the sets are made");
  app.add_option("--lowest", lowest, "share of the joints, at least");
  app.add_option("--highest", highest, "share of the joints, at most");
  CLI11_PARSE(app, argc, argv);
  std::vector<fxdyn::Joints> by_robot(robots);
  fxdyn::parallel_for(robots, [&](std::size_t i) { by_robot[i] = fxdyn::judged(seed + i); });
  fxdyn::Joints sum;
  std::array<fxdyn::Joints, 2> by_size;
  for (const fxdyn::Joints& one : by_robot) {
    for (fxdyn::Joints* of : {&sum, &by_size[one.all - 1]}) {
      of->inside += one.inside;
      of->all += one.all;
    }
  }
  const auto share = [](const fxdyn::Joints& of) {
    return static_cast<double>(of.inside) / static_cast<double>(of.all);
  };
  fmt::print("{} robots: {} of {} joints in their 90 % set, {:.3f} (one joint {:.3f}, two joints {:.3f})\n", robots,
             sum.inside, sum.all, share(sum), share(by_size[0]), share(by_size[1]));
  return share(sum) >= lowest && share(sum) <= highest ? 0 : 1;
}
