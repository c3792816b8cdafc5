#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <charconv>
#include <cmath>

#include "host_tools/signals/column_advice.hpp"
#include "host_tools/signals/foreign_format.hpp"
#include "host_tools/signals/log_reader.hpp"
#include "host_tools/signals/text_file.hpp"
#include "host_tools/signals/time_unit.hpp"
#include "host_tools/support/error.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;

enum Signal : std::size_t { q, dq, ddq, tau, qlink };

std::vector<std::string> split(std::string_view line) {
  std::vector<std::string> fields;
  while (true) {
    const std::size_t comma = line.find(',');
    fields.emplace_back(trim(line.substr(0, comma)));
    if (comma == std::string_view::npos) return fields;
    line.remove_prefix(comma + 1);
  }
}

bool starts_with_number(std::string_view text) {
  double number = 0;
  return std::from_chars(text.data(), text.data() + text.size(), number).ec == std::errc();
}

/// Which field of a row holds what.
struct Layout {
  std::size_t fields = 0;
  std::vector<int> target;                             ///< field -> column of the table of values, -1: not needed
  std::vector<std::string> names;                      ///< of the columns of that table
  std::array<std::vector<int>, signal_count> columns;  ///< signal, joint -> column of that table, -1: none
  std::optional<TimeUnit> unit;                        ///< of the stamps, where it is written down
  /// Whether two signals are read from the column.
  bool is_shared(int column) const {
    std::ptrdiff_t uses = 0;
    for (const auto& signal : columns) uses += std::count(signal.begin(), signal.end(), column);
    return uses > 1;
  }
};

class Header {
 public:
  Header(const std::string& file, int line, std::string_view text) : file_(file), line_(line), names_(split(text)) {
    layout_.fields = names_.size();
    layout_.target.assign(names_.size(), -1);
    has_names_ = !starts_with_number(names_.front());
    if (has_names_) return;
    for (std::size_t field = 0; field < names_.size(); ++field) names_[field] = fmt::format("#{}", field);
  }
  /// Else the file starts with a row of numbers: its columns are called #0, #1, ...
  bool has_names() const { return has_names_; }

  Layout layout(std::size_t joints, const LogFormat& format, bool torque_required) {
    joints_ = joints;
    const std::string time = prefix(format, "t");
    if (!take(time)) missing(time, "time stamps");
    layout_.unit = format.time_unit_s > 0 ? unit_of_seconds(format.time_unit_s) : unit_in_name(time);
    for (std::size_t signal = 0; signal < signal_count; ++signal) {
      const std::string name = signal_names[signal];
      if (const auto given = format.joint_columns.find(name); given != format.joint_columns.end()) {
        add_named(static_cast<Signal>(signal), given->second, joints);
        continue;
      }
      const auto prefix_of = format.columns.find(name);
      if (prefix_of != format.columns.end() && prefix_of->second.empty()) continue;  // not wanted
      const bool required = signal == q || (signal == tau && torque_required) || format.columns.contains(name);
      add(static_cast<Signal>(signal), prefix(format, name), joints, required);
    }
    return layout_;
  }

 private:
  static std::string prefix(const LogFormat& format, const std::string& signal) {
    const auto found = format.columns.find(signal);
    return found == format.columns.end() ? signal : found->second;
  }

  /// Where a column is, by its name or, as "#3", by its number from 0.
  std::vector<std::string>::const_iterator place_of(const std::string& name) const {
    const auto found = std::find(names_.begin(), names_.end(), name);
    if (found != names_.end() || !name.starts_with('#')) return found;
    std::size_t field = 0;
    const char* end = name.data() + name.size();
    const auto [stop, error] = std::from_chars(name.data() + 1, end, field);
    if (error != std::errc() || stop != end || field >= names_.size()) return names_.end();
    return names_.begin() + static_cast<std::ptrdiff_t>(field);
  }

  std::optional<int> take(const std::string& name) {
    const auto found = place_of(name);
    if (found == names_.end()) return std::nullopt;
    if (std::find(found + 1, names_.cend(), name) != names_.cend()) {
      throw InputError(fmt::format("{}:{}: column '{}' appears twice; rename one", file_, line_, name));
    }
    int& target = layout_.target[static_cast<std::size_t>(found - names_.begin())];
    if (target < 0) {
      target = static_cast<int>(layout_.names.size());
      layout_.names.push_back(name);
    }
    return target;
  }

  /// The columns that a project names joint by joint.
  void add_named(Signal signal, const std::vector<std::string>& names, std::size_t joints) {
    if (names.size() != joints) {
      throw InputError(fmt::format("{}:{}: columns.{} names {} columns for {} moving joints", file_, line_,
                                   signal_names[signal], names.size(), joints));
    }
    for (std::size_t joint = 0; joint < joints; ++joint) {
      const auto column = take(names[joint]);
      if (!column) missing(names[joint], fmt::format("signal {} of joint {}", signal_names[signal], joint + 1));
      layout_.columns[signal].push_back(*column);
    }
  }

  void add(Signal signal, const std::string& name, std::size_t joints, bool required) {
    std::vector<int> columns(joints, -1);
    std::string absent;
    std::size_t found = 0;
    for (std::size_t joint = 0; joint < joints; ++joint) {
      std::optional<int> column = take(fmt::format("{}{}", name, joint + 1));
      if (!column && joints == 1) column = take(name);  // one joint needs no number
      if (column) {
        columns[joint] = *column;
        ++found;
      } else if (absent.empty()) {
        absent = fmt::format("{}{}", name, joint + 1);
      }
    }
    const bool complete = found == joints || (signal == qlink && found > 0);  // not every joint has a second encoder
    if (!complete && (required || found > 0)) {
      missing(absent, fmt::format("signal {} of joint {}", signal_names[signal], absent.substr(name.size())));
    }
    if (complete) layout_.columns[signal] = columns;
    const std::string next = fmt::format("{}{}", name, joints + 1);
    const auto has = [&](const std::string& column) {
      return std::find(names_.begin(), names_.end(), column) != names_.end();
    };
    if (signal == q && has(name + "1") && has(next)) {
      throw InputError(
          fmt::format("{}:{}: column '{}', but the robot has {} moving joints; is this another robot's log? Else "
                      "remove the columns of "
                      "joints that the URDF does not have",
                      file_, line_, next, joints));
    }
  }

  [[noreturn]] void missing(const std::string& name, const std::string& meaning) const {
    if (name.starts_with('#')) {
      throw InputError(fmt::format("{}:{}: no column {} ({}): the file has {}, counted from 0", file_, line_,
                                   name.substr(1), meaning, names_.size()));
    }
    const std::string all = fmt::format("{}", fmt::join(names_, ","));
    if (names_.size() == 1 && all.find_first_of(";\t ") != std::string::npos) {
      throw InputError(fmt::format("{}:{}: no commas in the header '{}'; separate columns by commas", file_, line_,
                                   all.substr(0, 60)));
    }
    if (!has_names_) {
      throw InputError(fmt::format(
          "{}:{}: starts with a number; the first line must name the columns (t,q1,...,tau1,...), or the "
          "project gives the numbers of these {} columns, from 0: columns = {{ t = 0, q = [1], tau = [2] }}",
          file_, line_, names_.size()));
    }
    throw InputError(fmt::format("{}:{}: no column '{}' ({}); {}", file_, line_, name, meaning,
                                 column_advice(name, names_, joints_)));
  }

  std::string file_;
  int line_;
  std::vector<std::string> names_;
  bool has_names_ = true;
  std::size_t joints_ = 0;
  Layout layout_;
};

/// The rows of a window: column 0 is t.
struct Table {
  std::vector<std::vector<double>> columns;
  double first_t = 0, last_t = 0;  ///< of the whole file
  std::size_t rows() const { return columns[0].size(); }
};

class Rows {
 public:
  Rows(const std::string& file, const Layout& layout) : file_(file), layout_(layout), values_(layout.names.size()) {}

  /// Stamps as they stand, of the first rows.
  std::vector<double> first_stamps(LineReader lines) {
    constexpr std::size_t most = 2000;
    std::vector<double> stamps;
    for (std::string_view line; stamps.size() < most && lines.next(line);) {
      parse(line, lines.number());
      stamps.push_back(values_[0]);
    }
    return stamps;
  }

  Table read(MappedFile& file, LineReader& lines, double from, double to, const TimeUnit& unit) {
    Table table;
    table.columns.resize(layout_.names.size());
    // Columns that grow are held twice for a moment: room for as many rows as the first one says, and some more.
    const std::string_view rest = lines.rest();
    LineReader ahead(rest);
    std::string_view first;
    const std::size_t row = ahead.next(first) ? first.size() + 1 : rest.size() + 1;
    for (auto& column : table.columns) column.reserve(rest.size() / row * 21 / 20 + 16);
    double previous = -std::numeric_limits<double>::infinity();
    std::string_view line;
    std::size_t count = 0;
    while (lines.next(line)) {
      parse(line, lines.number());
      values_[0] /= unit.per_second;
      const double t = values_[0];
      if (!(t > previous)) {
        fail(lines.number(), fmt::format("time {} at {} s; sort the rows and remove doubles",
                                         t < previous ? "goes backwards" : "stands still", t));
      }
      if (count++ == 0) table.first_t = t;
      previous = table.last_t = t;
      file.release(line.data());
      if (t < from || t >= to) continue;
      for (std::size_t c = 0; c < values_.size(); ++c) table.columns[c].push_back(values_[c]);
    }
    if (count < 2) throw InputError(fmt::format("{}:{}: fewer than 2 rows of data", file_, lines.number()));
    return table;
  }

 private:
  [[noreturn]] void fail(int line, const std::string& what) const {
    throw InputError(fmt::format("{}:{}: {}", file_, line, what));
  }

  void parse(std::string_view line, int number) {
    const char* at = line.data();
    const char* const end = at + line.size();
    for (std::size_t field = 0; field < layout_.fields; ++field) {
      const int target = layout_.target[field];
      if (target >= 0) values_[static_cast<std::size_t>(target)] = value(at, end, number, target);
      at = std::find(at, end, ',');
      const bool last = field + 1 == layout_.fields;
      if (last != (at == end)) wrong_count(line, number);
      if (!last) ++at;
    }
  }

  [[noreturn]] void wrong_count(std::string_view line, int number) const {
    fail(number, fmt::format("{} fields where the header has {}", std::count(line.begin(), line.end(), ',') + 1,
                             layout_.fields));
  }

  /// The number at the start of a field.
  double value(const char* at, const char* end, int number, int target) const {
    const char* start = at;
    while (start < end && (*start == ' ' || *start == '\t' || *start == '+')) ++start;
    double result = 0;
    auto [stop, error] = std::from_chars(start, end, result);
    while (stop < end && (*stop == ' ' || *stop == '\t' || *stop == '\r')) ++stop;
    if (error != std::errc() || (stop < end && *stop != ',') || !std::isfinite(result)) {
      const std::string_view text = trim({at, static_cast<std::size_t>(std::find(at, end, ',') - at)});
      fail(number, fmt::format("column '{}': '{}' is not a number; remove the row or repair it",
                               layout_.names[static_cast<std::size_t>(target)], text.substr(0, 40)));
    }
    return result;
  }

  std::string file_;
  const Layout& layout_;
  std::vector<double> values_;
};

Log to_log(Table table, const Layout& layout, std::size_t joints) {
  Log log;
  const auto rows = static_cast<Index>(table.rows());
  log.t = Eigen::Map<const Eigen::VectorXd>(table.columns[0].data(), rows);
  const auto signals = signals_of(log);
  for (std::size_t s = 0; s < signal_count; ++s) {
    if (layout.columns[s].empty()) continue;
    signals[s]->setConstant(rows, static_cast<Index>(joints), std::numeric_limits<double>::quiet_NaN());
    for (std::size_t joint = 0; joint < joints; ++joint) {
      const int column = layout.columns[s][joint];
      if (column < 0) continue;
      std::vector<double>& values = table.columns[static_cast<std::size_t>(column)];
      signals[s]->col(static_cast<Index>(joint)) = Eigen::Map<const Eigen::VectorXd>(values.data(), rows);
      if (!layout.is_shared(column)) std::vector<double>().swap(values);
    }
  }
  return log;
}

/// The line that names the columns: the first one, or the comment in front of it where that is a row of numbers (as
/// numpy and rostopic write it).
Header header_of(LineReader& lines, const std::string& where) {
  LineReader ahead = lines;
  std::string_view first;
  if (!ahead.next(first))
    throw InputError(where + ":1: empty file; the first line must name the columns (t,q1,...,tau1,...)");
  const std::string_view comment = ahead.comment();
  const bool named_before =
      starts_with_number(trim(first)) && comment.find(',') != std::string_view::npos &&
      std::count(comment.begin(), comment.end(), ',') == std::count(first.begin(), first.end(), ',');
  if (named_before) return Header(where, ahead.number() - 1, comment);
  lines = ahead;
  return Header(where, lines.number(), first);
}

std::string unit_note(const std::string& file, const TimeUnit& unit) {
  return fmt::format(
      "{}: time stamps read as {}, by their steps; time_unit = \"{}\" in its [[log]] says it, or another of s, ms, "
      "us, ns",
      file, unit.name, unit.name);
}

}  // namespace

RecordedLog read_csv(const LogRequest& request) {
  const std::string where = request.file.string();
  MappedFile mapped(where);
  if (const std::string other = foreign_format(mapped.text()); !other.empty())
    throw InputError(fmt::format("{}: {}", where, other));
  LineReader lines(mapped.text());
  Header header = header_of(lines, where);
  const Layout layout = header.layout(request.joints, request.columns, request.torque_required);
  if (!header.has_names()) lines = LineReader(mapped.text());
  Rows rows(where, layout);
  const bool time_is_known = layout.unit.has_value();
  const TimeUnit unit = time_is_known ? *layout.unit : unit_of_stamps(rows.first_stamps(lines), where);
  Table table = rows.read(mapped, lines, request.from, request.to, unit);
  const double first_t = table.first_t, last_t = table.last_t;
  Log log = to_log(std::move(table), layout, request.joints);
  if (!time_is_known && unit.per_second != 1) log.time_note = unit_note(request.file.filename().string(), unit);
  return {std::move(log), first_t, last_t, time_is_known};
}

}  // namespace fxdyn
