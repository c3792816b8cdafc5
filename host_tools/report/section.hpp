#pragma once

#include <memory>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "host_tools/effects/forward.hpp"
#include "host_tools/project/project.hpp"
#include "host_tools/regression/dataset.hpp"
#include "host_tools/report/results.hpp"

namespace fxdyn {

struct ShownLog;

/// What a section may draw from.
struct ReportInput {
  const IdentifiedModel& fitted;           ///< effects/model_parts.hpp gives its parts, identified_model.hpp all of it
  const std::vector<ProcessedLog>& logs;   ///< to draw: the test logs, else validate, else train
  const Results& results;                  ///< all result files that a section needs
  const std::filesystem::path& directory;  ///< where the results are
  const ReportSettings& settings = default_settings;
  static inline const ReportSettings default_settings{};
  /// Of shown_logs() in shown_log.hpp: ask that.
  mutable std::shared_ptr<const std::vector<ShownLog>> shown{};
};

/// A part of report.html. One more: a file NAME_section.cpp with its function, and a line in sections.cpp
/// (docs/guide/report-section.md).
struct ReportSection {
  std::string_view name;
  ResultFile needs;  ///< "" : the model alone
  bool always;       ///< drawn without the result too, which is null then: it says how to make it
  /// Content of the page from the heading on; empty: nothing to say.
  std::string (*draw)(const ReportInput& input, const nlohmann::json& result);
};

/// In the order of the page.
std::span<const ReportSection> report_sections();

/// What the sections draw, one after another.
std::string draw_sections(const ReportInput& input, std::span<const ReportSection> sections);

}  // namespace fxdyn
