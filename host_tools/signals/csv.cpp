#include <fcntl.h>
#include <fmt/format.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <fstream>
#include <limits>
#include <numbers>
#include <string_view>
#include <system_error>

#include "host_tools/signals/log.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/nearest.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;

/// A file in memory.
class MappedFile {
 public:
  explicit MappedFile(const std::string& path) {
    const int descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
    struct stat status {};
    const bool regular = descriptor >= 0 && ::fstat(descriptor, &status) == 0 && S_ISREG(status.st_mode);
    if (regular && status.st_size > 0) {
      size_ = static_cast<std::size_t>(status.st_size);
      data_ = ::mmap(nullptr, size_, PROT_READ, MAP_PRIVATE, descriptor, 0);
    }
    if (descriptor >= 0) ::close(descriptor);
    if (!regular || data_ == MAP_FAILED) throw InputError(path + ": can't be read; check the path of the log");
  }
  ~MappedFile() {
    if (size_ > 0) ::munmap(data_, size_);
  }
  MappedFile(const MappedFile&) = delete;
  MappedFile& operator=(const MappedFile&) = delete;
  std::string_view text() const { return {static_cast<const char*>(data_), size_}; }
  /// What is before `at` is not needed any more: a long log does not stay in memory beside its numbers.
  void release(const char* at) {
    const auto page = static_cast<std::size_t>(::sysconf(_SC_PAGESIZE));
    const std::size_t end = static_cast<std::size_t>(at - static_cast<const char*>(data_)) / page * page;
    if (end < released_ + (std::size_t{16} << 20)) return;
    ::madvise(static_cast<char*>(data_) + released_, end - released_, MADV_DONTNEED);
    released_ = end;
  }

 private:
  void* data_ = nullptr;
  std::size_t size_ = 0, released_ = 0;
};

std::string_view trim(std::string_view text) {
  const auto blank = [](char c) { return c == ' ' || c == '\t' || c == '\r' || c == '"'; };
  while (!text.empty() && blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && blank(text.back())) text.remove_suffix(1);
  return text;
}

/// Line by line, with numbers.
class LineReader {
 public:
  LineReader(std::string_view text) : rest_(text) {
    if (rest_.starts_with("\xEF\xBB\xBF")) rest_.remove_prefix(3);
  }
  /// The next line that is not blank.
  bool next(std::string_view& line) {
    while (!rest_.empty()) {
      const std::size_t end = rest_.find('\n');
      line = rest_.substr(0, end);
      rest_.remove_prefix(end == std::string_view::npos ? rest_.size() : end + 1);
      ++number_;
      if (!trim(line).empty()) return true;
    }
    return false;
  }
  int number() const { return number_; }
  std::string_view rest() const { return rest_; }

 private:
  std::string_view rest_;
  int number_ = 0;
};

std::vector<std::string> split(std::string_view line) {
  std::vector<std::string> fields;
  while (true) {
    const std::size_t comma = line.find(',');
    fields.emplace_back(trim(line.substr(0, comma)));
    if (comma == std::string_view::npos) return fields;
    line.remove_prefix(comma + 1);
  }
}

enum Signal { q, dq, ddq, tau, qlink, signal_count };
constexpr std::array<const char*, signal_count> signal_names{"q", "dq", "ddq", "tau", "qlink"};

/// Which field of a row holds what.
struct Layout {
  std::size_t fields = 0;
  std::vector<int> target;                             ///< field -> column of the table of values, -1: not needed
  std::vector<std::string> names;                      ///< of the columns of that table
  std::array<std::vector<int>, signal_count> columns;  ///< signal, joint -> column of that table, -1: none
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
  }

  Layout layout(std::size_t joints, const LogFormat& format, bool torque_required) {
    if (!take(prefix(format, "t"))) missing(prefix(format, "t"), "time stamps in s");
    for (int signal = 0; signal < signal_count; ++signal) {
      const std::string name = signal_names[static_cast<std::size_t>(signal)];
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

  std::optional<int> take(const std::string& name) {
    const auto found = std::find(names_.begin(), names_.end(), name);
    if (found == names_.end()) return std::nullopt;
    if (std::find(found + 1, names_.end(), name) != names_.end()) {
      throw InputError(fmt::format("{}:{}: column '{}' appears twice; rename one", file_, line_, name));
    }
    int& target = layout_.target[static_cast<std::size_t>(found - names_.begin())];
    if (target < 0) {
      target = static_cast<int>(layout_.names.size());
      layout_.names.push_back(name);
    }
    return target;
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
    const std::string all = fmt::format("{}", fmt::join(names_, ","));
    if (names_.size() == 1 && all.find_first_of(";\t ") != std::string::npos) {
      throw InputError(fmt::format("{}:{}: no commas in the header '{}'; separate columns by commas", file_, line_,
                                   all.substr(0, 60)));
    }
    double number = 0;
    if (std::from_chars(all.data(), all.data() + all.size(), number).ec == std::errc()) {
      throw InputError(fmt::format(
          "{}:{}: starts with a number; the first line must name the columns (t,q1,...,tau1,...)", file_, line_));
    }
    throw InputError(fmt::format("{}:{}: no column '{}' ({}); nearest is '{}' (map it with columns = {{ ... }})", file_,
                                 line_, name, meaning, nearest(name, names_)));
  }

  std::string file_;
  int line_;
  std::vector<std::string> names_;
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

  Table read(MappedFile& file, LineReader& lines, double from, double to) {
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

Eigen::VectorXd differences(const Eigen::VectorXd& x) { return x.tail(x.size() - 1) - x.head(x.size() - 1); }

double quantile(Eigen::VectorXd x, double share) {
  const auto at = static_cast<std::ptrdiff_t>(share * static_cast<double>(x.size() - 1));
  std::nth_element(x.begin(), x.begin() + at, x.end());
  return x[at];
}

/// Median step; sets `resampled` where the stamps are not uniform to 1 % of it.
double check_stamps(Log& log, const std::string& file) {
  const Eigen::VectorXd steps = differences(log.t);
  const double step = quantile(steps, 0.5);
  Index widest = 0;
  const double gap = steps.maxCoeff(&widest);
  if (gap > 10 * step) {
    throw InputError(
        fmt::format("{}: gap of {:.6g} s after t = {:.9g} s (the step is {:.6g} s); use windows (from_s, to_s) "
                    "on either side of it",
                    file, gap, log.t[widest], step));
  }
  const double mean = (log.t[log.t.size() - 1] - log.t[0]) / static_cast<double>(steps.size());
  // Stamps written with few digits alternate about the grid: what counts is the distance from it.
  double jitter = 0;
  for (Index i = 0; i < log.t.size(); ++i) {
    jitter = std::max(jitter, std::abs(log.t[i] - (log.t[0] + mean * static_cast<double>(i))));
  }
  log.resampled = jitter > 0.01 * step && (steps.array() - step).abs().maxCoeff() > 0.01 * step;
  return log.resampled ? step : mean;
}

/// Linear interpolation of every column to a grid of `step`.
Eigen::MatrixXd resample(const Eigen::MatrixXd& columns, const Eigen::VectorXd& t, const Eigen::VectorXd& grid) {
  Eigen::MatrixXd result(grid.size(), columns.cols());
  Index left = 0;
  for (Index i = 0; i < grid.size(); ++i) {
    while (left + 2 < t.size() && t[left + 1] <= grid[i]) ++left;
    const double share = std::clamp((grid[i] - t[left]) / (t[left + 1] - t[left]), 0.0, 1.0);
    result.row(i) = (1 - share) * columns.row(left) + share * columns.row(left + 1);
  }
  return result;
}

}  // namespace

Eigen::MatrixXd interpolate(const Eigen::MatrixXd& columns, const Eigen::VectorXd& t, const Eigen::VectorXd& at) {
  return resample(columns, t, at);
}

double encoder_step(const Eigen::Ref<const Eigen::VectorXd>& q) {
  double smallest = 1e300, largest = 0;
  for (Index k = 1; k < q.size(); ++k) {
    const double step = std::fabs(q[k] - q[k - 1]);
    largest = std::max(largest, step);
    if (step > 1e-12) smallest = std::min(smallest, step);
  }
  if (smallest > largest) return 0;
  Index counted = 0, multiples = 0;
  for (Index k = 1; k < q.size(); ++k) {
    const double steps = std::fabs(q[k] - q[k - 1]) / smallest;
    if (steps < 0.5 || steps > 10) continue;  // of more the first one's rounding makes any number
    ++counted;
    multiples += std::fabs(steps - std::round(steps)) < 0.02 * steps + 0.02;
  }
  return counted > 20 && static_cast<double>(multiples) > 0.9 * static_cast<double>(counted) ? smallest : 0;
}

namespace {

void resample(Log& log, double step) {
  const double length = log.t[log.t.size() - 1] - log.t[0];
  const auto count = static_cast<Index>(std::floor(length / step * (1 + 1e-12))) + 1;
  const Eigen::VectorXd grid =
      Eigen::VectorXd::LinSpaced(count, 0, static_cast<double>(count - 1)).array() * step + log.t[0];
  for (Eigen::MatrixXd* signal : {&log.q, &log.dq, &log.ddq, &log.tau, &log.qlink}) {
    if (signal->size() > 0) *signal = resample(*signal, log.t, grid);
  }
  log.t = grid;
}

/// Takes out jumps by about one turn between two samples.
void unwrap(Eigen::Ref<Eigen::VectorXd> angle) {
  constexpr double turn = 2 * std::numbers::pi;
  double offset = 0;
  for (Index i = 1; i < angle.size(); ++i) {
    const double jump = angle[i] + offset - angle[i - 1];
    if (std::abs(std::abs(jump) - turn) < 1.0) offset -= std::copysign(turn, jump);
    angle[i] += offset;
  }
}

/// Units: compares dq with the slope of q.
void check_velocity(const Log& log, Index joint, bool revolute, const std::string& where) {
  constexpr double degrees = 180 / std::numbers::pi;
  // Over 20 ms on either side: the slope from one sample to the next is mostly the encoder's noise.
  const Index half = std::max<Index>(1, static_cast<Index>(0.02 / log.step_s));
  const Index n = log.samples() - 2 * half;
  if (n < 5) return;
  const Eigen::VectorXd span = log.t.tail(n) - log.t.head(n);
  const Eigen::VectorXd slope = (log.q.col(joint).tail(n) - log.q.col(joint).head(n)).cwiseQuotient(span);
  const Eigen::VectorXd dq = log.dq.col(joint).segment(half, n);
  const double power = dq.squaredNorm();
  if (power == 0 || slope.dot(dq) < 0.7 * slope.norm() * dq.norm()) return;  // too noisy or at rest: can't tell
  const double ratio = slope.dot(dq) / power;
  const auto near = [ratio](double value) { return std::abs(ratio / value - 1) < 0.15; };
  if (revolute && near(degrees)) {
    throw InputError(
        fmt::format("{}: q{} looks like degrees (it changes {:.3g} times as fast as dq{} says); multiply by pi/180",
                    where, joint + 1, ratio, joint + 1));
  }
  if (revolute && near(1 / degrees)) {
    throw InputError(
        fmt::format("{}: dq{} looks like degrees (q{} changes only {:.3g} times as fast); multiply by pi/180", where,
                    joint + 1, joint + 1, ratio));
  }
  if (near(1e-3)) {
    throw InputError(fmt::format(
        "{}: t looks like milliseconds (q{} changes only {:.3g} times as fast as dq{} says); divide by 1000", where,
        joint + 1, ratio, joint + 1));
  }
}

/// Units without dq: a joint that turns more than four times, less than an arm's few hundred degrees do as radians, and
/// does so faster than robots turn for a good part of the log.
void check_range(const Log& log, Index joint, const std::string& where) {
  const double range = log.q.col(joint).maxCoeff() - log.q.col(joint).minCoeff();
  if (range < 25 || range > 800) return;
  const Index stride =
      std::clamp<Index>(static_cast<Index>(0.02 / log.step_s), 1, std::max<Index>(1, log.samples() / 4));
  const Index n = log.samples() - stride;
  const Eigen::VectorXd speed =
      (log.q.col(joint).tail(n) - log.q.col(joint).head(n)).cwiseAbs() / (static_cast<double>(stride) * log.step_s);
  const double fast = quantile(speed, 0.9);
  if (fast < 25) return;
  throw InputError(fmt::format("{}: q{} looks like degrees (range {:.3g}, {:.3g} per second), multiply by pi/180",
                               where, joint + 1, range, fast));
}

/// Slow logs: one joint may turn more than twice, but not nearly every joint of an arm.
void check_ranges(const Log& log, const std::vector<bool>& revolute, const std::string& where) {
  std::size_t turning = 0;
  double widest = 0;
  for (Index joint = 0; joint < log.joints(); ++joint) {
    if (!revolute[static_cast<std::size_t>(joint)]) continue;
    const double range = log.q.col(joint).maxCoeff() - log.q.col(joint).minCoeff();
    if (range > 4 * std::numbers::pi) ++turning;
    widest = std::max(widest, range);
  }
  const auto count = static_cast<std::size_t>(std::count(revolute.begin(), revolute.end(), true));
  if (count < 3 || turning + 1 < count || widest > 800) return;
  throw InputError(fmt::format("{}: q looks like degrees ({} of {} joints turn more than twice), multiply by pi/180",
                               where, turning, count));
}

Log to_log(Table table, const Layout& layout, std::size_t joints, const LogFormat& format) {
  Log log;
  const auto rows = static_cast<Index>(table.rows());
  log.t = Eigen::Map<const Eigen::VectorXd>(table.columns[0].data(), rows);
  const std::array<Eigen::MatrixXd*, signal_count> signals{&log.q, &log.dq, &log.ddq, &log.tau, &log.qlink};
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
  if (log.tau.size() > 0) {
    for (std::size_t joint = 0; joint < format.torque_gain.size(); ++joint) {
      log.tau.col(static_cast<Index>(joint)) *= format.torque_gain[joint];
    }
  }
  return log;
}

void append(std::string& out, double value) {
  std::array<char, 32> text;
  const auto end = std::to_chars(text.data(), text.data() + text.size(), value, std::chars_format::general, 17).ptr;
  out.append(text.data(), end);
}

}  // namespace

std::string to_string(Role role) {
  switch (role) {
    case Role::baseline:
      return "baseline";
    case Role::train:
      return "train";
    case Role::validate:
      return "validate";
    case Role::test:
      return "test";
  }
  return "";
}

Log read_log(const std::filesystem::path& file, std::size_t joints, const std::vector<bool>& revolute,
             const LogFormat& format, std::optional<double> from_s, std::optional<double> to_s, bool torque_required) {
  const std::string where = file.string();
  if (!format.torque_gain.empty() && format.torque_gain.size() != joints) {
    throw InputError(
        fmt::format("{}: torque_gain has {} values for {} joints", where, format.torque_gain.size(), joints));
  }
  MappedFile mapped(where);
  LineReader lines(mapped.text());
  std::string_view first;
  if (!lines.next(first))
    throw InputError(where + ":1: empty file; the first line must name the columns (t,q1,...,tau1,...)");
  const Layout layout = Header(where, lines.number(), first).layout(joints, format, torque_required);
  constexpr double infinity = std::numeric_limits<double>::infinity();
  const double from = from_s.value_or(-infinity), to = to_s.value_or(infinity);
  Table table = Rows(where, layout).read(mapped, lines, from, to);
  if (table.rows() < 2) {
    throw InputError(fmt::format("{}: the window [{:.9g}, {:.9g}) s holds {} rows; the file has {:.9g} to {:.9g} s",
                                 where, from, to, table.rows(), table.first_t, table.last_t));
  }

  Log log = to_log(std::move(table), layout, joints, format);
  log.file = file;
  log.step_s = check_stamps(log, where);
  log.from_s = from_s.value_or(log.t[0]);
  log.to_s = to_s.value_or(log.t[log.t.size() - 1] + log.step_s);
  for (Index joint = 0; joint < log.joints(); ++joint) {
    const bool turns = revolute[static_cast<std::size_t>(joint)];
    if (turns) unwrap(log.q.col(joint));
    if (turns && log.qlink.size() > 0) unwrap(log.qlink.col(joint));
    if (log.dq.size() > 0) check_velocity(log, joint, turns, where);
    if (turns) check_range(log, joint, where);
  }
  check_ranges(log, revolute, where);
  if (log.resampled) {
    log.stamps = log.t;
    log.encoder_step.resize(log.joints());  // between samples there are no steps
    for (Index joint = 0; joint < log.joints(); ++joint) log.encoder_step[joint] = encoder_step(log.q.col(joint));
    resample(log, log.step_s);
  }
  return log;
}

void write_log(const std::filesystem::path& file, const Log& log) {
  std::string out = "t";
  std::vector<std::pair<const Eigen::MatrixXd*, Index>> columns;
  const std::array<const Eigen::MatrixXd*, signal_count> signals{&log.q, &log.dq, &log.ddq, &log.tau, &log.qlink};
  for (std::size_t s = 0; s < signal_count; ++s) {
    for (Index joint = 0; joint < signals[s]->cols(); ++joint) {
      if (signals[s]->rows() > 0 && std::isnan((*signals[s])(0, joint))) continue;  // no second encoder
      out += fmt::format(",{}{}", signal_names[s], joint + 1);
      columns.emplace_back(signals[s], joint);
    }
  }
  out += '\n';

  std::error_code error;
  if (file.has_parent_path()) std::filesystem::create_directories(file.parent_path(), error);
  std::filesystem::path temporary = file;
  temporary += ".tmp";
  std::ofstream stream(temporary, std::ios::binary | std::ios::trunc);
  for (Index i = 0; i < log.samples(); ++i) {
    append(out, log.t[i]);
    for (const auto& [signal, joint] : columns) {
      out += ',';
      append(out, (*signal)(i, joint));
    }
    out += '\n';
    if (out.size() > (1U << 20)) {
      stream.write(out.data(), static_cast<std::streamsize>(out.size()));
      out.clear();
    }
  }
  stream.write(out.data(), static_cast<std::streamsize>(out.size()));
  stream.close();
  if (!stream) throw InputError(file.string() + ": can't be written; check that the directory exists and has room");
  std::filesystem::rename(temporary, file);
}

}  // namespace fxdyn
