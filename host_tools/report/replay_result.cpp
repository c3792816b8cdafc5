#include "host_tools/report/replay_result.hpp"

#include <algorithm>
#include <nlohmann/json.hpp>

namespace fxdyn {
namespace {

using nlohmann::json;

json to_json(const ReplayedLog& log) {
  json joints = json::array();
  for (const ReplayedLog::Joint& joint : log.joints)
    joints.push_back({{"joint", joint.name},
                      {"index", joint.index},
                      {"largest_error", joint.largest_error},
                      {"unit", joint.unit},
                      {"largest_error_of_rated", joint.largest_error_of_rated}});
  return {{"log", log.name},
          {"ticks", log.ticks},
          {"different_ticks", log.different_ticks},
          {"saturations", log.saturations},
          {"instructions_per_tick", {{"fewest", log.fewest}, {"most", log.most}, {"mean", log.mean}}},
          {"joints", joints}};
}

ReplayedLog log_of(const json& file) {
  ReplayedLog out;
  out.name = file.at("log");
  out.ticks = file.at("ticks");
  out.different_ticks = file.at("different_ticks");
  out.saturations = file.at("saturations");
  const json& instructions = file.at("instructions_per_tick");
  out.fewest = instructions.at("fewest");
  out.most = instructions.at("most");
  out.mean = instructions.at("mean");
  for (const json& joint : file.at("joints"))
    out.joints.push_back({joint.at("joint"), joint.at("unit"), joint.at("index"), joint.at("largest_error"),
                          joint.at("largest_error_of_rated")});
  return out;
}

}  // namespace

json to_json(const ImageSize& size) {
  return {{"flash_bytes", size.flash}, {"ram_bytes", size.ram}, {"stack_bytes", size.stack}};
}

ImageSize image_size_of(const json& file) {
  return {file.at("flash_bytes"), file.at("ram_bytes"), file.at("stack_bytes")};
}

bool ReplayResult::bit_exact() const {
  return std::all_of(logs.begin(), logs.end(), [](const ReplayedLog& log) { return log.different_ticks == 0; });
}

json to_json(const ReplayResult& result) {
  json logs = json::array();
  for (const ReplayedLog& log : result.logs) logs.push_back(to_json(log));
  json out{{"schema", "fxdyn.replay/1"},
           {"image", result.image},
           {"tables_crc", result.tables_crc},
           {"output_joints", result.output_joints},
           {"tables_in", result.tables_in},
           {"bit_exact", result.bit_exact()},
           {"logs", logs}};
  if (result.size) out["size"] = to_json(*result.size);
  return out;
}

ReplayResult replay_of(const json& file) {
  ReplayResult out;
  out.image = file.at("image");
  out.tables_crc = file.at("tables_crc");
  out.output_joints = file.at("output_joints").get<std::vector<std::size_t>>();
  out.tables_in = file.at("tables_in");
  for (const json& log : file.at("logs")) out.logs.push_back(log_of(log));
  if (file.contains("size")) out.size = image_size_of(file.at("size"));
  return out;
}

}  // namespace fxdyn
