#include "host_tools/simulate/scenario.hpp"

#include <cmath>
#include <numbers>

#include "host_tools/model/effects.hpp"
#include "host_tools/simulate/mujoco_plant.hpp"
#include "host_tools/toml.hpp"

namespace fxdyn {
namespace {

namespace fs = std::filesystem;
using toml_input::Table;
using toml_input::Value;

double not_negative(const Value& value) {
  const double number = value.number();
  if (number < 0) value.place().fail("expected a number of at least 0");
  return number;
}

/// A share in [0, 1).
double share(const Value& value) {
  const double number = value.number();
  if (!(number >= 0 && number < 1)) value.place().fail("expected a number of at least 0 and below 1");
  return number;
}

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
    const bool several = fit.effect == Ripple::name || fit.effect == JointCoupling::name;
    if (!several && target->find(fit.effect) != nullptr)
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
  if (info.needs_peers) {
    const Value other = parameters.need("joint", "the other joint");
    const double n = static_cast<double>(scenario.plant.robot.size());
    if (fit.shape[0] != std::floor(fit.shape[0]) || fit.shape[0] > n ||
        target == &scenario.plant.joints[static_cast<std::size_t>(fit.shape[0]) - 1]) {
      other.place().fail(fmt::format("expected another joint of 1 .. {}", n));
    }
  }
  parameters.finish();
  table.finish();
  (target != nullptr ? target->effects : scenario.plant.body).push_back(fit);
}

/// What the plant can't show with this kind of motion.
void check_plant(const Value& effects, const Scenario& scenario) {
  const bool mujoco = scenario.plant_kind == Scenario::Plant::mujoco;
  const double longest = Delay::largest * plant_step(scenario) * (1 + 1e-9);
  for (const Value& value : effects.items()) {
    Table table(value);
    const auto joint = table.find("joint");
    if (!joint) continue;
    const JointFit& fit = scenario.plant.joints[static_cast<std::size_t>(joint->integer(1)) - 1];
    const EffectFit& effect = *fit.find(table.need("name", "").string());
    if (!mujoco && effect.effect == Delay::name && effect.shape[0] > longest) {
      value.place().fail(
          fmt::format("this plant's step of {} s leaves room for a delay of {:.4g} s at most; plant = "
                      "\"mujoco\" takes any",
                      plant_step(scenario), longest));
    }
    if (!mujoco) continue;
    if (const auto why = mujoco_refuses(fit, effect, scenario.motion == Scenario::Motion::closed_loop))
      value.place().fail(*why);
  }
}

ScenarioLog read_scenario_log(Table table) {
  ScenarioLog log;
  log.name = table.need("name", "the log's file name without .csv").string();
  log.duration_s = table.need("duration_s", "seconds").positive();
  toml_input::set(log.period_s, table.find("period_s"), toml_input::as_positive);
  toml_input::set(log.speed, table.find("speed"), toml_input::as_positive);
  if (const auto order = table.find("order")) log.order = order->count(3);
  log.seed = static_cast<std::uint64_t>(table.need("seed", "another one gives another trajectory").integer(0));
  toml_input::set(log.start_s, table.find("start_s"), not_negative);
  if (const auto amplitude = table.find("amplitude")) {
    log.amplitude = amplitude->positive();
    if (log.amplitude > 1) amplitude->place().fail("expected at most 1: a share of what the limits allow");
  }
  table.finish();
  return log;
}

/// The last log beside the others and the sensors.
void check_log(const Value& value, const Scenario& scenario) {
  const ScenarioLog& log = scenario.logs.back();
  if (log.name.empty() || log.name.find('/') != std::string::npos)
    value.place().fail(fmt::format("log \"{}\": expected the name of a file, without a folder and .csv", log.name));
  for (std::size_t i = 0; i + 1 < scenario.logs.size(); ++i) {
    if (scenario.logs[i].name == log.name)
      value.place().fail(fmt::format("log \"{}\" is there already; give each log a name of its own", log.name));
  }
  if (log.duration_s < 2 * scenario.sample_s)
    value.place().fail(fmt::format("log \"{}\": {:g} s are less than two samples of {:g} s", log.name, log.duration_s,
                                   scenario.sample_s));
}

ScenarioControl read_control(Table table) {
  ScenarioControl control;
  toml_input::set(control.bandwidth_hz, table.find("bandwidth_hz"), toml_input::as_positive);
  toml_input::set(control.feedforward, table.find("feedforward"), toml_input::as_boolean);
  toml_input::set(control.tick_s, table.find("tick_s"), toml_input::as_positive);
  table.finish();
  // A discrete loop needs some ticks within its own time.
  if (control.bandwidth_hz * control.tick_s > 0.05) {
    table.place().fail(fmt::format("a loop of {} Hz needs ticks of at most {:.3g} s", control.bandwidth_hz,
                                   0.05 / control.bandwidth_hz));
  }
  return control;
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

/// The largest delay that the plant has to remember [s].
double longest_delay(const IdentifiedModel& plant) {
  double longest = 0;
  for (const JointFit& joint : plant.joints) {
    if (const EffectFit* delay = joint.find(Delay::name)) longest = std::max(longest, delay->shape[0]);
  }
  return longest;
}

/// The plant is what identify or diagnose made of a robot.
void read_model_plant(const Value& name, const fs::path& directory, Scenario& scenario) {
  IdentifiedModel& plant = scenario.plant;
  plant = read_model(directory / name.string());
  plant.filter.torque_lead_s = 0;
  plant.session.reset();
  for (const JointFit& joint : plant.joints)
    scenario.bounds.push_back({joint.q_lower, joint.q_upper, joint.dq_limit, joint.ddq_limit});
}

void read_robot(Table& root, const fs::path& file, Scenario& scenario) {
  IdentifiedModel& plant = scenario.plant;
  Table table(root.need("robot", "add [robot] with urdf = \"...\" or model = \"...\""));
  if (const auto model = table.find("model")) {
    if (const auto urdf = table.find("urdf")) urdf->place().fail("model has the robot already: remove one of them");
    read_model_plant(*model, file.parent_path(), scenario);
    table.finish();
    return;
  }
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

}  // namespace

double plant_step(const Scenario& scenario) {
  constexpr double longest_step = 0.0005;  // under a controller
  constexpr int substeps = 4;              // of a sample: friction states are stepped so
  double step = scenario.sample_s / substeps;
  if (scenario.motion == Scenario::Motion::closed_loop) {
    const double tick = scenario.control.tick_s;
    return tick / std::max(1.0, std::ceil(tick / std::min(step, longest_step) - 1e-9));
  }
  const double remembered = longest_delay(scenario.plant) / (Delay::largest * (1 + 1e-9));
  // Stamps off the grid are interpolated, which wants a finer one.
  for (int finer = 0; finer < 2 && scenario.jitter > 0 && step / 2 >= remembered; ++finer) step /= 2;
  while (step < remembered && step < scenario.sample_s * 0.9) step *= 2;
  return step;
}

Scenario read_scenario(const fs::path& file) {
  const toml::table root_table = toml_input::parse(file);
  Table root({file.string(), "", 1}, root_table);
  Scenario scenario;
  read_robot(root, file, scenario);
  scenario.seed = static_cast<std::uint64_t>(root.need("seed", "noise is drawn from it").integer(0));
  if (auto table = root.table("sensors")) {
    toml_input::set(scenario.sample_s, table->find("sample_s"), toml_input::as_positive);
    if (const auto bits = table->find("encoder_bits")) scenario.encoder_bits = bits->count(0);
    toml_input::set(scenario.torque_noise, table->find("torque_noise"), not_negative);
    toml_input::set(scenario.ar_noise, table->find("ar_noise"), not_negative);
    toml_input::set(scenario.ar_pole, table->find("ar_pole"), share);
    toml_input::set(scenario.jitter, table->find("jitter"), share);
    toml_input::set(scenario.start_s, table->find("start_s"), toml_input::as_number);
    toml_input::set(scenario.exact_motion, table->find("exact_motion"), toml_input::as_boolean);
    read_link_encoders(*table, scenario);
    table->finish();
  }
  if (const auto kind = root.find("plant")) {
    if (kind->name({"internal", "mujoco"}, "plant") == "mujoco") scenario.plant_kind = Scenario::Plant::mujoco;
    if (scenario.plant_kind == Scenario::Plant::mujoco && !scenario.plant.base.empty())
      kind->place().fail("MuJoCo needs the inertia of every body, a model has base parameters: use urdf");
  }
  if (const auto motion = root.find("motion")) {
    if (motion->name({"prescribed", "closed_loop"}, "motion") == "closed_loop")
      scenario.motion = Scenario::Motion::closed_loop;
  }
  const auto control = root.table("control");
  if (control && scenario.motion == Scenario::Motion::prescribed)
    control->place().fail("serves motion = \"closed_loop\" only; set that or remove [control]");
  if (control) scenario.control = read_control(*control);
  const auto effects = root.find("effect"), logs = root.find("log");
  root.finish();
  if (effects) {
    for (const Value& value : effects->items()) read_effect(Table(value), scenario);
    check_plant(*effects, scenario);
  }
  if (!logs) throw InputError(file.string() + ": no log to simulate; add a [[log]] with name, duration_s and seed");
  for (const Value& value : logs->items()) {
    scenario.logs.push_back(read_scenario_log(Table(value)));
    check_log(value, scenario);
  }
  return scenario;
}

}  // namespace fxdyn
