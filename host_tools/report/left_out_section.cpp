#include <fmt/format.h>

#include "host_tools/page/page.hpp"
#include "host_tools/report/section.hpp"

namespace fxdyn {

using namespace page;
using nlohmann::json;

std::string left_out_section(const ReportInput& input, const json&) {
  std::string out;
  for (const std::string& file : input.results.unreadable)
    out +=
        paragraph(file + " can't be read, it may be half written, and is left out: run the verb that makes it again.");
  for (const std::string& verb : input.results.stale) {
    out += paragraph(fmt::format(
        "{}.json is of another project file, other logs or another model and left out: run `fxdyn {}` again.", verb,
        verb));
  }
  return out;
}

}  // namespace fxdyn
