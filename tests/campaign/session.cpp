#include "tests/campaign/session.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>

#include "host_tools/effects/effects.hpp"
#include "host_tools/support/random.hpp"

namespace fxdyn::campaign {
namespace {

std::string effect_toml(std::optional<std::size_t> joint, const std::string& effect,
                        const std::vector<std::pair<std::string, double>>& parameters) {
  std::string text = fmt::format("\n[[effect]]\nname = \"{}\"\n", effect);
  if (joint) text += fmt::format("joint = {}\n", *joint + 1);
  std::vector<std::string> pairs;
  for (const auto& [name, value] : parameters) {
    // TOML tells 1 from 1.0
    pairs.push_back(value == std::floor(value) && std::fabs(value) < 1e9 ? fmt::format("{} = {:.1f}", name, value)
                                                                         : fmt::format("{} = {:.17g}", name, value));
  }
  return text + fmt::format("parameters = {{ {} }}\n", fmt::join(pairs, ", "));
}

std::string effect_toml(std::optional<std::size_t> joint, const EffectFit& fit) {
  const EffectInfo& info = *find_effect(fit.effect);
  std::vector<std::pair<std::string, double>> parameters;
  for (std::size_t i = 0; i < info.shape.size(); ++i) parameters.emplace_back(info.shape[i].name, fit.shape[i]);
  for (std::size_t i = 0; i < info.linear.size(); ++i) parameters.emplace_back(info.linear[i].name, fit.linear[i]);
  return effect_toml(joint, fit.effect, parameters);
}

}  // namespace

std::vector<SessionLog> recording(const std::string& role, std::uint64_t seed, double start_s,
                                  const Recording& recorded) {
  // Fourier series: order / period is the highest frequency. The scale is set by the tightest limit, so a high order is
  // bound by acceleration and a low one by velocity or range.
  std::vector<SessionLog> logs{{role + "_fast", 10, 1, 0, 5, 0},
                               {role + "_mid", 5, 0.9, 0, 17, 0},
                               {role + "_slow", 10, 0.12, 0, 5, 0},
                               {role + "_reversals", 5, 0.03, 0, 8, 0}};
  // The same frequencies in shorter logs: as much shorter periods of as much lower orders.
  const double log_s = recorded.log_s, shorter = log_s / 10;
  logs.resize(std::min(recorded.logs, logs.size()));
  for (std::size_t i = 0; i < logs.size(); ++i) {
    logs[i].period_s *= shorter;
    logs[i].order = static_cast<int>(std::lround(shorter * logs[i].order));
    logs[i].start_s = start_s + static_cast<double>(i) * log_s;
    logs[i].seed = seed * 100 + i;
  }
  return logs;
}

Session healthy_session(const Case& wanted) {
  const TestRobot& robot = robot_of(wanted);
  Session session;
  session.urdf = "robot.urdf";
  session.robot = &robot;
  session.seed = wanted.seed;
  session.clock_s = wanted.clock_s;
  session.mujoco = wanted.mujoco;
  session.closed_loop = wanted.closed_loop;
  session.link_encoders = wanted.link_encoders;
  session.log_s = wanted.recording.log_s;
  session.sample_s = wanted.recording.sample_s;
  session.encoder_bits = wanted.recording.encoder_bits;
  session.jitter = wanted.recording.jitter;
  session.torque_noise = wanted.recording.noise;
  Random random(wanted.seed * 31 + (wanted.drawn_robot ? 7 : wanted.robot));
  const auto moved = [&](std::vector<double> values, double by) {
    for (double& value : values) value *= random.uniform(1 - by, 1 + by);
    return values;
  };
  session.viscous = moved(robot.viscous, 0.3);
  session.coulomb = moved(robot.coulomb, 0.3);
  session.width = moved(robot.width, 0.5);
  session.offset = moved(robot.offset, 1);
  session.rotor_inertia = moved(robot.rotor_inertia, 0.2);
  session.ar_pole = random.uniform(0.9, 0.98);
  return session;
}

std::string to_toml(const Session& s) {
  std::string text = fmt::format("seed = {}\nplant = \"{}\"\n", s.seed, s.mujoco ? "mujoco" : "internal");
  text += fmt::format("motion = \"{}\"\n", s.closed_loop ? "closed_loop" : "prescribed");
  text +=
      fmt::format("[robot]\nurdf = \"{}\"\ngravity = [{:.6f}]\nrated_torque = [{:.6f}]\nacceleration = [{:.6f}]\n\n",
                  s.urdf, fmt::join(s.robot->gravity, ", "), fmt::join(s.robot->rated_torque, ", "),
                  fmt::join(s.robot->acceleration, ", "));
  text += fmt::format("[sensors]\nsample_s = {}\n", s.sample_s);
  text += fmt::format("start_s = {:.6f}\n", s.clock_s);
  if (s.jitter > 0 && s.noise) text += fmt::format("jitter = {:.6f}\n", s.jitter);
  if (s.exact_motion) text += "exact_motion = true\n";
  if (s.noise) {
    text += fmt::format("encoder_bits = {}\ntorque_noise = {}\n", s.encoder_bits, s.torque_noise);
    text += fmt::format("ar_noise = {}\nar_pole = {:.6f}\n", 0.3 * s.torque_noise, s.ar_pole);
    if (s.link_encoders) text += "link_encoders = \"all\"\nlink_encoder_bits = 19\n";
  }
  for (std::size_t j = 0; j < s.viscous.size(); ++j) {
    text += effect_toml(j, "viscous", {{"coefficient", s.viscous[j]}});
    text += effect_toml(j, "coulomb", {{"amplitude", s.coulomb[j]}, {"width", s.width[j]}});
    text += effect_toml(j, "offset", {{"torque", s.offset[j]}});
    text += effect_toml(j, "rotor_inertia", {{"inertia", s.rotor_inertia[j]}});
  }
  for (const auto& [joint, fit] : s.effects) text += effect_toml(joint, fit);
  for (const SessionLog& log : s.logs) {
    text += fmt::format(
        "\n[[log]]\nname = \"{}\"\nduration_s = {:.6f}\nperiod_s = {:.6f}\nspeed = {:.6f}\norder = {}\nseed = {}\n",
        log.name, s.log_s, log.period_s, log.speed, log.order, log.seed);
    text += fmt::format("start_s = {:.6f}\n", log.start_s);
  }
  return text;
}

}  // namespace fxdyn::campaign
