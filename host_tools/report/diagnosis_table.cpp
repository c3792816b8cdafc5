#include "host_tools/report/diagnosis_table.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <vector>

#include "host_tools/report/diagnosis_words.hpp"

namespace fxdyn {
namespace {

namespace words = diagnosis_words;

constexpr std::size_t longest_name = 18;

/// Lines of at most `width` characters, broken at blanks; a word that is longer is cut.
std::vector<std::string> wrap(const std::string& text, std::size_t width) {
  std::vector<std::string> lines(1);
  for (std::size_t at = 0; at < text.size();) {
    std::size_t end = std::min(text.find(' ', at), text.size());
    std::string word = text.substr(at, end - at);
    at = end + 1;
    while (!word.empty()) {
      std::string& line = lines.back();
      const std::size_t blank = line.empty() ? 0 : 1;
      if (line.size() + blank + word.size() <= width) {
        line += (blank > 0 ? " " : "") + word;
        word.clear();
      } else if (!line.empty()) {
        lines.emplace_back();
      } else {
        line = word.substr(0, width);
        word.erase(0, width);
      }
    }
  }
  return lines;
}

/// "  title: text", wrapped behind the title.
std::string indented(const Terminal& on, const std::string& title, const std::string& text) {
  constexpr std::size_t indent = 4;
  std::string out;
  for (const std::string& line : wrap(title + ": " + text, on.width - indent))
    out += (out.empty() ? "  " : std::string(indent, ' ')) + line + "\n";
  return out;
}

/// Held-out samples that the firmware clamps: its torque there is of another motion, whatever the figures below say.
std::string clamped_lines(const Terminal& on, const DiagnosisResult& diagnosis) {
  std::string out;
  if (!diagnosis.evidence) return out;
  for (const std::string& note : diagnosis.evidence->fixed_point.notes) out += indented(on, "clamped", note);
  return out;
}

std::string shortened(const std::string& name) {
  return name.size() <= longest_name ? name : fmt::format("{}..", name.substr(0, longest_name - 2));
}

std::string all_effects(const JointDiagnosis& joint) {
  std::string out;
  for (const NamedEffect& effect : joint.effects) out += (out.empty() ? "" : "; ") + words::effect(effect, "+-");
  return out;
}

/// "1.9 -> 0.4"
std::string change(std::optional<double> before, std::optional<double> after) {
  return words::figure(before) + " -> " + words::figure(after);
}

/// Of the column with the joints' names.
template <class T>
std::size_t name_width(const std::vector<T>& joints) {
  std::size_t width = 6;
  for (const T& joint : joints) width = std::max(width, shortened(joint.joint).size() + 1);
  return width;
}

Colour colour_of(Verdict verdict) {
  switch (verdict) {
    case Verdict::nothing_missing:
    case Verdict::explained:
      return Colour::green;
    case Verdict::partly_explained:
      return Colour::yellow;
    case Verdict::unexplained:
      return Colour::red;
    case Verdict::not_excited:
      break;
  }
  return Colour::none;
}

std::string joint_rows(const Terminal& on, const std::vector<JointDiagnosis>& joints) {
  const std::size_t width = name_width(joints);
  const auto row = [&](const std::string& name, const std::string& verdict, Colour colour, const std::string& gap,
                       const std::string& unit, const std::string& noise, const std::string& left) {
    return fmt::format("{:<{}}{}{:>19} {:<4}{:>8} {:>17}  ", name, width,
                       in_colour(on, colour, fmt::format("{:<17}", verdict)), gap, unit, noise, left);
  };
  const std::string head =
      row("joint", "verdict", Colour::none, "gap before -> after", "", "noise", "left unexplained");
  std::string out = head + "effects\n";
  for (const JointDiagnosis& joint : joints) {
    const std::string begin = row(shortened(joint.joint), words::verdict(joint.verdict), colour_of(joint.verdict),
                                  change(joint.gap_before, joint.gap_after), joint.unit,
                                  words::figure(joint.noise_floor), words::left(joint.left));
    const std::vector<std::string> lines = wrap(all_effects(joint), on.width - head.size());
    for (std::size_t i = 0; i < lines.size(); ++i) {
      std::string line = (i == 0 ? begin : std::string(head.size(), ' ')) + lines[i];
      line.erase(line.find_last_not_of(' ') + 1);
      out += line + "\n";
    }
  }
  return out;
}

std::string where_lines(const Terminal& on, const std::vector<JointDiagnosis>& joints) {
  std::string out;
  for (const JointDiagnosis& joint : joints) {
    if (!joint.where.sentence.empty()) out += indented(on, joint.joint, joint.where.sentence);
  }
  return out.empty() ? "" : "where the gap sits\n" + out;
}

/// What has no name, but a variable.
std::string curve_lines(const Terminal& on, const std::vector<JointDiagnosis>& joints) {
  std::string out;
  for (const JointDiagnosis& joint : joints) {
    if (joint.curve) out += indented(on, joint.joint, words::curve(*joint.curve));
  }
  return out.empty() ? "" : "no name, but a curve\n" + out;
}

/// "presliding or lugre" of each set in which one effect is there.
std::string undecided_lines(const Terminal& on, const DiagnosisResult& diagnosis) {
  std::string out;
  const auto add = [&](const std::string& whose, const std::vector<std::vector<std::string>>& sets) {
    for (const auto& set : sets) out += indented(on, whose, words::either(set) + " is there; the model has the first");
  };
  for (const JointDiagnosis& joint : diagnosis.joints) add(joint.joint, joint.undecided);
  add("robot", diagnosis.undecided);
  return out.empty() ? "" : "found, but these logs don't tell which\n" + out;
}

std::string alternative_lines(const Terminal& on, const DiagnosisResult& diagnosis) {
  std::string out;
  const auto add = [&](const std::string& whose, const std::vector<NamedEffect>& effects) {
    for (const NamedEffect& effect : effects) {
      const std::string others = words::list(effect.alternatives);
      if (!others.empty()) out += indented(on, whose + effect.effect, "could as well be " + others);
    }
  };
  for (const JointDiagnosis& joint : diagnosis.joints) add(joint.joint + " ", joint.effects);
  add("", diagnosis.robot_effects);
  return out.empty() ? "" : "what these logs can't tell apart\n" + out;
}

std::string robot_lines(const Terminal& on, const DiagnosisResult& diagnosis) {
  std::string out;
  for (const NamedEffect& effect : diagnosis.robot_effects) {
    std::string line = words::parameters(effect, "+-");
    const std::string joints = words::list(effect.joints);
    if (!joints.empty()) line += (line.empty() ? "seen on joints " : "; seen on joints ") + joints;
    line += "; closes " + words::share(effect.held_out_closure) + " of the gap";
    out += indented(on, (effect.established ? "" : "likely ") + effect.effect, line);
  }
  return out.empty() ? "" : "on the robot as a whole\n" + out;
}

std::string hidden_lines(const Terminal& on, const DiagnosisResult& diagnosis) {
  std::string out;
  for (const JointDiagnosis& joint : diagnosis.joints) {
    const std::string names = words::list(joint.not_identifiable);
    if (!names.empty()) out += indented(on, joint.joint, names);
  }
  const std::string robot = words::list(diagnosis.not_identifiable);
  if (!robot.empty()) out += indented(on, "robot", robot);
  return out.empty() ? "" : "not identifiable with this motion\n" + out;
}

/// Fixed point and closed loop, a row a joint.
std::string evidence_lines(const Terminal& on, const HeldOutEvidence& evidence) {
  if (evidence.joints.empty()) return "";
  const std::vector<PlayedJoint> played = evidence.forward ? evidence.forward->joints : std::vector<PlayedJoint>();
  const std::size_t width = name_width(evidence.joints);
  std::string out = "held-out logs: RMS of the torque's error; recorded motion simulated in closed loop\n";
  out += fmt::format("{:<{}}{:>20}{:>10} {:<4}{:>20} {:<4}{:>20}\n", "joint", width, "before -> after", "fixed", "",
                     "tracking", "", "torque added");
  for (std::size_t j = 0; j < evidence.joints.size(); ++j) {
    const HeldOutEvidence::Joint& joint = evidence.joints[j];
    out += fmt::format("{:<{}}{:>20}{:>10} {:<4}", shortened(joint.joint), width, change(joint.before, joint.after),
                       words::figure(joint.after_fixed), joint.unit);
    if (j < played.size()) {
      const PlayedJoint& moved = played[j];
      out += fmt::format("{:>20} {:<4}{:>20}", change(moved.tracking_before, moved.tracking_after), moved.position_unit,
                         change(moved.torque_before, moved.torque_after));
    }
    out.erase(out.find_last_not_of(' ') + 1);
    out += "\n";
  }
  if (!evidence.note.empty()) out += indented(on, "note", evidence.note);
  if (!evidence.fixed_point.why_not.empty()) out += indented(on, "no fixed point", evidence.fixed_point.why_not);
  if (!evidence.forward) return out;
  const std::string &after = evidence.forward->failed_after, &before = evidence.forward->failed_before;
  if (!after.empty()) out += indented(on, "the model after is no plant", after);
  if (!before.empty()) out += indented(on, "the model before is no plant", before);
  return out;
}

}  // namespace

std::string diagnosis_table(const DiagnosisResult& diagnosis, const Terminal& on) {
  std::string out =
      "\ndiagnosis: " + in_colour(on, colour_of(diagnosis.verdict), words::verdict(diagnosis.verdict)) + "\n";
  if (const std::string logs = words::figures_on(diagnosis); !logs.empty()) out += "gaps on " + logs + "\n";
  if (const std::string those = words::not_borne_out(diagnosis); !those.empty())
    out += indented(on, "the test logs disagree, the error rises", those);
  out += clamped_lines(on, diagnosis) + joint_rows(on, diagnosis.joints) + robot_lines(on, diagnosis) +
         where_lines(on, diagnosis.joints) + curve_lines(on, diagnosis.joints) + undecided_lines(on, diagnosis) +
         alternative_lines(on, diagnosis) + hidden_lines(on, diagnosis);
  if (diagnosis.evidence) out += evidence_lines(on, *diagnosis.evidence);
  for (const std::string& one : words::experiments(diagnosis.next_experiment)) out += indented(on, "next", one);
  for (const std::string& note : diagnosis.notes) out += indented(on, "note", note);
  return out;
}

}  // namespace fxdyn
