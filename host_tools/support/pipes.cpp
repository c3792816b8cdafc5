#include "host_tools/support/pipes.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <map>
#include <mutex>
#include <vector>

#include "host_tools/support/error.hpp"

namespace fxdyn {
namespace {

std::string read_all(const std::string& name) {
  const bool standard = name == "-";
  const int descriptor = standard ? STDIN_FILENO : ::open(name.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor < 0) throw InputError(fmt::format("{}: can't be read: {}", name, std::strerror(errno)));
  if (standard && ::isatty(descriptor) != 0)
    throw InputError("-: standard input is the keyboard; send a log through it, as in `zcat run.csv.gz | fxdyn ..`");
  std::string bytes;
  std::vector<char> piece(std::size_t{1} << 16);
  while (true) {
    const ssize_t count = ::read(descriptor, piece.data(), piece.size());
    if (count < 0 && errno == EINTR) continue;
    const int cause = errno;
    if (count > 0) {
      bytes.append(piece.data(), static_cast<std::size_t>(count));
      continue;
    }
    if (!standard) ::close(descriptor);
    if (count < 0) throw InputError(fmt::format("{}: can't be read: {}", name, std::strerror(cause)));
    return bytes;
  }
}

}  // namespace

bool is_pipe(const std::filesystem::path& file) {
  if (file == "-") return true;
  struct stat status {};
  return ::stat(file.c_str(), &status) == 0 && S_ISFIFO(status.st_mode);
}

const std::string* piped(const std::filesystem::path& file) {
  static std::map<std::string, std::string> kept;
  static std::mutex reading;
  const std::lock_guard lock(reading);
  const std::string name = file.string();
  if (const auto found = kept.find(name); found != kept.end()) return &found->second;
  if (!is_pipe(file)) return nullptr;
  return &kept.emplace(name, read_all(name)).first->second;
}

std::string with_home(const std::string& path) {
  if (!path.starts_with('~') || (path.size() > 1 && path[1] != '/')) return path;
  const char* home = std::getenv("HOME");
  return home == nullptr || *home == '\0' ? path : home + path.substr(1);
}

std::string with_variable(const std::string& path) {
  const std::size_t from = path.find("${");
  if (from == std::string::npos) return path;
  const std::size_t to = path.find('}', from);
  if (to == std::string::npos) throw InputError("'${' without '}'");
  const std::string inner = path.substr(from + 2, to - from - 2);
  const std::size_t split = inner.find(":-");
  const char* set = std::getenv(inner.substr(0, split).c_str());
  if (set == nullptr && split == std::string::npos)
    throw InputError(fmt::format("environment variable {} is not set", inner));
  return path.substr(0, from) + (set != nullptr ? set : inner.substr(split + 2)) + path.substr(to + 1);
}

}  // namespace fxdyn
