#pragma once

#include <filesystem>
#include <vector>

#include "host_tools/effects/forward.hpp"
#include "host_tools/numbers/formats.hpp"
#include "host_tools/project/project.hpp"
#include "host_tools/regression/dataset.hpp"
#include "host_tools/report/export_result.hpp"
#include "host_tools/support/progress.hpp"

namespace fxdyn {

/// Proves ranges and errors, and writes the tables of all joints and of the drives that the project asks for. The model
/// learns formats, layout, lineage and CRC. `reported`: a file for a bug report.
/// @throws DataError: fixed point is off by more than was proven, or by more than the project accepts (`target`)
ExportResult export_tables(IdentifiedModel& model, const Formats& formats, const TargetSettings& target,
                           const std::vector<ProcessedLog>& logs, const std::filesystem::path& directory,
                           const std::filesystem::path& reported, Progress& progress);

}  // namespace fxdyn
