#include "host_tools/support/notes.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <cstdio>
#include <mutex>
#include <set>

namespace fxdyn {

void note_once(const std::string& words) {
  static std::set<std::string> said;
  static std::mutex saying;
  const std::lock_guard lock(saying);
  if (!said.insert(words).second) return;
  // In place of a progress bar, which is drawn again.
  fmt::print(stderr, "{}note: {}\n", ::isatty(STDERR_FILENO) != 0 ? "\r\033[K" : "", words);
}

}  // namespace fxdyn
