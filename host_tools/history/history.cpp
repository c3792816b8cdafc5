#include "host_tools/history/history.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <set>

#include "host_tools/fleet/summary.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/files.hpp"
#include "host_tools/support/nearest.hpp"
#include "model/version.hpp"

namespace fxdyn::history {
namespace {

using nlohmann::json;

void check_same_robot(const std::vector<Session>& sessions) {
  for (const Session& session : sessions) {
    if (session.robot != sessions.front().robot || session.joints != sessions.front().joints)
      throw InputError(fmt::format("{} is of robot '{}' with {} joints, {} of '{}' with {}: a history is of one robot",
                                   session.name, session.robot, session.joints.size(), sessions.front().name,
                                   sessions.front().robot, sessions.front().joints.size()));
  }
}

/// Sorts by day where all sessions have one.
bool sort_by_day(std::vector<Session>& sessions) {
  const auto has_day = [](const Session& s) { return s.day.has_value(); };
  const auto dated = std::count_if(sessions.begin(), sessions.end(), has_day);
  if (dated == 0) return false;
  if (dated < static_cast<std::ptrdiff_t>(sessions.size())) {
    const auto without = std::find_if_not(sessions.begin(), sessions.end(), has_day);
    throw InputError(
        fmt::format("{}: nothing tells its day, as it does of others: give the folder a name with the date, "
                    "as in session_2026-05-01",
                    without->name));
  }
  std::stable_sort(sessions.begin(), sessions.end(),
                   [](const Session& a, const Session& b) { return *a.day < *b.day; });
  return true;
}

std::vector<Series> series_of(const std::vector<Session>& sessions, bool has_days) {
  std::set<Quantity> quantities;
  for (const Session& session : sessions) {
    for (const auto& [quantity, value] : session.values) quantities.insert(quantity);
  }
  std::vector<Series> out;
  for (const Quantity& quantity : quantities) {
    Series series;
    series.quantity = quantity;
    for (std::size_t i = 0; i < sessions.size(); ++i) {
      const auto found = sessions[i].values.find(quantity);
      if (found == sessions[i].values.end()) continue;
      Measured value = found->second;
      value.at = has_days ? *sessions[i].day : static_cast<double>(i + 1);
      series.values.push_back(value);
      series.sessions.push_back(i);
    }
    out.push_back(std::move(series));
  }
  return out;
}

void set_limits(std::vector<Series>& all, const std::vector<Session>& sessions, const Options& options) {
  std::vector<std::string> names;
  for (Series& series : all) {
    names.push_back(series.quantity.label());
    if (series.quantity.name == error_name) {
      const double good = sessions.back().good_error.at(series.quantity.joint);
      if (good > 0) series.limit = good;
    }
  }
  for (const auto& [name, limit] : options.limits) {
    const auto found = std::find(names.begin(), names.end(), name);
    if (found == names.end())
      throw InputError(fmt::format("--limit {}: no session has it; nearest is '{}'", name, nearest(name, names)));
    all[static_cast<std::size_t>(found - names.begin())].limit = limit;
  }
}

void judge(std::vector<Series>& all, const Options& options) {
  std::vector<double> p;
  for (Series& series : all) {
    series.course = course_of(series.values, options.course);
    if (series.course) p.push_back(series.course->log10_p);
  }
  const fleet::FalseDiscovery found = fleet::benjamini_hochberg(p, options.rate);
  for (Series& series : all) {
    if (!series.course) continue;
    series.changes = found.discoveries > 0 && series.course->log10_p <= found.log10_threshold;
    if (series.changes && series.limit && series.course->change == Change::trend)
      series.reached = when_reached(series.course->line, *series.limit, series.values.back().at);
  }
  std::stable_sort(all.begin(), all.end(), [](const Series& a, const Series& b) {
    const auto order = [](const Series& s) { return std::pair(!s.changes, s.course ? s.course->log10_p : 0.0); };
    return order(a) < order(b);
  });
}

std::vector<Event> events_of(const std::vector<Session>& sessions) {
  std::vector<Event> out;
  for (std::size_t i = 1; i < sessions.size(); ++i) {
    const auto& before = sessions[i - 1].effects;
    const auto& now = sessions[i].effects;
    const auto add_missing = [&](const auto& from, const auto& in, bool appears) {
      for (const std::string& effect : from) {
        if (std::find(in.begin(), in.end(), effect) == in.end()) out.push_back({i, effect, appears});
      }
    };
    add_missing(now, before, true);
    add_missing(before, now, false);
  }
  return out;
}

json course_json(const Course& course) {
  if (course.change == Change::none) return {{"kind", "none"}};
  if (course.change == Change::step)
    return {{"kind", "step"},
            {"before", course.step.before},
            {"after", course.step.after},
            {"std", course.step.std},
            {"log10_p", course.log10_p}};
  return {{"kind", "trend"}, {"slope", course.line.slope}, {"std", course.line.slope_std}, {"log10_p", course.log10_p}};
}

json optional_json(const std::optional<double>& value) { return value ? json(*value) : json(); }

json to_json(const History& history, const Series& series) {
  json values = json::array();
  for (std::size_t i = 0; i < series.values.size(); ++i) {
    const Measured& m = series.values[i];
    values.push_back({{"session", history.sessions[series.sessions[i]].name},
                      {"at", m.at},
                      {"value", m.value},
                      {"std", m.std > 0 ? json(m.std) : json()}});
  }
  json out{{"joint", series.quantity.joint},
           {"quantity", series.quantity.name},
           {"unit", series.quantity.unit},
           {"changes", series.changes},
           {"values", values},
           {"limit", optional_json(series.limit)},
           {"course", series.course ? course_json(*series.course) : json()}};
  if (series.course && series.course->change == Change::step)
    out["course"]["session"] = history.sessions[series.sessions[series.course->step.index]].name;
  if (series.changes) out["sentence"] = sentence_of(history, series);
  if (series.reached)
    out["limit_reached"] = {{"at", series.reached->at},
                            {"earliest", optional_json(series.reached->earliest)},
                            {"latest", optional_json(series.reached->latest)}};
  return out;
}

}  // namespace

std::string moment_of(const History& history, double at) {
  return history.has_days ? date_of(at) : fmt::format("session {:.0f}", std::ceil(at));
}

std::string sentence_of(const History& history, const Series& series) {
  const Course& course = *series.course;
  const std::string unit = series.quantity.unit == "-" ? "" : " " + series.quantity.unit;
  if (course.change == Change::step) {
    const Session& there = history.sessions[series.sessions[course.step.index]];
    return fmt::format("{} steps from {:.3g} to {:.3g}{} with {}", series.quantity.label(), course.step.before,
                       course.step.after, unit, there.day && history.has_days ? date_of(*there.day) : there.name);
  }
  const double span = series.values.back().at - series.values.front().at;
  std::string out =
      fmt::format("{} {} by {:.3g}{} in {:.0f} {}", series.quantity.label(), course.line.slope > 0 ? "grows" : "falls",
                  std::fabs(course.line.slope) * span, unit, span, history.has_days ? "days" : "sessions");
  if (series.reached) {
    out += fmt::format("; it reaches {:.3g}{} about {}", *series.limit, unit, moment_of(history, series.reached->at));
    if (series.reached->earliest)
      out += fmt::format(" ({} to {} with 95 %)", moment_of(history, *series.reached->earliest),
                         series.reached->latest ? moment_of(history, *series.reached->latest) : "never");
  }
  return out;
}

History history_of(std::vector<Session> sessions, const Options& options) {
  if (sessions.size() < 2) throw InputError("history: name two result folders or more, each of one session");
  check_same_robot(sessions);
  History history;
  history.robot = sessions.front().robot;
  history.has_days = sort_by_day(sessions);
  history.series = series_of(sessions, history.has_days);
  set_limits(history.series, sessions, options);
  judge(history.series, options);
  history.events = events_of(sessions);
  history.sessions = std::move(sessions);
  return history;
}

json to_json(const History& history) {
  json sessions = json::array(), series = json::array(), events = json::array();
  for (const Session& s : history.sessions)
    sessions.push_back({{"name", s.name},
                        {"date", history.has_days ? json(date_of(*s.day)) : json()},
                        {"judged_on", s.judged_on},
                        {"effects", s.effects}});
  for (const Series& s : history.series) series.push_back(to_json(history, s));
  for (const Event& e : history.events)
    events.push_back({{"session", history.sessions[e.session].name}, {"effect", e.effect}, {"appears", e.appears}});
  return {{"schema", "fxdyn.history/1"}, {"tool_version", version}, {"robot", history.robot},
          {"sessions", sessions},        {"series", series},        {"events", events}};
}

std::string write_history(const std::vector<std::filesystem::path>& folders, const Options& options,
                          const std::filesystem::path& out) {
  check_writable(out);
  std::vector<Session> sessions;
  for (const auto& folder : folders) sessions.push_back(read_session(folder, options.good_enough));
  const History history = history_of(std::move(sessions), options);
  write_file(out / "history.html", html_of(history));
  write_file(out / "history.json", to_json(history).dump(1) + "\n");
  std::string said = fmt::format(
      "{}: {} sessions{}: {}/history.html, history.json\n", history.robot, history.sessions.size(),
      history.has_days
          ? fmt::format(", {} to {}", date_of(*history.sessions.front().day), date_of(*history.sessions.back().day))
          : "",
      out.string());
  bool any = false;
  for (const Series& series : history.series) {
    if (series.changes) said += "  " + sentence_of(history, series) + "\n", any = true;
  }
  for (const Event& event : history.events)
    said += fmt::format("  {} {} with {}\n", event.effect, event.appears ? "appears" : "is gone",
                        history.sessions[event.session].name);
  if (history.sessions.size() < options.course.fewest)
    said += fmt::format("  what drifts can be told from {} sessions on\n", options.course.fewest);
  else if (!any)
    said += "  no quantity changes by more than it does from session to session\n";
  return said;
}

}  // namespace fxdyn::history
