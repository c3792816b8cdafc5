#include "host_tools/report/diagnosis_table.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <vector>

#include "host_tools/report/diagnosis_words.hpp"

namespace fxdyn {
namespace {

using nlohmann::json;
namespace words = diagnosis_words;

constexpr std::size_t page_width = 100;
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
std::string indented(const std::string& title, const std::string& text) {
  constexpr std::size_t indent = 4;
  std::string out;
  for (const std::string& line : wrap(title + ": " + text, page_width - indent))
    out += (out.empty() ? "  " : std::string(indent, ' ')) + line + "\n";
  return out;
}

/// Held-out samples that the firmware clamps: its torque there is of another motion, whatever the figures below say.
std::string clamped_lines(const json& diagnosis) {
  std::string out;
  const json fixed = diagnosis.value("evidence", json::object()).value("fixed_point", json::object());
  for (const json& note : fixed.value("notes", json::array())) out += indented("clamped", note.get<std::string>());
  return out;
}

std::string shortened(const std::string& name) {
  return name.size() <= longest_name ? name : fmt::format("{}..", name.substr(0, longest_name - 2));
}

std::string all_effects(const json& joint) {
  std::string out;
  for (const json& effect : joint.value("effects", json::array()))
    out += (out.empty() ? "" : "; ") + words::effect(effect, "+-");
  return out;
}

/// "1.9 -> 0.4"
std::string change(const json& of, const char* before, const char* after) {
  return words::figure(of, before) + " -> " + words::figure(of, after);
}

std::string joint_rows(const json& joints) {
  std::size_t width = 6;
  for (std::size_t j = 0; j < joints.size(); ++j)
    width = std::max(width, shortened(words::joint(joints[j], j)).size() + 1);
  const auto row = [&](const std::string& name, const std::string& verdict, const std::string& gap,
                       const std::string& unit, const std::string& noise, const std::string& left) {
    return fmt::format("{:<{}}{:<17}{:>20} {:<4}{:>8}{:>17}  ", name, width, verdict, gap, unit, noise, left);
  };
  std::string head = row("joint", "verdict", "gap before -> after", "", "noise", "left unexplained");
  std::string out = head + "effects\n";
  for (std::size_t j = 0; j < joints.size(); ++j) {
    const json& joint = joints[j];
    const std::string begin =
        row(shortened(words::joint(joint, j)), words::verdict(joint), change(joint, "gap_before", "gap_after"),
            joint.value("unit", ""), words::figure(joint, "noise_floor"), words::left(joint));
    const std::vector<std::string> lines = wrap(all_effects(joint), page_width - head.size());
    for (std::size_t i = 0; i < lines.size(); ++i) {
      std::string line = (i == 0 ? begin : std::string(head.size(), ' ')) + lines[i];
      line.erase(line.find_last_not_of(' ') + 1);
      out += line + "\n";
    }
  }
  return out;
}

std::string where_lines(const json& joints) {
  std::string out;
  for (std::size_t j = 0; j < joints.size(); ++j) {
    const std::string sentence = words::where(joints[j]);
    if (!sentence.empty()) out += indented(words::joint(joints[j], j), sentence);
  }
  return out.empty() ? "" : "where the gap sits\n" + out;
}

/// "presliding or lugre" of each set in which one effect is there.
std::string undecided_lines(const json& diagnosis) {
  std::string out;
  const auto add = [&](const std::string& whose, const json& sets) {
    for (const json& set : sets) out += indented(whose, words::either(set) + " is there; the model has the first");
  };
  const json joints = diagnosis.value("joints", json::array());
  for (std::size_t j = 0; j < joints.size(); ++j)
    add(words::joint(joints[j], j), joints[j].value("undecided", json::array()));
  add("robot", diagnosis.value("undecided", json::array()));
  return out.empty() ? "" : "found, but these logs don't tell which\n" + out;
}

std::string alternative_lines(const json& diagnosis) {
  std::string out;
  const auto add = [&](const std::string& whose, const json& effects) {
    for (const json& effect : effects) {
      const std::string others = words::list(effect.value("alternatives", json::array()));
      if (!others.empty()) out += indented(whose + effect.value("effect", ""), "could as well be " + others);
    }
  };
  const json joints = diagnosis.value("joints", json::array());
  for (std::size_t j = 0; j < joints.size(); ++j)
    add(words::joint(joints[j], j) + " ", joints[j].value("effects", json::array()));
  add("", diagnosis.value("robot_effects", json::array()));
  return out.empty() ? "" : "what these logs can't tell apart\n" + out;
}

std::string robot_lines(const json& diagnosis) {
  std::string out;
  for (const json& effect : diagnosis.value("robot_effects", json::array())) {
    std::string line = words::parameters(effect, "+-");
    const std::string joints = words::list(effect.value("joints", json::array()));
    if (!joints.empty()) line += (line.empty() ? "seen on joints " : "; seen on joints ") + joints;
    if (effect.contains("held_out_closure"))
      line += "; closes " + words::share(effect, "held_out_closure") + " of the gap";
    out += indented((effect.value("certainty", "") == "likely" ? "likely " : "") + effect.value("effect", ""), line);
  }
  return out.empty() ? "" : "on the robot as a whole\n" + out;
}

std::string hidden_lines(const json& diagnosis) {
  const json joints = diagnosis.value("joints", json::array());
  std::string out;
  for (std::size_t j = 0; j < joints.size(); ++j) {
    const std::string names = words::list(joints[j].value("not_identifiable", json::array()));
    if (!names.empty()) out += indented(words::joint(joints[j], j), names);
  }
  const std::string robot = words::list(diagnosis.value("not_identifiable", json::array()));
  if (!robot.empty()) out += indented("robot", robot);
  return out.empty() ? "" : "not identifiable with this motion\n" + out;
}

/// Fixed point and closed loop, a row a joint.
std::string evidence_lines(const json& diagnosis) {
  const json evidence = diagnosis.value("evidence", json::object());
  const json joints = evidence.value("joints", json::array());
  if (joints.empty()) return "";
  const json forward = evidence.value("forward", json());
  const json played = forward.is_object() ? forward.value("joints", json::array()) : json::array();
  std::size_t width = 6;
  for (std::size_t j = 0; j < joints.size(); ++j)
    width = std::max(width, shortened(words::joint(joints[j], j)).size() + 1);
  std::string out = "held-out logs: RMS of the torque's error; recorded motion simulated in closed loop\n";
  out += fmt::format("{:<{}}{:>20}{:>10} {:<4}{:>20} {:<4}{:>20}\n", "joint", width, "before -> after", "fixed", "",
                     "tracking", "", "torque added");
  for (std::size_t j = 0; j < joints.size(); ++j) {
    const json& joint = joints[j];
    out += fmt::format("{:<{}}{:>20}{:>10} {:<4}", shortened(words::joint(joint, j)), width,
                       change(joint, "rms_before", "rms_after"), words::figure(joint, "rms_after_fixed"),
                       joint.value("unit", ""));
    if (j < played.size()) {
      out += fmt::format("{:>20} {:<4}{:>20}", change(played[j], "tracking_before", "tracking_after"),
                         played[j].value("tracking_unit", ""), change(played[j], "torque_before", "torque_after"));
    }
    out.erase(out.find_last_not_of(' ') + 1);
    out += "\n";
  }
  if (evidence.contains("note")) out += indented("note", evidence.value("note", ""));
  const json fixed = evidence.value("fixed_point", json::object());
  if (fixed.contains("why_not")) out += indented("no fixed point", fixed.value("why_not", ""));
  if (!played.empty()) {
    const json failed = forward.value("failed", json::object());
    for (const auto& [which, why] : failed.items())
      out += indented("the model " + which + " is no plant", why.is_string() ? why.get<std::string>() : "");
  }
  return out;
}

}  // namespace

std::string diagnosis_table(const json& diagnosis) {
  const json joints = diagnosis.value("joints", json::array());
  std::string out = "\ndiagnosis: " + words::verdict(diagnosis) + "\n";
  if (const std::string on = words::figures_on(diagnosis); !on.empty()) out += "gaps on " + on + "\n";
  if (const std::string those = words::not_borne_out(diagnosis); !those.empty())
    out += indented("the test logs disagree, the error rises", those);
  out += clamped_lines(diagnosis) + joint_rows(joints) + robot_lines(diagnosis) + where_lines(joints) +
         undecided_lines(diagnosis) + alternative_lines(diagnosis) + hidden_lines(diagnosis) +
         evidence_lines(diagnosis);
  if (const std::string next = words::next_experiment(diagnosis); !next.empty()) out += indented("next", next);
  for (const json& note : diagnosis.value("notes", json::array())) {
    if (note.is_string()) out += indented("note", note.get<std::string>());
  }
  return out;
}

}  // namespace fxdyn
