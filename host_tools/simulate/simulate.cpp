#include "host_tools/simulate/simulate.hpp"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "host_tools/effects/effects.hpp"
#include "host_tools/effects/evaluator.hpp"
#include "host_tools/effects/identified_model.hpp"
#include "host_tools/signals/filter.hpp"
#include "host_tools/signals/fourier.hpp"
#include "host_tools/simulate/closed_loop.hpp"
#include "host_tools/simulate/lugre_plant.hpp"
#include "host_tools/simulate/mujoco_plant.hpp"
#include "host_tools/simulate/scenario.hpp"
#include "host_tools/simulate/sensors.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/files.hpp"
#include "host_tools/support/toml.hpp"

namespace fxdyn {
namespace {

namespace fs = std::filesystem;

Reference play(const Scenario& scenario, const ScenarioLog& log, double step_s, Eigen::Index samples) {
  const std::size_t n = scenario.bounds.size();
  const auto cols = static_cast<Eigen::Index>(n);
  Reference motion{step_s, Eigen::MatrixXd(samples, cols), Eigen::MatrixXd(samples, cols),
                   Eigen::MatrixXd(samples, cols), Eigen::MatrixXd()};
  for (std::size_t j = 0; j < n; ++j) {
    FourierJoint joint =
        log.series.empty() ? random_fourier(log.seed * 1000 + j, log.order, log.period_s, scenario.bounds[j], log.speed)
                           : log.series[j];
    joint.a *= log.amplitude;
    joint.b *= log.amplitude;
    const auto col = static_cast<Eigen::Index>(j);
    for (Eigen::Index k = 0; k < samples; ++k) {
      const FourierState state = evaluate(joint, log.period_s, step_s * static_cast<double>(k));
      motion.q(k, col) = state.q;
      motion.dq(k, col) = state.dq;
      motion.ddq(k, col) = state.ddq;
    }
  }
  return motion;
}

/// What a controller knows: the rigid body and its rotors, not what a session hides.
IdentifiedModel nominal(IdentifiedModel plant) {
  plant.body.clear();
  for (JointFit& joint : plant.joints)
    std::erase_if(joint.effects, [](const EffectFit& fit) { return !in_base(fit.effect); });
  return plant;
}

bool bends(const IdentifiedModel& plant) {
  for (const JointFit& joint : plant.joints) {
    if (std::any_of(joint.effects.begin(), joint.effects.end(),
                    [](const EffectFit& fit) { return find_effect(fit.effect)->bends(); }))
      return true;
  }
  return false;
}

PlantRun closed_loop(const Scenario& scenario, Reference reference, double age_s, int hold) {
  if (scenario.control.feedforward) {
    reference.feedforward =
        predict(nominal(scenario.plant), reference.q, reference.dq, reference.ddq, reference.step_s);
  }
  ClosedLoopSettings settings;
  settings.bandwidth_hz = scenario.control.bandwidth_hz;
  settings.substeps = 1;
  settings.hold = hold;
  settings.age_s = age_s;
  if (scenario.plant_kind == Scenario::Plant::mujoco) return closed_loop_on_mujoco(scenario.plant, reference, settings);
  ClosedLoopRun run = run_closed_loop(scenario.plant, reference, settings);
  if (bends(scenario.plant)) {
    // The torque's steps from tick to tick would bend the gears at once, as no gear does: their edges are taken off.
    // The same filter on all three keeps them derivatives of one motion.
    const ZeroPhaseFilter filter(4 * scenario.control.bandwidth_hz, reference.step_s);
    for (Eigen::MatrixXd* signal : {&run.q, &run.dq, &run.ddq}) *signal = filter.apply(*signal);
  }
  return {{std::move(run.q), std::move(run.dq), std::move(run.ddq)}, reference.step_s, {}, {}};
}

/// The torque of the very motion that the log shows, however the plant came to it. LuGre friction has code of its own.
void add_torque(const Scenario& scenario, double start_s, PlantRun& run) {
  IdentifiedModel plant = scenario.plant;
  take_out_lugre(plant.joints);
  run.tau = predict(plant, run.q, run.dq, run.ddq, run.step_s, &run.deflections, start_s);
  if (has_lugre(scenario.plant)) run.tau += lugre_torque(scenario.plant, run.dq, run.step_s);
}

PlantRun run_plant(const Scenario& scenario, const ScenarioLog& log, double length_s) {
  const bool controlled = scenario.motion == Scenario::Motion::closed_loop;
  const double step_s = plant_step(scenario);
  const int hold = controlled ? static_cast<int>(std::lround(scenario.control.tick_s / step_s)) : 1;
  const auto samples = static_cast<Eigen::Index>(std::ceil(length_s / step_s - 1e-9));
  Reference motion = play(scenario, log, step_s, samples);
  const bool mujoco = scenario.plant_kind == Scenario::Plant::mujoco;
  if (mujoco && !controlled) return prescribed_on_mujoco(scenario.plant, motion, log.start_s);
  PlantRun run;
  if (controlled) {
    run = closed_loop(scenario, std::move(motion), log.start_s, hold);
  } else {
    run = {{std::move(motion.q), std::move(motion.dq), std::move(motion.ddq)}, step_s, {}, {}};
  }
  if (mujoco) return run;
  add_torque(scenario, log.start_s, run);
  return run;
}

struct Simulated {
  std::string name;
  Log log, clean;
};

Simulated simulate_log(const Scenario& scenario, const ScenarioLog& spec) {
  const Eigen::VectorXd times = sampling_times(scenario, spec);
  const PlantRun run = run_plant(scenario, spec, scenario.sample_s * static_cast<double>(times.size()));
  Log log = sampled(scenario, run, times);
  log.t.array() += scenario.start_s + spec.start_s;
  Log clean;
  clean.t = log.t;
  clean.tau = log.tau;
  measure(scenario, spec, log);
  return {spec.name, std::move(log), std::move(clean)};
}

}  // namespace

std::string scenario_hash(const fs::path& scenario) {
  const toml::table root = toml_input::parse(scenario);
  const auto urdf = root["robot"]["urdf"].value<std::string>();
  const fs::path robot = scenario.parent_path() / urdf.value_or("");
  std::string all = read_file(scenario) + (fs::is_regular_file(robot) ? read_file(robot) : "");
  if (const toml::array* logs = root["log"].as_array()) {
    for (const toml::node& log : *logs) {
      const toml::table* table = log.as_table();
      const auto plan = table != nullptr ? (*table)["plan"].value<std::string>() : std::nullopt;
      if (plan && fs::is_regular_file(scenario.parent_path() / *plan)) all += read_file(scenario.parent_path() / *plan);
    }
  }
  return hash_of(all);
}

std::vector<fs::path> simulate(const fs::path& scenario_file, const fs::path& directory) {
  const Scenario scenario = read_scenario(scenario_file);
  // All of it before any of it is written: a robot that runs away in the last log leaves nothing half done.
  std::vector<Simulated> all;
  for (const ScenarioLog& spec : scenario.logs) {
    try {
      all.push_back(simulate_log(scenario, spec));
    } catch (const RunsAway& error) {
      throw DataError(fmt::format("{}: log \"{}\": {}; lower [control] bandwidth_hz or the motion's speed",
                                  scenario_file.string(), spec.name, error.what()));
    }
  }
  fs::create_directories(directory);
  write_file(directory / "truth.json", to_json(scenario.plant).dump(1) + "\n");
  std::vector<fs::path> files;
  for (const Simulated& one : all) {
    write_log(directory / (one.name + ".truth.csv"), one.clean);
    files.push_back(directory / (one.name + ".csv"));
    write_log(files.back(), one.log);
  }
  return files;
}

}  // namespace fxdyn
