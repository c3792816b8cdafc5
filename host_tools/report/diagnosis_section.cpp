#include "host_tools/page/diagnosis_plot.hpp"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "host_tools/page/page.hpp"
#include "host_tools/report/diagnosis_words.hpp"
#include "host_tools/report/section.hpp"
#include "host_tools/support/files.hpp"

namespace fxdyn {
namespace {

using namespace page;
using nlohmann::json;
namespace fs = std::filesystem;
namespace words = diagnosis_words;

constexpr const char* plus_minus = " ± ";

std::string what_it_means(const json& diagnosis) {
  const std::string verdict = diagnosis.value("verdict", "");
  if (verdict == "explained" && !words::not_borne_out(diagnosis).empty())
    return "Explained on the data that judged: it confirms the effects below. The test logs do not bear them all out.";
  if (verdict == "explained")
    return "Explained: the model lacked physics; held-out data confirms the effects below, and what is left is noise.";
  if (verdict == "partly_explained")
    return "Partly explained: held-out data confirms the effects below, and on some joint structure is left.";
  if (verdict == "nothing_missing") return "Nothing missing: what remains between model and log looks like noise.";
  if (verdict == "unexplained")
    return "Unexplained: on some joint the model misses structure, and no effect of the catalogue is established "
           "there.";
  if (verdict == "not_excited") return "Not excited: the motion in the logs can't tell.";
  return verdict;
}

std::string figures(const json& diagnosis) {
  std::string out;
  if (const std::string those = words::not_borne_out(diagnosis); !those.empty())
    out += paragraph("The test logs disagree (amber): with what was found the error rises at " + those + ".");
  if (const std::string on = words::figures_on(diagnosis); !on.empty()) out += paragraph("Gaps on " + on + ".");
  const std::string hidden = words::list(diagnosis.value("not_identifiable", json::array()));
  if (!hidden.empty()) out += paragraph("Not identifiable on the robot as a whole: " + hidden + ".");
  return out;
}

Cell n(const std::string& text) { return {text, "n"}; }

const char* colour_of(const json& joint) {
  const std::string verdict = joint.value("verdict", "");
  if (joint.value("carries_over", json()) == false) return verdict == "unexplained" ? "bad" : "amber";
  if (verdict == "nothing_missing" || verdict == "explained") return "good";
  return verdict == "unexplained" ? "bad" : "";
}

std::string joint_table(const json& joints) {
  Table table({{"joint"},
               {"unit"},
               {"verdict"},
               {"gap before", "n"},
               {"gap after", "n"},
               {"gate before", "n"},
               {"gate after", "n"},
               {"noise floor", "n"},
               {"left unexplained", "n"},
               {"where the gap sits"},
               {"not identifiable"}});
  for (std::size_t j = 0; j < joints.size(); ++j) {
    const json& joint = joints[j];
    std::string found_where = words::where(joint);
    for (const json& set : joint.value("undecided", json::array()))
      found_where += (found_where.empty() ? "" : "; ") + words::either(set) + " is there";
    table.add({{words::joint(joint, j)},
               {joint.value("unit", "")},
               {words::verdict(joint), colour_of(joint)},
               n(words::figure(joint, "gap_before")),
               n(words::figure(joint, "gap_after")),
               n(words::figure(joint, "gate_before")),
               n(words::figure(joint, "gate_after")),
               n(words::figure(joint, "noise_floor")),
               n(words::left(joint)),
               {found_where},
               {words::list(joint.value("not_identifiable", json::array()))}});
  }
  return table.html() +
         paragraph(
             "The gap is the RMS of measured minus model torque on held-out logs, both filtered alike, noise not "
             "subtracted. Gate: the same on the data that accepted the names. Amber: it falls there, and rises on the "
             "test "
             "logs. Noise floor: what of the gap after has no structure, on the data that accepted the names: no "
             "model could explain it. Left unexplained: the share of the gap's power above the noise that no finding "
             "explains, with its 95 % interval. Not identifiable: effects that this motion could not show.");
}

std::string effect_table(const json& diagnosis) {
  Table table({{"joint"},
               {"effect"},
               {"certainty"},
               {"parameters"},
               {"closes", "n"},
               {"of the model's torque", "n"},
               {"could as well be"}});
  bool any = false;
  const auto add = [&](const std::string& joint, const json& effect) {
    any = true;
    table.add({{joint},
               {effect.value("effect", "")},
               {words::certainty(effect)},
               {words::parameters(effect, plus_minus)},
               n(words::share(effect, "held_out_closure")),
               n(words::share(effect, "model_share")),
               {words::list(effect.value("alternatives", json::array()))}});
  };
  const json joints = diagnosis.value("joints", json::array());
  for (std::size_t j = 0; j < joints.size(); ++j) {
    for (const json& effect : joints[j].value("effects", json::array())) add(words::joint(joints[j], j), effect);
  }
  for (const json& effect : diagnosis.value("robot_effects", json::array())) {
    const std::string seen = words::list(effect.value("joints", json::array()));
    add(seen.empty() ? "robot" : "robot, seen on " + seen, effect);
  }
  if (!any) return "";
  return subsection("Effects found") + table.html() +
         paragraph(
             "± is one standard deviation. Established: 1000 to 1 against nothing and against the closest rival, on "
             "data "
             "that did not fit it. Likely: 20 to 1; it is not in the model. Closes: the share of the gap that comes "
             "back when this effect alone is taken out. Could as well be: what these logs don't tell apart from it.");
}

std::string evidence_section(const json& evidence) {
  const json joints = evidence.value("joints", json::array());
  std::string out = subsection("On held-out logs");
  if (joints.empty()) return out + paragraph("No log was held out.");
  Table table(
      {{"joint"}, {"unit"}, {"RMS before", "n"}, {"after", "n"}, {"after, fixed point", "n"}, {"white noise", "n"}});
  for (std::size_t j = 0; j < joints.size(); ++j) {
    table.add({{words::joint(joints[j], j)},
               {joints[j].value("unit", "")},
               n(words::figure(joints[j], "rms_before")),
               n(words::figure(joints[j], "rms_after")),
               n(words::figure(joints[j], "rms_after_fixed")),
               n(words::figure(joints[j], "noise_floor"))});
  }
  std::string files;
  for (const json& log : evidence.value("held_out", json::array())) {
    files += (files.empty() ? "" : ", ") +
             (log.is_string() ? log.get<std::string>()
                              : fmt::format("{} ({}, {} .. {} s)", log.value("file", ""), log.value("role", ""),
                                            words::figure(log, "from_s"), words::figure(log, "to_s")));
  }
  out += table.html();
  out += paragraph(
      "RMS of measured minus model torque over these logs, before and after what diagnosis found, and after as the "
      "firmware computes it. White noise: as under Error.");
  if (!files.empty()) out += paragraph("Logs: " + files + ".");
  if (evidence.contains("note")) out += paragraph("Note: " + evidence.value("note", "") + ".");
  const json fixed = evidence.value("fixed_point", json::object());
  for (const json& note : fixed.value("notes", json::array()))
    out += paragraph("Fixed point: " + note.get<std::string>() + ".");
  if (fixed.contains("why_not")) out += paragraph("No fixed point: " + fixed.value("why_not", "") + ".");
  return out;
}

std::string forward_section(const json& forward) {
  if (!forward.is_object()) return "";
  const json joints = forward.value("joints", json::array());
  Table table({{"joint"},
               {"tracking before", "n"},
               {"after", "n"},
               {"unit"},
               {"torque added before", "n"},
               {"after", "n"},
               {"unit"}});
  for (std::size_t j = 0; j < joints.size(); ++j) {
    const std::string position = joints[j].value("tracking_unit", "");
    table.add({{words::joint(joints[j], j)},
               n(words::figure(joints[j], "tracking_before")),
               n(words::figure(joints[j], "tracking_after")),
               {position},
               n(words::figure(joints[j], "torque_before")),
               n(words::figure(joints[j], "torque_after")),
               {joints[j].value("torque_unit", position == "m" ? "N" : "N*m")}});
  }
  std::string out = subsection("Forward: the recorded motion in closed loop") + table.html();
  out += paragraph(fmt::format(
      "{} s of {} played through the simulator with the model before and after as the robot. The recorded torque is "
      "fed "
      "forward, a PD controller holds the simulated robot at the recorded motion. Tracking: RMS of simulated minus "
      "recorded position. Torque added: RMS of what the controller had to add to the recorded torque. Less is better.",
      words::figure(forward, "seconds"), forward.value("log", "")));
  const json failed = forward.value("failed", json::object());
  for (const auto& [which, why] : failed.items()) {
    if (why.is_string())
      out += paragraph(fmt::format("The model {} can't be simulated: {}.", which, why.get<std::string>()));
  }
  return out;
}

std::string pictures(const json& joints, const fs::path& directory) {
  std::string out;
  for (std::size_t j = 0; j < joints.size(); ++j) {
    const fs::path file = diagnosis_plot(directory, joints[j].value("index", j + 1) - 1);
    if (!fs::exists(file)) continue;
    out += subsection(words::joint(joints[j], j) + ": residual before and after") + read_file(file);
  }
  if (out.empty()) return out;
  return out + paragraph(
                   "Against velocity and position: all held-out logs, thin lines the samples, thick lines their mean. "
                   "Time and spectrum: the log in which the model gained most.");
}

}  // namespace

std::string diagnosis_section(const ReportInput& input, const json& diagnosis) {
  const json joints = diagnosis.value("joints", json::array());
  std::string out = section("Diagnosis") + paragraph(what_it_means(diagnosis)) + figures(diagnosis) +
                    joint_table(joints) + effect_table(diagnosis);
  if (diagnosis.contains("evidence")) {
    const json& evidence = diagnosis.at("evidence");
    out += evidence_section(evidence) + forward_section(evidence.value("forward", json()));
  }
  if (const std::string next = words::next_experiment(diagnosis); !next.empty())
    out += subsection("Next experiment") + paragraph(next);
  for (const json& note : diagnosis.value("notes", json::array())) {
    if (note.is_string()) out += paragraph("Note: " + note.get<std::string>() + ".");
  }
  return out + pictures(joints, input.directory);
}

}  // namespace fxdyn
