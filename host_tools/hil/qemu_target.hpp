#pragma once

#include <sys/types.h>

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "firmware/protocol/serial_protocol.hpp"

namespace fxdyn {

/// What the target computed for one tick.
struct TickReply {
  std::vector<std::int32_t> torques;  ///< raw, one per joint
  std::uint32_t saturations = 0;      ///< numbers that left their format or limits in this tick
  std::uint32_t instructions = 0;     ///< executed by the tick
  friend bool operator==(const TickReply&, const TickReply&) = default;
};

/// A firmware image that runs in qemu-system-arm, reached over its UART. The emulator lives as long as the object, and
/// no longer than the thread that made it.
class QemuTarget {
 public:
  struct Options {
    std::string emulator = "qemu-system-arm";
    std::string machine = "mps2-an386";
    std::chrono::milliseconds timeout{10'000};  ///< for each reply; generous for loaded machines
    std::filesystem::path update_page;          ///< tables.bin to load into the image's slot for updates; empty: none
  };

  explicit QemuTarget(const std::filesystem::path& image) : QemuTarget(image, Options{}) {}
  QemuTarget(const std::filesystem::path& image, Options options);
  ~QemuTarget();
  QemuTarget(const QemuTarget&) = delete;
  QemuTarget& operator=(const QemuTarget&) = delete;

  /// Who is there; call it first.
  serial::Identity hello();
  /// Sets what the model's effects remember back to the robot at rest.
  void reset();
  /// `words`: raw q, dq, ddq of each joint in turn.
  TickReply tick(std::span<const std::int32_t> words);
  /// Ticks one after the other, `words_per_tick` each.
  std::vector<TickReply> run(std::span<const std::int32_t> words, std::size_t words_per_tick);

 private:
  using Reply = serial::Frame<serial::largest_payload>;

  void start(const std::filesystem::path& image);
  void stop() noexcept;
  void send(serial::Type type, std::span<const std::uint32_t> payload);
  const Reply& receive(serial::Type expected);
  [[noreturn]] void fail(const std::string& what);

  Options options_;
  pid_t process_ = -1;
  int line_ = -1;      ///< our end of the serial line
  int messages_ = -1;  ///< what the emulator prints
  std::uint32_t sequence_ = 0;
  std::size_t outputs_ = 0;  ///< torques of a tick, once hello() has said it
  serial::FrameReader<serial::largest_payload> reader_;
  Reply reply_;
};

}  // namespace fxdyn
