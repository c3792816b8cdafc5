#include "host_tools/report/joint_answer.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "host_tools/effects/model_parts.hpp"
#include "host_tools/report/diagnosis_words.hpp"
#include "host_tools/report/stage_figures.hpp"

namespace fxdyn {
namespace {

namespace words = diagnosis_words;

/// What the results know of one joint; null: nothing.
struct Known {
  const JointDiagnosis* diagnosis = nullptr;
  const TrainedJoint* trained = nullptr;
};

std::string capital(std::string words) {
  if (!words.empty() && words[0] >= 'a' && words[0] <= 'z') words[0] = static_cast<char>(words[0] - 'a' + 'A');
  return words;
}

std::string found_in_words(const Known& known) {
  if (known.diagnosis == nullptr) return "Not diagnosed";
  const JointDiagnosis& joint = *known.diagnosis;
  if (joint.verdict == Verdict::not_excited) return "The logs hardly move it";
  std::vector<std::string> names;
  for (const NamedEffect& effect : joint.effects) {
    const bool again = std::find(names.begin(), names.end(), effect.effect) != names.end();  // two ripples
    if (effect.established && !again) names.push_back(effect.effect);
  }
  for (const auto& set : joint.undecided) names.push_back(words::either(set) + " (these logs do not tell which)");
  std::string out = names.empty() ? "nothing" : words::list(names);
  if (names.size() > 1) out.replace(out.rfind(", "), 2, " and ");
  if (names.empty() && joint.verdict == Verdict::nothing_missing) return "Nothing is missing";
  if (names.empty()) out += " that has a name";
  out = capital(out) + " found";
  return known.trained != nullptr && known.trained->kept ? out + ", a BLS learned more" : out;
}

/// "error 2.51 -> 0.19 N*m (-92 %)"
std::string brings_in_words(const JointAnswer& answer) {
  if (!answer.left) return "";
  if (!answer.before || !(*answer.before > 0)) return fmt::format("error {:.3g} {}", *answer.left, answer.unit);
  return fmt::format("error {:.3g} → {:.3g} {} ({:+.0f} %)", *answer.before, *answer.left, answer.unit,
                     100 * (*answer.left / *answer.before - 1));
}

/// What diagnosis proposes for a joint (from 1): of "a or b at joint 3: constant speeds" what follows the colon.
std::string experiment_for(const std::string& all, std::size_t joint) {
  const std::string at = fmt::format("at joint {}: ", joint), more = fmt::format("record more of joint {}", joint);
  std::string out;
  for (const std::string& part : words::experiments(all)) {
    if (const std::size_t found = part.find(at); found != std::string::npos) return part.substr(found + at.size());
    if (part == more) out = "record more of its motion";
    if (part.starts_with(more + ", ")) out = "record more motion: " + part.substr(more.size() + 2);
  }
  return out;
}

std::string next_in_words(const JointAnswer& answer, const Known& known, const std::string& experiments) {
  if (known.diagnosis == nullptr && answer.mood != Mood::calm) return "Run fxdyn diagnose.";
  if (known.diagnosis != nullptr && known.diagnosis->verdict == Verdict::not_excited)
    return "Record motion that moves it.";
  switch (answer.mood) {
    case Mood::calm:
      return answer.noise_only ? "What is left is noise: nothing to do." : "Nothing to do.";
    case Mood::amber:
      return "The test logs disagree: train with a log like the robot's work.";
    case Mood::red: {
      const std::string& where = known.diagnosis->where.sentence;
      const std::string experiment = experiment_for(experiments, known.diagnosis->index);
      const std::string next = experiment.empty() ? "Look at its plots." : capital(experiment) + ".";
      return where.empty() ? next : capital(where) + ". " + next;
    }
    case Mood::unknown:
      break;
  }
  return "";
}

bool has_structure(const Known& known) {
  return known.diagnosis != nullptr &&
         (known.diagnosis->verdict == Verdict::unexplained || known.diagnosis->verdict == Verdict::partly_explained);
}

Mood mood_of(const JointAnswer& answer, const Known& known, double good_enough) {
  if (known.diagnosis != nullptr && known.diagnosis->verdict == Verdict::not_excited) return Mood::unknown;
  if (const auto share = answer.share(); share && *share <= good_enough) return Mood::calm;
  if (has_structure(known)) return Mood::red;
  if (answer.test_logs_disagree) return Mood::amber;
  return known.diagnosis == nullptr ? Mood::unknown : Mood::calm;
}

/// Errors with nominal friction and as exported, from metrics.json; else before and after diagnosis.
void set_errors(JointAnswer& answer, const ReportInput& input, std::size_t j, const Known& known) {
  if (known.diagnosis != nullptr) {
    answer.before = known.diagnosis->gap_before;
    answer.left = known.diagnosis->gap_after;
    answer.test_logs_disagree = !known.diagnosis->carries_over.value_or(true);
  }
  const nlohmann::json& file = input.results["metrics"];
  if (file.is_null()) return;
  const MetricsResult metrics = metrics_of(file);
  if (metrics.stages.empty()) return;
  const StageFigures figures = stage_figures(metrics, role_of(input.results.role), j);
  const auto friction = std::find_if(metrics.stages.begin(), metrics.stages.end(),
                                     [](const StageErrors& stage) { return stage.stage == "friction"; });
  const auto first = friction == metrics.stages.end() ? std::ptrdiff_t{0} : friction - metrics.stages.begin();
  answer.before = figures.shown[static_cast<std::size_t>(first)].rmse;
  answer.left = figures.shown[figures.exported].rmse;
  if (input.results.role == to_string(Role::test) && figures.another_is_better_on_shown())
    answer.test_logs_disagree = true;
}

}  // namespace

const char* css_class(Mood mood) {
  switch (mood) {
    case Mood::calm:
      return "good";
    case Mood::amber:
      return "amber";
    case Mood::red:
      return "bad";
    case Mood::unknown:
      break;
  }
  return "";
}

const char* in_words(Mood mood) {
  switch (mood) {
    case Mood::calm:
      return "good";
    case Mood::amber:
      return "test logs disagree";
    case Mood::red:
      return "structure is left";
    case Mood::unknown:
      break;
  }
  return "not known";
}

std::string experiments_for_the_robot(const std::string& all) {
  std::string out;
  for (const std::string& part : words::experiments(all)) {
    const std::size_t joint = part.find("joint ");
    const bool of_one =
        joint != std::string::npos && joint + 6 < part.size() && part[joint + 6] >= '0' && part[joint + 6] <= '9';
    if (!of_one) out += (out.empty() ? "" : "; ") + part;
  }
  return out;
}

std::optional<double> JointAnswer::share() const {
  return left && std::isfinite(*left) && rated > 0 ? std::optional(*left / rated) : std::nullopt;
}

std::vector<JointAnswer> joint_answers(const ReportInput& input) {
  const nlohmann::json &diagnosed = input.results["diagnosis"], &metrics = input.results["metrics"];
  const DiagnosisResult diagnosis = diagnosed.is_null() ? DiagnosisResult() : diagnosis_of(diagnosed);
  const auto training = metrics.is_null() ? std::nullopt : metrics_of(metrics).training;
  const std::size_t moving = robot_of(input.fitted).size();
  std::vector<JointAnswer> out(std::max(moving, diagnosis.joints.size()));
  for (std::size_t j = 0; j < out.size(); ++j) {
    JointAnswer& answer = out[j];
    Known known;
    for (const JointDiagnosis& joint : diagnosis.joints) {
      if (joint.index == j + 1) known.diagnosis = &joint;
    }
    if (training && j < training->size()) known.trained = &(*training)[j];
    if (j < moving) {
      const Joint& joint = robot_of(input.fitted).joints[j];
      answer.name = joint.name;
      answer.unit = joint.torque_unit();
      answer.rated = joints_of(input.fitted)[j].rated_torque;
    } else if (known.diagnosis != nullptr) {
      answer.name = known.diagnosis->joint;
      answer.unit = known.diagnosis->unit;
    }
    if (j < moving || metrics.is_null()) set_errors(answer, input, j, known);
    answer.mood = mood_of(answer, known, input.settings.good_enough);
    answer.noise_only = known.diagnosis != nullptr && !has_structure(known);
    const bool noisy = answer.mood == Mood::calm && answer.share().value_or(0) > input.settings.good_enough;
    answer.word = noisy ? "noise is left" : in_words(answer.mood);
    answer.found = found_in_words(known);
    answer.brings = brings_in_words(answer);
    answer.next = next_in_words(answer, known, diagnosis.next_experiment);
  }
  return out;
}

bool is_good_enough(const ReportInput& input, std::size_t joint, double rmse) {
  if (joint >= robot_of(input.fitted).size()) return false;
  const double rated = joints_of(input.fitted)[joint].rated_torque;
  return rated > 0 && rmse <= input.settings.good_enough * rated;
}

}  // namespace fxdyn
