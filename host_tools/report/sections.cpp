#include <array>

#include "host_tools/report/section.hpp"

// A line a section, in the order of the page: name; result file without .json, "" where model and logs are enough; what
// the result has to belong to (Belongs in results.hpp), else it is left out; whether it is drawn without its result.
#define FXDYN_REPORT_SECTIONS(SECTION)              \
  SECTION(overview, "", anything, true)             \
  SECTION(left_out, "", anything, true)             \
  SECTION(data, "metrics", anything, false)         \
  SECTION(error, "metrics", anything, false)        \
  SECTION(diagnosis, "diagnosis", diagnosis, false) \
  SECTION(findings, "", anything, true)             \
  SECTION(residual, "", anything, true)             \
  SECTION(bls, "metrics", anything, false)          \
  SECTION(comparison, "compare", inputs, false)     \
  SECTION(efficiency, "efficiency", inputs, false)  \
  SECTION(vibration, "vibration", inputs, false)    \
  SECTION(effects, "", anything, true)              \
  SECTION(base, "", anything, true)                 \
  SECTION(fixed_point, "export", tables, true)      \
  SECTION(replay, "replay", tables, true)           \
  SECTION(torque, "", anything, true)

namespace fxdyn {

#define FXDYN_DECLARE(name, ...) std::string name##_section(const ReportInput&, const nlohmann::json&);
FXDYN_REPORT_SECTIONS(FXDYN_DECLARE)

namespace {

#define FXDYN_ENTRY(name, file, belongs, always) \
  ReportSection{#name, {file, Belongs::to_##belongs}, always, name##_section},
constexpr std::array sections{FXDYN_REPORT_SECTIONS(FXDYN_ENTRY)};

}  // namespace

std::span<const ReportSection> report_sections() { return sections; }

std::string draw_sections(const ReportInput& input, std::span<const ReportSection> drawn) {
  std::string out;
  for (const ReportSection& section : drawn) {
    const nlohmann::json& result = input.results[section.needs.name];
    if (!result.is_null() || section.always) out += section.draw(input, result);
  }
  return out;
}

}  // namespace fxdyn
