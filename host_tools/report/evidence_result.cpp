#include "host_tools/report/evidence_result.hpp"

#include <nlohmann/json.hpp>

#include "host_tools/support/json_number.hpp"

namespace fxdyn {
namespace {

using nlohmann::json;

json to_json(const PlayedForward& played) {
  json joints = json::array();
  for (const PlayedJoint& joint : played.joints) {
    joints.push_back({{"joint", joint.joint},
                      {"index", joints.size() + 1},
                      {"tracking_before", or_null(joint.tracking_before)},
                      {"tracking_after", or_null(joint.tracking_after)},
                      {"tracking_unit", joint.position_unit},
                      {"torque_before", or_null(joint.torque_before)},
                      {"torque_after", or_null(joint.torque_after)},
                      {"torque_unit", joint.torque_unit}});
  }
  json out = {{"log", played.log}, {"from_s", played.from_s}, {"seconds", played.seconds}, {"joints", joints}};
  if (!played.failed_before.empty()) out["failed"]["before"] = played.failed_before;
  if (!played.failed_after.empty()) out["failed"]["after"] = played.failed_after;
  return out;
}

PlayedForward played_of(const json& file) {
  PlayedForward out{file.at("log"), file.at("from_s"), file.at("seconds")};
  for (const json& joint : file.at("joints")) {
    out.joints.push_back({joint.at("joint"), joint.at("tracking_unit"), joint.at("torque_unit"),
                          optional_of(joint.at("tracking_before")), optional_of(joint.at("tracking_after")),
                          optional_of(joint.at("torque_before")), optional_of(joint.at("torque_after"))});
  }
  if (!file.contains("failed")) return out;
  out.failed_before = file.at("failed").value("before", "");
  out.failed_after = file.at("failed").value("after", "");
  return out;
}

json to_json(const HeldOutEvidence::FixedPoint& fixed, bool judged) {
  json out{{"computed", fixed.computed}};
  if (!fixed.why_not.empty()) out["why_not"] = fixed.why_not;
  if (judged) out["notes"] = fixed.notes;
  return out;
}

}  // namespace

json to_json(const HeldOutEvidence& evidence) {
  json logs = json::array(), joints = json::array();
  for (const HeldOutEvidence::Log& log : evidence.held_out)
    logs.push_back({{"file", log.file}, {"role", to_string(log.role)}, {"from_s", log.from_s}, {"to_s", log.to_s}});
  for (const HeldOutEvidence::Joint& joint : evidence.joints) {
    joints.push_back({{"joint", joint.joint},
                      {"index", joints.size() + 1},
                      {"unit", joint.unit},
                      {"rms_before", or_null(joint.before)},
                      {"rms_after", or_null(joint.after)},
                      {"rms_after_fixed", or_null(joint.after_fixed)},
                      {"noise_floor", or_null(joint.noise_floor)}});
  }
  json out = {{"held_out", logs},
              {"joints", joints},
              {"fixed_point", to_json(evidence.fixed_point, !evidence.held_out.empty())},
              {"forward", evidence.forward ? to_json(*evidence.forward) : json(nullptr)}};
  if (!evidence.note.empty()) out["note"] = evidence.note;
  return out;
}

HeldOutEvidence evidence_of(const json& file) {
  HeldOutEvidence out;
  for (const json& log : file.at("held_out"))
    out.held_out.push_back(
        {log.at("file"), role_of(log.at("role").get<std::string>()), log.at("from_s"), log.at("to_s")});
  for (const json& joint : file.at("joints")) {
    out.joints.push_back({joint.at("joint"), joint.at("unit"), optional_of(joint.at("rms_before")),
                          optional_of(joint.at("rms_after")), optional_of(joint.at("rms_after_fixed")),
                          optional_of(joint.at("noise_floor"))});
  }
  const json& fixed = file.at("fixed_point");
  out.fixed_point = {fixed.at("computed"), fixed.value("why_not", ""),
                     fixed.value("notes", std::vector<std::string>())};
  if (!file.at("forward").is_null()) out.forward = played_of(file.at("forward"));
  out.note = file.value("note", "");
  return out;
}

}  // namespace fxdyn
