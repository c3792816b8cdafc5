#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "host_tools/fleet/fleet_file.hpp"
#include "host_tools/fleet/robot_result.hpp"

namespace fxdyn::fleet {

/// Who took a robot's state as the new baseline, and when. The only words of fleet.json that differ from run to run.
struct Acceptance {
  std::string by, at;  ///< ISO 8601, UTC
  RobotState state;
};

/// What a robot has and where.
struct Finding {
  std::size_t joint = 0;  ///< from 1; 0: the robot as a whole
  std::string where;      ///< the joint's name, or "robot"
  FoundEffect found;
  bool is_new = false;      ///< not there in the accepted state; without one: found against a healthy session
  bool discovered = false;  ///< it passes the fleet's false-discovery rate
  /// Its parameters in the accepted state; empty: it was not there. What they differ by has no odds: nobody knows how
  /// much sessions of a healthy robot differ.
  std::vector<NamedParameter> before{};
};

/// What is left without a name and was not so in the reference.
struct Unnamed {
  std::size_t joint = 0;
  std::string where;
  Verdict verdict = Verdict::unexplained;
  bool discovered = false;
};

struct RobotSummary {
  std::string id, project;  ///< as relative to the fleet file
  std::string complaint;    ///< empty: there is a result
  std::optional<RobotState> state;
  std::optional<Acceptance> accepted;
  std::string reference;  ///< accepted | baseline | none: what "new" is measured against
  std::vector<Finding> findings;
  std::vector<Unnamed> unnamed;
  std::vector<std::string> gone;  ///< "elbow: ripple": in the accepted state, not today
  bool drifts = false;
  /// The joint with the largest; none: nothing was judged.
  std::optional<double> worst_error;
  double strongest_odds = 0;  ///< log10
};

/// The same effect at the same joint of robots of one name.
struct Cluster {
  std::string robot, where, effect;
  std::vector<std::string> ids;
};

/// A test of "nothing is there" at a joint.
struct FalseDiscovery {
  double rate = 0;
  std::size_t hypotheses = 0, discoveries = 0;
  /// log10 of rate k / m, k the number of discoveries, which are at or below it. It, and not the largest p among them,
  /// is what a further effect at one of their joints is held against. Without any: 0
  double log10_threshold = 0;
};

struct Summary {
  std::string verb;
  std::vector<RobotSummary> robots;       ///< worst first
  std::vector<Cluster> clusters;          ///< of two robots or more, largest first
  FalseDiscovery false_discovery;         ///< of what is there
  FalseDiscovery false_discovery_of_new;  ///< of what is new since the robots' references
};

/// Benjamini and Hochberg 1995: the largest p that is at most rate k / m, k its rank of m. All hypotheses whose log10 p
/// is at or below it are discoveries. Where p = 1 / odds of a likelihood ratio on data that fitted nothing, this holds
/// for any dependence between hypotheses (Wang and Ramdas 2022, "False discovery rate control with e-values").
FalseDiscovery benjamini_hochberg(std::vector<double> log10_p, double rate);

/// From DIR/robots and DIR/accepted. What can't be read of one robot is its complaint.
Summary summarise(const Fleet& fleet, const std::filesystem::path& directory);
nlohmann::json to_json(const Summary& summary);
std::string html_of(const Summary& summary);
/// fleet.json and fleet.html; returns what the terminal shows.
std::string write_summary(const Summary& summary, const std::filesystem::path& directory);

}  // namespace fxdyn::fleet
