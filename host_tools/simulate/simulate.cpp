#include "host_tools/simulate/simulate.hpp"

#include <nlohmann/json.hpp>

#include <cmath>
#include <numbers>

#include "host_tools/excite/fourier.hpp"
#include "host_tools/files.hpp"
#include "host_tools/log/log.hpp"
#include "host_tools/model/effects.hpp"
#include "host_tools/model/evaluator.hpp"
#include "host_tools/random.hpp"
#include "host_tools/toml.hpp"

namespace fxdyn {
namespace {

namespace fs = std::filesystem;
using toml_input::Table;
using toml_input::Value;

/// Friction states are stepped this much finer than the log is sampled.
constexpr int substeps = 4;

struct ScenarioLog {
  std::string name;
  double duration_s = 10, period_s = 10, speed = 1;
  int order = 5;
  std::uint64_t seed = 0;
};

struct Scenario {
  IdentifiedModel plant;
  std::vector<FourierBounds> bounds;
  double sample_s = 0.002;
  int encoder_bits = 0;  ///< per turn of the joint, or per metre; 0: exact
  int link_encoder_bits = 0;
  std::vector<bool> link_encoder;  ///< which joints have one; empty: none
  double torque_noise = 0;         ///< white, share of rated torque
  bool exact_motion = false;       ///< logs carry exact q, dq, ddq
  std::uint64_t seed = 1;
  std::vector<ScenarioLog> logs;
};

void read_effect(Table table, Scenario& scenario) {
  toml_input::Names known;
  for (const std::string_view effect : effect_names()) known.emplace_back(effect);
  EffectFit fit;
  const Value name = table.need("name", "one of the catalogue, see `fxdyn effects`");
  fit.effect = name.name(known, "effect");
  fit.named = true;
  const EffectInfo& info = *find_effect(fit.effect);
  JointFit* target = nullptr;  // an effect on the body has no joint
  if (info.acts_on == ActsOn::body) {
    if (const auto joint = table.find("joint"))
      joint->place().fail(fmt::format("{} acts on the robot as a whole: remove joint", fit.effect));
  }
  if (info.acts_on != ActsOn::body) {
    const Value joint_value = table.need("joint", "1 for the first moving joint");
    const auto joint = static_cast<std::size_t>(joint_value.integer(1));
    if (joint > scenario.plant.robot.size()) {
      joint_value.place().fail(fmt::format("the robot has {} joints", scenario.plant.robot.size()));
    }
    target = &scenario.plant.joints[joint - 1];
    if (target->find(fit.effect) != nullptr)
      joint_value.place().fail(fmt::format("joint {} has {} already", joint, fit.effect));
  }
  Table parameters(table.need("parameters", "as in { amplitude = 2.0 }"));
  const auto read = [&](const ParameterInfo& parameter) {
    const Value value = parameters.need(std::string(parameter.name), fmt::format("in {}", parameter.unit));
    const double number = value.number();
    if (number < parameter.lower || number > parameter.upper) {
      value.place().fail(fmt::format("expected {} .. {} {}", parameter.lower, parameter.upper, parameter.unit));
    }
    return number;
  };
  for (const ParameterInfo& parameter : info.shape) fit.shape.push_back(read(parameter));
  for (const ParameterInfo& parameter : info.linear) fit.linear.push_back(read(parameter));
  if (fit.effect == "coulomb") {
    if (const auto width = parameters.find("width")) target->sign_width = width->positive();
  }
  parameters.finish();
  table.finish();
  (target != nullptr ? target->effects : scenario.plant.body).push_back(fit);
}

ScenarioLog read_scenario_log(Table table) {
  ScenarioLog log;
  log.name = table.need("name", "the log's file name without .csv").string();
  log.duration_s = table.need("duration_s", "seconds").positive();
  toml_input::set(log.period_s, table.find("period_s"), toml_input::as_positive);
  toml_input::set(log.speed, table.find("speed"), toml_input::as_positive);
  if (const auto order = table.find("order")) log.order = order->count(3);
  log.seed = static_cast<std::uint64_t>(table.need("seed", "another one gives another trajectory").integer(0));
  table.finish();
  return log;
}

void read_link_encoders(Table& sensors, Scenario& scenario) {
  const std::size_t n = scenario.plant.robot.size();
  scenario.link_encoder_bits = scenario.encoder_bits;
  if (const auto bits = sensors.find("link_encoder_bits")) {
    scenario.link_encoder_bits = bits->count(0);
    scenario.link_encoder.assign(n, true);
  }
  const auto which = sensors.find("link_encoders");
  if (!which) return;
  scenario.link_encoder.assign(n, which->is_string());
  if (which->is_string()) {
    which->name({"all"}, "choice of joints");
    return;
  }
  for (const Value& item : which->items()) {
    const auto joint = static_cast<std::size_t>(item.integer(1));
    if (joint > n) item.place().fail(fmt::format("the robot has {} joints", n));
    scenario.link_encoder[joint - 1] = true;
  }
}

Scenario read_scenario(const fs::path& file) {
  const toml::table root_table = toml_input::parse(file);
  Table root({file.string(), "", 1}, root_table);
  Scenario scenario;
  IdentifiedModel& plant = scenario.plant;
  {
    Table table(root.need("robot", "add [robot] with urdf = \"...\""));
    const Value urdf = table.need("urdf", "a URDF with inertias");
    plant.robot = read_urdf(file.parent_path() / urdf.string());
    if (const auto gravity = table.find("gravity")) {
      const auto g = gravity->numbers(3, "x, y, z");
      plant.robot.gravity = {g[0], g[1], g[2]};
    }
    const std::size_t n = plant.robot.size();
    const DhChain chain = to_dh(plant.robot);
    plant.joints.resize(n);
    const auto rated = table.need("rated_torque", "noise is a share of it").positives(n, "one a joint");
    const auto acceleration = table.need("acceleration", "limit of the motion").positives(n, "one a joint");
    for (std::size_t j = 0; j < n; ++j) {
      const Joint& joint = plant.robot.joints[j];
      if (!joint.inertial) urdf.place().fail(fmt::format("link {} has no <inertial>: a plant needs one", joint.link));
      if (!joint.limits) urdf.place().fail(fmt::format("joint {} has no <limit>: the motion needs it", joint.name));
      plant.inertia.push_back(to_link_inertia(*joint.inertial, chain.urdf_in_dh[j]));
      plant.joints[j].rated_torque = rated[j];
      const bool turns = joint.continuous || !(joint.limits->upper > joint.limits->lower);
      scenario.bounds.push_back({turns ? -std::numbers::pi : joint.limits->lower,
                                 turns ? std::numbers::pi : joint.limits->upper, joint.limits->velocity,
                                 acceleration[j]});
    }
    table.finish();
  }
  scenario.seed = static_cast<std::uint64_t>(root.need("seed", "noise is drawn from it").integer(0));
  if (auto table = root.table("sensors")) {
    toml_input::set(scenario.sample_s, table->find("sample_s"), toml_input::as_positive);
    if (const auto bits = table->find("encoder_bits")) scenario.encoder_bits = bits->count(0);
    toml_input::set(scenario.torque_noise, table->find("torque_noise"), toml_input::as_number);
    toml_input::set(scenario.exact_motion, table->find("exact_motion"), toml_input::as_boolean);
    read_link_encoders(*table, scenario);
    table->finish();
  }
  if (const auto plant_kind = root.find("plant")) plant_kind->name({"internal"}, "plant");
  const auto effects = root.find("effect"), logs = root.find("log");
  root.finish();
  if (effects) {
    for (const Value& value : effects->items()) read_effect(Table(value), scenario);
  }
  if (!logs) throw InputError(file.string() + ": no log to simulate; add a [[log]] with name, duration_s and seed");
  for (const Value& value : logs->items()) scenario.logs.push_back(read_scenario_log(Table(value)));
  return scenario;
}

struct Motion {
  Eigen::MatrixXd q, dq, ddq;
};

Motion play(const Scenario& scenario, const ScenarioLog& log, double step_s, Eigen::Index samples) {
  const std::size_t n = scenario.bounds.size();
  const auto cols = static_cast<Eigen::Index>(n);
  Motion motion{Eigen::MatrixXd(samples, cols), Eigen::MatrixXd(samples, cols), Eigen::MatrixXd(samples, cols)};
  for (std::size_t j = 0; j < n; ++j) {
    const FourierJoint joint =
        random_fourier(log.seed * 1000 + j, log.order, log.period_s, scenario.bounds[j], log.speed);
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

Eigen::MatrixXd every(const Eigen::MatrixXd& m, int stride) {
  return m(Eigen::seq(0, m.rows() - 1, stride), Eigen::all);
}

fs::path simulate_log(const Scenario& scenario, std::size_t index, const fs::path& directory) {
  const ScenarioLog& spec = scenario.logs[index];
  const auto samples = static_cast<Eigen::Index>(std::llround(spec.duration_s / scenario.sample_s));
  const double fine = scenario.sample_s / substeps;
  const Motion motion = play(scenario, spec, fine, samples * substeps);
  Eigen::MatrixXd deflections;
  const Eigen::MatrixXd truth =
      every(predict(scenario.plant, motion.q, motion.dq, motion.ddq, fine, &deflections), substeps);

  Log log;
  log.t = Eigen::VectorXd::LinSpaced(samples, 0, scenario.sample_s * static_cast<double>(samples - 1));
  log.q = every(motion.q, substeps);
  if (scenario.exact_motion) {
    log.dq = every(motion.dq, substeps);
    log.ddq = every(motion.ddq, substeps);
  }
  log.tau = truth;
  if (!scenario.link_encoder.empty()) log.qlink = log.q - every(deflections, substeps);
  Random noise(scenario.seed * 7919 + spec.seed);
  for (Eigen::Index j = 0; j < truth.cols(); ++j) {
    const auto& joint = scenario.plant.robot.joints[static_cast<std::size_t>(j)];
    const auto encode = [&](auto&& column, int bits) {
      if (bits == 0) return;
      const double unit = joint.type == JointType::revolute ? 2 * std::numbers::pi : 1.0;
      const double step = unit / std::ldexp(1.0, bits);
      column = ((column / step).array().round() * step).matrix().eval();
    };
    encode(log.q.col(j), scenario.encoder_bits);
    if (!scenario.link_encoder.empty()) {
      encode(log.qlink.col(j), scenario.link_encoder_bits);
      if (!scenario.link_encoder[static_cast<std::size_t>(j)]) log.qlink.col(j).setConstant(std::nan(""));
    }
    const double sigma = scenario.torque_noise * scenario.plant.joints[static_cast<std::size_t>(j)].rated_torque;
    for (Eigen::Index k = 0; k < samples; ++k) log.tau(k, j) += sigma * noise.normal();
  }
  const fs::path file = directory / (spec.name + ".csv");
  Log clean;
  clean.t = log.t;
  clean.tau = truth;
  write_log(directory / (spec.name + ".truth.csv"), clean);
  write_log(file, log);
  return file;
}

}  // namespace

std::string scenario_hash(const fs::path& scenario) {
  const toml::table root = toml_input::parse(scenario);
  const auto urdf = root["robot"]["urdf"].value<std::string>();
  const fs::path robot = scenario.parent_path() / urdf.value_or("");
  return hash_of(read_file(scenario) + (fs::is_regular_file(robot) ? read_file(robot) : ""));
}

std::vector<fs::path> simulate(const fs::path& scenario_file, const fs::path& directory) {
  const Scenario scenario = read_scenario(scenario_file);
  fs::create_directories(directory);
  write_file(directory / "truth.json", to_json(scenario.plant).dump(1) + "\n");
  std::vector<fs::path> files;
  for (std::size_t i = 0; i < scenario.logs.size(); ++i) files.push_back(simulate_log(scenario, i, directory));
  return files;
}

}  // namespace fxdyn
