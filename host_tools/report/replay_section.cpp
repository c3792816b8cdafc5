#include <fmt/format.h>

#include "host_tools/page/page.hpp"
#include "host_tools/report/section.hpp"

namespace fxdyn {

using namespace page;
using nlohmann::json;

std::string replay_section(const ReportInput&, const json& result) {
  std::string out = section("Replay on the firmware");
  if (result.is_null())
    return out + paragraph(
                     "Not replayed with these tables: build the image with toolchains/build_image.sh, then run fxdyn "
                     "replay.");
  const ReplaySummary sum = summarise_replay(result);
  out += paragraph(fmt::format("{} ticks on {} in QEMU (image {}): {}. {} to {} instructions a tick.", sum.ticks,
                               sum.processor, text(result.at("image")),
                               sum.different_ticks == 0
                                   ? "every torque is the host's bit for bit"
                                   : fmt::format("{} ticks differ from the host", sum.different_ticks),
                               sum.fewest, sum.most));
  if (result.contains("size")) {
    out += paragraph(fmt::format("Image: {} bytes flash, {} bytes RAM (stack included).",
                                 result.at("size").at("flash_bytes").get<int>(),
                                 result.at("size").at("ram_bytes").get<int>()));
  }
  Table table({{"stream"},
               {"ticks", "n"},
               {"different", "n"},
               {"saturations", "n"},
               {"instructions a tick", "n"},
               {"largest |firmware - double| of rated", "n"}});
  for (const json& log : result.at("logs")) {
    double largest = 0;
    for (const json& joint : log.at("joints"))
      largest = std::max(largest, joint.at("largest_error_of_rated").get<double>());
    const auto different = log.at("different_ticks").get<std::int64_t>();
    table.add({{text(log.at("log"))},
               {fmt::format("{}", log.at("ticks").get<std::int64_t>()), "n"},
               {fmt::format("{}", different), different == 0 ? "n good" : "n bad"},
               {fmt::format("{}", log.at("saturations").get<std::int64_t>()), "n"},
               {fmt::format("{:.0f}", log.at("instructions_per_tick").at("mean").get<double>()), "n"},
               {fmt::format("{:.2g}", largest), "n"}});
  }
  return out + table.html();
}

}  // namespace fxdyn
