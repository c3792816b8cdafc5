#include "host_tools/signals/column_advice.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cctype>

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

}  // namespace

std::string column_advice(const std::string& missing, const std::vector<std::string>& columns, std::size_t joints) {
  const std::string signal = family_of(missing);
  const std::vector<Names> all = families(columns, joints);
  const auto same = std::find_if(all.begin(), all.end(), [&](const Names& one) { return family_of(one[0]) == signal; });
  if (!signal.empty() && same != all.end() && same->front() == signal + "0") {
    return fmt::format("its columns count from 0: name them, as in columns = {{ {} = {} }}", signal, quoted(*same));
  }
  if (joints > 1 && !signal.empty() && !all.empty()) {
    Names words;
    for (const Names& one : all) words.push_back(fmt::format("{} .. {}", one.front(), one.back()));
    return fmt::format("there is one a joint of {}; name those that are it, as in columns = {{ {} = {} }}",
                       fmt::join(words, ", of "), signal, quoted(all.front()));
  }
  return fmt::format("nearest is '{}' (map it with columns = {{ ... }})", nearest(missing, columns));
}

}  // namespace fxdyn
