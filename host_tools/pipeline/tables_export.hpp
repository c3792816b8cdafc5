#pragma once

#include <Eigen/Dense>
#include <cstdint>
#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "host_tools/effects/identified_model.hpp"
#include "host_tools/project/project.hpp"
#include "host_tools/regression/dataset.hpp"
#include "host_tools/support/progress.hpp"

namespace fxdyn {

/// What export.json says of a page of tables.
struct ExportResult {
  struct Joint {
    std::string name, unit;
    double rated_torque = 0;                                ///< this and what follows: [N*m | N]
    double proven_error = 0;                                ///< |fixed - double| within the limits, at most
    double largest_error = 0, rms_error = 0;                ///< of the same, observed
    double proven_torque = 0, attained_torque = 0;          ///< |torque|
    double proven_structural = 0, attained_structural = 0;  ///< |torque of the rigid body|
  };
  /// Tables of one joint's drive alone.
  struct Drive {
    std::size_t joint = 0;
    std::uint32_t tables_crc = 0;
    std::uintmax_t table_bytes = 0;
  };
  double tick_s = 0;
  std::string board;
  std::uint32_t tables_crc = 0;
  Lineage lineage;
  Formats formats;
  std::vector<Joint> joints;
  std::vector<Drive> drives;
  std::uint32_t saturations_on_logs = 0;
  std::uintmax_t table_bytes = 0;
};
nlohmann::json to_json(const ExportResult& result);

/// Proves ranges and errors, and writes the tables of all joints and of the drives that the project asks for. The model
/// learns formats, layout, lineage and CRC. `reported`: a file for a bug report.
/// @throws DataError: fixed point is off by more than was proven, or by more than 1e-3 of rated torque on the logs
ExportResult export_tables(IdentifiedModel& model, const Formats& formats, const TargetSettings& target,
                           const std::vector<ProcessedLog>& logs, const std::filesystem::path& directory,
                           const std::filesystem::path& reported, Progress& progress);

}  // namespace fxdyn
