#include <fmt/format.h>

#include "host_tools/page/page.hpp"
#include "host_tools/report/replay_result.hpp"
#include "host_tools/report/section.hpp"

namespace fxdyn {

using namespace page;

std::string replay_section(const ReportInput&, const nlohmann::json& file) {
  std::string out = section("Replay on the firmware");
  if (file.is_null())
    return out + paragraph(
                     "Not replayed with these tables: build the image with toolchains/build_image.sh, then run fxdyn "
                     "replay.");
  const ReplayResult result = replay_of(file);
  const ReplaySummary sum = summarise_replay(result);
  out += paragraph(fmt::format(
      "{} ticks on {} in QEMU (image {}): {}. {} to {} instructions a tick.", sum.ticks, sum.processor, result.image,
      sum.different_ticks == 0 ? "every torque is the host's bit for bit"
                               : fmt::format("{} ticks differ from the host", sum.different_ticks),
      sum.fewest, sum.most));
  if (result.size) {
    out += paragraph(
        fmt::format("Image: {} bytes flash, {} bytes RAM (stack included).", result.size->flash, result.size->ram));
  }
  Table table({{"stream"},
               {"ticks", "n"},
               {"different", "n"},
               {"saturations", "n"},
               {"instructions a tick", "n"},
               {"largest |firmware - double| of rated", "n"}});
  for (const ReplayedLog& log : result.logs) {
    double largest = 0;
    for (const ReplayedLog::Joint& joint : log.joints) largest = std::max(largest, joint.largest_error_of_rated);
    table.add({{log.name},
               {fmt::format("{}", log.ticks), "n"},
               {fmt::format("{}", log.different_ticks), log.different_ticks == 0 ? "n good" : "n bad"},
               {fmt::format("{}", log.saturations), "n"},
               {fmt::format("{:.0f}", log.mean), "n"},
               {fmt::format("{:.2g}", largest), "n"}});
  }
  return out + table.html("Streams played on the firmware") +
         paragraph(
             "Different: ticks in which a torque is not the host's bit for bit. Saturations: numbers that left their "
             "format and were held at its end; perturbed streams are made to do that. Instructions are counted by QEMU "
             "and "
             "are no cycles. The last column: largest difference from the model in double, of rated torque.");
}

}  // namespace fxdyn
