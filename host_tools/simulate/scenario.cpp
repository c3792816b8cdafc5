#include "host_tools/simulate/scenario.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "host_tools/effects/braking.hpp"
#include "host_tools/effects/effects.hpp"
#include "host_tools/effects/identified_model.hpp"
#include "host_tools/signals/planned_series.hpp"
#include "host_tools/simulate/mujoco_plant.hpp"
#include "host_tools/support/files.hpp"
#include "host_tools/support/toml.hpp"

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

/// Indices of the joints that an effect names: one, a list, or "all".
std::vector<std::size_t> joints_of(const Value& value, const Scenario& scenario) {
  const std::size_t n = scenario.plant.robot.size();
  std::vector<std::size_t> joints;
  const auto add = [&](const Value& item) {
    const auto joint = static_cast<std::size_t>(item.integer(1));
    if (joint > n) item.place().fail(fmt::format("the robot has {} joints", n));
    joints.push_back(joint - 1);
  };
  if (value.is_string()) {
    value.name({"all"}, "choice of joints");
    for (std::size_t j = 0; j < n; ++j) joints.push_back(j);
  } else if (value.is_list()) {
    for (const Value& item : value.items()) add(item);
  } else {
    add(value);
  }
  return joints;
}

/// A number within the parameter's bounds.
double bounded(const Value& value, const ParameterInfo& parameter) {
  const double number = value.number();
  if (number < parameter.lower || number > parameter.upper)
    value.place().fail(fmt::format("expected {} .. {} {}", parameter.lower, parameter.upper, parameter.unit));
  return number;
}

/// One number for all of `count` joints, or a list with one for each.
Value of_joint(const Value& value, std::size_t at, std::size_t count) {
  if (!value.is_list()) return value;
  const std::vector<Value> items = value.items();
  value.expect(items.size(), count, "one a joint of this effect");
  return items[at];
}

void read_effect(Table table, Scenario& scenario) {
  toml_input::Names known;
  for (const std::string_view effect : effect_names()) known.emplace_back(effect);
  EffectFit fit;
  const Value name = table.need("name", "one of the catalogue, see `fxdyn effects`");
  fit.effect = name.name(known, "effect");
  fit.named = true;
  const EffectInfo& info = *find_effect(fit.effect);
  std::vector<std::size_t> joints;
  const bool on_body = info.acts_on == ActsOn::body;
  if (on_body) {
    if (const auto joint = table.find("joint"))
      joint->place().fail(fmt::format("{} acts on the robot as a whole: remove joint", fit.effect));
  } else {
    const Value value = table.need("joint", "1 for the first moving joint, a list, or \"all\"");
    joints = joints_of(value, scenario);
    for (std::size_t at = 0; at < joints.size(); ++at) {
      const bool twice = std::find(joints.begin(), joints.begin() + static_cast<std::ptrdiff_t>(at), joints[at]) !=
                         joints.begin() + static_cast<std::ptrdiff_t>(at);
      if (twice || (!info.several && scenario.plant.joints[joints[at]].find(fit.effect) != nullptr))
        value.place().fail(fmt::format("joint {} has {} already", joints[at] + 1, fit.effect));
    }
  }
  Table parameters(table.need("parameters", "as in { amplitude = 2.0 }"));
  const auto need = [&](const ParameterInfo& parameter) {
    return parameters.need(std::string(parameter.name), fmt::format("in {}", parameter.unit));
  };
  const auto width = info.has_sign_width ? parameters.find("width") : std::nullopt;
  const std::size_t count = on_body ? 1 : joints.size();
  for (std::size_t at = 0; at < count; ++at) {
    EffectFit one = fit;
    for (const ParameterInfo& parameter : info.shape)
      one.shape.push_back(bounded(of_joint(need(parameter), at, count), parameter));
    for (const ParameterInfo& parameter : info.linear)
      one.linear.push_back(bounded(of_joint(need(parameter), at, count), parameter));
    if (on_body) {
      scenario.plant.body.push_back(one);
      continue;
    }
    JointFit& target = scenario.plant.joints[joints[at]];
    if (width) target.sign_width = of_joint(*width, at, count).positive();
    if (info.needs_peers) {
      const double n = static_cast<double>(scenario.plant.robot.size()), other = one.shape[0];
      if (other != std::floor(other) || other > n || static_cast<std::size_t>(other) == joints[at] + 1)
        parameters.need("joint", "").place().fail(fmt::format("expected another joint of 1 .. {}", n));
    }
    target.effects.push_back(one);
  }
  parameters.finish();
  table.finish();
}

/// The longest time [s] that an effect remembers where it steps every `step_s`; 0: any, or none at all.
double longest_memory(const EffectInfo& info, double step_s) { return info.most_ticks * step_s * (1 + 1e-9); }

/// What the plant can't show with this kind of motion.
void check_plant(const Value& effects, const Scenario& scenario) {
  const bool mujoco = scenario.plant_kind == Scenario::Plant::mujoco;
  for (const Value& value : effects.items()) {
    Table table(value);
    const auto joint = table.find("joint");
    if (!joint) continue;
    for (const std::size_t j : joints_of(*joint, scenario)) {
      const JointFit& fit = scenario.plant.joints[j];
      const EffectFit& effect = *fit.find(table.need("name", "").string());
      if (find_effect(effect.effect)->brakes.given) {
        if (const auto why = why_it_does_not_brake(fit, scenario.bounds[j].velocity)) value.place().fail(*why);
      }
      const double longest = longest_memory(*find_effect(effect.effect), plant_step(scenario));
      if (!mujoco && longest > 0 && effect.shape[0] > longest) {
        value.place().fail(
            fmt::format("this plant's step of {} s leaves room for a {} of {:.4g} s at most; plant = "
                        "\"mujoco\" takes any",
                        plant_step(scenario), effect.effect, longest));
      }
      if (!mujoco) continue;
      if (const auto why = mujoco_refuses(fit, effect, scenario.motion == Scenario::Motion::closed_loop))
        value.place().fail(*why);
    }
  }
}

/// A trajectory of an excite.json, for this robot.
void read_plan(const Value& file, const Value& name, const fs::path& directory, const Scenario& scenario,
               ScenarioLog& log) {
  const fs::path path = directory / file.string();
  if (!fs::is_regular_file(path)) file.place().fail(fmt::format("no file {}: make one by fxdyn excite", path.string()));
  std::vector<PlannedSeries> plan;
  try {
    plan = read_planned_series(path);
  } catch (const InputError& error) {
    file.place().fail(error.what());
  }
  std::string known;
  for (PlannedSeries& one : plan) {
    known += " " + one.name;
    if (one.name != name.string()) continue;
    if (one.joints.empty()) name.place().fail(fmt::format("'{}' is a walk through poses, without a series", one.name));
    if (one.joints.size() != scenario.plant.robot.size())
      file.place().fail(fmt::format("{} is of a robot with {} joints", path.string(), one.joints.size()));
    log.period_s = one.period_s;
    log.series = std::move(one.joints);
    return;
  }
  name.place().fail(fmt::format("'{}' is not in {} (there:{})", name.string(), path.string(), known));
}

ScenarioLog read_scenario_log(Table table, const fs::path& directory, const Scenario& scenario) {
  ScenarioLog log;
  log.name = table.need("name", "the log's file name without .csv").string();
  log.duration_s = table.need("duration_s", "seconds").positive();
  toml_input::set(log.period_s, table.find("period_s"), toml_input::as_positive);
  toml_input::set(log.speed, table.find("speed"), toml_input::as_positive);
  if (const auto order = table.find("order")) log.order = order->count(3);
  if (const auto plan = table.find("plan")) {
    read_plan(*plan, table.need("trajectory", "the name of one in the plan"), directory, scenario, log);
    for (const char* key : {"period_s", "speed", "order"}) {
      if (const auto other = table.find(key)) other->place().fail("the plan has it already: remove it");
    }
  }
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
  scenario.link_encoder.assign(n, false);
  for (const std::size_t joint : joints_of(*which, scenario)) scenario.link_encoder[joint] = true;
}

TorqueVibration read_vibration(Table table, double sample_s) {
  TorqueVibration vibration;
  vibration.amplitude = table.need("amplitude", "a share of rated torque").positive();
  const Value frequency = table.need("frequency_hz", "below half of the sampling rate");
  vibration.frequency_hz = frequency.positive();
  // Above it the log would show another, slower vibration than the file says.
  const double highest = 0.5 / sample_s;
  if (vibration.frequency_hz >= highest) {
    frequency.place().fail(
        fmt::format("expected a number below {:g}: half of the sampling rate of {:g} Hz", highest, 1 / sample_s));
  }
  table.finish();
  return vibration;
}

/// The smallest step with which every effect of the plant remembers as long as it has to [s].
double remembering_step(const IdentifiedModel& plant) {
  double step = 0;
  for (const JointFit& joint : plant.joints) {
    for (const EffectFit& fit : joint.effects) {
      const std::uint32_t ticks = find_effect(fit.effect)->most_ticks;
      if (ticks > 0) step = std::max(step, fit.shape[0] / (ticks * (1 + 1e-9)));
    }
  }
  return step;
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
  constexpr int substeps = 4;  // of a sample: friction states are stepped so
  double step = scenario.sample_s / substeps;
  if (scenario.motion == Scenario::Motion::closed_loop) {
    const double tick = scenario.control.tick_s;
    return tick / std::max(1.0, std::ceil(tick / std::min(step, longest_controlled_step) - 1e-9));
  }
  const double remembered = remembering_step(scenario.plant);
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
    if (auto vibration = table->table("torque_vibration"))
      scenario.vibration = read_vibration(*vibration, scenario.sample_s);
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
    scenario.logs.push_back(read_scenario_log(Table(value), file.parent_path(), scenario));
    check_log(value, scenario);
  }
  return scenario;
}

}  // namespace fxdyn
