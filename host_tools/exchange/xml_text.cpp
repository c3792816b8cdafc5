#include "host_tools/exchange/xml_text.hpp"

#include <fmt/format.h>

namespace fxdyn {

std::string escaped(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c == '&')
      out += "&amp;";
    else if (c == '<')
      out += "&lt;";
    else if (c == '"')
      out += "&quot;";
    else
      out += c;
  }
  return out;
}

std::string quoted(const std::string& text) { return '"' + escaped(text) + '"'; }

std::string numbers(const Eigen::Vector3d& v) { return fmt::format("{:.17g} {:.17g} {:.17g}", v.x(), v.y(), v.z()); }

}  // namespace fxdyn
