#include "host_tools/report/drive_line.hpp"

#include <fmt/format.h>

#include "host_tools/report/export_result.hpp"
#include "host_tools/report/replay_result.hpp"

namespace fxdyn {
namespace {

double kib(std::int64_t bytes) { return static_cast<double>(bytes) / 1024; }

/// ", at most 242 us on an STM32G4 at 170 MHz (..)"; "" for another core: nothing is known of its cycles.
std::string time_of(const ReplaySummary& sum) {
  if (sum.processor != "Cortex-M4") return "";
  const double seconds = sum.most * stm32g4_cycles_per_instruction / stm32g4_clock_hz;
  return fmt::format(", at most {:.0f} µs on an STM32G4 at 170 MHz ({:.1f} cycles an instruction, from a timing model)",
                     1e6 * seconds, stm32g4_cycles_per_instruction);
}

std::string replayed_line(const ReplayResult& replayed) {
  const ReplaySummary sum = summarise_replay(replayed);
  std::string out = fmt::format("{} instructions a tick on {}{}", sum.most, sum.processor, time_of(sum));
  if (replayed.size)
    out += fmt::format("; {:.1f} KiB flash, {:.1f} KiB RAM", kib(replayed.size->flash), kib(replayed.size->ram));
  if (sum.ticks == 0) return out + "; no tick was replayed";
  return out + (replayed.bit_exact()
                    ? fmt::format("; bit-exact in {} ticks", sum.ticks)
                    : fmt::format("; {} of {} ticks DIFFER from the host", sum.different_ticks, sum.ticks));
}

}  // namespace

std::string drive_line(const Results& results) {
  const nlohmann::json &replayed = results["replay"], &exported = results["export"];
  if (exported.is_null() && replayed.is_null()) return "no tables yet: run fxdyn export";
  std::string out;
  if (!exported.is_null())
    out = fmt::format("tables of {} bytes for {}; ", export_of(exported).table_bytes, export_of(exported).board);
  return out + (replayed.is_null()
                    ? "not yet replayed: build the image (toolchains/build_image.sh), then run fxdyn replay"
                    : replayed_line(replay_of(replayed)));
}

}  // namespace fxdyn
