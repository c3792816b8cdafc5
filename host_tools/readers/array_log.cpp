#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <fstream>

#include "host_tools/arrays/arrays.hpp"
#include "host_tools/bytes/foreign_format.hpp"
#include "host_tools/logs/time_unit.hpp"
#include "host_tools/readers/array_groups.hpp"
#include "host_tools/readers/column_cut.hpp"
#include "host_tools/readers/log_reader.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/pipes.hpp"

namespace fxdyn {
namespace {

using Names = std::vector<std::string>;

constexpr std::size_t most_listed = 12;  // a data set has hundreds

std::string listed(Names names) {
  const std::size_t all = names.size();
  if (all > most_listed) names.resize(most_listed);
  return fmt::format("{}{}", fmt::join(names, ", "),
                     all > most_listed ? fmt::format(" and {} others", all - most_listed) : "");
}

std::string arrays_of(const ArrayList& list) {
  Names out;
  for (const ArrayInfo& array : list.arrays)
    out.push_back(fmt::format("{} ({})", list.name_of(array.path), array.described()));
  return out.empty() ? "nothing" : listed(out);
}

/// A text under such a name, as what Git LFS leaves where the file itself was not fetched.
std::string words_of_text(const std::filesystem::path& file) {
  if (is_pipe(file)) return "";
  std::string head(1024, '\0');
  std::ifstream in(file, std::ios::binary);
  in.read(head.data(), static_cast<std::streamsize>(head.size()));
  head.resize(static_cast<std::size_t>(in.gcount()));
  if (head.empty() || head.find('\0') != std::string::npos) return "";
  const std::string words = foreign_format(head);
  return words.empty() && file.extension() == ".parquet" ? "is no Parquet, but text: copy the file again" : words;
}

/// @throws InputError see list_arrays()
ArrayList list_of(const std::filesystem::path& file) {
  const bool is_known = is_matlab(file) || is_hdf5(file) || is_parquet(file);
  if (const std::string words = is_known ? "" : words_of_text(file); !words.empty())
    throw InputError(fmt::format("{}: {}", file.string(), words));
  return list_arrays(file);
}

std::string column_of(const LogFormat& format, const char* signal) {
  const auto found = format.columns.find(signal);
  return found == format.columns.end() ? signal : found->second;
}

/// "data/demo_0" and "data.demo_0" are one name, and so is "/log".
std::string plain(std::string topic) {
  std::replace(topic.begin(), topic.end(), '.', '/');
  return topic.starts_with('/') ? topic.substr(1) : topic;
}

Names topics_of(const std::vector<ArrayGroup>& groups) {
  Names out;
  for (const ArrayGroup& group : groups) out.push_back(group.topic);
  return out;
}

Names names_of(const ArrayGroup& group) {
  Names out;
  for (const ArrayColumn& column : group.columns) out.push_back(column.name);
  return out;
}

/// @throws InputError: no logs in it
std::vector<ArrayGroup> groups_in(const ArrayList& list, const std::string& time, const std::string& where) {
  std::vector<ArrayGroup> out = groups_of(list, time);
  if (!out.empty()) return out;
  for (const ArrayInfo& array : list.arrays)
    if (!array.trouble.empty() && (array.path.back() == time || is_time_name(array.path.back())))
      throw InputError(fmt::format("{}: {} {}", where, list.name_of(array.path), array.trouble));
  throw InputError(
      fmt::format("{}: no time stamps: it has {}; save them as a vector t or time, or name them: columns = "
                  "{{ t = \"..\" }}",
                  where, arrays_of(list)));
}

/// "tau" of "tau3".
std::string without_number(const std::string& name) { return name.substr(0, name.find_last_not_of("0123456789") + 1); }

/// Where a signal's own array is there and can't be used, that is what to say.
void explain(const ArrayGroup& group, const LogRequest& request, const std::string& where) {
  for (const std::string signal : signal_names) {
    const bool is_mapped = request.columns.columns.contains(signal);
    const auto given = request.columns.joint_columns.find(signal);
    const bool by_joint = given != request.columns.joint_columns.end();
    if (signal != "q" && signal != "tau" && !is_mapped && !by_joint) continue;
    const Names names = by_joint ? given->second : Names{column_of(request.columns, signal.c_str())};
    for (const auto& [array, why] : group.unusable)
      for (const std::string& name : names)
        if (!name.empty() && (array == name || array == without_number(name) || without_number(array) == name))
          throw InputError(fmt::format("{}: {} {}", where, array, why));
  }
}

struct Choice {
  const ArrayGroup* group;
  ColumnLayout layout;
  std::string where;
};

/// The group that has the columns, as a bag's topic is chosen.
Choice choose(const std::vector<ArrayGroup>& all, const LogRequest& request) {
  const std::string file = request.file.string(), topic = column_of(request.columns, topic_key);
  const bool is_named = request.columns.columns.contains(topic_key);
  std::vector<Choice> able;
  std::string complaint;
  bool found = false;
  for (const ArrayGroup& group : all) {
    if (is_named && plain(group.topic) != plain(topic)) continue;
    found = true;
    const std::string where = group.topic == "/" ? file : fmt::format("{}: {}", file, group.topic);
    LogFormat format = request.columns;
    format.columns.try_emplace("t", group.columns.front().name);
    try {
      able.push_back(
          {&group, ColumnNames(where, names_of(group)).layout(request.joints, format, request.torque_required), where});
    } catch (const InputError& error) {
      if (complaint.empty()) explain(group, request, where);
      if (complaint.empty()) complaint = error.what();
    }
  }
  if (!found)
    throw InputError(fmt::format("{}: no log is called {}: it has {}; write one of these as topic = \"..\"", file,
                                 topic, listed(topics_of(all))));
  if (able.empty()) throw InputError(complaint);
  if (able.size() > 1) {
    Names names;
    for (const Choice& one : able) names.push_back(one.group->topic);
    throw InputError(fmt::format("{}: {} all have these joints; write topic = \"{}\", or another one", file,
                                 listed(names), able.front().group->topic));
  }
  return able.front();
}

/// The columns of a layout, and the stamps that have to be the same.
struct Numbers {
  std::vector<std::vector<double>> columns, other_times;
};

Numbers numbers_of(const LogRequest& request, const ArrayList& list, const Choice& choice) {
  const ArrayGroup& group = *choice.group;
  Numbers out;
  out.columns.resize(choice.layout.names.size());
  out.other_times.resize(group.other_times.size());
  std::vector<ArrayPath> paths;
  std::vector<std::vector<std::vector<double>*>> targets;  // array that is read, channel
  std::vector<ArrayOrder> orders;
  std::vector<std::size_t> place(list.arrays.size(), SIZE_MAX);
  std::vector<std::pair<std::vector<double>*, std::vector<double>*>>
      copies;  // a channel that is asked for by both its names
  const auto target_of = [&](std::size_t array, std::size_t channel) -> std::vector<double>*& {
    if (place[array] == SIZE_MAX) {
      place[array] = paths.size();
      paths.push_back(list.arrays[array].path);
      orders.push_back(order_of(list.arrays[array], group.samples).value_or(ArrayOrder{}));
      targets.emplace_back(orders.back().channels, nullptr);
    }
    return targets[place[array]][channel];
  };
  for (std::size_t field = 0; field < group.columns.size(); ++field) {
    const ArrayColumn& column = group.columns[field];
    const int target = choice.layout.target[field];
    if (target < 0 || column.array == list.arrays.size()) continue;
    std::vector<double>*& into = target_of(column.array, column.channel);
    std::vector<double>* const own = &out.columns[static_cast<std::size_t>(target)];
    if (into == nullptr) into = own;
    if (into != own) copies.emplace_back(into, own);
  }
  for (std::size_t k = 0; k < group.other_times.size(); ++k) target_of(group.other_times[k], 0) = &out.other_times[k];
  constexpr std::uint64_t most_reserved = 1 << 22;  // a damaged file may claim any size
  for (auto& channels : targets)
    for (std::vector<double>* target : channels)
      if (target != nullptr) target->reserve(std::min(group.samples, most_reserved));
  read_arrays(request.file, paths, [&](std::size_t which, std::uint64_t at, std::span<const double> some) {
    if (which >= paths.size()) return;
    const ArrayOrder& order = orders[which];
    if (order.channels == 1) {  // no division for each number
      if (std::vector<double>* const into = targets[which][0]) into->insert(into->end(), some.begin(), some.end());
      return;
    }
    for (const double number : some) {
      const std::uint64_t channel = order.sample_by_sample ? at % order.channels : at / group.samples;
      if (channel < order.channels && targets[which][channel] != nullptr) targets[which][channel]->push_back(number);
      ++at;
    }
  });
  for (const auto& [from, to] : copies) *to = *from;
  return out;
}

/// Rows behind the last stamp that is a number are none.
void drop_unfilled(std::vector<std::vector<double>>& columns, const std::string& where, std::string& note) {
  const std::vector<double>& t = columns[0];
  const auto last = std::find_if(t.rbegin(), t.rend(), [](double stamp) { return std::isfinite(stamp); });
  const auto rows = static_cast<std::size_t>(t.rend() - last);
  if (rows < 2) throw InputError(where + ": fewer than 2 samples");
  if (rows < t.size())
    note = fmt::format("{}: {} samples behind its last time stamp: left out", where, t.size() - rows);
  for (std::vector<double>& column : columns) column.resize(rows);
}

/// To stamps in seconds that rise.
TimeUnit to_seconds(std::vector<double>& t, const ColumnLayout& layout, const std::string& where) {
  for (std::size_t row = 0; row < t.size(); ++row)
    if (!std::isfinite(t[row]))
      throw InputError(fmt::format("{}: the time of sample {} is no number; remove the sample", where, row + 1));
  constexpr std::size_t most = 2000;
  const std::vector<double> first(t.begin(), t.begin() + static_cast<std::ptrdiff_t>(std::min(t.size(), most)));
  const TimeUnit unit = layout.unit ? *layout.unit : unit_of_stamps(first, where);
  for (std::size_t row = 0; row < t.size(); ++row) {
    t[row] /= unit.per_second;
    if (row > 0 && !(t[row] > t[row - 1]))
      throw InputError(
          fmt::format("{}: time {} at {} s, sample {}; sort the samples, remove doubles and what was never "
                      "filled",
                      where, t[row] < t[row - 1] ? "goes backwards" : "stands still", t[row], row + 1));
  }
  return unit;
}

void check_complete(const Numbers& numbers, const Choice& choice) {
  for (const std::vector<double>& column : numbers.columns)
    if (column.size() != choice.group->samples)
      throw InputError(choice.where + ": is cut or damaged: copy it again, or write it again");
  for (const std::vector<double>& times : numbers.other_times)
    if (times != numbers.columns[0])
      throw InputError(choice.where + ": its structures with time have different times: log all signals at one rate");
}

}  // namespace

RecordedLog read_array_log(const LogRequest& request) {
  const ArrayList list = list_of(request.file);
  const std::vector<ArrayGroup> groups = groups_in(list, column_of(request.columns, "t"), request.file.string());
  const Choice choice = choose(groups, request);
  const ArrayGroup& group = *choice.group;
  Numbers numbers = numbers_of(request, list, choice);
  for (std::uint64_t k = 0; !group.has_stamps() && k < group.samples; ++k)
    numbers.columns[0].push_back(static_cast<double>(k) / group.rate_hz);
  check_complete(numbers, choice);
  std::string note;
  drop_unfilled(numbers.columns, choice.where, note);
  const TimeUnit unit = to_seconds(numbers.columns[0], choice.layout, choice.where);
  const bool time_is_known = choice.layout.unit.has_value() || !group.has_stamps();
  if (!time_is_known && unit.per_second != 1)
    note += (note.empty() ? "" : "; ") + unit_note(unit, request.file.filename().string());
  ColumnTable rows = cut_rows(std::move(numbers.columns), choice.layout.names, request, choice.where, note);
  const double first_t = rows.first_t, last_t = rows.last_t;
  Log log = to_log(std::move(rows), choice.layout, request.joints);
  log.time_note = note;
  return {std::move(log), first_t, last_t, time_is_known};
}

std::vector<LogColumns> array_columns(const std::filesystem::path& file) {
  const std::vector<ArrayGroup> groups = groups_in(list_of(file), "t", file.string());
  std::vector<LogColumns> out;
  out.reserve(groups.size());
  for (const ArrayGroup& group : groups) {
    out.push_back({group.topic, {}});
    for (const ArrayColumn& column : group.columns)
      if (!column.has_better_name) out.back().names.push_back(column.name);
  }
  return out;
}

}  // namespace fxdyn
