#include "host_tools/logs/column_advice.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cctype>
#include <iterator>

#include "host_tools/logs/recorded_log.hpp"
#include "host_tools/support/nearest.hpp"

namespace fxdyn {
namespace {

using Names = std::vector<std::string>;

/// "position_" of "position_shoulder_pan", "q" of "q12"; empty: the name has but one part.
std::string family_of(const std::string& name) {
  std::size_t end = name.size();
  while (end > 0 && std::isdigit(static_cast<unsigned char>(name[end - 1])) != 0) --end;
  if (end < name.size()) return name.substr(0, end);
  const std::size_t mark = name.find_first_of("_.[/ ");
  return mark == std::string::npos ? "" : name.substr(0, mark + 1);
}

/// Columns of one family, in the file's order; only families of one column a joint.
std::vector<Names> families(const Names& columns, std::size_t joints) {
  std::vector<Names> out;
  for (const std::string& name : columns) {
    const std::string family = family_of(name);
    if (family.empty()) continue;
    const auto found =
        std::find_if(out.begin(), out.end(), [&](const Names& one) { return family_of(one[0]) == family; });
    if (found == out.end())
      out.push_back({name});
    else
      found->push_back(name);
  }
  std::erase_if(out, [joints](const Names& one) { return one.size() != joints; });
  return out;
}

std::string quoted(const Names& names) { return fmt::format("[\"{}\"]", fmt::join(names, "\", \"")); }

bool is_signal(const std::string& family) {
  return std::find(signal_names.begin(), signal_names.end(), family) != signal_names.end();
}

/// Whether a column has the name that is looked for, for the joint in question or another one.
bool has(const Names& columns, const std::string& name) {
  return std::find(columns.begin(), columns.end(), name) != columns.end();
}

/// The columns that are no signal's by name.
Names open_of(const Names& columns) {
  Names out;
  std::copy_if(columns.begin(), columns.end(), std::back_inserter(out),
               [](const std::string& name) { return name != "t" && !is_signal(family_of(name)); });
  return out;
}

/// The nearest of them, or of all where there are none.
std::string nearest_of(const std::string& missing, const Names& columns) {
  const Names open = open_of(columns);
  return nearest(missing, open.empty() ? columns : open);
}

/// The family's columns, joint by joint, with the nearest other one where a single one is missing; empty: more are.
Names with_nearest(const std::string& family, const Names& columns, std::size_t joints) {
  Names out;
  std::size_t absent = 0;
  for (std::size_t joint = 1; joint <= joints; ++joint) {
    const std::string name = family + std::to_string(joint);
    absent += has(columns, name) ? 0 : 1;
    out.push_back(has(columns, name) ? name : nearest_of(name, columns));
  }
  return !family.empty() && joints > 1 && absent == 1 && !open_of(columns).empty() ? out : Names{};
}

}  // namespace

std::string column_advice(const std::string& signal, const std::string& missing,
                          const std::vector<std::string>& columns, std::size_t joints) {
  const std::string family = family_of(missing);
  std::vector<Names> all = families(columns, joints);
  const auto same = std::find_if(all.begin(), all.end(), [&](const Names& one) { return family_of(one[0]) == family; });
  if (!family.empty() && same != all.end() && same->front() == family + "0") {
    return fmt::format("its columns count from 0: name them, as in columns = {{ {} = {} }}", signal, quoted(*same));
  }
  if (const Names completed = with_nearest(family, columns, joints); !completed.empty()) {
    return fmt::format("nearest is '{}'; if that is it: columns = {{ {} = {} }}", nearest_of(missing, columns), signal,
                       quoted(completed));
  }
  // What has a signal's own name is that signal.
  std::erase_if(all, [&](const Names& one) { return is_signal(family_of(one[0])) && family_of(one[0]) != signal; });
  if (joints > 1 && !family.empty() && !all.empty()) {
    Names words;
    for (const Names& one : all) words.push_back(fmt::format("{} .. {}", one.front(), one.back()));
    return fmt::format("there is one a joint of {}; name those that are it, as in columns = {{ {} = {} }}",
                       fmt::join(words, ", of "), signal, quoted(all.front()));
  }
  return fmt::format("nearest is '{}' (map it with columns = {{ ... }})", nearest_of(missing, columns));
}

}  // namespace fxdyn
