#include "host_tools/hil/qemu_target.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sched.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <utility>

#include "host_tools/hil/elf.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/files.hpp"

namespace fxdyn {
namespace {

/// Between fork and exec: only async-signal-safe calls. Returns only if the program can't be started.
void become(char* const* arguments, int line, int messages, pid_t parent) {
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (::getppid() != parent) ::_exit(1);  // it died before prctl
  // The emulator's two threads hand each byte to and fro: on one CPU that is about three times as fast as on two.
  cpu_set_t one_cpu;
  CPU_ZERO(&one_cpu);
  CPU_SET(static_cast<std::size_t>(std::max(::sched_getcpu(), 0)), &one_cpu);
  ::sched_setaffinity(0, sizeof one_cpu, &one_cpu);
  ::fcntl(line, F_SETFD, 0);
  const int nothing = ::open("/dev/null", O_RDONLY);
  ::dup2(nothing, STDIN_FILENO);
  ::dup2(messages, STDOUT_FILENO);
  ::dup2(messages, STDERR_FILENO);
  ::execvp(arguments[0], arguments);
}

/// What loads the page into the image's slot for updates.
std::vector<std::string> page_arguments(const std::filesystem::path& image, const std::filesystem::path& page) {
  if (page.empty()) return {};
  const auto begin = symbol_of(image, "fxdyn_update_begin"), end = symbol_of(image, "fxdyn_update_end");
  if (!begin || !end)
    throw InputError(fmt::format("{}: has no slot for updated tables: build it anew", image.string()));
  const std::size_t bytes = read_file(page).size(), slot = *end - *begin;
  if (bytes > slot) throw InputError(fmt::format("{}: {} bytes, the slot has {}", page.string(), bytes, slot));
  std::string file = page.string();  // a comma ends an option of the emulator, two are one of the name
  for (std::size_t at = file.find(','); at != std::string::npos; at = file.find(',', at + 2)) file.insert(at, 1, ',');
  return {"-device", fmt::format("loader,file={},addr={:#x},force-raw=on", file, *begin)};
}

}  // namespace

QemuTarget::QemuTarget(const std::filesystem::path& image, Options options) : options_(std::move(options)) {
  if (!std::filesystem::exists(image))
    throw InputError(fmt::format("no firmware image {}: toolchains/build_image.sh makes one", image.string()));
  std::array<char, 20> head{};
  std::ifstream(image, std::ios::binary).read(head.data(), head.size());
  // ELF header: magic, 32 bits (byte 4), machine 40 = Arm (byte 18)
  if (std::string_view(head.data(), 4) !=
          "\x7f"
          "ELF" ||
      head[4] != 1 || head[18] != 40)
    throw InputError(fmt::format("{}: not a firmware image; toolchains/build_image.sh makes one", image.string()));
  try {
    start(image);
  } catch (...) {
    stop();  // the destructor doesn't run
    throw;
  }
}

QemuTarget::~QemuTarget() { stop(); }

void QemuTarget::start(const std::filesystem::path& image) {
  const std::vector<std::string> page = page_arguments(image, options_.update_page);
  std::array<int, 2> line{-1, -1}, failure{-1, -1};
  if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, line.data()) != 0) {
    throw InputError(fmt::format("socketpair: {}", std::strerror(errno)));
  }
  line_ = line[0];
  messages_ = ::memfd_create("qemu-messages", MFD_CLOEXEC);
  if (messages_ < 0 || ::pipe2(failure.data(), O_CLOEXEC) != 0) {
    ::close(line[1]);
    throw InputError(fmt::format("can't start {}: {}", options_.emulator, std::strerror(errno)));
  }

  // -icount: one instruction takes 2^8 ns of emulated time, so the target's timer counts instructions.
  std::vector<std::string> texts{options_.emulator, "-M",
                                 options_.machine,  "-nographic",
                                 "-monitor",        "none",
                                 "-icount",         "shift=8",
                                 "-chardev",        fmt::format("socket,id=uart0,fd={}", line[1]),
                                 "-serial",         "chardev:uart0",
                                 "-kernel",         image.string()};
  texts.insert(texts.end(), page.begin(), page.end());
  std::vector<char*> arguments;
  for (std::string& text : texts) arguments.push_back(text.data());
  arguments.push_back(nullptr);

  const pid_t parent = ::getpid();
  process_ = ::fork();
  if (process_ == 0) {
    become(arguments.data(), line[1], messages_, parent);
    const int error = errno;
    [[maybe_unused]] const auto written = ::write(failure[1], &error, sizeof error);
    ::_exit(127);
  }
  const int fork_error = errno;
  ::close(line[1]);
  ::close(failure[1]);
  int error = process_ < 0 ? fork_error : 0;
  // The pipe closes by itself when the emulator has started.
  if (process_ > 0 && ::read(failure[0], &error, sizeof error) <= 0) error = 0;
  ::close(failure[0]);
  if (error == ENOENT) throw InputError(fmt::format("{} not found: run toolchains/setup.sh", options_.emulator));
  if (error != 0) throw InputError(fmt::format("can't start {}: {}", options_.emulator, std::strerror(error)));
}

void QemuTarget::stop() noexcept {
  if (process_ > 0) {
    ::kill(process_, SIGKILL);
    while (::waitpid(process_, nullptr, 0) < 0 && errno == EINTR) {}
  }
  process_ = -1;
  for (int* file : {&line_, &messages_}) {
    if (*file >= 0) ::close(*file);
    *file = -1;
  }
}

serial::Identity QemuTarget::hello() {
  send(serial::Type::hello, {});
  const auto& words = receive(serial::Type::identity).words;
  if (words[0] != serial::protocol_version) {
    fail(fmt::format("speaks protocol version {}, not {}", words[0], serial::protocol_version));
  }
  outputs_ = static_cast<std::size_t>(std::popcount(words[6]));
  return {words[0], words[1], words[2], words[3], static_cast<serial::NodeState>(words[4]), words[5], words[6]};
}

void QemuTarget::reset() {
  send(serial::Type::reset, {});
  receive(serial::Type::reset_done);
}

TickReply QemuTarget::tick(std::span<const std::int32_t> words) {
  const std::size_t joints = words.size() / 3;
  if (words.size() != 3 * joints || serial::tick_words(joints) > serial::largest_payload) {
    throw InputError(fmt::format("a tick of {} words: 3 for each of at most {} joints", words.size(),
                                 (serial::largest_payload - 1) / 3));
  }
  std::vector<std::uint32_t> payload{++sequence_};
  for (const std::int32_t word : words) payload.push_back(std::bit_cast<std::uint32_t>(word));
  send(serial::Type::tick, payload);

  const Reply& reply = receive(serial::Type::torque);
  const std::size_t outputs = reply.size - serial::torque_words(0);
  if (reply.size <= serial::torque_words(0) || (outputs_ != 0 && outputs != outputs_) || reply.words[0] != sequence_) {
    fail(fmt::format("answered tick {} where {} was expected", reply.words[0], sequence_));
  }
  TickReply result{{}, reply.words[1 + outputs], reply.words[2 + outputs]};
  for (std::size_t j = 0; j < outputs; ++j) result.torques.push_back(std::bit_cast<std::int32_t>(reply.words[1 + j]));
  return result;
}

std::vector<TickReply> QemuTarget::run(std::span<const std::int32_t> words, std::size_t words_per_tick) {
  if (words_per_tick == 0 || words.size() % words_per_tick != 0) throw InputError("the setpoints are not whole ticks");
  std::vector<TickReply> replies;
  replies.reserve(words.size() / words_per_tick);
  for (; !words.empty(); words = words.subspan(words_per_tick)) replies.push_back(tick(words.first(words_per_tick)));
  return replies;
}

void QemuTarget::send(serial::Type type, std::span<const std::uint32_t> payload) {
  std::array<std::uint8_t, serial::frame_bytes(serial::largest_payload)> frame;
  const std::size_t size = serial::encode(type, payload, frame);
  for (std::size_t sent = 0; sent < size;) {
    const ssize_t count = ::send(line_, frame.data() + sent, size - sent, MSG_NOSIGNAL);
    if (count > 0) {
      sent += static_cast<std::size_t>(count);
    } else if (errno != EINTR) {
      fail("stopped");
    }
  }
}

const QemuTarget::Reply& QemuTarget::receive(serial::Type expected) {
  const auto deadline = std::chrono::steady_clock::now() + options_.timeout;
  while (!reader_.next(reply_)) {
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(deadline - std::chrono::steady_clock::now());
    pollfd line{line_, POLLIN, 0};
    const int ready = left.count() > 0 ? ::poll(&line, 1, static_cast<int>(left.count())) : 0;
    if (ready == 0) fail(fmt::format("no reply within {} ms", options_.timeout.count()));
    std::array<std::uint8_t, 4096> bytes;
    const ssize_t count = ready > 0 ? ::recv(line_, bytes.data(), std::min(bytes.size(), reader_.space()), 0) : -1;
    if (count > 0) {
      reader_.push(std::span{bytes}.first(static_cast<std::size_t>(count)));
    } else if (count == 0 || errno != EINTR) {
      fail("stopped");
    }
  }
  if (reply_.type == serial::Type::refused && reply_.size == 2) {
    switch (static_cast<serial::Refusal>(reply_.words[1])) {
      case serial::Refusal::tables_invalid:
        fail("refuses to compute: its tables are corrupt");
      case serial::Refusal::wrong_length:
        fail("refuses the tick: its number of joints is another one");
      case serial::Refusal::unknown_type:
        break;
    }
    fail("does not know the message");
  }
  const bool identity = expected == serial::Type::identity;
  if (reply_.type != expected || (identity && reply_.size != serial::identity_words)) {
    fail(fmt::format("answered with a message of type {:#x}", static_cast<unsigned>(reply_.type)));
  }
  return reply_;
}

void QemuTarget::fail(const std::string& what) {
  // The first line that the emulator printed says most; a register dump follows.
  std::array<char, 512> text{};
  const ssize_t size = ::pread(messages_, text.data(), text.size() - 1, 0);
  std::string said(text.data(), size > 0 ? static_cast<std::size_t>(size) : 0);
  said = said.substr(0, said.find('\n'));
  throw DataError(
      fmt::format("target {} {}{}{}", options_.machine, what, said.empty() ? "" : "; the emulator said: ", said));
}

}  // namespace fxdyn
