#include <fmt/format.h>

#include "host_tools/page/page.hpp"
#include "host_tools/report/section.hpp"

namespace fxdyn {

using namespace page;
using nlohmann::json;

std::string data_section(const ReportInput& input, const json& result) {
  Table logs({{"log"}, {"from [s]", "n"}, {"to [s]", "n"}, {"role"}, {"what it decided"}});
  for (const json& log : result.at("logs")) {
    const std::string of = text(log.at("role"));
    logs.add({{text(log.at("file"))},
              number(log.at("from_s"), 6),
              number(log.at("to_s"), 6),
              {of},
              {of == "train"      ? "the parameters"
               : of == "validate" ? "which effects and nodes are kept"
                                  : "nothing: only judged"}});
  }
  std::string out = section("Data") + logs.html();
  out += paragraph("Choices were gated on: " + text(result.at("gate")) + ". The errors below are on the " +
                   input.results.role + " logs" +
                   (input.results.role == "test" ? ", which decided nothing."
                                                 : ", since there is no test log: they are optimistic."));
  for (const json& note : result.value("notes", json::array())) out += paragraph("Note: " + text(note) + ".");
  const json& filter = input.model.at("filter");
  out += paragraph(
      fmt::format("Filters (zero phase, Butterworth of order 4, forward and backward): motion {:.4g} Hz; torque and "
                  "every model column alike {:.4g} Hz; {:.3g} s dropped at both ends of each log.",
                  filter.at("position_cutoff_hz").get<double>(), filter.at("torque_cutoff_hz").get<double>(),
                  filter.at("edge_s").get<double>()));
  return out;
}

}  // namespace fxdyn
