#pragma once

#include <fmt/format.h>

#include <string>

namespace fxdyn {

/// A moment of a log [s], for people and for a project file: whole milliseconds, also of stamps that count from 1970.
inline std::string time_text(double seconds) {
  std::string text = fmt::format("{:.3f}", seconds);
  while (text.back() == '0') text.pop_back();
  if (text.back() == '.') text += '0';
  return text == "-0.0" ? "0.0" : text;
}

}  // namespace fxdyn
