// How often `fxdyn check` finds a mistake in the columns or the URDF, on robots drawn at random whose URDF's masses are
// off. Every robot is judged as it is, and with one mistake of each kind put in.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <numbers>

#include "host_tools/check/arrangement_search.hpp"
#include "host_tools/check/check.hpp"
#include "host_tools/check/torque_column.hpp"
#include "host_tools/identify/gate_data.hpp"
#include "host_tools/project/project.hpp"
#include "host_tools/simulate/recordings.hpp"
#include "host_tools/support/heap.hpp"
#include "host_tools/support/parallel.hpp"
#include "host_tools/support/random.hpp"
#include "tests/campaign/generate.hpp"
#include "tests/check/told.hpp"

namespace {

using namespace fxdyn;
using Eigen::Index;
namespace fs = std::filesystem;

struct Planted {
  std::string name;
  Robot robot;
  TorqueSamples samples;
  Mistake mistake{};
  Index joint = 0, other = 0;
  Arrangement right{};  ///< of the faulty samples
};

/// Each mass with its inertia off by up to `share`.
Robot with_masses_off(Robot robot, double share, Random& random) {
  for (Joint& joint : robot.joints) {
    const double factor = 1 + share * random.uniform(-1, 1);
    if (!joint.inertial) continue;
    joint.inertial->mass *= factor;
    joint.inertial->tensor *= factor;
  }
  return robot;
}

/// A turn of the base that horizontal axes show, by 30 degrees to half a turn.
Eigen::Vector3d turned(const Eigen::Vector3d& gravity, Random& random) {
  const Eigen::Vector3d any(random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1));
  const Eigen::Vector3d axis = gravity.cross(any).normalized();
  return Eigen::AngleAxisd(random.uniform(std::numbers::pi / 6, std::numbers::pi), axis) * gravity;
}

/// A spring at a joint drawn at random: a torsion spring, or (every other hinge) a coil spring from a lever to the link
/// before, which is none of the check's shapes. Its torque is 0.3 to 2 times that of the joint.
TorqueSamples with_spring(const Robot& robot, TorqueSamples samples, Random& random) {
  const auto j = static_cast<Index>(random.next() % robot.size());
  const bool turns = robot.joints[static_cast<std::size_t>(j)].type == JointType::revolute;
  const bool coil = turns && random.next() % 2 == 0;
  const Eigen::ArrayXd q = samples.q.col(j).array();
  const double rest = random.uniform(q.minCoeff(), q.maxCoeff());
  Eigen::ArrayXd torque = q - rest;
  if (coil) {
    const double lever = random.uniform(0.1, 0.8), free = random.uniform(0, 1 - lever);  // of the way to its other end
    const Eigen::ArrayXd length = (1 + lever * lever - 2 * lever * (q - rest).cos()).sqrt();
    torque = (1 - free / length) * lever * (q - rest).sin();
  }
  const double size =
      random.uniform(0.3, 2) * std::sqrt(samples.tau.col(j).squaredNorm() / torque.matrix().squaredNorm());
  samples.tau.col(j).array() += size * torque;
  return samples;
}

std::vector<Planted> plant(const Robot& robot, const TorqueSamples& samples, Random& random) {
  const auto n = static_cast<Index>(robot.size());
  const auto any = [&] { return static_cast<Index>(random.next() % static_cast<std::uint64_t>(n)); };
  const auto at = [](Index j) { return static_cast<std::size_t>(j); };
  std::vector<Planted> out;
  out.reserve(16);  // those that were planted stay where they are
  const auto add = [&](std::string name, Mistake mistake, Index joint, Index other = -1) -> Planted& {
    return out.emplace_back(Planted{std::move(name), robot, samples, mistake, joint, other, as_given(robot)});
  };
  const Index a = any();
  const Index b =
      (a + 1 + static_cast<Index>(random.next() % static_cast<std::uint64_t>(std::max<Index>(1, n - 1)))) % n;
  if (n > 1 && robot.joints[static_cast<std::size_t>(a)].type == robot.joints[static_cast<std::size_t>(b)].type) {
    Planted& joints = add("swapped joints", Mistake::swapped_joints, std::min(a, b), std::max(a, b));
    for (Eigen::MatrixXd* m : {&joints.samples.q, &joints.samples.dq, &joints.samples.ddq, &joints.samples.tau})
      m->col(a).swap(m->col(b));
    for (auto* from : {&joints.right.motion_from, &joints.right.torque_from}) std::swap((*from)[at(a)], (*from)[at(b)]);
    Planted& torques = add("swapped torques", Mistake::swapped_torques, std::min(a, b), std::max(a, b));
    torques.samples.tau.col(a).swap(torques.samples.tau.col(b));
    std::swap(torques.right.torque_from[at(a)], torques.right.torque_from[at(b)]);
  }
  const Index c = any();
  Planted& mirrored = add("mirrored joint", Mistake::mirrored_joint, c);
  Planted& motion = add("mirrored motion", Mistake::mirrored_motion, c);
  Planted& torque = add("mirrored torque", Mistake::mirrored_torque, c);
  for (Planted* one : {&mirrored, &motion}) {
    for (Eigen::MatrixXd* m : {&one->samples.q, &one->samples.dq, &one->samples.ddq}) m->col(c) *= -1;
    one->right.motion_gain[c] = -1;
  }
  for (Planted* one : {&mirrored, &torque}) {
    one->samples.tau.col(c) *= -1;
    one->right.torque_gain[c] = -1;
  }
  const Index d = any();
  if (robot.joints[static_cast<std::size_t>(d)].type == JointType::revolute) {
    const double by = random.uniform(20, 180) * std::numbers::pi / 180 * (random.next() % 2 == 0 ? 1 : -1);
    Planted& zero = add("zero", Mistake::zero, d);
    zero.samples.q.col(d).array() += by;
    zero.right.motion_offset[d] = -by;
  }
  const Index e = any();
  const double times = random.uniform(1.3, 2), factor = random.next() % 2 == 0 ? times : 1 / times;
  Planted& gain = add("gain", Mistake::torque_gain, e);
  gain.samples.tau.col(e) *= factor;
  gain.right.torque_gain[e] = 1 / factor;
  Planted& gravity = add("gravity", Mistake::gravity, 0);
  gravity.robot.gravity = turned(robot.gravity, random);
  const Index f = any();
  Joint& joint = add("axis", Mistake::axis, f).robot.joints[static_cast<std::size_t>(f)];
  joint.axis = Eigen::Vector3d(joint.axis.y(), joint.axis.z(), joint.axis.x());
  const Index g = any();
  const bool turns = robot.joints[static_cast<std::size_t>(g)].type == JointType::revolute;
  Planted& units = add(turns ? "degrees" : "mm", Mistake::position_unit, g);
  for (Eigen::MatrixXd* m : {&units.samples.q, &units.samples.dq, &units.samples.ddq})
    m->col(g) *= turns ? 180 / std::numbers::pi : 1e3;
  units.right.motion_gain[g] = turns ? std::numbers::pi / 180 : 1e-3;
  return out;
}

struct Tally {
  int told = 0, right = 0, found = 0, all = 0, hidden = 0, wrong = 0, hidden_found = 0;
  std::vector<double> ratios;  ///< RMS error after over before, of the right ones
};

bool is_right(const ArrangementMove& move, const Planted& planted) {
  return move.mistake == planted.mistake && (planted.mistake == Mistake::gravity || move.joint == planted.joint) &&
         (planted.other < 0 || move.other == planted.other);
}

/// Torque that was recorded 20 to 80 ms before or after the motion, and positions in the torque's columns.
void judge_columns(Project project, const Robot& robot, const fs::path& data, const std::vector<ProcessedLog>& logs,
                   std::uint64_t wanted_seed, const ArrangementOptions& options, std::map<std::string, Tally>& counts) {
  project.robot = robot;
  const auto count = [&](const std::string& name, bool found, bool right, const std::string& seen, bool shows = true) {
    Tally& tally = counts[name];
    if (!shows) {
      ++tally.hidden;
      tally.wrong += found && !right;
      tally.hidden_found += right;
      return;
    }
    ++tally.all;
    tally.found += found;
    tally.right += right;
    tally.told += right;
    if (!right) fmt::print("{}: {}: {}\n", data.parent_path().filename().string(), name, seen);
  };
  const auto seen = [](const std::optional<TorqueLead>& lead) {
    if (!lead) return std::string("nothing told");
    return fmt::format("told {:.3g} s, {:.0f} nats, {:.3g} -> {:.3g}", lead->seconds, lead->nats, lead->before,
                       lead->after);
  };
  const auto told = find_long_torque_lead(project, logs, options);
  count("sound times", told.has_value(), !told, seen(told));
  Random random(wanted_seed * 31 + 7);
  const double off = random.uniform(0.02, 0.08) * (random.next() % 2 == 0 ? 1 : -1);
  // What the right times would gain: less than that, and no method of this kind can tell.
  const double gained = torque_lead_nats(project, logs, off, options) - torque_lead_nats(project, logs, 0, options);
  project.signals.torque_lead_s = off;
  const auto late = find_long_torque_lead(project, logs, options);
  count("late torque", late.has_value(), late && std::fabs(late->seconds) < 0.01,
        fmt::format("{:.3g} s off, the right times gain {:.0f} nats, {}", off, gained, seen(late)),
        gained >= options.gain);
  project.signals.torque_lead_s.reset();
  std::vector<Log> train = read_logs(project, Role::train, data);
  const bool sound = are_exchanged(project, train, options);
  count("sound columns", sound, !sound, "exchanged?");
  for (Log& log : train) {
    std::swap(log.q, log.tau);
    for (Eigen::MatrixXd* rates : {&log.dq, &log.ddq, &log.qlink}) rates->resize(0, 0);
    log.encoder_step.resize(0);
  }
  const bool exchanged = are_exchanged(project, train, options);
  count("q and tau", exchanged, exchanged, "not seen");
}

/// Mistakes in one log that decides nothing in the fit, each at a joint drawn at random.
struct OwnColumns {
  std::string name;
  std::function<void(Log& log, Index joint, Index other)> make;
};
const std::vector<OwnColumns>& own_columns() {
  static const std::vector<OwnColumns> all{
      {"log sound", [](Log&, Index, Index) {}},
      {"log torques swapped", [](Log& log, Index j, Index other) { log.tau.col(j).swap(log.tau.col(other)); }},
      {"log q mirrored", [](Log& log, Index j, Index) { log.q.col(j) *= -1; }},
      {"log torque mirrored", [](Log& log, Index j, Index) { log.tau.col(j) *= -1; }},
      {"log zero off", [](Log& log, Index j, Index) { log.q.col(j).array() += 0.7; }},
      {"log gain x 2", [](Log& log, Index j, Index) { log.tau.col(j) *= 2; }},
      {"log torques x 100", [](Log& log, Index, Index) { log.tau *= 100; }},
  };
  return all;
}

/// Each test log as it is, and one of them, drawn at random, with one mistake of each kind.
void judge_logs(const Project& project, const GateData& gate, const fs::path& data, std::uint64_t wanted_seed,
                const ArrangementOptions& options, std::map<std::string, Tally>& counts) {
  const TorqueSamples train = sample_torque(gate.logs, options.samples);
  const std::vector<Log> logs = read_logs(project, Role::test, data);
  Random random(wanted_seed * 101 + 9);
  const auto n = static_cast<std::uint64_t>(project.robot.size());
  const std::size_t drawn = random.next() % logs.size();
  const auto j = static_cast<Index>(random.next() % n), other = static_cast<Index>((j + 1) % static_cast<Index>(n));
  for (const OwnColumns& one : own_columns()) {
    const bool sound = one.name == "log sound";
    for (std::size_t l = 0; l < logs.size(); ++l) {
      if (!sound && l != drawn) continue;
      Log log = logs[l];
      one.make(log, j, other);
      const auto findings = check_one_log(project, train, std::move(log), gate.filter, options);
      Tally& tally = counts[one.name];
      ++tally.all;
      tally.found += !findings.empty();
      tally.right += sound == findings.empty();
      tally.told += sound == findings.empty();
      if (sound == findings.empty()) continue;
      fmt::print("{} {} {} joint {}: {}\n", data.parent_path().filename().string(), logs[l].file.filename().string(),
                 one.name, j + 1, findings.empty() ? "not seen" : findings.front().text);
    }
  }
}

std::string words(const ArrangementMove& move) {
  return fmt::format("{} {} {:.3g}", to_string(move.mistake), move.joint + 1, move.value);
}

int run(int argc, char** argv) {
  fxdyn::keep_freed_memory();
  CLI::App app{
      "Mistakes in columns, signs, zeros, axes, gravity and gains: how many are found, and how many sound robots "
      "are warned."};
  std::uint64_t seed = 1000;
  std::size_t robots = 60;
  fs::path folder = "build/check_study";
  double share = 0.3;
  ArrangementOptions options;
  app.add_option("--seed", seed, "first")->capture_default_str();
  app.add_option("--robots", robots)->capture_default_str();
  app.add_option("--out", folder)->capture_default_str();
  app.add_option("--masses", share, "off by up to this share")->capture_default_str();
  app.add_option("--gain", options.gain)->capture_default_str();
  app.add_option("--independent", options.independent)->capture_default_str();
  app.add_option("--beyond", options.beyond)->capture_default_str();
  bool springs = false;
  app.add_flag("--springs", springs, "each robot has one at a joint");
  bool bare = false;
  app.add_flag("--bare", bare, "the URDFs have no masses");
  std::vector<std::string> only;
  app.add_option("--only", only, "names of cases; else all");
  app.add_option("--vague-leaves", options.vague_leaves)->capture_default_str();
  app.add_option("--mass-error", options.mass_errors[0])->capture_default_str();
  CLI11_PARSE(app, argc, argv);

  const auto wants = [&](const std::string& name) {
    return only.empty() || std::find(only.begin(), only.end(), name) != only.end();
  };
  std::map<std::string, Tally> counts;
  for (campaign::Case wanted : campaign::drawn_cases(seed, robots)) {
    const fs::path data = folder / wanted.name / "data";
    wanted.baseline = wanted.validate = false;
    wanted.recording.sample_s = std::max(wanted.recording.sample_s, 0.002);  // faster ones are filtered down to it
    try {
      if (!fs::exists(data / "project.toml")) campaign::generate(wanted, data, folder / wanted.name / "truth");
    } catch (const campaign::NotPossible&) {
      continue;
    }
    const Project project = read_project(data / "project.toml");
    const GateData gate = read_gate_data(project, data);
    TorqueSamples samples = sample_torque(gate.logs, options.samples);
    Random random(wanted.seed * 7919 + 3);
    Robot robot = with_masses_off(project.robot, share, random);
    if (bare)
      for (Joint& joint : robot.joints) joint.inertial.reset();
    Random of_spring(wanted.seed * 3571 + 5);
    if (springs) samples = with_spring(robot, std::move(samples), of_spring);
    if (wants("late torque")) judge_columns(project, robot, data, gate.logs, wanted.seed, options, counts);
    if (wants("log sound")) judge_logs(project, gate, data, wanted.seed, options, counts);
    std::vector<Planted> cases = plant(robot, samples, random);
    cases.push_back({"sound", robot, samples, {}, 0, 0, as_given(robot)});
    for (const Planted& one : cases) {
      if (!wants(one.name)) continue;
      const ArrangementEvidence evidence(one.robot, one.samples, options);
      // What the right columns would gain: less than that, and no method of this kind can tell.
      const double gained = one.name == "sound" ? 0 : test::gained_by(evidence, one.right);
      const auto findings = find_mistakes(evidence, options);
      Tally& count = counts[one.name];
      if (one.name != "sound" && gained < options.gain) {
        const bool right = !findings.empty() && is_right(findings.front().move, one);
        ++count.hidden;
        count.hidden_found += right;
        count.wrong += !findings.empty() && !right;
        continue;
      }
      ++count.all;
      count.found += !findings.empty();
      const bool first = !findings.empty() && is_right(findings.front().move, one);
      bool among = first;
      for (const auto& finding : findings) {
        among = among || is_right(finding.move, one);
        for (const auto& move : finding.others) among = among || is_right(move, one);
      }
      count.right += first;
      count.told += among;
      if (first) count.ratios.push_back(findings.front().after / findings.front().before);
      if (first || (one.name == "sound" && findings.empty())) continue;
      fmt::print("{} {} joint {}, {:.0f} nats:", wanted.name, one.name, one.joint + 1, gained);
      for (const auto& finding : findings) {
        fmt::print(" [{:.0f} nats {}, {:.3g} -> {:.3g}", finding.move.nats, words(finding.move), finding.before,
                   finding.after);
        for (const auto& move : finding.others) fmt::print(" | {}", words(move));
        fmt::print("]");
      }
      fmt::print("\n");
      std::fflush(stdout);
    }
  }
  fmt::print("{:<18}{:>8}{:>8}{:>8}{:>8}{:>10}{:>8}{:>8}{:>8}\n", "", "cases", "found", "first", "among", "error x",
             "hidden", "wrong", "of all");
  for (auto& [name, count] : counts) {
    std::sort(count.ratios.begin(), count.ratios.end());
    const double most = count.ratios.empty() ? 0 : count.ratios[count.ratios.size() * 9 / 10];
    fmt::print("{:<18}{:>8}{:>8.3f}{:>8.3f}{:>8.3f}{:>10.2f}{:>8}{:>8}{:>8.3f}\n", name, count.all,
               static_cast<double>(count.found) / count.all, static_cast<double>(count.right) / count.all,
               static_cast<double>(count.told) / count.all, most, count.hidden, count.wrong,
               static_cast<double>(count.right + count.hidden_found) / (count.all + count.hidden));
  }
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(argc, argv);
  } catch (const std::exception& error) {
    fmt::print(stderr, "check_study: {}\n", error.what());
    return 2;
  }
}
