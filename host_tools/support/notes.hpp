#pragma once

#include <string>

namespace fxdyn {

/// A line for people on stderr, "note: ..", once a process however often it is said.
void note_once(const std::string& words);

}  // namespace fxdyn
