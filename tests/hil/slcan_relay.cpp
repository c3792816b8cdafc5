// slcan_relay LISTEN CONNECT: joins two serial lines that speak SLCAN, both Unix sockets, and hands on whole lines
// only. QEMU's UARTs write a byte at a time, and a guest would be interrupted for each of them. It listens on one,
// waits for the other to be there, and ends when either does.

#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <time.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>
#include <string_view>

namespace {

/// Whoever reads what comes byte by byte is woken as often: a frame's characters are waited for together.
constexpr timespec rest_of_a_line{0, 30'000};

[[noreturn]] void quit(const char* what) {
  std::fprintf(stderr, "slcan_relay: %s: %s\n", what, std::strerror(errno));
  std::exit(1);
}

sockaddr_un address_of(std::string_view path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (path.size() >= sizeof address.sun_path) {
    errno = ENAMETOOLONG;
    quit("socket");
  }
  path.copy(address.sun_path, path.size());
  return address;
}

int accept_one(const char* path) {
  const int listener = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
  const sockaddr_un address = address_of(path);
  if (::bind(listener, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0 || ::listen(listener, 1) != 0)
    quit(path);
  const int line = ::accept(listener, nullptr, nullptr);
  if (line < 0) quit(path);
  ::close(listener);
  return line;
}

int connect_to(const char* path) {
  const int line = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
  const sockaddr_un address = address_of(path);
  for (int tries = 0; ::connect(line, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0; ++tries) {
    if (tries == 100) quit(path);
    ::usleep(100'000);
  }
  return line;
}

/// One direction.
class Direction {
 public:
  Direction(int from, int to) : from_(from), to_(to) {}
  /// Reads what is there and hands on the lines that are complete. False: the other side is gone.
  bool forward() {
    char bytes[4096];
    const ssize_t count = ::recv(from_, bytes, sizeof bytes, MSG_DONTWAIT);
    if (count == 0 || (count < 0 && errno != EAGAIN && errno != EINTR)) return false;
    if (count > 0) waiting_.append(bytes, static_cast<std::size_t>(count));
    // An adapter answers with CR or, to a refusal, BEL.
    const std::size_t end = waiting_.find_last_of("\r\a");
    if (end == std::string::npos) return true;
    for (std::size_t sent = 0; sent <= end;) {
      const ssize_t written = ::send(to_, waiting_.data() + sent, end + 1 - sent, MSG_NOSIGNAL);
      if (written < 0 && errno != EINTR) return false;
      if (written > 0) sent += static_cast<std::size_t>(written);
    }
    waiting_.erase(0, end + 1);
    return true;
  }
  bool in_a_line() const { return !waiting_.empty(); }

 private:
  int from_, to_;
  std::string waiting_;
};

}  // namespace

int main(int count, char** arguments) {
  if (count != 3) {
    std::fprintf(stderr, "usage: slcan_relay LISTEN CONNECT\n");
    return 2;
  }
  const int board = connect_to(arguments[2]), host = accept_one(arguments[1]);
  Direction to_host(board, host), to_board(host, board);
  pollfd inputs[]{{board, POLLIN, 0}, {host, POLLIN, 0}};
  for (;;) {
    if (::poll(inputs, 2, -1) < 0 && errno != EINTR) quit("poll");
    if (inputs[0].revents != 0 && !to_host.forward()) return 0;
    if (inputs[1].revents != 0 && !to_board.forward()) return 0;
    if (to_host.in_a_line()) ::nanosleep(&rest_of_a_line, nullptr);
  }
}
