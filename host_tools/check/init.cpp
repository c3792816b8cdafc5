#include "host_tools/check/init.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <optional>

#include "host_tools/check/check.hpp"
#include "host_tools/check/column_guess.hpp"
#include "host_tools/check/course.hpp"
#include "host_tools/logs/time_unit.hpp"
#include "host_tools/project/log_entries.hpp"
#include "host_tools/readers/log_reader.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/time_text.hpp"

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

std::vector<std::string> names_of(const Robot& robot) {
  std::vector<std::string> names;
  for (const Joint& joint : robot.joints) names.push_back(joint.name);
  return names;
}

/// Whether the names are those that a project need not say: q1, q2, ...; in a recording that names its joints, the
/// URDF's.
bool is_default(const LogFormat& format, const Robot& robot) {
  if (format.columns.size() > 1 + format.columns.count(topic_key) || format.columns.at("t") != "t") return false;
  return std::all_of(format.joint_columns.begin(), format.joint_columns.end(), [&](const auto& given) {
    const auto& [signal, names] = given;
    std::vector<std::string> numbered;
    for (std::size_t j = 0; j < names.size(); ++j) numbered.push_back(fmt::format("{}{}", signal, j + 1));
    return names == numbered || names == joint_columns_of(signal, names_of(robot));
  });
}

/// The joints' columns of a recording that names them: of the first topic that has what is needed.
ColumnGuess guess_topic(const std::vector<LogColumns>& topics, const Robot& robot) {
  std::optional<ColumnGuess> out;
  for (const LogColumns& topic : topics) {
    const auto has = [&](const std::string& name) {
      return std::find(topic.names.begin(), topic.names.end(), name) != topic.names.end();
    };
    ColumnGuess guess;
    guess.format.columns["t"] = "t";
    for (const char* signal : signal_names) {
      const std::vector<std::string> names = joint_columns_of(signal, names_of(robot));
      if (!names.empty() && std::all_of(names.begin(), names.end(), has)) guess.format.joint_columns[signal] = names;
    }
    const bool named = guess.format.joint_columns.contains("q") && guess.format.joint_columns.contains("tau");
    if (!named) guess = guess_columns(CsvHead{topic.names, {}, topic.names.size()}, robot);
    if (topics.size() > 1) {
      guess.format.columns[topic_key] = topic.topic;
      guess.notes.push_back(fmt::format("one of {} logs in the file, {} to {}; a [[log]] may have the topic of another",
                                        topics.size(), topics.front().topic, topics.back().topic));
    }
    if (guess.missing.empty()) return guess;
    if (!out) out = guess;
  }
  return *out;
}

struct Recorded {
  fs::path file;
  LogFacts facts;
  Course course;
  double from_s = 0, to_s = 0;  ///< without standstill
};

Recorded recorded_of(const fs::path& file, const Log& log, const LogFactOptions& options) {
  Recorded out{file, facts_of(log, options), {}};
  const LogFacts& facts = out.facts;
  out.from_s = facts.rest_until_s - facts.begin_s > options.rest ? facts.rest_until_s : facts.begin_s;
  out.to_s = facts.end_s - facts.rest_from_s > options.rest ? facts.rest_from_s : facts.end_s;
  out.course = course_of(log, facts.rest_until_s, facts.rest_from_s);
  return out;
}

/// The columns by their names, or as they are given.
ColumnGuess columns_in(const fs::path& file, const Robot& robot, const std::string& given) {
  const LogReader& reader = reader_of(file);
  ColumnGuess guess =
      reader.columns == nullptr ? guess_columns(read_head(file), robot) : guess_topic(reader.columns(file), robot);
  if (!given.empty()) {
    LogFormat named = columns_of(given, robot);
    for (const auto& [signal, prefix] : named.columns) {
      if (prefix.empty()) {
        guess.format.joint_columns.erase(signal);
        guess.format.columns[signal] = "";
        continue;
      }
      for (std::size_t j = 0; j < robot.size() && signal != "t"; ++j)
        named.joint_columns[signal].push_back(fmt::format("{}{}", prefix, j + 1));
    }
    const auto is_named = [&](const std::string& signal) {
      return signal == "t" ? named.columns.contains(signal) : named.joint_columns.contains(signal);
    };
    if (is_named("t")) {
      guess.format.columns["t"] = named.columns.at("t");
      guess.format.time_unit_s = 0;  // was that of another column
    }
    if (is_named("tau")) guess.torque_is_current = false;
    for (const auto& [signal, names] : named.joint_columns) guess.format.joint_columns[signal] = names;
    // "t in one column (..)"
    std::erase_if(guess.missing, [&](const std::string& what) { return is_named(what.substr(0, what.find(' '))); });
  }
  if (!guess.missing.empty()) {
    throw InputError(
        fmt::format("{}: no column is seen for {}; name them, or their numbers from 0: --columns '{{ t = "
                    "\"..\", q = [\"..\", ..], tau = [\"..\", ..] }}'",
                    file.string(), fmt::join(guess.missing, ", ")));
  }
  return guess;
}

/// Of one log; what stands for all of them has to be that of each.
double time_unit_in(const fs::path& file, const Robot& robot) {
  constexpr std::size_t rows = 2000;
  if (reader_of(file).columns != nullptr) return 0;
  return guess_columns(read_head(file, rows), robot).format.time_unit_s;
}

/// Roles by trajectories: repetitions of one motion share theirs. One motion: empty.
std::vector<std::string> roles_of(const std::vector<Recorded>& logs) {
  std::vector<std::size_t> motion;
  std::size_t motions = 0;
  for (std::size_t i = 0; i < logs.size(); ++i) {
    std::size_t same = i;
    for (std::size_t k = 0; k < i && same == i; ++k)
      if (same_course(logs[k].course, logs[i].course)) same = k;
    motion.push_back(same == i ? motions++ : motion[same]);
  }
  std::vector<std::string> roles;
  if (motions < 2) return roles;
  for (const std::size_t m : motion)
    roles.push_back(m + 1 == motions ? "test" : (motions > 2 && m + 2 == motions ? "validate" : "train"));
  return roles;
}

/// @param format of the guess, with what the numbers have shown of its units
void write_signals(const ColumnGuess& guess, const LogFormat& format, const Robot& robot, std::string& out) {
  const bool by_names = !format.columns.at("t").starts_with('#');
  const auto topic = format.columns.find(topic_key);
  if (is_default(format, robot) && !guess.torque_is_current && format.position_gain.empty() &&
      topic == format.columns.end() && format.time_unit_s == 0)
    return;
  out += "\n[signals]\n";
  if (topic != format.columns.end()) out += fmt::format("topic = \"{}\"\n", topic->second);
  if (format.time_unit_s > 0)
    out += fmt::format("time_unit = \"{}\"   # by the steps of the time stamps\n",
                       unit_of_seconds(format.time_unit_s).name);
  if (!is_default(format, robot)) {
    out += fmt::format("# which column of the file holds what, joint by joint{}\n",
                       by_names ? "" : "; numbers count from 0");
    std::string columns = "t = " + quoted(format.columns.at("t"));
    for (const auto& [signal, names] : format.joint_columns) columns += fmt::format(", {} = {}", signal, list(names));
    std::string left_out;
    for (const auto& [signal, prefix] : format.columns)
      if (prefix.empty()) left_out += fmt::format(", {} = false", signal);
    if (!left_out.empty()) out += "# its velocity is in another unit than q: left out, and differentiated from q\n";
    out += fmt::format("columns = {{ {}{} }}\n", columns, left_out);
  }
  for (const std::string& note : guess.notes) out += fmt::format("# {}\n", note);
  if (!format.position_gain.empty()) {
    out += "# q looks like degrees: to rad\n";
    out += fmt::format("position_gain = [{:.10g}]\n", fmt::join(format.position_gain, ", "));
  }
  if (guess.torque_is_current) {
    out +=
        "# the torque's columns are currents: write torque constant x gear ratio of each joint [N*m/A], then check\n";
    out += fmt::format("torque_gain = [{}]\n", fmt::join(std::vector<std::string>(robot.size(), "1.0"), ", "));
  }
}

std::string name_in_project(const fs::path& file, const fs::path& directory) {
  return file == "-" ? "-" : fs::relative(file, directory).generic_string();
}

void write_log_entry(const Recorded& log, const fs::path& directory, const std::string& role, double from, double to,
                     std::string& out) {
  const LogFacts& facts = log.facts;
  out += fmt::format("\n# {:.4g} s at {:.4g} Hz\n[[log]]\nfile = \"{}\"\nrole = \"{}\"\n", facts.seconds, facts.rate_hz,
                     name_in_project(log.file, directory), role);
  if (from > facts.begin_s) out += fmt::format("from_s = {}\n", time_text(from));
  if (to < facts.end_s) out += fmt::format("to_s = {}\n", time_text(to));
}

/// A log whose positions may be degrees: the format gets the gain, and loses a velocity that is in another unit.
Log read_in_its_unit(const fs::path& file, std::size_t joints, const std::vector<bool>& turns, LogFormat& format) {
  for (;;) {
    try {
      return read_log(file, joints, turns, format, {}, {});
    } catch (const InputError& error) {
      const std::string why = error.what();
      const bool gain = why.find("multiply by pi/180") != std::string::npos && format.position_gain.empty();
      const bool velocity = why.find("dq = false") != std::string::npos && format.joint_columns.contains("dq");
      if (!gain && !velocity) throw;
      for (const bool turn : turns)
        if (gain) format.position_gain.push_back(turn ? std::numbers::pi / 180 : 1);
      for (const char* signal : {"dq", "ddq"}) {
        if (velocity && format.joint_columns.erase(signal) > 0) format.columns[signal] = "";
      }
    }
  }
}

}  // namespace

std::string init_project(const std::vector<fs::path>& logs, const fs::path& urdf, const fs::path& directory,
                         const std::string& columns) {
  const Robot robot = read_urdf(urdf);
  std::vector<bool> turns;
  for (const Joint& joint : robot.joints) turns.push_back(joint.type == JointType::revolute);
  const ColumnGuess guess = columns_in(logs.front(), robot, columns);
  LogFormat format = guess.format;
  for (const fs::path& file : logs)
    if (format.time_unit_s > 0 && time_unit_in(file, robot) != format.time_unit_s) format.time_unit_s = 0;
  std::vector<Recorded> recorded;
  recorded.reserve(logs.size());
  const LogFactOptions options;
  for (const fs::path& file : logs)
    recorded.push_back(recorded_of(file, read_in_its_unit(file, robot.size(), turns, format), options));

  std::string out = fmt::format("# {}: {} joints ({})\n", robot.name, robot.size(), fmt::join(names_of(robot), ", "));
  out += "# made by fxdyn init; go on with: fxdyn check PROJECT\n[robot]\n";
  out += fmt::format("urdf = \"{}\"\n", fs::relative(urdf, directory).generic_string());
  out += "# gravity = [0.0, 0.0, -9.81]   # in the base frame: write another where the base is not level\n";
  out += fmt::format("# rated_torque = [{}]   # of each joint, from the data sheet\n",
                     fmt::join(std::vector<std::string>(robot.size(), ".."), ", "));
  write_signals(guess, format, robot, out);

  const std::vector<std::string> roles = roles_of(recorded);
  for (std::size_t i = 0; i < recorded.size(); ++i) {
    const double from = recorded[i].from_s, to = recorded[i].to_s;
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
