#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "host_tools/history/sessions.hpp"

namespace fxdyn::history {

struct Options {
  double good_enough = 0.01;  ///< share of rated torque: where a joint's error is at its limit, as [report] good_enough
  double rate = 0.05;         ///< false discoveries among all quantities that are said to change (Benjamini-Hochberg)
  /// "elbow coulomb amplitude": the limit of that quantity.
  std::vector<std::pair<std::string, double>> limits;
  CourseOptions course;
};

/// A quantity over the sessions.
struct Series {
  Quantity quantity;
  std::vector<Measured> values;       ///< of the sessions that have it, in their order
  std::vector<std::size_t> sessions;  ///< which ones, from 0
  std::optional<Course> course;       ///< none: too few sessions
  bool changes = false;               ///< among all quantities its change is a discovery
  std::optional<double> limit;
  std::optional<Reached> reached;  ///< of a trend with a limit
};

/// An effect that a session's diagnosis has for sure and the one before has not, or the other way round.
struct Event {
  std::size_t session = 0;
  std::string effect;  ///< "elbow: ripple"
  bool appears = true;
};

struct History {
  std::string robot;
  std::vector<Session> sessions;  ///< in the order of their days, or as given
  bool has_days = false;          ///< else `at` is the number of the session, from 1
  std::vector<Series> series;     ///< those that change first, the surest first
  std::vector<Event> events;
};

/// @throws InputError: fewer than two sessions, different robots, one session has a day and another none, a limit of a
/// quantity that no session has
History history_of(std::vector<Session> sessions, const Options& options = {});

nlohmann::json to_json(const History& history);
std::string html_of(const History& history);
/// One sentence: "elbow coulomb amplitude grows by 0.12 N*m in 30 days".
std::string sentence_of(const History& history, const Series& series);
/// "2026-05-01", or "session 3".
std::string moment_of(const History& history, double at);

/// Reads the folders, writes history.json and history.html into `out`; what the terminal shows.
std::string write_history(const std::vector<std::filesystem::path>& folders, const Options& options,
                          const std::filesystem::path& out);

}  // namespace fxdyn::history
