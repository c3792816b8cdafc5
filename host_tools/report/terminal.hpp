#pragma once

#include <cstddef>
#include <string>

namespace fxdyn {

/// What tables are printed on.
struct Terminal {
  std::size_t width = 100;  ///< columns
  bool colours = false;
};

/// Standard output as it is now: as wide as the terminal, 100 to 160 columns, and with colours unless NO_COLOR is set
/// (no-color.org) or TERM is "dumb". Where it is no terminal: 100 columns without colours.
Terminal terminal_of_output();

enum class Colour { none, green, yellow, red };
/// The text in that colour, where the terminal has colours.
std::string in_colour(const Terminal& terminal, Colour colour, const std::string& text);

}  // namespace fxdyn
