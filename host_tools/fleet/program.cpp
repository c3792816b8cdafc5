#include "host_tools/fleet/program.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <fstream>

#include "host_tools/support/error.hpp"
#include "host_tools/support/files.hpp"

namespace fxdyn::fleet {
namespace {

namespace fs = std::filesystem;

constexpr int not_started = 127;  // as of a shell

/// In the new process: only what is allowed between fork and exec.
[[noreturn]] void become(char* const* words, char* const* environment, const Limits& limits, int output, pid_t parent) {
  ::setpgid(0, 0);
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (::getppid() != parent) ::_exit(not_started);  // it is gone already
  sigset_t none;
  ::sigemptyset(&none);
  ::sigprocmask(SIG_SETMASK, &none, nullptr);
  const rlim_t bytes = static_cast<rlim_t>(limits.memory_mb) << 20;
  const rlimit memory{bytes, bytes}, no_core{0, 0};
  ::setrlimit(RLIMIT_DATA, &memory);
  ::setrlimit(RLIMIT_CORE, &no_core);
  const int nothing = ::open("/dev/null", O_RDONLY);
  ::dup2(nothing, STDIN_FILENO);
  ::dup2(output, STDOUT_FILENO);
  ::dup2(output, STDERR_FILENO);
  ::execve(words[0], words, environment);
  ::_exit(not_started);
}

/// Of this process, with as many threads as it may use.
std::vector<std::string> environment_with(std::size_t threads) {
  std::vector<std::string> out;
  for (char** entry = environ; *entry != nullptr; ++entry) {
    if (std::strncmp(*entry, "FXDYN_THREADS=", 14) != 0) out.emplace_back(*entry);
  }
  out.push_back(fmt::format("FXDYN_THREADS={}", threads));
  return out;
}

std::vector<char*> pointers(std::vector<std::string>& words) {
  std::vector<char*> out;
  out.reserve(words.size() + 1);
  for (std::string& word : words) out.push_back(word.data());
  out.push_back(nullptr);
  return out;
}

/// What a program said last of why it stopped: the line that fxdyn writes, else the last one.
std::string last_words(const fs::path& output) {
  std::ifstream in(output);
  std::string said;
  for (std::string line; std::getline(in, line);) {
    if (line.starts_with("fxdyn: ")) said = line.substr(7);
  }
  return said.empty() ? last_line(output) : said;
}

}  // namespace

std::string last_line(const fs::path& output) {
  std::ifstream in(output);
  std::string last;
  for (std::string line; std::getline(in, line);) {
    if (!line.empty()) last = line;
  }
  return last;
}

Program start(const std::vector<std::string>& words, const Limits& limits, const fs::path& output,
              std::size_t threads) {
  std::vector<std::string> copy = words, environment = environment_with(threads);
  const std::vector<char*> arguments = pointers(copy), variables = pointers(environment);
  write_file(output, "");  // complains of a full disk
  const int file = ::open(output.c_str(), O_WRONLY | O_TRUNC | O_CLOEXEC);
  if (file < 0) throw InputError(fmt::format("{}: can't be written: {}", output.string(), std::strerror(errno)));
  const pid_t parent = ::getpid();
  const pid_t process = ::fork();
  const int cause = errno;
  if (process == 0) become(arguments.data(), variables.data(), limits, file, parent);
  ::close(file);
  if (process < 0)
    throw InputError(fmt::format("no further process can be started ({}): lower --jobs", std::strerror(cause)));
  ::setpgid(process, process);  // whoever of the two comes first
  return {process, std::chrono::steady_clock::now()};
}

void end(const Program& program) { ::kill(-program.process, SIGKILL); }

Ending ending_of(const Program& program, int status, const Limits& limits, const fs::path& output) {
  if (program.too_slow)
    return {fmt::format("took longer than {:g} s: shorten its logs, or raise time_s in [limits]", limits.time_s)};
  if (WIFSIGNALED(status)) {
    const int signal = WTERMSIG(status);
    return {fmt::format("ended by signal {} ({}){}", signal, ::strsignal(signal),
                        signal == SIGKILL ? ": killed from outside, or by the system for want of memory" : "")};
  }
  const int code = WEXITSTATUS(status);
  if (code == 0) return {};
  const std::string words = last_words(output);
  if (code == not_started && words.empty()) return {"the program can't be started: check --program"};
  const bool memory = words.starts_with("not enough memory");
  if (words.empty()) return {fmt::format("ended with exit code {} and said nothing", code)};
  return {memory ? fmt::format("{} (or raise memory_mb in [limits], {} now)", words, limits.memory_mb) : words};
}

}  // namespace fxdyn::fleet
