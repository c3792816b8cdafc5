#include "host_tools/report/terminal.hpp"

#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <string_view>

namespace fxdyn {
namespace {

constexpr std::size_t narrowest = 100, widest = 160;  // below, tables break; beyond, lines are hard to read

std::string_view variable(const char* name) {
  const char* value = std::getenv(name);
  return value == nullptr ? "" : value;
}

}  // namespace

Terminal terminal_of_output() {
  Terminal out;
  if (::isatty(STDOUT_FILENO) == 0) return out;
  winsize size{};
  if (::ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0)
    out.width = std::clamp<std::size_t>(size.ws_col, narrowest, widest);
  out.colours = variable("NO_COLOR").empty() && variable("TERM") != "dumb";
  return out;
}

std::string in_colour(const Terminal& terminal, Colour colour, const std::string& text) {
  if (!terminal.colours || colour == Colour::none) return text;
  const int code = colour == Colour::green ? 32 : colour == Colour::yellow ? 33 : 31;
  return fmt::format("\033[{}m{}\033[0m", code, text);
}

}  // namespace fxdyn
