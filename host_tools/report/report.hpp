#pragma once

#include <filesystem>
#include <vector>

#include "host_tools/effects/forward.hpp"
#include "host_tools/project/project.hpp"
#include "host_tools/regression/dataset.hpp"

namespace fxdyn {

/// Writes report.html: tables from model.json, metrics.json, export.json (and replay.json and diagnosis.json where they
/// are there), and the measured and predicted torque of the given logs, drawn by gnuplot.
void write_report(const IdentifiedModel& model, const std::vector<ProcessedLog>& logs,
                  const std::filesystem::path& directory, const ReportSettings& settings = {});

/// The table that ends `fxdyn run` and the demo: held-out error per joint and stage, fixed point against double, and
/// the diagnosis where DIR/diagnosis.json is there.
std::string summary_table(const std::filesystem::path& directory);

}  // namespace fxdyn
