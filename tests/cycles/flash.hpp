#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

namespace fxdyn::cycles {

using Time = std::uint64_t;  // processor cycles

/// What becomes of a line that was prefetched and used. RM0440 calls the accelerator an "instruction prefetch queue and
/// branch cache" and has the line read "each time a miss occurs" copied into the cache, where a line in the prefetch
/// buffer is no miss. Whether a line that is still on its way is one, and whether the prefetch goes on behind a line
/// out of the cache, it leaves open.
enum class Prefetch : std::uint8_t {
  off,
  copied,            ///< into the cache, when it is used
  copied_if_late,    ///< .. unless it was there in time
  apart,             ///< not into the cache; begun behind a line that came out of the flash
  apart_after_hits,  ///< .. and behind a line that came out of the cache
};

/// How the STM32G4's flash is set up (RM0440, "Embedded flash memory": FLASH_ACR, option DBANK).
struct FlashSetup {
  int wait_states = 0;  ///< 4 at 170 MHz in range 1 boost ("Number of wait states according to CPU clock")
  /// Bytes that one read gives: 8 in dual bank mode (as delivered), 16 in single bank mode.
  std::uint32_t width = 8;
  Prefetch prefetch = Prefetch::off;
  bool caches = false;  ///< for instructions and for data
};

/// Lines of 32 bytes, least recently used goes; a part as wide as a read is valid or not.
class LineCache {
 public:
  LineCache(std::size_t lines, std::uint32_t width) : lines_(lines), width_(width) {}
  bool has(std::uint32_t address) const;
  /// Whether it is there; counts as a use.
  bool use(std::uint32_t address);
  void fill(std::uint32_t address);
  void clear() { kept_.clear(); }

  static constexpr std::uint32_t line_bytes = 32;

 private:
  struct Line {
    std::uint32_t address = 0;
    unsigned valid = 0;  ///< a bit for each part
  };
  unsigned part(std::uint32_t address) const { return 1U << (address % line_bytes / width_); }

  std::size_t lines_;
  std::uint32_t width_;
  std::vector<Line> kept_;  ///< least recently used first
};

/// Who waits how long for the flash: one array that gives one line at a time, behind it a buffer of the current line
/// for instructions and for data, a prefetched line, and two caches (RM0440, "Read access", "ART Accelerator"). Data
/// goes before instructions, but a read that runs is not broken off.
class Flash {
 public:
  explicit Flash(const FlashSetup& setup);

  /// When the word that is asked for at `now` has come. Without wait states: at `now` + 1.
  Time fetch(std::uint32_t address, Time now);
  /// `misses`: as if no buffer or cache had it, and as if nobody else could use what it brings in.
  Time load(std::uint32_t address, Time now, bool misses = false);
  /// As after a change of the flash or a reset of the caches; time goes on.
  void forget();

  const FlashSetup& setup() const { return setup_; }

 private:
  struct Read {
    std::uint32_t line = 0;
    Time ready = 0;
  };
  std::uint32_t line_of(std::uint32_t address) const { return address & ~(setup_.width - 1); }
  Time read(Time now);
  void start_prefetch_before(Time now);
  Time start_prefetch();

  FlashSetup setup_;
  Time free_ = 0;  ///< when the array can begin another read
  std::optional<Read> instructions_, data_, prefetched_;
  std::optional<Read> to_prefetch_;  ///< `ready`: when it may begin
  LineCache instruction_cache_, data_cache_;
  std::uint32_t elsewhere_ = 0xf000'0000;  ///< lines of loads that miss whatever happens
};

}  // namespace fxdyn::cycles
