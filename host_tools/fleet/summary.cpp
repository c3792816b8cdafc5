#include "host_tools/fleet/summary.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <tuple>

#include "host_tools/fleet/acceptance.hpp"
#include "host_tools/fleet/robot_folder.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/files.hpp"
#include "model/version.hpp"

namespace fxdyn::fleet {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

bool has(const std::vector<FoundEffect>& effects, const std::string& name) {
  return std::any_of(effects.begin(), effects.end(), [&](const FoundEffect& e) { return e.effect == name; });
}

std::vector<NamedParameter> parameters_of(const std::vector<FoundEffect>* effects, const std::string& name) {
  if (effects == nullptr) return {};
  for (const FoundEffect& found : *effects) {
    if (found.effect == name) return found.parameters;
  }
  return {};
}

json to_json(const NamedParameter& p, const std::vector<NamedParameter>& before) {
  json out{{"name", p.name}, {"unit", p.unit}, {"value", p.value}, {"std", p.std ? json(*p.std) : json()}};
  out["accepted"] = nullptr;
  for (const NamedParameter& then : before) {
    if (then.name == p.name) out["accepted"] = then.value;
  }
  return out;
}

bool has_a_gap(Verdict verdict) { return verdict == Verdict::unexplained || verdict == Verdict::partly_explained; }

/// @returns a complaint: the accepted state has other joints; it is another robot's
std::string complaint_of_accepted(const RobotSummary& robot) {
  const auto& now = robot.state->joints;
  const auto& then = robot.accepted->state.joints;
  const bool same = std::equal(now.begin(), now.end(), then.begin(), then.end(),
                               [](const auto& a, const auto& b) { return a.joint == b.joint && a.unit == b.unit; });
  if (same && robot.state->robot == robot.accepted->state.robot) return "";
  return fmt::format(
      "accepted/{0}.json: is the baseline of another robot ('{1}', {2} joints; today '{3}', {4}): remove it, or run "
      "`fxdyn fleet .. --accept {0}`",
      robot.id, robot.accepted->state.robot, then.size(), robot.state->robot, now.size());
}

void add_findings(RobotSummary& robot, std::size_t joint, const std::string& where,
                  const std::vector<FoundEffect>& today, const std::vector<FoundEffect>* then) {
  for (const FoundEffect& found : today) {
    const bool is_new = then != nullptr ? !has(*then, found.effect) : robot.reference == "baseline";
    robot.findings.push_back({joint, where, found, is_new, false, parameters_of(then, found.effect)});
    robot.strongest_odds = std::max(robot.strongest_odds, found.odds);
  }
  if (then == nullptr) return;
  for (const FoundEffect& before : *then) {
    if (!has(today, before.effect)) robot.gone.push_back(where + ": " + before.effect);
  }
}

void compare(RobotSummary& robot) {
  const RobotState& now = *robot.state;
  const RobotState* then = robot.accepted ? &robot.accepted->state : nullptr;
  robot.reference = then != nullptr ? "accepted" : now.baseline ? "baseline" : "none";
  for (std::size_t j = 0; j < now.joints.size(); ++j) {
    const JointState& joint = now.joints[j];
    if (joint.error) robot.worst_error = std::max(robot.worst_error.value_or(0), *joint.error);
    const JointState* before = then != nullptr ? &then->joints[j] : nullptr;
    add_findings(robot, j + 1, joint.joint, joint.effects, before != nullptr ? &before->effects : nullptr);
    const bool had_gap = before != nullptr ? before->verdict && has_a_gap(*before->verdict) : !now.baseline;
    if (joint.verdict && has_a_gap(*joint.verdict) && !had_gap)
      robot.unnamed.push_back({j + 1, joint.joint, *joint.verdict, false});
  }
  add_findings(robot, 0, "robot", now.on_robot, then != nullptr ? &then->on_robot : nullptr);
}

/// log10 of p that nothing is there: of the strongest effect, or of the lack of fit, whichever is smaller, times two
/// for having had the choice.
double log10_p(const std::vector<FoundEffect>& effects, const std::optional<double>& lack_log10_p) {
  double lowest = lack_log10_p.value_or(0);
  for (const FoundEffect& found : effects) lowest = std::min(lowest, -found.odds);
  return std::min(0.0, lowest + std::log10(2.0));
}

/// What is new at a joint (0: on the robot as a whole), as if nothing else had been found there.
double log10_p_of_new(const RobotSummary& robot, std::size_t joint) {
  std::vector<FoundEffect> fresh;
  for (const Finding& finding : robot.findings) {
    if (finding.joint == joint && finding.is_new) fresh.push_back(finding.found);
  }
  const bool gap = std::any_of(robot.unnamed.begin(), robot.unnamed.end(),
                               [&](const Unnamed& unnamed) { return unnamed.joint == joint; });
  return log10_p(fresh, gap ? robot.state->joints[joint - 1].lack_log10_p : std::nullopt);
}

/// Two families of tests: what is there, and what is new. What was there all along is certain on most robots, and would
/// make room for false news among its own kind.
void judge(Summary& summary, double rate) {
  std::vector<double> all, fresh;
  for (const RobotSummary& robot : summary.robots) {
    if (!robot.state || !robot.state->verdict) continue;
    for (const JointState& joint : robot.state->joints) all.push_back(log10_p(joint.effects, joint.lack_log10_p));
    all.push_back(log10_p(robot.state->on_robot, {}));
    for (std::size_t joint = 0; joint <= robot.state->joints.size(); ++joint)
      fresh.push_back(log10_p_of_new(robot, joint));
  }
  summary.false_discovery = benjamini_hochberg(all, rate);
  summary.false_discovery_of_new = benjamini_hochberg(fresh, rate);
  const auto passes = [](const FalseDiscovery& limit, double p) {
    return limit.discoveries > 0 && p <= limit.log10_threshold;
  };
  for (RobotSummary& robot : summary.robots) {
    for (Finding& finding : robot.findings) {
      finding.discovered = passes(finding.is_new ? summary.false_discovery_of_new : summary.false_discovery,
                                  log10_p({finding.found}, {}));
      // Of a likely effect the name is in doubt, not that something is there.
      robot.drifts = robot.drifts || (finding.is_new && finding.discovered);
    }
    for (Unnamed& gap : robot.unnamed) {
      gap.discovered =
          passes(summary.false_discovery_of_new, log10_p({}, robot.state->joints[gap.joint - 1].lack_log10_p));
      robot.drifts = robot.drifts || gap.discovered;
    }
  }
}

/// What a reader has to see first: what failed, what drifts, then the worst verdicts.
auto order_of(const RobotSummary& robot) {
  constexpr int unexplained = 4;
  int verdict = 0;
  if (robot.state && robot.state->verdict) {
    switch (*robot.state->verdict) {
      case Verdict::unexplained:
        verdict = unexplained;
        break;
      case Verdict::partly_explained:
        verdict = unexplained - 1;
        break;
      case Verdict::explained:
        verdict = 2;
        break;
      case Verdict::not_excited:
        verdict = 1;
        break;
      case Verdict::nothing_missing:
        break;
    }
  }
  return std::make_tuple(robot.complaint.empty(), !robot.drifts, -verdict, -robot.strongest_odds,
                         -robot.worst_error.value_or(0), robot.id);
}

std::vector<Cluster> clusters_of(const std::vector<RobotSummary>& robots) {
  std::map<std::tuple<std::string, std::string, std::string>, std::vector<std::string>> found;
  for (const RobotSummary& robot : robots) {
    for (const Finding& f : robot.findings) {
      if (f.discovered) found[{robot.state->robot, f.where, f.found.effect}].push_back(robot.id);
    }
  }
  std::vector<Cluster> out;
  for (auto& [key, ids] : found) {
    if (ids.size() < 2) continue;
    std::sort(ids.begin(), ids.end());
    out.push_back({std::get<0>(key), std::get<1>(key), std::get<2>(key), std::move(ids)});
  }
  std::stable_sort(out.begin(), out.end(), [](const auto& a, const auto& b) { return a.ids.size() > b.ids.size(); });
  return out;
}

json to_json(const RobotSummary& robot) {
  json findings = json::array(), unnamed = json::array();
  const auto joint_of = [](std::size_t joint) { return joint == 0 ? json() : json(joint); };
  for (const Finding& f : robot.findings) {
    json parameters = json::array();
    for (const NamedParameter& p : f.found.parameters) parameters.push_back(to_json(p, f.before));
    findings.push_back({{"joint", f.where},
                        {"index", joint_of(f.joint)},
                        {"effect", f.found.effect},
                        {"certainty", f.found.established ? "established" : "likely"},
                        {"log10_odds_nothing", f.found.odds},
                        {"parameters", parameters},
                        {"new", f.is_new},
                        {"discovered", f.discovered}});
  }
  for (const Unnamed& gap : robot.unnamed)
    unnamed.push_back({{"joint", gap.where},
                       {"index", gap.joint},
                       {"verdict", to_string(gap.verdict)},
                       {"discovered", gap.discovered}});
  json out{{"id", robot.id},
           {"project", robot.project},
           {"error", robot.complaint.empty() ? json() : json(robot.complaint)},
           {"drifts", robot.drifts},
           {"reference", robot.reference},
           {"findings", findings},
           {"new_without_name", unnamed},
           {"gone", robot.gone}};
  out["verdict"] = robot.state && robot.state->verdict ? json(to_string(*robot.state->verdict)) : json();
  out["robot"] = robot.state ? json(robot.state->robot) : json();
  out["worst_relative_error"] = robot.worst_error ? json(*robot.worst_error) : json();
  out["accepted"] = robot.accepted ? json{{"by", robot.accepted->by}, {"at", robot.accepted->at}} : json();
  out["files"] = out["notes"] = json::array();
  if (robot.state) {
    out["notes"] = robot.state->notes;
    for (const std::string& file : robot.state->files)
      out["files"].push_back(fmt::format("robots/{}/{}", robot.id, file));
  }
  return out;
}

}  // namespace

FalseDiscovery benjamini_hochberg(std::vector<double> log10_p, double rate) {
  std::sort(log10_p.begin(), log10_p.end());
  FalseDiscovery out{rate, log10_p.size(), 0, 0};
  const auto m = static_cast<double>(log10_p.size());
  for (std::size_t k = 1; k <= log10_p.size(); ++k) {
    const double limit = std::log10(rate * static_cast<double>(k) / m);
    if (log10_p[k - 1] > limit) continue;
    out.discoveries = k;
    out.log10_threshold = limit;
  }
  return out;
}

Summary summarise(const Fleet& fleet, const fs::path& directory) {
  Summary summary;
  summary.verb = fleet.verb;
  for (const Member& member : fleet.members) {
    RobotSummary robot;
    robot.id = member.id;
    robot.project = fs::relative(member.project, fleet.file.parent_path()).generic_string();
    const RobotFolder folder(directory, member.id);
    robot.complaint = folder.complaint();
    try {
      robot.state = folder.result();
      robot.accepted = acceptance_of(directory, member.id);
    } catch (const InputError& error) {
      robot.complaint = error.what();
    }
    if (!robot.state && robot.complaint.empty()) robot.complaint = "no result yet: start the fleet again";
    if (robot.state && robot.accepted && robot.complaint.empty()) robot.complaint = complaint_of_accepted(robot);
    // One robot's broken file costs nobody else.
    if (!robot.complaint.empty()) robot.state.reset();
    if (robot.state) compare(robot);
    summary.robots.push_back(std::move(robot));
  }
  judge(summary, fleet.false_discovery_rate);
  std::sort(summary.robots.begin(), summary.robots.end(),
            [](const RobotSummary& a, const RobotSummary& b) { return order_of(a) < order_of(b); });
  summary.clusters = clusters_of(summary.robots);
  return summary;
}

json to_json(const Summary& summary) {
  json robots = json::array(), clusters = json::array();
  std::size_t failed = 0, drifting = 0;
  for (const RobotSummary& robot : summary.robots) {
    robots.push_back(to_json(robot));
    failed += robot.complaint.empty() ? 0 : 1;
    drifting += robot.drifts ? 1 : 0;
  }
  for (const Cluster& c : summary.clusters)
    clusters.push_back({{"robot", c.robot}, {"joint", c.where}, {"effect", c.effect}, {"ids", c.ids}});
  const auto family = [](const FalseDiscovery& f) {
    return json{{"method", "Benjamini-Hochberg"},
                {"rate", f.rate},
                {"hypotheses", f.hypotheses},
                {"discoveries", f.discoveries},
                {"log10_p_threshold", f.discoveries > 0 ? json(f.log10_threshold) : json()}};
  };
  return {{"schema", "fxdyn.fleet/1"},
          {"tool_version", version},
          {"verb", summary.verb},
          {"count", summary.robots.size()},
          {"failed", failed},
          {"drifting", drifting},
          {"false_discovery", family(summary.false_discovery)},
          {"false_discovery_of_new", family(summary.false_discovery_of_new)},
          {"robots", robots},
          {"clusters", clusters}};
}

std::string write_summary(const Summary& summary, const fs::path& directory) {
  const json content = to_json(summary);
  write_file(directory / "fleet.html", html_of(summary));
  write_file(directory / "fleet.json", content.dump(1) + "\n");
  std::string out = fmt::format("{} robots, {} failed, {} drift: {}/fleet.html, fleet.json\n", summary.robots.size(),
                                content.at("failed").get<std::size_t>(), content.at("drifting").get<std::size_t>(),
                                directory.string());
  constexpr std::size_t shown = 20;  // lines of a terminal; the page has all
  std::size_t lines = 0;
  for (const RobotSummary& robot : summary.robots) {
    if (robot.complaint.empty() && !robot.drifts) continue;
    if (++lines > shown) return out + "..\n";
    std::vector<std::string> words;
    for (const Finding& f : robot.findings) {
      if (f.is_new && f.discovered) words.push_back(f.where + ": " + f.found.effect);
    }
    for (const Unnamed& gap : robot.unnamed) {
      if (gap.discovered) words.push_back(fmt::format("{}: {}", gap.where, to_string(gap.verdict)));
    }
    out += robot.complaint.empty() ? fmt::format("  {} drifts: {}\n", robot.id, fmt::join(words, ", "))
                                   : fmt::format("  {} failed: {}\n", robot.id, robot.complaint);
  }
  return out;
}

}  // namespace fxdyn::fleet
