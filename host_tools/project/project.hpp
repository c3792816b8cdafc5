#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "host_tools/logs/log.hpp"
#include "host_tools/robot/robot.hpp"

namespace fxdyn {

struct LogEntry {
  std::filesystem::path file;                     ///< absolute; empty where a scenario makes it
  std::optional<std::filesystem::path> scenario;  ///< simulated on first use into DIR/logs/<scenario name>/
  std::string scenario_log;                       ///< which of its logs: <scenario_log>.csv
  Role role = Role::train;
  std::optional<double> from_s, to_s;
  LogFormat format;
  bool own_format = false;   ///< its [[log]] says something of it, not only [signals]
  std::optional<Load> load;  ///< a known load of this run
  int line = 0;              ///< of the [[log]] in the project file
};

struct IdentifySettings {
  std::string method = "wls";  ///< ls | wls | irls | rls
  std::optional<std::vector<std::string>> effects;
  bool physical = true;               ///< pseudo-inertias positive definite, friction and rotor inertia not negative
  bool essential = false;             ///< base parameters that do not matter are left out
  double forgetting = 1;              ///< rls: what a second-old row counts
  std::optional<double> prior_error;  ///< relative, of the URDF's masses: they take part in the fit
};

/// What `fxdyn check`, and every verb that fits, looks at before it believes a log.
struct CheckSettings {
  bool columns = true;  ///< order, signs, zeros, axes, gravity and gains against the URDF
};

struct DiagnoseSettings {
  int max_effects = 3;  ///< per joint
};

/// Search of the BLS's hyperparameters by a particle swarm (host_tools/train/swarm.hpp).
struct PsoSettings {
  int particles = 30, iterations = 40, stall = 10;
  std::vector<std::string> activations{};  ///< to choose from; empty: that of [train]
  /// Lowest and highest; nodes: of all windows.
  std::array<double, 2> windows{1, 4}, nodes{4, 40}, ridge{1e-4, 1e-1};
};

struct TrainSettings {
  bool enabled = true;
  std::uint64_t seed = 1;
  std::string inputs = "physical";  ///< physical | bristles | extended | state
  std::string features = "random";  ///< random | sparse
  std::optional<int> windows, nodes, enhancement;
  std::string activation = "tanh";   ///< tanh | sigmoid | relu
  std::optional<double> wavenumber;  ///< of sin(n q), cos(n q) [rad^-1 | m^-1]
  std::optional<double> ridge;
  std::optional<PsoSettings> pso;  ///< none: a small grid
};

/// What `fxdyn run` does beside the model.
struct CompareSettings {
  bool enabled = false;  ///< compare every method, too
  bool paper = false;    ///< the report sets the paper's Table 2 beside ours
};

struct TargetSettings {
  std::string board = "mps2-an386";
  double tick_s = 0.002;
  std::vector<std::size_t> joints;  ///< one image for each of these (from 0); empty: one image for all
  std::uint32_t sequence = 1;       ///< of the exported tables, at least
  double accept_error = 0.01;       ///< proven |fixed - double| at most, of rated torque; observed: a tenth of it
};

struct LimitSettings {
  std::vector<std::array<double, 2>> position;
  std::vector<double> velocity, acceleration, torque;
  std::optional<std::array<Eigen::Vector3d, 2>> box;  ///< lowest and highest corner, base frame [m]
};

/// How the report judges.
struct ReportSettings {
  /// RMSE as a share of rated torque up to which a joint is drawn calm: a choice, not a measurement.
  double good_enough = 0.01;
};

/// How `fxdyn excite` plans its trajectories, see docs/guide/excite.md.
struct ExciteSettings {
  double period_s = 10;
  int order = 5;              ///< harmonics of each series, at least 2
  int trajectories = 4;       ///< fast, slow, reversals, static, and again fast, slow, ..
  std::vector<double> noise;  ///< standard deviation of the torque, one a joint [N*m | N]; empty: not known
  std::uint64_t seed = 1;
  double step_s = 0.002;  ///< sampling interval of what is written
  int starts = 3;         ///< of the optimiser, for each trajectory
  double margin = 0.05;   ///< share of every limit that is left unused
};

/// A project file (TOML), see docs/guide/project.md. All paths are relative to it.
struct Project {
  std::filesystem::path file;
  Robot robot;
  std::filesystem::path urdf;
  std::vector<double> rated_torque;  ///< may be empty
  LimitSettings limits;              ///< each may be empty
  std::vector<LogEntry> logs;
  SignalSettings signals;
  IdentifySettings identify;
  CheckSettings check;
  DiagnoseSettings diagnose;
  TrainSettings train;
  ExciteSettings excite;
  CompareSettings compare;
  TargetSettings target;
  ReportSettings report;
  bool has_role(Role role) const;
};

/// @throws InputError with file and line: not TOML, an unknown key (names the nearest known one), a wrong type, a
/// vector whose length is not the number of joints, an unknown role, board, effect or method, overlapping
/// windows of the same file whatever their roles, a missing file.
Project read_project(const std::filesystem::path& file);

}  // namespace fxdyn
