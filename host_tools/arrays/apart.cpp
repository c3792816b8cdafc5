#include "host_tools/arrays/apart.hpp"

#include <fcntl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdint>
#include <exception>
#include <fstream>
#include <string>

#include "host_tools/support/error.hpp"

namespace fxdyn {
namespace {

/// Least speed of a library that gets on [bytes/s of processor time], and what it may take in any case [s] (hand:
/// unpacking takes a hundredth of that).
constexpr std::uint64_t least_speed = 2'000'000, least_time_s = 2;
/// Memory for a file's size, and in any case [bytes] (hand: numbers pack to a tenth, zeros to a thousandth).
constexpr std::uint64_t memory_for_size = 64, least_memory = std::uint64_t{1} << 30;
/// A piece is never longer [bytes].
constexpr std::uint64_t longest_piece = std::uint64_t{1} << 28;

enum Kind : char { piece_of_work = 'p', input_error = 'e', done = 'd' };

class Pipe {
 public:
  Pipe() {
    if (::pipe2(ends_, O_CLOEXEC) != 0) throw InputError("no pipe can be made: too many files are open");
  }
  ~Pipe() {
    close(0);
    close(1);
  }
  Pipe(const Pipe&) = delete;
  Pipe& operator=(const Pipe&) = delete;
  int operator[](std::size_t end) const { return ends_[end]; }
  void close(std::size_t end) {
    if (ends_[end] >= 0) ::close(ends_[end]);
    ends_[end] = -1;
  }

 private:
  int ends_[2] = {-1, -1};
};

void write_all(int to, const char* bytes, std::size_t count) {
  while (count > 0) {
    const ssize_t put = ::write(to, bytes, count);
    if (put < 0 && errno == EINTR) continue;
    if (put <= 0) ::_exit(1);  // nobody listens any more
    bytes += put;
    count -= static_cast<std::size_t>(put);
  }
}

void send(int to, Kind kind, std::string_view bytes) {
  const std::uint64_t size = bytes.size();
  write_all(to, &reinterpret_cast<const char&>(kind), 1);
  write_all(to, reinterpret_cast<const char*>(&size), sizeof size);
  write_all(to, bytes.data(), bytes.size());
}

bool read_all(int from, char* bytes, std::size_t count) {
  while (count > 0) {
    const ssize_t got = ::read(from, bytes, count);
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) return false;
    bytes += got;
    count -= static_cast<std::size_t>(got);
  }
  return true;
}

void limit(decltype(RLIMIT_CPU) what, std::uint64_t most) {
  rlimit now{};
  ::getrlimit(what, &now);
  now.rlim_cur = std::min<rlim_t>(most, now.rlim_max);
  ::setrlimit(what, &now);
}

void limit_all(std::uint64_t size) {
  std::uint64_t pages = 0;
  std::ifstream("/proc/self/statm") >> pages;
  limit(RLIMIT_CORE, 0);
  limit(RLIMIT_CPU, least_time_s + size / least_speed);
  limit(RLIMIT_AS, pages * static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE)) + least_memory + size * memory_for_size);
}

[[noreturn]] void be_child(int to, std::uint64_t size, const std::function<void(const SendPiece&)>& work) {
  if (const int nowhere = ::open("/dev/null", O_WRONLY | O_CLOEXEC); nowhere >= 0) {
    ::dup2(nowhere, 1);
    ::dup2(nowhere, 2);
  }
  limit_all(size);
  try {
    work([to](std::string_view piece) { send(to, piece_of_work, piece); });
    send(to, done, {});
  } catch (const InputError& error) {
    send(to, input_error, error.what());
  } catch (const std::exception&) {
    ::_exit(1);  // as if the library had failed
  }
  ::_exit(0);
}

class Child {
 public:
  explicit Child(pid_t process) : process_(process) {}
  ~Child() {
    ::kill(process_, SIGKILL);
    while (::waitpid(process_, nullptr, 0) < 0 && errno == EINTR) {}
  }
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;

 private:
  pid_t process_;
};

}  // namespace

void read_apart(const std::filesystem::path& file, const std::function<void(const SendPiece&)>& work,
                const std::function<void(std::string_view)>& piece) {
  std::error_code error;
  const std::uint64_t size = std::filesystem::file_size(file, error);
  if (error) throw InputError(file.string() + ": can't be read; check the path of the log");
  Pipe pipe;
  const pid_t process = ::fork();
  if (process < 0) throw InputError(file.string() + ": no process can be started to read it: free some memory");
  if (process == 0) be_child(pipe[1], size, work);
  pipe.close(1);
  const Child child(process);
  std::string bytes;
  char kind = 0;
  std::uint64_t count = 0;
  while (read_all(pipe[0], &kind, 1) && read_all(pipe[0], reinterpret_cast<char*>(&count), sizeof count) &&
         count <= longest_piece) {
    bytes.resize(count);
    if (!read_all(pipe[0], bytes.data(), count)) break;
    if (kind == done) return;
    if (kind == input_error) throw InputError(bytes);
    piece(bytes);
  }
  throw InputError(file.string() + ": is damaged: copy it again, or write it again");
}

}  // namespace fxdyn
