#include "host_tools/report/export_result.hpp"

#include "host_tools/effects/formats_json.hpp"

namespace fxdyn {

using nlohmann::json;

json to_json(const ExportResult& result) {
  json drives = json::array(), joints = json::array();
  for (const ExportResult::Drive& drive : result.drives)
    drives.push_back(
        {{"index", drive.joint + 1}, {"tables_crc", drive.tables_crc}, {"table_bytes", drive.table_bytes}});
  for (std::size_t j = 0; j < result.joints.size(); ++j) {
    const ExportResult::Joint& joint = result.joints[j];
    joints.push_back({{"joint", joint.name},
                      {"index", j + 1},
                      {"unit", joint.unit},
                      {"rated_torque", joint.rated_torque},
                      {"formats", formats_json(result.formats)},
                      {"proven_bound", joint.proven_error},
                      {"proven_bound_of_rated", joint.proven_error / joint.rated_torque},
                      {"observed_max", joint.largest_error},
                      {"observed_max_of_rated", joint.largest_error / joint.rated_torque},
                      {"quantisation_rms", joint.rms_error},
                      {"torque_range",
                       {{"proven", joint.proven_torque},
                        {"proven_structural", joint.proven_structural},
                        {"attained", joint.attained_torque},
                        {"attained_structural", joint.attained_structural}}}});
  }
  return {{"schema", "fxdyn.export/1"},
          {"tick_s", result.tick_s},
          {"board", result.board},
          {"tables_crc", result.tables_crc},
          {"origin", result.lineage.origin},
          {"sequence", result.lineage.sequence},
          {"formats", formats_json(result.formats)},
          {"joints", joints},
          {"drives", drives},
          {"saturations_on_logs", result.saturations_on_logs},
          {"table_bytes", result.table_bytes}};
}

ExportResult export_of(const json& file) {
  ExportResult out{.tick_s = file.at("tick_s"),
                   .board = file.at("board"),
                   .tables_crc = file.at("tables_crc"),
                   .lineage = {file.at("origin"), file.at("sequence")},
                   .formats = formats_of(file.at("formats")),
                   .saturations_on_logs = file.at("saturations_on_logs"),
                   .table_bytes = file.at("table_bytes")};
  for (const json& drive : file.at("drives")) {
    out.drives.push_back({drive.at("index").get<std::size_t>() - 1, drive.at("tables_crc"), drive.at("table_bytes")});
  }
  for (const json& joint : file.at("joints")) {
    const json& range = joint.at("torque_range");
    out.joints.push_back({.name = joint.at("joint"),
                          .unit = joint.at("unit"),
                          .rated_torque = joint.at("rated_torque"),
                          .proven_error = joint.at("proven_bound"),
                          .largest_error = joint.at("observed_max"),
                          .rms_error = joint.at("quantisation_rms"),
                          .proven_torque = range.at("proven"),
                          .attained_torque = range.at("attained"),
                          .proven_structural = range.at("proven_structural"),
                          .attained_structural = range.at("attained_structural")});
  }
  return out;
}

}  // namespace fxdyn
