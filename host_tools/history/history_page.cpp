// history.html: what changes comes first, with a picture; then every other quantity.

#include <fmt/format.h>

#include <algorithm>

#include "host_tools/history/history.hpp"
#include "host_tools/page/page.hpp"
#include "host_tools/page/plot.hpp"
#include "model/version.hpp"

namespace fxdyn::history {
namespace {

using namespace page;
using Eigen::VectorXd;

constexpr const char *measured_colour = "#1f5fa8", *course_colour = "#c8553d", *limit_colour = "#8a8a8a";

/// Where a session stands on the picture's axis: days since the first one, or its number.
double place_of(const History& history, double at) {
  return history.has_days ? at - *history.sessions.front().day : at;
}

/// The values as crosses: a bar of one standard deviation each way, as long as the scatter where none is known.
void add_values(Chart& chart, const History& history, const Series& series) {
  const auto n = static_cast<Eigen::Index>(series.values.size());
  const double width = 0.008 * (series.values.back().at - series.values.front().at);
  constexpr double gap = std::numeric_limits<double>::quiet_NaN();
  VectorXd x(8 * n), y(8 * n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const Measured& m = series.values[static_cast<std::size_t>(i)];
    const double at = place_of(history, m.at);
    x.segment(8 * i, 8) << at, at, at, at - width, at + width, at + width, at, at;
    y.segment(8 * i, 8) << m.value - m.std, m.value + m.std, gap, m.value, m.value, gap, gap, gap;
  }
  chart.curves.push_back({x, y, measured_colour, 2, "sessions", true});
}

void add_course(Chart& chart, const History& history, const Series& series) {
  const Course& course = *series.course;
  const double first = series.values.front().at, last = series.values.back().at;
  if (course.change == Change::step) {
    const double there = 0.5 * (series.values[course.step.index - 1].at + series.values[course.step.index].at);
    VectorXd x(4), y(4);
    x << place_of(history, first), place_of(history, there), place_of(history, there), place_of(history, last);
    y << course.step.before, course.step.before, course.step.after, course.step.after;
    chart.curves.push_back({x, y, course_colour, 1.5, "step", true});
    return;
  }
  const double end = series.reached ? std::min(series.reached->at, last + (last - first)) : last;
  VectorXd x(2), y(2);
  x << place_of(history, first), place_of(history, end);
  y << course.line.at(first), course.line.at(end);
  chart.curves.push_back({x, y, course_colour, 1.5, "trend", true});
}

Chart chart_of(const History& history, const Series& series) {
  Chart chart;
  chart.x_label = history.has_days ? "days since " + date_of(*history.sessions.front().day) : "session";
  chart.y_label = fmt::format("{} [{}]", series.quantity.label(), series.quantity.unit);
  add_values(chart, history, series);
  if (series.course && series.changes) add_course(chart, history, series);
  if (series.limit) {
    VectorXd x(2), y(2);
    x << place_of(history, series.values.front().at), place_of(history, series.values.back().at);
    y << *series.limit, *series.limit;
    chart.curves.push_back({x, y, limit_colour, 1, "limit", true});
  }
  return chart;
}

std::string changing(const History& history) {
  std::vector<Chart> charts;
  std::string list;
  for (const Series& series : history.series) {
    if (!series.changes) continue;
    list += "<li>" + escape(sentence_of(history, series)) + ".</li>\n";
    charts.push_back(chart_of(history, series));
  }
  if (charts.empty()) {
    const bool judged =
        std::any_of(history.series.begin(), history.series.end(), [](const Series& s) { return s.course.has_value(); });
    return paragraph(judged ? "No quantity changes by more than it does from session to session."
                            : fmt::format("There are {} sessions. What drifts can be told from {} on.",
                                          history.sessions.size(), CourseOptions{}.fewest));
  }
  return "<ul>\n" + list + "</ul>\n" +
         figure(draw(charts, 2),
                "What changes: the value of every session with its standard deviation, the trend or "
                "step, and the limit where there is one.");
}

std::string events(const History& history) {
  if (history.events.empty()) return paragraph("The diagnoses of all sessions name the same effects.");
  Table table({{"session"}, {"effect"}, {"what happens"}});
  for (const Event& event : history.events)
    table.add({{history.sessions[event.session].name},
               {event.effect},
               {event.appears ? "appears" : "is gone", event.appears ? "amber" : ""}});
  return table.html();
}

/// The error of each joint, whether it changes or not: people look for it.
std::string errors(const History& history) {
  std::vector<Chart> charts;
  for (const Series& series : history.series) {
    if (series.quantity.name == error_name) charts.push_back(chart_of(history, series));
  }
  if (charts.empty()) return paragraph("No session has errors.");
  return figure(draw(charts, 2), "RMS error of every joint's torque in each session, and what is good enough.");
}

std::string others(const History& history) {
  Table table(
      {{"quantity"}, {"unit"}, {"sessions", "n"}, {"first", "n"}, {"last", "n"}, {"p that nothing changes", "n"}});
  bool any = false;
  for (const Series& series : history.series) {
    if (series.changes) continue;
    any = true;
    table.add({{series.quantity.label()},
               {series.quantity.unit},
               {fmt::format("{}", series.values.size()), "n"},
               number(series.values.front().value),
               number(series.values.back().value),
               {series.course ? fmt::format("{:.2g}", std::pow(10, series.course->log10_p)) : "-", "n"}});
  }
  return any ? table.html() : paragraph("None.");
}

std::string sessions(const History& history) {
  Table table({{"session"}, {"date"}, {"errors are of the logs"}, {"effects for sure"}});
  for (const Session& s : history.sessions) {
    std::string effects;
    for (const std::string& effect : s.effects) effects += (effects.empty() ? "" : "; ") + effect;
    table.add({{s.name}, {history.has_days ? date_of(*s.day) : "-"}, {s.judged_on}, {effects.empty() ? "-" : effects}});
  }
  return table.html();
}

}  // namespace

std::string html_of(const History& history) {
  std::string body = fmt::format("<h1>History of {}</h1>\n", escape(history.robot));
  body += fmt::format("<p class=\"quiet\">fxdyn {}, {} sessions, {} quantities</p>\n", version, history.sessions.size(),
                      history.series.size());
  body += section("What changes") + changing(history);
  body += section("Effects that come and go") + events(history);
  body += section("Errors of the joints") + errors(history);
  body += section("All other quantities") + others(history);
  body += section("Sessions") + sessions(history);
  return document("History of " + history.robot, "<main id=\"main\">\n" + body + "</main>\n");
}

}  // namespace fxdyn::history
