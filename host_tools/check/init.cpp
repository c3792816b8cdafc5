#include "host_tools/check/init.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

#include "host_tools/check/check.hpp"
#include "host_tools/check/column_guess.hpp"
#include "host_tools/support/error.hpp"

namespace fxdyn {

namespace fs = std::filesystem;

namespace {

std::string quoted(const std::string& column) {
  return column.starts_with('#') ? column.substr(1) : '"' + column + '"';
}
std::string list(const std::vector<std::string>& columns) {
  std::vector<std::string> out;
  out.reserve(columns.size());
  for (const std::string& column : columns) out.push_back(quoted(column));
  return fmt::format("[{}]", fmt::join(out, ", "));
}

/// Whether the names are those that a project need not say: q1, q2, ...
bool is_default(const LogFormat& format) {
  if (format.columns.at("t") != "t") return false;
  for (const auto& [signal, names] : format.joint_columns) {
    for (std::size_t j = 0; j < names.size(); ++j)
      if (names[j] != fmt::format("{}{}", signal, j + 1)) return false;
  }
  return true;
}

struct Recorded {
  fs::path file;
  LogFacts facts;
};

/// Whether two logs show the same motion: their joints' ranges agree to one part in a hundred.
bool same_motion(const LogFacts& a, const LogFacts& b) {
  const Eigen::VectorXd range = (a.q_upper - a.q_lower).cwiseMax(1e-9);
  return ((a.q_upper - b.q_upper).cwiseAbs().array() < 0.01 * range.array()).all() &&
         ((a.q_lower - b.q_lower).cwiseAbs().array() < 0.01 * range.array()).all();
}

/// Roles by trajectories: repetitions of one motion share theirs. One motion: empty.
std::vector<std::string> roles_of(const std::vector<Recorded>& logs) {
  std::vector<std::size_t> motion;
  std::size_t motions = 0;
  for (std::size_t i = 0; i < logs.size(); ++i) {
    std::size_t same = i;
    for (std::size_t k = 0; k < i && same == i; ++k)
      if (same_motion(logs[k].facts, logs[i].facts)) same = k;
    motion.push_back(same == i ? motions++ : motion[same]);
  }
  std::vector<std::string> roles;
  if (motions < 2) return roles;
  for (const std::size_t m : motion)
    roles.push_back(m + 1 == motions ? "test" : (motions > 2 && m + 2 == motions ? "validate" : "train"));
  return roles;
}

void write_signals(const ColumnGuess& guess, const std::vector<double>& position_gain, std::size_t joints,
                   std::string& out) {
  const LogFormat& format = guess.format;
  if (is_default(format) && !guess.torque_is_current && position_gain.empty()) return;
  out += "\n[signals]\n";
  if (!is_default(format)) {
    out += fmt::format("# which column of the file holds what, joint by joint{}\n",
                       format.columns.at("t").starts_with('#') ? "; numbers count from 0" : "");
    std::string columns = "t = " + quoted(format.columns.at("t"));
    for (const auto& [signal, names] : format.joint_columns) columns += fmt::format(", {} = {}", signal, list(names));
    out += fmt::format("columns = {{ {} }}\n", columns);
  }
  for (const std::string& note : guess.notes) out += fmt::format("# {}\n", note);
  if (!position_gain.empty()) {
    out += "# q looks like degrees: to rad\n";
    out += fmt::format("position_gain = [{:.10g}]\n", fmt::join(position_gain, ", "));
  }
  if (guess.torque_is_current) {
    out +=
        "# the torque's columns are currents: write torque constant x gear ratio of each joint [N*m/A], then check\n";
    out += fmt::format("torque_gain = [{}]\n", fmt::join(std::vector<std::string>(joints, "1.0"), ", "));
  }
}

void write_log_entry(const Recorded& log, const fs::path& directory, const std::string& role, double from, double to,
                     std::string& out) {
  const LogFacts& facts = log.facts;
  out += fmt::format("\n# {:.4g} s at {:.4g} Hz\n[[log]]\nfile = \"{}\"\nrole = \"{}\"\n", facts.seconds, facts.rate_hz,
                     fs::relative(log.file, directory).generic_string(), role);
  if (from > facts.begin_s) out += fmt::format("from_s = {}\n", seconds_text(from));
  if (to < facts.end_s) out += fmt::format("to_s = {}\n", seconds_text(to));
}

}  // namespace

std::string init_project(const std::vector<fs::path>& logs, const fs::path& urdf, const fs::path& directory) {
  const Robot robot = read_urdf(urdf);
  std::vector<bool> turns;
  for (const Joint& joint : robot.joints) turns.push_back(joint.type == JointType::revolute);
  const ColumnGuess guess = guess_columns(read_head(logs.front()), robot);
  if (!guess.missing.empty()) {
    throw InputError(
        fmt::format("{}: no column is seen for {}; name them: columns = {{ t = \"..\", q = [\"..\", ..], tau = "
                    "[\"..\", ..] }}",
                    logs.front().string(), fmt::join(guess.missing, ", ")));
  }
  LogFormat format = guess.format;
  std::vector<double> position_gain;
  std::vector<Recorded> recorded;
  const LogFactOptions options;
  for (const fs::path& file : logs) {
    try {
      recorded.push_back({file, facts_of(read_log(file, robot.size(), turns, format, {}, {}), options)});
    } catch (const InputError& error) {
      if (std::string(error.what()).find("degrees") == std::string::npos || !position_gain.empty()) throw;
      for (const bool turn : turns) position_gain.push_back(turn ? std::numbers::pi / 180 : 1);
      format.position_gain = position_gain;
      recorded.push_back({file, facts_of(read_log(file, robot.size(), turns, format, {}, {}), options)});
    }
  }

  std::string out = fmt::format("# {}: {} joints ({})\n", robot.name, robot.size(),
                                fmt::join(
                                    [&] {
                                      std::vector<std::string> names;
                                      for (const Joint& joint : robot.joints) names.push_back(joint.name);
                                      return names;
                                    }(),
                                    ", "));
  out += "# made by fxdyn init; go on with: fxdyn check PROJECT\n[robot]\n";
  out += fmt::format("urdf = \"{}\"\n", fs::relative(urdf, directory).generic_string());
  out += "# gravity = [0.0, 0.0, -9.81]   # in the base frame: write another where the base is not level\n";
  out += fmt::format("# rated_torque = [{}]   # of each joint, from the data sheet\n",
                     fmt::join(std::vector<std::string>(robot.size(), ".."), ", "));
  write_signals(guess, position_gain, robot.size(), out);

  const std::vector<std::string> roles = roles_of(recorded);
  for (std::size_t i = 0; i < recorded.size(); ++i) {
    const LogFacts& facts = recorded[i].facts;
    const double from = facts.rest_until_s - facts.begin_s > options.rest ? facts.rest_until_s : facts.begin_s;
    const double to = facts.end_s - facts.rest_from_s > options.rest ? facts.rest_from_s : facts.end_s;
    if (!roles.empty()) {
      write_log_entry(recorded[i], directory, roles[i], from, to, out);
      continue;
    }
    // One motion: its first two thirds fit, the rest judges. Better is another trajectory.
    if (i == 0) out += "\n# All logs show one motion. Record another one: it judges better than the end of this one.\n";
    const double cut = from + 2 * (to - from) / 3;
    write_log_entry(recorded[i], directory, "train", from, cut, out);
    write_log_entry(recorded[i], directory, "test", cut, to, out);
  }
  return out;
}

}  // namespace fxdyn
