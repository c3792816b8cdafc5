#include "tests/campaign/generate.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <nlohmann/json.hpp>

#include "host_tools/effects/effects.hpp"
#include "host_tools/effects/identified_model.hpp"
#include "host_tools/logs/log.hpp"
#include "host_tools/simulate/scenario.hpp"
#include "host_tools/simulate/simulate.hpp"
#include "host_tools/support/files.hpp"
#include "tests/campaign/healthy_friction.hpp"
#include "tests/campaign/truth.hpp"

namespace fxdyn::campaign {
namespace {

namespace fs = std::filesystem;
using Eigen::Index;
using nlohmann::json;

const fs::path source_dir = FXDYN_SOURCE_DIR;
double role_duration_s(const Case& wanted) {
  return static_cast<double>(wanted.recording.logs) * wanted.recording.log_s;
}

/// Seeds of the trajectories: no two roles and no two cases share one.
std::uint64_t motion_seed(const Case& wanted, std::uint64_t role) { return (wanted.seed * 10 + role) * 10; }

/// The session's measured roles, one after the other.
std::vector<SessionLog> measured_logs(const Case& wanted) {
  std::vector<SessionLog> logs;
  double start = 0;
  std::uint64_t role = 1;
  for (const char* name : {"train", "validate", "test"}) {
    const bool used = wanted.validate || std::string_view(name) != "validate";
    for (const SessionLog& log : recording(name, motion_seed(wanted, role), start, wanted.recording)) {
      if (used) logs.push_back(log);
    }
    start += role_duration_s(wanted);
    ++role;
  }
  return logs;
}

std::vector<Motion> motions_of(const std::vector<fs::path>& files, const Robot& robot) {
  std::vector<Motion> motions;
  for (const fs::path& file : files) {
    Log log = read_exact(file, robot);
    motions.push_back({file.stem().string(), log.step_s, log.t, log.q, log.dq, log.ddq});
  }
  return motions;
}

/// Joints in random order, those asked for first.
std::vector<std::size_t> joints_to_try(const Wanted& wanted, std::optional<std::size_t> first, std::size_t n,
                                       Random& random) {
  if (wanted.joint) return {*wanted.joint};
  if (wanted.same_joint_as_first && first) return {*first};
  std::vector<std::size_t> joints(n);
  for (std::size_t j = 0; j < n; ++j) joints[j] = j;
  for (std::size_t j = n; j > 1; --j) std::swap(joints[j - 1], joints[random.next() % j]);
  return joints;
}

bool load_reverses(const Plan& plan, std::size_t joint) {
  IdentifiedModel rigid = plan.healthy;
  for (JointFit& fit : rigid.joints) fit.effects.clear();
  const auto j = static_cast<Index>(joint);
  double positive = 0, negative = 0, samples = 0;
  for (const Motion& motion : plan.motions) {
    const Eigen::ArrayXd torque = torque_of(rigid, motion).col(j);
    positive += static_cast<double>((torque > 0.1 * plan.largest_structural[j]).count());
    negative += static_cast<double>((torque < -0.1 * plan.largest_structural[j]).count());
    samples += static_cast<double>(torque.size());
  }
  return std::min(positive, negative) > 0.1 * samples;
}

std::pair<std::optional<std::size_t>, EffectFit> find(const Wanted& wanted, std::optional<std::size_t> first,
                                                      const Plan& plan, Random& random) {
  for (const std::size_t joint : joints_to_try(wanted, first, plan.joints(), random)) {
    if (plan.healthy.joints[joint].find(wanted.effect) != nullptr) continue;  // the background has it
    // The play of a gear is seen where the load takes the link from one flank to the other.
    if (wanted.effect == "backlash" && !load_reverses(plan, joint)) continue;
    for (int attempt = 0; attempt < 3; ++attempt) {  // another shape may do what this one can't
      const auto drawn = draw(wanted.effect, joint, plan, random);
      if (!drawn) break;
      const auto fit = wanted.deflection > 0 ? scaled_to_deflection(*drawn, wanted.deflection, plan)
                                             : scaled(*drawn, wanted.share, plan);
      if (fit) return {drawn->joint, *fit};
    }
  }
  throw NotPossible(fmt::format("no joint of {} gives {} of {}", plan.healthy.robot.name,
                                wanted.deflection > 0 ? wanted.deflection : wanted.share, wanted.effect));
}

/// An effect that is there already, so much larger.
std::pair<std::optional<std::size_t>, EffectFit> grown(const std::pair<std::optional<std::size_t>, EffectFit>& first,
                                                       double share, const Plan& plan) {
  Drawn more{first.second.effect, first.first, {}, 1, 1e3};
  more.at = [fit = first.second](double size) {
    EffectFit larger = fit;
    for (double& value : larger.linear) value *= size;
    return larger;
  };
  const auto fit = scaled(more, share, plan);
  if (!fit) throw NotPossible(fmt::format("no more {} on top of itself", first.second.effect));
  return {first.first, *fit};
}

void change_friction(Session& session, double by, std::uint64_t seed) {
  Random random(seed * 977 + 5);
  for (auto* values : {&session.viscous, &session.coulomb}) {
    for (double& value : *values) value *= 1 + (random.uniform() < 0.5 ? -by : by);
  }
}

std::vector<fs::path> play(const Session& session, const fs::path& scenario, const fs::path& out) {
  write_file(scenario, to_toml(session));
  return simulate(scenario, out);
}

json effect_json(std::optional<std::size_t> joint, const EffectFit& fit) {
  const EffectInfo& info = *find_effect(fit.effect);
  json parameters;
  for (std::size_t i = 0; i < info.shape.size(); ++i) parameters[std::string(info.shape[i].name)] = fit.shape[i];
  for (std::size_t i = 0; i < info.linear.size(); ++i) parameters[std::string(info.linear[i].name)] = fit.linear[i];
  json out{{"effect", fit.effect}, {"parameters", parameters}};
  if (joint) out["joint"] = *joint + 1;
  return out;
}

/// Whether its logs are more than the simulator writes.
bool is_finished_here(const Case& wanted) {
  return wanted.friction != Friction::catalogue || wanted.recording.lost > 0 || wanted.recording.torque_step > 0;
}

/// What the joints' friction adds to the catalogue's, samples x joints.
Eigen::MatrixXd friction_of(const Case& wanted, const Session& session, const Log& log, const Plan& plan) {
  const Robot& robot = plan.healthy.robot;
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(log.samples(), static_cast<Index>(robot.size()));
  for (std::size_t j = 0; wanted.friction != Friction::catalogue && j < robot.size(); ++j) {
    const auto k = static_cast<Index>(j);
    const DryFriction friction =
        draw_friction(wanted.friction, session.coulomb[j], session.width[j], plan.largest_velocity[k],
                      session.rotor_inertia[j], robot.joints[j].type == JointType::revolute, wanted.seed * 16 + j);
    out.col(k) = added_friction(friction, log.t, log.dq.col(k));
  }
  return out;
}

/// .. and what the simulator has no name for.
Eigen::MatrixXd added_torque(const Case& wanted, const Session& session, const std::vector<Outside>& outside,
                             const Log& log, const Plan& plan) {
  const Motion motion{"", log.step_s, log.t.array() - wanted.clock_s, log.q, log.dq, log.ddq};
  Eigen::MatrixXd added = friction_of(wanted, session, log, plan);
  for (const Outside& effect : outside) added.col(static_cast<Index>(effect.joint)) += outside_torque(effect, motion);
  return added;
}

/// .. to a noise-free log's truth.
void add_to_truth(const Case& wanted, const Session& session, const std::vector<Outside>& outside, const fs::path& file,
                  const Plan& plan) {
  const Robot& robot = plan.healthy.robot;
  const Log log = read_exact(file, robot);
  fs::path truth_file = file;
  truth_file.replace_extension(".truth.csv");
  Log truth;
  truth.t = log.t;
  truth.tau = read_truth(truth_file, robot.size()) + added_torque(wanted, session, outside, log, plan);
  write_log(truth_file, truth);
}

/// Rows of a log that a recorder kept.
void lose_rows(Log& log, double share, Random& random) {
  std::vector<Index> kept;
  for (Index k = 0; k < log.samples(); ++k) {
    if (k == 0 || random.uniform() >= share) kept.push_back(k);
  }
  log.t = log.t(kept).eval();
  for (Eigen::MatrixXd* columns : {&log.q, &log.tau, &log.qlink}) {
    if (columns->size() > 0) *columns = (*columns)(kept, Eigen::all).eval();
  }
}

/// Adds what the simulator has no name for to the torques of a log, measures it as the case's recorder does and takes
/// the exact motion out of the file again.
void finish(const Case& wanted, const Session& session, const std::vector<Outside>& outside, const fs::path& file,
            const Plan& plan) {
  const Robot& robot = plan.healthy.robot;
  Log log = read_exact(file, robot);
  fs::path truth_file = file;
  truth_file.replace_extension(".truth.csv");
  Log truth;
  truth.t = log.t;
  truth.tau = read_truth(truth_file, robot.size());
  const Eigen::MatrixXd added = added_torque(wanted, session, outside, log, plan);
  log.tau += added;
  truth.tau += added;
  log.dq.resize(0, 0);
  log.ddq.resize(0, 0);
  const Recording& recorded = wanted.recording;
  if (session.noise) {
    for (std::size_t j = 0; recorded.torque_step > 0 && j < robot.size(); ++j) {
      const double step = recorded.torque_step * session.robot->rated_torque[j];
      auto column = log.tau.col(static_cast<Index>(j)).array();
      column = (column / step).round() * step;
    }
    Random random(wanted.seed * 389 + std::hash<std::string>{}(file.stem().string()));
    if (recorded.lost > 0) lose_rows(log, recorded.lost, random);
  }
  write_log(file, log);
  write_log(truth_file, truth);
}

std::string project_toml(const Case& wanted, const std::vector<std::pair<std::string, std::string>>& logs) {
  const TestRobot& robot = robot_of(wanted);
  std::string text = fmt::format("[robot]\nurdf = \"robot.urdf\"\ngravity = [{:.6f}]\nrated_torque = [{:.6f}]\n",
                                 fmt::join(robot.gravity, ", "), fmt::join(robot.rated_torque, ", "));
  for (const auto& [file, role] : logs) text += fmt::format("\n[[log]]\nfile = \"{}\"\nrole = \"{}\"\n", file, role);
  return text;
}

Session measured_session(const Case& wanted, const Ground& ground) {
  Session session = healthy_session(wanted);
  session.effects = ground.background;
  for (const auto& effect : ground.effects) {
    const auto& joint = effect.first;
    const auto& fit = effect.second;
    const auto same = std::find_if(session.effects.begin(), session.effects.end(), [&](const auto& there) {
      return there.first == joint && there.second.effect == fit.effect && there.second.shape == fit.shape;
    });
    if (same == session.effects.end()) {
      session.effects.emplace_back(joint, fit);
      continue;
    }
    for (std::size_t i = 0; i < fit.linear.size(); ++i) same->second.linear[i] += fit.linear[i];
  }
  if (wanted.friction_change > 0) change_friction(session, wanted.friction_change, wanted.seed);
  session.seed = wanted.seed * 2 + 1;
  session.logs = measured_logs(wanted);
  return session;
}

/// Logs into `data`, everything that tells how they were made into `truth`; the plant as SESSION.json.
void part(const std::string& session, const fs::path& made, const fs::path& data, const fs::path& truth) {
  fs::create_directories(data);
  for (const auto& entry : fs::directory_iterator(made)) {
    const std::string name = entry.path().filename().string();
    const bool log = name.ends_with(".csv") && !name.ends_with(".truth.csv");
    if (log)
      fs::rename(entry.path(), data / name);
    else
      fs::rename(entry.path(), truth / (name == "truth.json" ? session + ".json" : name));
  }
  fs::remove_all(made);
}

json expected_json(const Expected& expected) {
  return {{"verdict", to_string(expected)},
          {"chi", expected.chi},
          {"share", expected.share},
          {"rival", expected.rival},
          {"rival_chi", expected.rival_chi}};
}

/// What the scorer compares with.
json truth_json(const Case& wanted, const Ground& ground) {
  const TestRobot& robot = robot_of(wanted);
  json out{{"name", wanted.name},
           {"group", to_string(wanted.group)},
           {"robot", robot.name},
           {"plant", wanted.mujoco ? "mujoco" : "internal"},
           {"seed", wanted.seed},
           {"closed_loop", wanted.closed_loop},
           {"baseline", wanted.baseline},
           {"link_encoders", wanted.link_encoders},
           {"clock_s", wanted.clock_s},
           {"friction_change", wanted.friction_change},
           {"friction", to_string(wanted.friction)},
           {"validate", wanted.validate},
           {"sample_s", wanted.recording.sample_s},
           {"encoder_bits", wanted.recording.encoder_bits},
           {"effects", json::array()},
           {"background", json::array()},
           {"rated_torque", robot.rated_torque}};
  for (const auto& [joint, fit] : ground.background) out["background"].push_back(effect_json(joint, fit));
  // What every joint of such a robot has: with a baseline it is no change, without one a name for it is right.
  const std::vector<std::string> dry =
      wanted.friction == Friction::catalogue ? std::vector<std::string>{}
      : wanted.friction == Friction::smooth_sign
          ? std::vector<std::string>{"stribeck", "viscous_quadratic", "viscous_cubic", "soft_knee"}
          : std::vector<std::string>{"presliding", "stribeck", "lugre", "maxwell_slip"};
  for (std::size_t j = 0; !dry.empty() && j < ground.plan.joints(); ++j)
    out["background"].push_back({{"effect", to_string(wanted.friction)}, {"joint", j + 1}, {"names", dry}});
  const NoiseLevel noise{.white = wanted.recording.noise,
                         .coloured = 0.3 * wanted.recording.noise,
                         .pole = healthy_session(wanted).ar_pole,
                         .step_s = wanted.recording.sample_s};
  const auto add = [&](json entry, const std::vector<Eigen::MatrixXd>& change, std::optional<std::size_t> joint,
                       const std::vector<std::string>& names, const Wanted& asked) {
    Index feels = 0;
    const Eigen::VectorXd shares = shares_of_rated(ground.plan, change);
    entry["share"] = shares.maxCoeff(&feels);
    entry["shares"] = std::vector<double>(shares.data(), shares.data() + shares.size());
    entry["wanted_share"] = asked.share;
    if (asked.deflection > 0) entry["wanted_deflection"] = asked.deflection;
    entry["feels"] = feels + 1;
    const std::size_t where = joint ? *joint : static_cast<std::size_t>(feels);
    entry["expected"] = expected_json(expect(ground.plan, change, names, where, wanted.baseline, noise));
    out["effects"].push_back(entry);
  };
  std::size_t at = 0;
  for (const auto& [joint, fit] : ground.effects) {
    add(effect_json(joint, fit), torque_change(ground.plan, with_effect(ground.plan.healthy, joint, fit)), joint,
        {fit.effect}, wanted.effects[at]);
    ++at;
  }
  for (const Outside& outside : ground.outside) {
    std::vector<Eigen::MatrixXd> change;
    for (const Motion& motion : ground.plan.motions) {
      change.emplace_back(Eigen::MatrixXd::Zero(motion.q.rows(), motion.q.cols()));
      change.back().col(static_cast<Index>(outside.joint)) = outside_torque(outside, motion);
    }
    json entry{{"effect", outside.effect}, {"joint", outside.joint + 1}, {"other", outside.other + 1}};
    if (const auto place = place_of(outside))
      entry["place"] = {{"signal", place->signal}, {"from", place->from}, {"to", place->to}};
    const std::vector<std::string> stands_for = names_of_form(outside.effect);
    if (stands_for.empty()) {
      entry["outside"] = true;
      entry["curve"] = curve_of(outside);
      if (const auto curve = swept(outside, 3 * role_duration_s(wanted)))
        entry["swept"] = {{"x", curve->x}, {"y", curve->y}, {"friction", curve->friction}};
    } else {
      entry["names"] = stands_for;
    }
    add(entry, change, outside.joint, stands_for, wanted.effects[at]);
    ++at;
  }
  return out;
}

}  // namespace

Ground plan_case(const Case& wanted, const fs::path& folder) {
  fs::create_directories(folder);
  if (const TestRobot& robot = robot_of(wanted); !robot.urdf_text.empty()) {
    write_file(folder / "robot.urdf", robot.urdf_text);
  } else {
    fs::copy_file(source_dir / robot.urdf, folder / "robot.urdf", fs::copy_options::overwrite_existing);
  }
  Session session = healthy_session(wanted);
  session.noise = false;
  session.exact_motion = true;
  session.mujoco = session.closed_loop = session.link_encoders = false;
  session.clock_s = 0;
  // Torques of gears that bend are second derivatives: they need the log's own steps.
  bool bends = false;
  for (const Wanted& one : wanted.effects) {
    const EffectInfo* info = find_effect(one.effect);
    bends |= info != nullptr && info->acts_on == ActsOn::position;
  }
  session.sample_s = bends ? 0.002 : 0.005;
  session.logs = recording("train", motion_seed(wanted, 1), 0, wanted.recording);
  const auto files = play(session, folder / "plan.toml", folder / "plan");
  const IdentifiedModel healthy = read_model(folder / "plan" / "truth.json");

  Ground ground;
  const auto planned = [&](const IdentifiedModel& model, std::vector<Motion> motions) {
    Plan plan = make_plan(model, std::move(motions));
    if (wanted.closed_loop && !wanted.mujoco)
      plan.longest_delay_s = find_effect("delay")->most_ticks * longest_controlled_step;
    return plan;
  };
  ground.plan = planned(healthy, motions_of(files, healthy.robot));
  fs::remove_all(folder / "plan");
  Random random(wanted.seed * 7919 + 11);
  for (const Wanted& one : wanted.background) {
    ground.background.push_back(find(one, {}, ground.plan, random));
    ground.plan =
        planned(with_effect(ground.plan.healthy, ground.background.back().first, ground.background.back().second),
                std::move(ground.plan.motions));
  }
  ground.measured = ground.plan.healthy;
  std::optional<std::size_t> first;
  for (const Wanted& one : wanted.effects) {
    if (is_outside(one.effect)) {
      const std::size_t joint = one.joint ? *one.joint : random.next() % ground.plan.joints();
      Outside outside = draw_outside(one.effect, joint, ground.plan, random.next());
      scale(outside, one.share, ground.plan);
      ground.outside.push_back(outside);
      continue;
    }
    const auto [joint, fit] =
        one.grows ? grown(ground.background.front(), one.share, ground.plan) : find(one, first, ground.plan, random);
    if (!first) first = joint;
    ground.effects.emplace_back(joint, fit);
    ground.measured = with_effect(ground.measured, joint, fit);
  }
  return ground;
}

void generate(const Case& wanted, const fs::path& data, const fs::path& truth) {
  fs::remove_all(data);
  fs::remove_all(truth);
  fs::create_directories(data);
  const Ground ground = plan_case(wanted, truth);
  std::vector<std::pair<std::string, std::string>> logs;
  const fs::path made = truth / "made";

  if (wanted.baseline) {
    Session session = healthy_session(wanted);
    session.effects = ground.background;
    session.seed = wanted.seed * 2;
    session.logs = recording("baseline", motion_seed(wanted, 0), 0, wanted.recording);
    session.exact_motion = is_finished_here(wanted);
    for (const fs::path& file : play(session, truth / "baseline.toml", made)) {
      if (is_finished_here(wanted)) finish(wanted, session, {}, file, ground.plan);
      logs.emplace_back(file.filename().string(), "baseline");
    }
    part("baseline", made, data, truth);
  }
  Session session = measured_session(wanted, ground);
  const bool changed_after = is_finished_here(wanted) || !ground.outside.empty();
  session.exact_motion = changed_after;
  for (const fs::path& file : play(session, truth / "measured.toml", made)) {
    if (changed_after) finish(wanted, session, ground.outside, file, ground.plan);
    const std::string name = file.filename().string();
    logs.emplace_back(name, name.substr(0, name.find('_')));
  }
  part("measured", made, data, truth);

  if (!ground.effects.empty() || !ground.outside.empty()) {
    session.noise = false;
    session.exact_motion = true;
    session.link_encoders = false;
    session.logs = recording("test", motion_seed(wanted, 3), 2 * role_duration_s(wanted), wanted.recording);
    for (const fs::path& file : play(session, truth / "exact.toml", truth / "exact")) {
      if (changed_after) add_to_truth(wanted, session, ground.outside, file, ground.plan);
    }
  }
  fs::copy_file(truth / "robot.urdf", data / "robot.urdf");
  write_file(data / "project.toml", project_toml(wanted, logs));
  write_file(truth / "truth.json", truth_json(wanted, ground).dump(1) + "\n");
}

}  // namespace fxdyn::campaign
