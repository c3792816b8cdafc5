#include "host_tools/logs/column_layout.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <charconv>
#include <map>

#include "host_tools/logs/column_advice.hpp"
#include "host_tools/support/error.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;

enum Signal : std::size_t { q, dq, ddq, tau, qlink };

std::string prefix(const LogFormat& format, const std::string& signal) {
  const auto found = format.columns.find(signal);
  return found == format.columns.end() ? signal : found->second;
}

}  // namespace

ColumnNames::ColumnNames(std::string where, std::vector<std::string> names, bool has_names)
    : where_(std::move(where)), names_(std::move(names)), has_names_(has_names) {
  layout_.fields = names_.size();
  layout_.target.assign(names_.size(), -1);
}

ColumnLayout ColumnNames::layout(std::size_t joints, const LogFormat& format, bool torque_required) {
  joints_ = joints;
  const std::string time = prefix(format, "t");
  if (!take(time)) missing("t", time, "time stamps");
  layout_.unit = format.time_unit_s > 0 ? unit_of_seconds(format.time_unit_s) : unit_in_name(time);
  for (std::size_t signal = 0; signal < signal_count; ++signal) {
    const std::string name = signal_names[signal];
    if (const auto given = format.joint_columns.find(name); given != format.joint_columns.end()) {
      add_named(signal, given->second, joints);
      continue;
    }
    const auto prefix_of = format.columns.find(name);
    if (prefix_of != format.columns.end() && prefix_of->second.empty()) continue;  // not wanted
    const bool required = signal == q || (signal == tau && torque_required) || format.columns.contains(name);
    add(signal, prefix(format, name), joints, required);
  }
  if (!format.joint_columns.empty()) refuse_two_uses();  // prefixes may be the same: a log of torques alone
  return layout_;
}

void ColumnNames::refuse_two_uses() const {
  std::map<int, std::string> uses;
  for (std::size_t signal = 0; signal < signal_count; ++signal) {
    for (std::size_t joint = 0; joint < layout_.columns[signal].size(); ++joint) {
      const int column = layout_.columns[signal][joint];
      const std::string use = fmt::format("{} of joint {}", signal_names[signal], joint + 1);
      const auto [before, first] = uses.emplace(column, use);
      if (column < 0 || first) continue;
      throw InputError(fmt::format("{}: column '{}' is {} and {}; a column is one signal: correct `columns`", where_,
                                   layout_.names[static_cast<std::size_t>(column)], before->second, use));
    }
  }
}

/// Where a column is, by its name or, as "#3", by its number from 0.
std::vector<std::string>::const_iterator ColumnNames::place_of(const std::string& name) const {
  const auto found = std::find(names_.begin(), names_.end(), name);
  if (found != names_.end() || !name.starts_with('#')) return found;
  std::size_t field = 0;
  const char* end = name.data() + name.size();
  const auto [stop, error] = std::from_chars(name.data() + 1, end, field);
  if (error != std::errc() || stop != end || field >= names_.size()) return names_.end();
  return names_.begin() + static_cast<std::ptrdiff_t>(field);
}

std::optional<int> ColumnNames::take(const std::string& name) {
  const auto found = place_of(name);
  if (found == names_.end()) return std::nullopt;
  if (std::find(found + 1, names_.cend(), name) != names_.cend()) {
    throw InputError(fmt::format("{}: column '{}' appears twice; rename one", where_, name));
  }
  int& target = layout_.target[static_cast<std::size_t>(found - names_.begin())];
  if (target < 0) {
    target = static_cast<int>(layout_.names.size());
    layout_.names.push_back(name);
  }
  return target;
}

/// The columns that a project names joint by joint.
void ColumnNames::add_named(std::size_t signal, const std::vector<std::string>& names, std::size_t joints) {
  if (names.size() != joints) {
    throw InputError(fmt::format("{}: columns.{} names {} columns for {} moving joints", where_, signal_names[signal],
                                 names.size(), joints));
  }
  for (std::size_t joint = 0; joint < joints; ++joint) {
    const auto column = take(names[joint]);
    if (!column)
      missing(signal_names[signal], names[joint],
              fmt::format("signal {} of joint {}", signal_names[signal], joint + 1));
    layout_.columns[signal].push_back(*column);
  }
}

void ColumnNames::add(std::size_t signal, const std::string& name, std::size_t joints, bool required) {
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
    missing(signal_names[signal], absent,
            fmt::format("signal {} of joint {}", signal_names[signal], absent.substr(name.size())));
  }
  if (complete) layout_.columns[signal] = columns;
  const std::string next = fmt::format("{}{}", name, joints + 1);
  const auto has = [&](const std::string& column) {
    return std::find(names_.begin(), names_.end(), column) != names_.end();
  };
  if (signal == q && has(name + "1") && has(next)) {
    throw InputError(
        fmt::format("{}: column '{}', but the robot has {} moving joints; is this another robot's log? Else "
                    "remove the columns of "
                    "joints that the URDF does not have",
                    where_, next, joints));
  }
}

void ColumnNames::missing(const std::string& signal, const std::string& name, const std::string& meaning) const {
  if (name.starts_with('#')) {
    throw InputError(fmt::format("{}: no column {} ({}): the file has {}, counted from 0", where_, name.substr(1),
                                 meaning, names_.size()));
  }
  const std::string all = fmt::format("{}", fmt::join(names_, ","));
  if (names_.size() == 1 && all.find_first_of(";\t ") != std::string::npos) {
    throw InputError(
        fmt::format("{}: no commas in the header '{}'; separate columns by commas", where_, all.substr(0, 60)));
  }
  if (!has_names_) {
    throw InputError(
        fmt::format("{}: starts with a number; the first line must name the columns (t,q1,...,tau1,...), or the "
                    "project gives the numbers of these {} columns, from 0: columns = {{ t = 0, q = [1], tau = [2] }}",
                    where_, names_.size()));
  }
  throw InputError(
      fmt::format("{}: no column '{}' ({}); {}", where_, name, meaning, column_advice(signal, name, names_, joints_)));
}

Log to_log(ColumnTable table, const ColumnLayout& layout, std::size_t joints) {
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

}  // namespace fxdyn
