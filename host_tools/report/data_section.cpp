#include <fmt/format.h>

#include "host_tools/effects/model_parts.hpp"
#include "host_tools/page/page.hpp"
#include "host_tools/regression/metrics_result.hpp"
#include "host_tools/report/section.hpp"
#include "host_tools/support/time_text.hpp"

namespace fxdyn {

using namespace page;
using nlohmann::json;

std::string data_section(const ReportInput& input, const json& file) {
  const MetricsResult result = metrics_of(file);
  Table logs({{"log"}, {"from [s]", "n"}, {"to [s]", "n"}, {"role"}, {"what it decided"}});
  for (const LogErrors& log : result.logs) {
    logs.add({{log.file},
              {time_text(log.from_s), "n"},
              {time_text(log.to_s), "n"},
              {to_string(log.role)},
              {log.role == Role::train      ? "the parameters"
               : log.role == Role::validate ? "which effects and nodes are kept"
                                            : "nothing: only judged"}});
  }
  std::string out = section("Data") + logs.html("Logs and what they decided");
  out += paragraph("Choices were gated on: " + result.gate + ". The errors below are on the " + input.results.role +
                   " logs" +
                   (input.results.role == "test" ? ", which decided nothing."
                                                 : ", since there is no test log: they are optimistic."));
  for (const std::string& note : result.notes) out += paragraph("Note: " + note + ".");
  const FilterFit& filter = filter_of(input.fitted);
  out += paragraph(
      fmt::format("Filters (zero phase, Butterworth of order 4, forward and backward): motion {:.4g} Hz; torque and "
                  "every model column alike {:.4g} Hz; {:.3g} s dropped at both ends of each log.",
                  filter.position_cutoff_hz, filter.torque_cutoff_hz, filter.edge_s));
  return out;
}

}  // namespace fxdyn
