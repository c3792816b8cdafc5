#include "host_tools/check/column_guess.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>
#include <limits>
#include <optional>

#include "host_tools/bytes/foreign_format.hpp"
#include "host_tools/bytes/text_file.hpp"
#include "host_tools/logs/time_unit.hpp"
#include "host_tools/support/error.hpp"

namespace fxdyn {
namespace {

std::vector<std::string> split(std::string_view line, char separator) {
  std::vector<std::string> fields;
  if (separator != ',') line = trim(line);
  for (;;) {
    const std::size_t end = line.find(separator);
    fields.emplace_back(trim(line.substr(0, end)));
    if (end == std::string_view::npos) return fields;
    line.remove_prefix(end + 1);
  }
}

double number_of(const std::string& text) {
  double value = 0;
  const auto [stop, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc() && stop == text.data() + text.size() ? value : std::numeric_limits<double>::quiet_NaN();
}

/// Words and numbers of a name: "actual_q_0" -> actual q 0, "tauMeasured3" -> tau measured 3.
std::vector<std::string> words_of(const std::string& name) {
  std::vector<std::string> words;
  char before = 0;
  for (const char c : name) {
    const bool digit = std::isdigit(static_cast<unsigned char>(c)) != 0;
    const bool letter = std::isalpha(static_cast<unsigned char>(c)) != 0;
    if (digit || letter) {
      const bool was_digit = std::isdigit(static_cast<unsigned char>(before)) != 0;
      const bool was_letter = std::isalpha(static_cast<unsigned char>(before)) != 0;
      const bool hump = letter && std::isupper(static_cast<unsigned char>(c)) != 0 &&
                        std::islower(static_cast<unsigned char>(before)) != 0;
      if (digit ? !was_digit : (!was_letter || hump)) words.emplace_back();
      words.back() += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    }
    before = c;
  }
  return words;
}

enum Kind : std::size_t { time, position, velocity, acceleration, torque, current, kinds };

bool is_one_of(const std::string& word, std::initializer_list<const char*> list) {
  return std::any_of(list.begin(), list.end(), [&](const char* one) { return word == one; });
}

std::optional<Kind> kind_of(const std::vector<std::string>& words) {
  const auto has = [&](std::initializer_list<const char*> list) {
    return std::any_of(words.begin(), words.end(), [&](const std::string& word) { return is_one_of(word, list); });
  };
  if (has({"ddq", "qdd", "acc", "accel", "acceleration", "accelerations"})) return acceleration;
  if (has({"dq", "qd", "vel", "qvel", "velocity", "velocities", "speed", "speeds"})) return velocity;
  if (has({"tau", "torque", "torques", "effort", "efforts", "moment"})) return torque;
  if (has({"current", "currents", "cur", "amps", "amp", "i", "iq"})) return current;
  if (has({"q", "pos", "qpos", "position", "positions", "angle", "angles"})) return position;
  if (has({"t", "time", "timestamp", "stamp", "timestamps", "stamps", "tout", "sec", "secs", "seconds", "clock"}))
    return time;
  // LeRobot's observation.state, whose numbers are positions where it does not call them anything else.
  if (has({"state"}) && has({"observation"})) return position;
  // A voltage has this letter, too, but more words beside it.
  if (words.size() == 2 && words.front() == "v" && std::isdigit(static_cast<unsigned char>(words.back()[0])) != 0)
    return velocity;
  return {};
}

/// What was made of the measured signal: taken where that is missing.
bool is_processed(const std::vector<std::string>& words) {
  return std::any_of(words.begin(), words.end(), [](const std::string& word) {
    return is_one_of(word, {"filtered", "filt", "smoothed", "est", "estimated"});
  });
}

/// What was asked of the robot, or what the controller thinks of the outside, rather than measured.
bool is_command(const std::vector<std::string>& words) {
  return std::any_of(words.begin(), words.end(), [](const std::string& word) {
    return is_one_of(word, {"target", "desired", "cmd", "command", "commanded", "ref", "reference", "goal", "error",
                            "des", "ext", "external", "residual", "action", "actions"});
  });
}

/// What drives a slide; other forces are those of a sensor at the tool.
bool is_drive_force(const std::vector<std::string>& words, const Robot& robot) {
  const bool slides = std::any_of(robot.joints.begin(), robot.joints.end(),
                                  [](const Joint& joint) { return joint.type == JointType::prismatic; });
  const auto has = [&](std::initializer_list<const char*> list) {
    return std::any_of(words.begin(), words.end(), [&](const std::string& word) { return is_one_of(word, list); });
  };
  return slides && has({"force", "forces", "thrust"}) && !has({"tcp", "tool", "ft", "wrench", "contact", "sensor"});
}

struct Column {
  std::string name;
  Kind kind{};
  std::size_t rank = 0;              ///< 0: measured, 1: made of it, 2: commanded or of the controller's model
  std::optional<std::size_t> joint;  ///< by its name
  std::optional<int> number;         ///< the last one in its name
};

std::string plain(const std::string& name) {
  std::string out;
  for (const std::string& word : words_of(name)) out += word;
  return out;
}

Column describe(const std::string& name, const Robot& robot) {
  Column out;
  out.name = name;
  std::string rest = plain(name);
  std::size_t longest = 0;
  for (std::size_t j = 0; j < robot.size(); ++j) {
    const std::string joint = plain(robot.joints[j].name);
    if (joint.size() <= longest || rest.find(joint) == std::string::npos) continue;
    longest = joint.size();
    out.joint = j;
  }
  const std::vector<std::string> words = words_of(name);
  for (const std::string& word : words) {
    int value = 0;
    if (std::from_chars(word.data(), word.data() + word.size(), value).ec == std::errc()) out.number = value;
  }
  const auto kind = kind_of(words);
  out.kind = kind.value_or(is_drive_force(words, robot) ? torque : kinds);
  out.rank = is_command(words) ? 2 : is_processed(words) ? 1 : 0;
  return out;
}

/// One column a joint of a kind: by the joints' names, else by numbers from 0 or 1. Those of lower rank first.
std::vector<std::string> columns_of(const std::vector<Column>& all, Kind kind, std::size_t joints,
                                    std::initializer_list<std::size_t> ranks = {0, 1, 2}) {
  for (const std::size_t rank : ranks) {
    std::vector<std::string> named(joints), counted(joints);
    for (const int first : {1, 0}) {
      std::fill(counted.begin(), counted.end(), "");
      for (const Column& column : all) {
        if (column.kind != kind || column.rank != rank) continue;
        if (column.joint && named[*column.joint].empty()) named[*column.joint] = column.name;
        const int at = column.number ? *column.number - first : (joints == 1 ? 0 : -1);
        if (at >= 0 && at < static_cast<int>(joints) && counted[static_cast<std::size_t>(at)].empty())
          counted[static_cast<std::size_t>(at)] = column.name;
      }
      for (const auto& names : {named, counted})
        if (std::none_of(names.begin(), names.end(), [](const std::string& name) { return name.empty(); }))
          return names;
    }
  }
  return {};
}

const char* signal_of(Kind kind) {
  constexpr std::array names{"t", "q", "dq", "ddq", "tau", "tau"};
  return names[kind];
}

ColumnGuess by_names(const CsvHead& head, const Robot& robot) {
  ColumnGuess out;
  std::vector<Column> all;
  for (const std::string& name : head.names) all.push_back(describe(name, robot));
  const auto t = std::find_if(all.begin(), all.end(), [](const Column& column) { return column.kind == time; });
  const auto is_nano = [](const Column& column) {
    const std::vector<std::string> words = words_of(column.name);
    return std::any_of(words.begin(), words.end(), [](const std::string& word) {
      return is_one_of(word, {"nanosec", "nsec", "nsecs", "nanoseconds"});
    });
  };
  if (t != all.end() && std::any_of(all.begin(), all.end(), is_nano) && words_of(t->name).back() == "sec") {
    out.missing.push_back(fmt::format("t in one column ({} has whole seconds: add its nanoseconds / 1e9)", t->name));
  } else if (t != all.end()) {
    out.format.columns["t"] = t->name;
  } else {
    out.missing.push_back("t");
  }
  for (const Kind kind : {position, velocity, acceleration, torque}) {
    std::vector<std::string> names;
    if (kind == torque) {
      names = columns_of(all, torque, robot.size(), {0, 1});
      if (names.empty()) names = columns_of(all, current, robot.size(), {0, 1});
      out.torque_is_current = !names.empty() && describe(names.front(), robot).kind == current;
    }
    if (names.empty()) {
      names = columns_of(all, kind, robot.size());
      if (kind == torque && !names.empty())
        out.notes.push_back(
            "no measured torque or current is seen: these are commanded, or the controller's own estimate");
    }
    if (!names.empty()) {
      out.format.joint_columns[signal_of(kind)] = names;
    } else if (kind == position || kind == torque) {
      out.missing.push_back(signal_of(kind));
    }
  }
  return out;
}

/// The unit that the steps of a CSV's stamps show, as long as no name says one: 0 where it may be seconds.
double time_unit_of(const CsvHead& head, const std::string& name) {
  constexpr std::size_t most = 2000;
  const auto named = std::find(head.names.begin(), head.names.end(), name);
  const std::size_t column = head.names.empty() ? 0 : static_cast<std::size_t>(named - head.names.begin());
  if (column >= head.columns || unit_in_name(name)) return 0;
  std::vector<double> stamps;
  for (const std::vector<double>& row : head.rows) {
    if (stamps.size() == most || !std::isfinite(row[column])) break;
    stamps.push_back(row[column]);
  }
  try {
    const TimeUnit unit = unit_of_stamps(stamps, name);
    return unit.per_second > 1 ? 1 / unit.per_second : 0;
  } catch (const InputError&) {
    return 0;  // said where the log is read
  }
}

/// Whether column b is the time derivative of column a: over 50 ms, which a coarse encoder's steps do not hide, and
/// over the whole file, which may begin at rest.
bool is_derivative(const CsvHead& head, std::size_t a, std::size_t b) {
  constexpr double span_s = 0.05;
  constexpr double unlike = 0.1;  // share of the square that another signal exceeds by far
  const std::size_t count = head.rows.size();
  const double step = (head.rows[count - 1][0] - head.rows[0][0]) / static_cast<double>(count - 1);
  const auto span = std::clamp<std::size_t>(static_cast<std::size_t>(step > 0 ? span_s / step : 1), 1,
                                            std::max<std::size_t>(1, count / 4));
  double error = 0, size = 0;
  for (std::size_t first = 0; first + span < count; first += span) {
    double moved = 0;
    for (std::size_t k = first + 1; k <= first + span; ++k)
      moved += (head.rows[k][b] + head.rows[k - 1][b]) / 2 * (head.rows[k][0] - head.rows[k - 1][0]);
    const double difference = head.rows[first + span][a] - head.rows[first][a] - moved;
    error += difference * difference;
    size += moved * moved;
  }
  return size > 0 && error < unlike * size;
}

/// t, then blocks of one column a joint: q, dq and ddq where they are derivatives, tau.
ColumnGuess by_numbers(const CsvHead& head, const Robot& robot) {
  ColumnGuess out;
  const std::size_t n = robot.size();
  if (head.columns < 1 + 2 * n) {
    out.missing = {"t", "q", "tau"};
    out.notes.push_back(fmt::format("{} columns are too few for t and q, tau of {} joints", head.columns, n));
    return out;
  }
  const auto block = [&](std::size_t first) {
    std::vector<std::string> names;
    for (std::size_t j = 0; j < n; ++j) names.push_back(fmt::format("#{}", first + j));
    return names;
  };
  out.format.columns["t"] = "#0";
  out.format.joint_columns["q"] = block(1);
  std::size_t next = 1 + n;
  for (const char* signal : {"dq", "ddq"}) {
    if (head.columns < next + 2 * n) break;
    std::size_t derivatives = 0;
    for (std::size_t j = 0; j < n; ++j) derivatives += is_derivative(head, next - n + j, next + j);
    if (2 * derivatives <= n) break;
    out.format.joint_columns[signal] = block(next);
    next += n;
  }
  out.format.joint_columns["tau"] = block(next);
  out.notes.push_back("the file names no columns: this order is a guess; check it");
  out.notes.push_back(
      "are the last ones currents? Then write torque_gain = [..]: torque constant x gear ratio of each joint");
  if (head.columns > next + n) out.notes.push_back(fmt::format("columns from {} on are not used", next + n));
  return out;
}

}  // namespace

CsvHead read_head(const std::filesystem::path& file, std::size_t rows) {
  CsvHead head;
  MappedFile mapped(file.string());
  if (const std::string other = foreign_format(mapped.text()); !other.empty())
    throw InputError(fmt::format("{}: {}", file.string(), other));
  LineReader lines(mapped.text());
  const char separator = separator_of(lines);
  std::string_view line;
  while (head.rows.size() < rows && lines.next(line)) {
    const std::vector<std::string> fields = split(line, separator);
    if (head.columns == 0) {
      head.columns = fields.size();
      if (std::isnan(number_of(fields.front()))) {
        head.names = fields;
        continue;
      }
    }
    if (fields.size() != head.columns) break;
    std::vector<double>& row = head.rows.emplace_back();
    for (const std::string& field : fields) row.push_back(number_of(field));
  }
  const bool one_field = head.columns == 1 && !head.names.empty();
  if (one_field && head.names.front().find_first_of("; \t") != std::string::npos)
    throw InputError(file.string() + ": its fields are not apart by commas: write them with commas");
  if (head.rows.size() < 2) throw InputError(file.string() + ": no rows of numbers with commas between them");
  return head;
}

ColumnGuess guess_columns(const CsvHead& head, const Robot& robot) {
  ColumnGuess out = head.names.empty() ? by_numbers(head, robot) : by_names(head, robot);
  const auto time = out.format.columns.find("t");
  if (time != out.format.columns.end() && !head.rows.empty()) out.format.time_unit_s = time_unit_of(head, time->second);
  return out;
}

}  // namespace fxdyn
