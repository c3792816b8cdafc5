#include "host_tools/readers/array_groups.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <map>
#include <set>

#include "host_tools/logs/time_unit.hpp"

namespace fxdyn {
namespace {

bool all_digits(std::string_view text) {
  return !text.empty() && std::all_of(text.begin(), text.end(), [](unsigned char c) { return std::isdigit(c) != 0; });
}

bool is_demo(std::string_view name) { return name.starts_with("demo_") && all_digits(name.substr(5)); }

/// Order of people: demo_2 before demo_10.
bool before(const ArrayPath& a, const ArrayPath& b) {
  const auto key = [](const std::string& name) {
    const std::string text = name.substr(0, name.find_last_not_of("0123456789") + 1);
    return std::tuple(text, name.size(), name);
  };
  return std::lexicographical_compare(a.begin(), a.end(), b.begin(), b.end(),
                                      [&](const auto& x, const auto& y) { return key(x) < key(y); });
}

struct Before {
  bool operator()(const ArrayPath& a, const ArrayPath& b) const { return before(a, b); }
};

ArrayPath parent_of(const ArrayPath& path) { return {path.begin(), path.end() - 1}; }

/// Puts the arrays of a file into groups.
class Grouping {
 public:
  Grouping(const ArrayList& list, const std::string& time_name) : list_(list), time_name_(time_name) {
    find_simulink();
    for (const ArrayInfo& array : list.arrays) {
      const ArrayPath group = group_around(array);
      if (!group.empty() || is_time(array)) groups_[group];
    }
    for (std::size_t k = 0; k < list.arrays.size(); ++k)
      if (const auto group = home_of(list.arrays[k].path)) groups_[*group].push_back(k);
  }

  std::vector<ArrayGroup> all() const {
    std::vector<ArrayGroup> out;
    for (const auto& [path, members] : groups_) out.push_back(group(path, members));
    std::erase_if(out, [](const ArrayGroup& one) { return one.samples < 2; });
    return out;
  }

 private:
  bool is_time(const ArrayInfo& array) const {
    return array.trouble.empty() && array.shape.size() == 1 && array.shape[0] > 1 &&
           (array.path.back() == time_name_ || is_time_name(array.path.back()));
  }

  /// "signals" or "signals(2)" of X.signals.values.
  static bool is_signal(const ArrayPath& path, const std::string& field) {
    return path.size() >= 3 && path.back() == field &&
           (path[path.size() - 2] == "signals" || path[path.size() - 2].starts_with("signals("));
  }

  /// Simulink's structures with time. Several side by side are one log.
  void find_simulink() {
    std::map<ArrayPath, std::set<ArrayPath>> around;
    for (const ArrayInfo& array : list_.arrays) {
      if (is_signal(array.path, "label")) labels_[parent_of(array.path)] = array.text;
      if (!is_signal(array.path, "values")) continue;
      const ArrayPath structure = parent_of(parent_of(array.path));
      ++signals_[structure];
      around[parent_of(structure)].insert(structure);
    }
    for (const auto& [outside, structures] : around) {
      const bool has_time = std::any_of(list_.arrays.begin(), list_.arrays.end(), [&, o = outside](const auto& array) {
        return is_time(array) && parent_of(array.path) == o;
      });
      if (structures.size() > 1 || has_time) merged_.insert(structures.begin(), structures.end());
    }
  }

  /// The group that an array's being there makes; empty: none, or the file itself.
  ArrayPath group_around(const ArrayInfo& array) const {
    for (std::size_t k = 0; k + 1 < array.path.size(); ++k)
      if (is_demo(array.path[k])) return {array.path.begin(), array.path.begin() + static_cast<std::ptrdiff_t>(k) + 1};
    if (!is_time(array)) return {};
    const ArrayPath group = parent_of(array.path);
    return merged_.contains(group) ? parent_of(group) : group;
  }

  std::optional<ArrayPath> home_of(ArrayPath path) const {
    while (!path.empty()) {
      path.pop_back();
      if (groups_.contains(path)) return path;
    }
    return {};
  }

  /// What the columns of an array are called in its group.
  std::string name_in(const ArrayPath& group, const ArrayPath& path) const {
    if (is_signal(path, "values")) {
      const ArrayPath signal = parent_of(path), structure = parent_of(signal);
      const auto label = labels_.find(signal);
      const bool several = signals_.at(structure) > 1;
      if (label != labels_.end() && !label->second.empty() && (several || !merged_.contains(structure)))
        return label->second;
      if (!several) return structure.back();
    }
    return fmt::format("{}", fmt::join(path.begin() + static_cast<std::ptrdiff_t>(group.size()), path.end(), "."));
  }

  ArrayGroup group(const ArrayPath& path, const std::vector<std::size_t>& members) const {
    ArrayGroup out;
    out.topic = path.empty() ? "/" : list_.name_of(path);
    const std::optional<std::size_t> time = time_of(path, members, out);
    for (const std::size_t k : members) {
      if (k != time && std::find(out.other_times.begin(), out.other_times.end(), k) == out.other_times.end())
        add(path, k, out);
    }
    return out;
  }

  std::optional<std::size_t> time_of(const ArrayPath& path, const std::vector<std::size_t>& members,
                                     ArrayGroup& out) const {
    std::vector<std::size_t> times;
    for (const std::size_t k : members)
      if (is_time(list_.arrays[k])) times.push_back(k);
    std::stable_sort(times.begin(), times.end(), [&](std::size_t a, std::size_t b) {
      const auto rank = [&](const ArrayPath& array) { return std::pair(array.size(), array.back() != time_name_); };
      return rank(list_.arrays[a].path) < rank(list_.arrays[b].path);
    });
    if (times.empty()) {
      out.rate_hz = list_.rate_hz;
      out.samples = out.rate_hz > 0 ? steps_of(members) : 0;
      out.columns.push_back({time_name_, list_.arrays.size(), 0});
      return {};
    }
    const ArrayInfo& first = list_.arrays[times.front()];
    out.samples = first.size();
    const bool is_merged = merged_.contains(parent_of(first.path));
    out.columns.push_back({is_merged ? first.path.back() : name_in(path, first.path), times.front(), 0});
    for (const std::size_t k : times)
      if (merged_.contains(parent_of(list_.arrays[k].path)) && k != times.front()) out.other_times.push_back(k);
    return times.front();
  }

  /// Of a demonstration: as many as it has actions, else as its first array has.
  std::uint64_t steps_of(const std::vector<std::size_t>& members) const {
    std::uint64_t out = 0;
    for (const std::size_t k : members) {
      const ArrayInfo& array = list_.arrays[k];
      if (array.shape.empty()) continue;
      if (array.path.back() == "actions") return array.shape[0];
      if (out == 0) out = array.shape[0];
    }
    return out;
  }

  /// Empty: it has none of its own.
  static std::string channel_name(const ArrayInfo& array, std::size_t channel) {
    const auto& names = array.channels;
    if (channel >= names.size() || std::count(names.begin(), names.end(), names[channel]) > 1) return "";
    return names[channel];
  }

  void add(const ArrayPath& path, std::size_t k, ArrayGroup& out) const {
    const ArrayInfo& array = list_.arrays[k];
    const std::string name = name_in(path, array.path);
    if (!array.trouble.empty()) {
      out.unusable.emplace_back(name, array.trouble);
      return;
    }
    const auto order = order_of(array, out.samples);
    if (!order) {
      out.unusable.emplace_back(name, fmt::format("is {}, and {} has {} samples: one dimension has to be as long",
                                                  array.described(), out.columns.front().name, out.samples));
      return;
    }
    if (array.shape.size() == 1) {
      out.columns.push_back({name, k, 0});
      return;
    }
    for (std::size_t channel = 0; channel < order->channels; ++channel) {
      const std::string own = channel_name(array, channel);
      out.columns.push_back({fmt::format("{}{}", name, channel + 1), k, channel, !own.empty()});
      if (!own.empty()) out.columns.push_back({fmt::format("{}.{}", name, own), k, channel});
    }
  }

  const ArrayList& list_;
  std::string time_name_;
  std::map<ArrayPath, std::string> labels_;
  std::map<ArrayPath, int> signals_;  ///< of a structure with time
  std::set<ArrayPath> merged_;        ///< structures with time that are no groups of their own
  std::map<ArrayPath, std::vector<std::size_t>, Before> groups_;
};

}  // namespace

bool is_time_name(std::string name) {
  if (const auto unit = unit_in_name(name)) {
    while (name.back() == ')' || name.back() == ']' || name.back() == ' ') name.pop_back();
    name.resize(name.size() - std::string_view(unit->name).size() - 1);
    while (!name.empty() && (name.back() == ' ' || name.back() == '_')) name.pop_back();
  }
  std::transform(name.begin(), name.end(), name.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  constexpr std::array names{"t", "time", "times", "timestamp", "timestamps", "stamp", "stamps", "tout"};
  return std::find(names.begin(), names.end(), name) != names.end();
}

std::optional<ArrayOrder> order_of(const ArrayInfo& array, std::uint64_t samples) {
  constexpr std::uint64_t most_channels = 4096;  // images are no signals
  const auto& shape = array.shape;
  if (shape.size() == 1 && shape[0] == samples) return ArrayOrder{};
  if (shape.size() != 2) return {};
  // Rows as their program counts them, where both would do.
  const bool first = shape[0] == samples, last = shape[1] == samples;
  if (first && !(last && array.by_columns) && shape[1] <= most_channels) return ArrayOrder{shape[1], true};
  if (last && shape[0] <= most_channels) return ArrayOrder{shape[0], false};
  return {};
}

std::vector<ArrayGroup> groups_of(const ArrayList& list, const std::string& time_name) {
  return Grouping(list, time_name).all();
}

}  // namespace fxdyn
