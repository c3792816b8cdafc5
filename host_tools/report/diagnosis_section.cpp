#include "host_tools/page/diagnosis_plot.hpp"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "host_tools/page/page.hpp"
#include "host_tools/report/diagnosis_words.hpp"
#include "host_tools/report/joint_answer.hpp"
#include "host_tools/report/section.hpp"
#include "host_tools/support/files.hpp"
#include "host_tools/support/time_text.hpp"

namespace fxdyn {
namespace {

using namespace page;
namespace fs = std::filesystem;
namespace words = diagnosis_words;

constexpr const char* plus_minus = " ± ";

std::string what_it_means(const DiagnosisResult& diagnosis) {
  switch (diagnosis.verdict) {
    case Verdict::explained:
      return words::not_borne_out(diagnosis).empty()
                 ? "Explained: the model lacked physics; held-out data confirms the effects below, and what is left is "
                   "noise."
                 : "Explained on the data that judged: it confirms the effects below. The test logs do not bear them "
                   "all out.";
    case Verdict::partly_explained:
      return "Partly explained: held-out data confirms the effects below, and on some joint structure is left.";
    case Verdict::nothing_missing:
      return "Nothing missing: what remains between model and log looks like noise.";
    case Verdict::unexplained:
      return "Unexplained: on some joint the model misses structure, and no effect of the catalogue is established "
             "there.";
    case Verdict::not_excited:
      break;
  }
  return "Not excited: the motion in the logs can't tell.";
}

std::string gaps_on(const DiagnosisResult& diagnosis) {
  std::string out;
  if (const std::string those = words::not_borne_out(diagnosis); !those.empty())
    out += paragraph("The test logs disagree: with what was found the error rises at " + those + ".");
  if (const std::string on = words::figures_on(diagnosis); !on.empty()) out += paragraph("Gaps on " + on + ".");
  const std::string hidden = words::list(diagnosis.not_identifiable);
  if (!hidden.empty()) out += paragraph("Not identifiable on the robot as a whole: " + hidden + ".");
  return out;
}

Cell n(const std::string& text) { return {text, "n"}; }

std::string joint_table(const std::vector<JointDiagnosis>& joints, const std::vector<JointAnswer>& answers) {
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
  for (const JointDiagnosis& joint : joints) {
    std::string found_where = joint.where.sentence;
    for (const auto& set : joint.undecided)
      found_where += (found_where.empty() ? "" : "; ") + words::either(set) + " is there";
    if (joint.curve) found_where += (found_where.empty() ? "" : "; ") + words::curve(*joint.curve);
    table.add({{joint.joint},
               {joint.unit},
               {words::verdict(joint.verdict), css_class(answers.at(joint.index - 1).mood)},
               n(words::figure(joint.gap_before)),
               n(words::figure(joint.gap_after)),
               n(words::figure(joint.gate_before)),
               n(words::figure(joint.gate_after)),
               n(words::figure(joint.noise_floor)),
               n(words::left(joint.left)),
               {found_where},
               {words::list(joint.not_identifiable)}});
  }
  return table.html("What is there and what is left, joint by joint") +
         paragraph(
             "The gap is the RMS of measured minus model torque on held-out logs, both filtered alike, noise not "
             "subtracted. Gate: the same on the data that accepted the names. Colours as on the first screen. Amber: "
             "the test logs disagree. Noise floor: what of the gap after has no structure, on the data that accepted "
             "the names: no "
             "model could explain it. Left unexplained: the share of the gap's power above the noise that no finding "
             "explains, with its 95 % interval. Not identifiable: effects that this motion could not show.");
}

std::string effect_table(const DiagnosisResult& diagnosis) {
  Table table({{"joint"},
               {"effect"},
               {"certainty"},
               {"parameters"},
               {"closes", "n"},
               {"of the model's torque", "n"},
               {"could as well be"}});
  bool any = false;
  const auto add = [&](const std::string& joint, const NamedEffect& effect) {
    any = true;
    table.add({{joint},
               {effect.effect},
               {words::certainty(effect)},
               {words::parameters(effect, plus_minus)},
               n(words::share(effect.held_out_closure)),
               n(words::share(effect.model_share)),
               {words::list(effect.alternatives)}});
  };
  for (const JointDiagnosis& joint : diagnosis.joints) {
    for (const NamedEffect& effect : joint.effects) add(joint.joint, effect);
  }
  for (const NamedEffect& effect : diagnosis.robot_effects) {
    const std::string seen = words::list(effect.joints);
    add(seen.empty() ? "robot" : "robot, seen on " + seen, effect);
  }
  if (!any) return "";
  return subsection("Effects found") + table.html("Effects, their certainty and their parameters") +
         paragraph(
             "± is one standard deviation. Established: 1000 to 1 against nothing and against the closest rival, on "
             "data "
             "that did not fit it. Likely: 20 to 1, or its name is open, or more is left at its joint than names "
             "close. Closes: the share of the gap that comes "
             "back when this effect alone is taken out. Could as well be: what these logs don't tell apart from it.");
}

std::string evidence_section(const HeldOutEvidence& evidence) {
  std::string out = subsection("On held-out logs");
  if (evidence.joints.empty()) return out + paragraph("No log was held out.");
  Table table(
      {{"joint"}, {"unit"}, {"RMS before", "n"}, {"after", "n"}, {"after, fixed point", "n"}, {"white noise", "n"}});
  for (const HeldOutEvidence::Joint& joint : evidence.joints) {
    table.add({{joint.joint},
               {joint.unit},
               n(words::figure(joint.before)),
               n(words::figure(joint.after)),
               n(words::figure(joint.after_fixed)),
               n(words::figure(joint.noise_floor))});
  }
  std::string files;
  for (const HeldOutEvidence::Log& log : evidence.held_out) {
    files += fmt::format("{}{} ({}, {} .. {} s)", files.empty() ? "" : ", ", log.file, to_string(log.role),
                         time_text(log.from_s), time_text(log.to_s));
  }
  out += table.html("Errors before and after diagnosis");
  out += paragraph(
      "RMS of measured minus model torque over these logs, before and after what diagnosis found, and after as the "
      "firmware computes it. White noise: as under Error.");
  if (!files.empty()) out += paragraph("Logs: " + files + ".");
  if (!evidence.note.empty()) out += paragraph("Note: " + evidence.note + ".");
  for (const std::string& note : evidence.fixed_point.notes) out += paragraph("Fixed point: " + note + ".");
  if (const std::string& why = evidence.fixed_point.why_not; !why.empty())
    out += paragraph("No fixed point: " + why + ".");
  return out;
}

std::string forward_section(const PlayedForward& forward) {
  Table table({{"joint"},
               {"tracking before", "n"},
               {"after", "n"},
               {"unit"},
               {"torque added before", "n"},
               {"after", "n"},
               {"unit"}});
  for (const PlayedJoint& joint : forward.joints) {
    table.add({{joint.joint},
               n(words::figure(joint.tracking_before)),
               n(words::figure(joint.tracking_after)),
               {joint.position_unit},
               n(words::figure(joint.torque_before)),
               n(words::figure(joint.torque_after)),
               {joint.torque_unit}});
  }
  std::string out = subsection("Forward: the recorded motion in closed loop") + table.html("Errors in closed loop");
  out += paragraph(fmt::format(
      "{} s of {} played through the simulator with the model before and after as the robot. The recorded torque is "
      "fed "
      "forward, a PD controller holds the simulated robot at the recorded motion. Tracking: RMS of simulated minus "
      "recorded position. Torque added: RMS of what the controller had to add to the recorded torque. Less is better.",
      words::figure(forward.seconds), forward.log));
  const auto say = [&](const char* which, const std::string& why) {
    if (!why.empty()) out += paragraph(fmt::format("The model {} can't be simulated: {}.", which, why));
  };
  say("after", forward.failed_after);
  say("before", forward.failed_before);
  return out;
}

std::string pictures(const std::vector<JointDiagnosis>& joints, const fs::path& directory) {
  std::vector<std::string> all;
  for (const JointDiagnosis& joint : joints) {
    const fs::path file = diagnosis_plot(directory, joint.index - 1);
    if (!fs::exists(file)) continue;
    all.push_back(figure(read_file(file), joint.joint + ": residual before and after"));
  }
  if (all.empty()) return "";
  return subsection("Residuals") + figures(all) +
         paragraph(
             "Against velocity and position: all held-out logs, thin lines the samples, thick lines their mean. "
             "Time and spectrum: the log in which the model gained most.");
}

}  // namespace

std::string diagnosis_section(const ReportInput& input, const nlohmann::json& file) {
  const DiagnosisResult diagnosis = diagnosis_of(file);
  std::string out = section("Diagnosis") + paragraph(what_it_means(diagnosis)) + gaps_on(diagnosis) +
                    joint_table(diagnosis.joints, joint_answers(input)) + effect_table(diagnosis);
  if (diagnosis.evidence) {
    out += evidence_section(*diagnosis.evidence);
    if (diagnosis.evidence->forward) out += forward_section(*diagnosis.evidence->forward);
  }
  if (!diagnosis.next_experiment.empty()) out += subsection("Next experiment");
  for (const std::string& one : words::experiments(diagnosis.next_experiment)) out += paragraph(one);
  for (const std::string& note : diagnosis.notes) out += paragraph("Note: " + note + ".");
  return out + pictures(diagnosis.joints, input.directory);
}

}  // namespace fxdyn
