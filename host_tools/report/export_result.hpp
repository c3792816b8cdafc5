#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "host_tools/effects/lineage.hpp"
#include "host_tools/numbers/formats.hpp"

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
  std::vector<Joint> joints{};
  std::vector<Drive> drives{};
  std::uint32_t saturations_on_logs = 0;
  std::uintmax_t table_bytes = 0;
};
nlohmann::json to_json(const ExportResult& result);
ExportResult export_of(const nlohmann::json& file);

}  // namespace fxdyn
