#include "host_tools/page/compact_svg.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <utility>
#include <vector>

namespace fxdyn::page {
namespace {

constexpr const char* blanks = " \t\r\n";

/// How gnuplot writes what occurs most, and what stands for it in a page (style.cpp).
constexpr std::string_view usual_group =
    "<g fill=\"none\" color=\"black\" stroke=\"currentColor\" stroke-width=\"1.00\" stroke-linecap=\"butt\" "
    "stroke-linejoin=\"miter\">";
constexpr std::array<std::pair<std::string_view, std::string_view>, 6> usual{{
    {usual_group, "<g class=\"k\">"},
    {" stroke=\"none\" fill=\"rgb(51,51,51)\" font-family=\"sans-serif\"", " class=\"t\""},
    {" stroke=\"none\" fill=\"black\" font-family=\"sans-serif\"", " class=\"t b\""},
    {"<path stroke='rgb(228, 228, 228)' class=\"gridline\" ", "<path class=\"r\""},
    {"<path stroke='rgb(136, 136, 136)' ", "<path class=\"a\""},
    {"<text></text>", ""},
}};

/// A number of tenths, as in "-12.3", ".5" or "7", after a blank where the one before would run into it.
void append(std::string& out, long tenths) {
  if (tenths >= 0 && out.back() != 'm') out += ' ';
  if (tenths < 0) out += '-';
  const long whole = std::abs(tenths) / 10, part = std::abs(tenths) % 10;
  if (whole != 0 || part == 0) out += fmt::format("{}", whole);
  if (part != 0) out += fmt::format(".{}", part);
}

/// "M1.00,2.00 L3.50,2.00" as "m1 2 2.5 0"; "" where there is anything but moves and lines. Rounded are the points, not
/// the steps between them: nothing adds up.
std::string relative_path(std::string_view path) {
  std::string out;
  long x = 0, y = 0;
  for (std::size_t i = path.find_first_not_of(blanks); i < path.size(); i = path.find_first_not_of(blanks, i)) {
    const char command = path[i];
    const std::size_t comma = path.find(',', i);
    const std::size_t end = std::min(path.size(), path.find_first_of(blanks, i));
    if ((command != 'M' && (command != 'L' || out.empty())) || comma >= end) return "";
    double to_x = 0, to_y = 0;
    const auto first = std::from_chars(path.data() + i + 1, path.data() + comma, to_x);
    const auto second = std::from_chars(path.data() + comma + 1, path.data() + end, to_y);
    if (first.ptr != path.data() + comma || second.ptr != path.data() + end) return "";
    const long new_x = std::lround(10 * to_x), new_y = std::lround(10 * to_y);
    if (command == 'M' || new_x != x || new_y != y) {
      if (command == 'M') out += 'm';  // pairs after the first of a move are lines
      append(out, new_x - x);
      append(out, new_y - y);
    }
    x = new_x;
    y = new_y;
    i = end;
  }
  return out;
}

/// The attribute d='..' of a path that begins here, and how many characters it replaces; 0: none, or another kind.
std::pair<std::string, std::size_t> short_path(std::string_view rest) {
  constexpr std::string_view open = " d='";
  if (!rest.starts_with(open)) return {};
  const std::size_t close = rest.find('\'', open.size());
  if (close == std::string_view::npos) return {};
  const std::string path = relative_path(rest.substr(open.size(), close - open.size()));
  if (path.empty()) return {};
  return {fmt::format(" d='{}'", path), close + 1};
}

/// What stands for the beginning of the rest, and how many characters it replaces; 0: nothing does.
std::pair<std::string, std::size_t> shorter(std::string_view rest) {
  for (const auto& [long_form, short_form] : usual) {
    if (rest.starts_with(long_form)) return {std::string(short_form), long_form.size()};
  }
  return short_path(rest);
}

/// The groups that are open, and whether they are usual ones.
class Groups {
 public:
  void open(std::string_view rest) {
    if (rest.starts_with("<g ") || rest.starts_with("<g>")) usual_.push_back(rest.starts_with(usual_group));
  }

  /// The end of a group with which the rest begins. Groups with nothing in them vanish; a usual group after a usual one
  /// goes on with it. Returns how many characters of the rest are done.
  std::size_t close(std::string& out, std::string_view rest) {
    constexpr std::string_view end = "</g>";
    const bool is_usual = !usual_.empty() && usual_.back();
    if (!usual_.empty()) usual_.pop_back();
    out.erase(out.find_last_not_of(blanks) + 1);
    const std::size_t tag = out.rfind('<');
    if (tag != std::string::npos && out.back() == '>' && out.compare(tag, 2, "<g") == 0) {
      out.erase(tag);
      return end.size();
    }
    const std::size_t next = std::min(rest.size(), rest.find_first_not_of(blanks, end.size()));
    if (is_usual && rest.substr(next).starts_with(usual_group)) {
      usual_.push_back(true);
      return next + usual_group.size();
    }
    out += end;
    return end.size();
  }

 private:
  std::vector<bool> usual_;
};

}  // namespace

std::string compact_svg(std::string_view svg) {
  Groups groups;
  std::string out;
  for (std::size_t i = 0; i < svg.size();) {
    const std::string_view rest = svg.substr(i);
    if (rest.starts_with("</g>")) {
      i += groups.close(out, rest);
      continue;
    }
    groups.open(rest);
    const auto [words, replaced] = shorter(rest);
    if (replaced > 0) {
      out += words;
      i += replaced;
    } else if (svg[i] == '\n') {
      out += '\n';
      i = std::min(svg.size(), svg.find_first_not_of(blanks, i));
    } else {
      out += svg[i++];
    }
  }
  return out;
}

}  // namespace fxdyn::page
