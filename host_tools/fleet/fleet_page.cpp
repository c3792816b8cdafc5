// fleet.html: what is worst comes first.

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "host_tools/fleet/summary.hpp"
#include "host_tools/page/page.hpp"
#include "model/version.hpp"

namespace fxdyn::fleet {
namespace {

using namespace page;

std::string words_of(std::string_view name) {
  std::string out(name);
  std::replace(out.begin(), out.end(), '_', ' ');
  return out;
}

std::string link_to(const RobotSummary& robot) {
  return robot.state && !robot.state->files.empty() ? fmt::format("robots/{}/{}", robot.id, robot.state->files.front())
                                                    : "";
}

/// Beside each what it was in the accepted state.
std::string parameters_of(const Finding& finding) {
  std::vector<std::string> words;
  for (const NamedParameter& p : finding.found.parameters) {
    words.push_back(fmt::format("{} {:.3g}{}", p.name, p.value, p.unit == "-" ? "" : " " + p.unit));
    for (const NamedParameter& then : finding.before) {
      if (then.name == p.name) words.back() += fmt::format(", was {:.3g}", then.value);
    }
  }
  return fmt::format("{}", fmt::join(words, "; "));
}

/// Of what is new, or of the rest.
std::string findings_of(const RobotSummary& robot, bool is_new) {
  std::vector<std::string> words;
  for (const Finding& f : robot.findings) {
    if (f.is_new != is_new) continue;
    words.push_back(fmt::format("{}: {} ({}; odds 10^{:.1f}{})", f.where, words_of(f.found.effect), parameters_of(f),
                                f.found.odds,
                                f.discovered ? (f.found.established ? "" : ", likely") : ", may be chance"));
  }
  if (is_new) {
    for (const Unnamed& gap : robot.unnamed)
      words.push_back(fmt::format("{}: {}{}", gap.where, words_of(to_string(gap.verdict)),
                                  gap.discovered ? "" : ", may be chance"));
    for (const std::string& gone : robot.gone) words.push_back("gone: " + gone);
  }
  return words.empty() ? "-" : fmt::format("{}", fmt::join(words, "; "));
}

std::string failures(const Summary& summary) {
  Table table({{"robot"}, {"project"}, {"why there is no result"}});
  bool any = false;
  for (const RobotSummary& robot : summary.robots) {
    if (robot.complaint.empty()) continue;
    any = true;
    table.add({{robot.id}, {robot.project}, {robot.complaint, "bad"}});
  }
  return any ? section("Failed") + table.html() : "";
}

std::string accepted_words(const RobotSummary& robot) {
  if (robot.accepted) return fmt::format("accepted by {}, {}", robot.accepted->by, robot.accepted->at);
  return robot.reference == "baseline" ? "healthy session" : "none";
}

std::string robots_table(const Summary& summary, bool drifting) {
  Table table({{"robot"}, {"verdict"}, {"largest error", "n"}, {"new since the reference"}, {"known"}, {"reference"}});
  bool any = false;
  for (const RobotSummary& robot : summary.robots) {
    if (!robot.state || robot.drifts != drifting) continue;
    any = true;
    const std::string verdict = robot.state->verdict ? words_of(to_string(*robot.state->verdict)) : "-";
    table.add({{robot.id, "", link_to(robot)},
               {verdict, robot.drifts ? "bad" : ""},
               robot.worst_error ? percent(*robot.worst_error) : Cell{"-", "n"},
               {findings_of(robot, true), robot.drifts ? "amber" : ""},
               {findings_of(robot, false)},
               {accepted_words(robot)}});
  }
  return any ? table.html() : paragraph("None.");
}

std::string clusters(const Summary& summary) {
  if (summary.clusters.empty()) return "";
  Table table({{"robots", "n"}, {"type"}, {"joint"}, {"effect"}, {"ids"}});
  for (const Cluster& c : summary.clusters)
    table.add({{fmt::format("{}", c.ids.size()), "n"},
               {c.robot},
               {c.where},
               {words_of(c.effect)},
               {fmt::format("{}", fmt::join(c.ids, " "))}});
  return section("The same finding on several robots") + table.html();
}

/// Such as friction that changed by more than it does from session to session.
std::string notes(const Summary& summary) {
  Table table({{"robot"}, {"note"}});
  bool any = false;
  for (const RobotSummary& robot : summary.robots) {
    if (!robot.state) continue;
    for (const std::string& note : robot.state->notes) table.add({{robot.id, "", link_to(robot)}, {note}}), any = true;
  }
  return any ? section("Notes of the diagnoses") + table.html() : "";
}

std::string head(const Summary& summary) {
  std::size_t failed = 0, drifting = 0;
  for (const RobotSummary& robot : summary.robots) {
    failed += robot.complaint.empty() ? 0 : 1;
    drifting += robot.drifts ? 1 : 0;
  }
  std::string out = "<h1>Fleet</h1>\n";
  out += fmt::format("<p class=\"quiet\">fxdyn {} {}, {} robots: {} drift, {} failed</p>\n", version,
                     escape(summary.verb), summary.robots.size(), drifting, failed);
  const auto stand = [](const FalseDiscovery& f) {
    return fmt::format("{} of {}{}", f.discoveries, f.hypotheses,
                       f.discoveries > 0 ? fmt::format(", p up to 10^{:.1f}", f.log10_threshold) : "");
  };
  out += paragraph(fmt::format(
      "Every joint, and every robot as a whole, was tested at a false-discovery rate of {:g} (Benjamini-Hochberg). "
      "Something is there at {}. Something is new at {}. New is what the robot's reference did not have: the state "
      "that "
      "was accepted, else its healthy session. A robot with something new drifts.",
      summary.false_discovery.rate, stand(summary.false_discovery), stand(summary.false_discovery_of_new)));
  return out;
}

}  // namespace

std::string html_of(const Summary& summary) {
  std::string body = head(summary);
  body += failures(summary);
  body += section("Drifting") + robots_table(summary, true);
  body += clusters(summary);
  body += section("All others, worst first") + robots_table(summary, false);
  body += notes(summary);
  return document("Fleet", "<main id=\"main\">\n" + body + "</main>\n");
}

}  // namespace fxdyn::fleet
