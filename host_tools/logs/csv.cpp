#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>

#include "host_tools/bytes/foreign_format.hpp"
#include "host_tools/bytes/text_file.hpp"
#include "host_tools/logs/column_layout.hpp"
#include "host_tools/logs/recorded_log.hpp"
#include "host_tools/logs/time_unit.hpp"
#include "host_tools/support/error.hpp"

namespace fxdyn {
namespace {

std::vector<std::string> split(std::string_view line, char separator) {
  std::vector<std::string> fields;
  if (separator != ',') line = trim(line);
  while (true) {
    const std::size_t end = line.find(separator);
    fields.emplace_back(trim(line.substr(0, end)));
    if (end == std::string_view::npos) return fields;
    line.remove_prefix(end + 1);
  }
}

bool starts_with_number(std::string_view text) {
  double number = 0;
  return std::from_chars(text.data(), text.data() + text.size(), number).ec == std::errc();
}

class Rows {
 public:
  Rows(const std::string& file, const ColumnLayout& layout, char separator)
      : file_(file), layout_(layout), separator_(separator), values_(layout.names.size()) {}

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

  ColumnTable read(MappedFile& file, LineReader& lines, double from, double to, const TimeUnit& unit) {
    ColumnTable table;
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
    if (separator_ != ',') line = trim(line);
    const char* at = line.data();
    const char* const end = at + line.size();
    for (std::size_t field = 0; field < layout_.fields; ++field) {
      const int target = layout_.target[field];
      if (target >= 0) values_[static_cast<std::size_t>(target)] = value(at, end, number, target);
      at = std::find(at, end, separator_);
      const bool last = field + 1 == layout_.fields;
      if (last != (at == end)) wrong_count(line, number);
      if (!last) ++at;
    }
  }

  [[noreturn]] void wrong_count(std::string_view line, int number) const {
    fail(number, fmt::format("{} fields where the header has {}", std::count(line.begin(), line.end(), separator_) + 1,
                             layout_.fields));
  }

  /// The number at the start of a field.
  double value(const char* at, const char* end, int number, int target) const {
    const char* start = at;
    while (start < end && *start != separator_ && (*start == ' ' || *start == '\t' || *start == '+')) ++start;
    double result = 0;
    auto [stop, error] = std::from_chars(start, end, result);
    while (stop < end && *stop != separator_ && (*stop == ' ' || *stop == '\t' || *stop == '\r')) ++stop;
    if (error != std::errc() || (stop < end && *stop != separator_) || !std::isfinite(result)) {
      const std::string_view text = trim({at, static_cast<std::size_t>(std::find(at, end, separator_) - at)});
      fail(number, fmt::format("column '{}': '{}' is not a number; remove the row or repair it",
                               layout_.names[static_cast<std::size_t>(target)], text.substr(0, 40)));
    }
    return result;
  }

  std::string file_;
  const ColumnLayout& layout_;
  char separator_;
  std::vector<double> values_;
};

/// Of a file that starts with a row of numbers the columns are called #0, #1, ...
ColumnNames header(const std::string& file, int line, std::string_view text, char separator) {
  std::vector<std::string> names = split(text, separator);
  const bool has_names = !starts_with_number(names.front());
  for (std::size_t field = 0; field < names.size() && !has_names; ++field) names[field] = fmt::format("#{}", field);
  return ColumnNames(fmt::format("{}:{}", file, line), std::move(names), has_names);
}

/// The line that names the columns: the first one, or the comment in front of it where that is a row of numbers (as
/// numpy and rostopic write it).
ColumnNames header_of(LineReader& lines, const std::string& where, char separator) {
  LineReader ahead = lines;
  std::string_view first;
  if (!ahead.next(first))
    throw InputError(where + ":1: empty file; the first line must name the columns (t,q1,...,tau1,...)");
  const std::string_view comment = ahead.comment();
  const bool named_before =
      starts_with_number(trim(first)) && comment.find(separator) != std::string_view::npos &&
      std::count(comment.begin(), comment.end(), separator) == std::count(first.begin(), first.end(), separator);
  if (named_before) return header(where, ahead.number() - 1, comment, separator);
  lines = ahead;
  return header(where, lines.number(), first, separator);
}

}  // namespace

RecordedLog read_csv(const LogRequest& request) {
  const std::string where = request.file.string();
  MappedFile mapped(where);
  if (const std::string other = foreign_format(mapped.text()); !other.empty())
    throw InputError(fmt::format("{}: {}", where, other));
  LineReader lines(mapped.text());
  const char separator = separator_of(lines);
  ColumnNames header = header_of(lines, where, separator);
  const ColumnLayout layout = header.layout(request.joints, request.columns, request.torque_required);
  if (!header.has_names()) lines = LineReader(mapped.text());
  Rows rows(where, layout, separator);
  const bool time_is_known = layout.unit.has_value();
  const TimeUnit unit = time_is_known ? *layout.unit : unit_of_stamps(rows.first_stamps(lines), where);
  ColumnTable table = rows.read(mapped, lines, request.from, request.to, unit);
  const double first_t = table.first_t, last_t = table.last_t;
  Log log = to_log(std::move(table), layout, request.joints);
  if (!time_is_known && unit.per_second != 1) log.time_note = unit_note(unit, request.file.filename().string());
  return {std::move(log), first_t, last_t, time_is_known};
}

}  // namespace fxdyn
