#include <fmt/format.h>

#include <algorithm>

#include "host_tools/effects/model_parts.hpp"
#include "host_tools/page/page.hpp"
#include "host_tools/page/plot.hpp"
#include "host_tools/report/diagnosis_words.hpp"
#include "host_tools/report/drive_line.hpp"
#include "host_tools/report/joint_answer.hpp"
#include "host_tools/report/robot_sketch.hpp"
#include "host_tools/report/section.hpp"
#include "host_tools/report/shown_log.hpp"

namespace fxdyn {

using namespace page;
using nlohmann::json;

namespace {

/// "0.20 %"; a share of rated torque.
std::string of_rated(double share) { return fmt::format("{:.2g} % of rated", 100 * share); }

/// "All 6 joints are good: at most 0.2 % of rated torque is left."
std::string headline(const std::vector<JointAnswer>& answers, double good_enough) {
  const auto count = [&](Mood mood) {
    return std::count_if(answers.begin(), answers.end(),
                         [&](const JointAnswer& answer) { return answer.mood == mood; });
  };
  double most = 0;
  for (const JointAnswer& answer : answers) most = std::max(most, answer.share().value_or(0));
  const std::size_t all = answers.size();
  if (count(Mood::calm) == static_cast<std::ptrdiff_t>(all)) {
    return fmt::format("{} good: at most {} torque is left",
                       all == 1 ? "The joint is" : fmt::format("All {} joints are", all), of_rated(most));
  }
  if (all == 1) return fmt::format("The joint: {}", in_words(answers.front().mood));
  std::string out = fmt::format("{} of {} joints are good (up to {:.3g} % of rated torque left, or noise alone)",
                                count(Mood::calm), all, 100 * good_enough);
  for (const Mood mood : {Mood::red, Mood::amber, Mood::unknown}) {
    if (count(mood) > 0) out += fmt::format("; {}: {}", in_words(mood), count(mood));
  }
  return out;
}

/// Punctuated pieces of a joint's line that are there.
std::string sentence(const JointAnswer& answer) {
  std::string out = answer.found;
  if (!answer.brings.empty()) out += ": " + answer.brings;
  out += ". ";
  if (const auto share = answer.share()) out += fmt::format("Left: {}. ", of_rated(*share));
  return out + answer.next;
}

std::string joint_list(const std::vector<JointAnswer>& answers) {
  std::string out = "<ol class=\"joints\">\n";
  for (std::size_t j = 0; j < answers.size(); ++j) {
    const JointAnswer& answer = answers[j];
    const char* kind = answer.mood == Mood::unknown ? "unknown" : css_class(answer.mood);
    out += fmt::format(
        "<li id=\"joint-{0}\"><span class=\"mark {1}\" aria-hidden=\"true\">{0}</span><span><strong>{2}</strong> "
        "<span class=\"word {1}\">{3}</span><br>{4}</span></li>\n",
        j + 1, kind, escape(answer.name), answer.word, escape(sentence(answer)));
  }
  return out + "</ol>\n";
}

std::string robot_effects(const json& diagnosed) {
  if (diagnosed.is_null()) return "";
  std::string out;
  for (const NamedEffect& effect : diagnosis_of(diagnosed).robot_effects)
    out += (out.empty() ? "" : "; ") + diagnosis_words::effect(effect, " ± ");
  return out.empty() ? "" : "<p><strong>On the robot as a whole:</strong> " + escape(out) + ".</p>\n";
}

/// The torque of a robot's only joint in the log that leaves most of it; empty: no log has torque.
std::string torque_of_one(const ReportInput& input) {
  const std::vector<ShownLog>& logs = shown_logs(input);
  if (logs.empty()) return "";
  const auto left = [](const ShownLog& log) { return log.residual.squaredNorm() / static_cast<double>(log.t.size()); };
  const ShownLog& worst = *std::max_element(logs.begin(), logs.end(),
                                            [&](const ShownLog& a, const ShownLog& b) { return left(a) < left(b); });
  const Joint& joint = robot_of(input.fitted).joints.front();
  const TorquePlot plot{worst.t, worst.measured.col(0), worst.predicted.col(0), joint.torque_unit()};
  const std::string which = logs.size() > 1 ? ", of its logs the one that leaves most" : "";
  return figure(draw(std::vector<TorquePlot>{plot}).front(),
                fmt::format("Torque of {} in {}{}", joint.name, worst.log->name, which));
}

}  // namespace

std::string overview_section(const ReportInput& input, const json&) {
  const std::vector<JointAnswer> answers = joint_answers(input);
  const json& diagnosed = input.results["diagnosis"];
  std::string out = "<h2 class=\"first\">" + escape(headline(answers, input.settings.good_enough)) + "</h2>\n";
  if (input.results.role != to_string(Role::test))
    out += paragraph("There is no test log: these figures are on the " + input.results.role +
                     " logs, which decided something, and so optimistic.");
  std::string lines = "<div class=\"answers\">\n" + joint_list(answers) + robot_effects(diagnosed);
  const std::string next =
      diagnosed.is_null() ? "" : experiments_for_the_robot(diagnosis_of(diagnosed).next_experiment);
  if (!next.empty()) lines += "<p><strong>To learn more:</strong> " + escape(next) + ".</p>\n";
  lines += "<p id=\"drive\"><strong>The drive:</strong> " + escape(drive_line(input.results)) + ".</p>\n</div>";
  // The sketch of one joint is a dot.
  if (answers.size() == 1) return out + "<div class=\"overview one\">\n" + lines + torque_of_one(input) + "</div>\n";
  return out + "<div class=\"overview\">\n<figure>" + robot_sketch(robot_of(input.fitted), answers) + "</figure>\n" +
         lines + "</div>\n";
}

}  // namespace fxdyn
