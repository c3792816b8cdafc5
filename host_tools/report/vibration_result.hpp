#pragma once

#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

namespace fxdyn {

/// What a method comes to over some moves, see vibration().
struct VibrationFigures {
  double tracking_motor = 0, tracking_link = 0, residual = 0;  ///< [mrad | mm]
  double settling_s = 0;
  double roughness = 0;                   ///< of rated torque
  std::optional<double> residual_late{};  ///< [mrad | mm]; as still_s: files from before shaped paths have none
  std::optional<double> still_s{};
};
/// Those that there are, by their names in vibration.json.
std::map<std::string, double> by_name(const VibrationFigures& figures);

/// Of a row whose links' path is not as it was asked for.
struct VibrationPath {
  std::string kind;             ///< shaped, slower
  std::vector<double> delay_s;  ///< of each move's stop
  double cut_short = 0;         ///< at most [mrad | mm]
};

struct VibrationMethod {
  std::string feedforward;                        ///< none, friction, rigid, model, model_elastic, ..
  std::string numbers;                            ///< what computes it: fixed, real, drive; "-": nothing does
  std::string parameters_off;                     ///< "none": they are the model's
  bool motor_side = false;                        ///< the reference is the motors'
  VibrationFigures all;                           ///< over all moves
  std::map<std::string, VibrationFigures> kinds;  ///< .. of one kind
  /// By the feedforward of another method (none, rigid), by figure: this one's over all moves as a share of that one's.
  std::map<std::string, std::map<std::string, double>> ratios;
  std::optional<VibrationPath> path{};  ///< none: as it was asked for

  /// Whether its parameters are the model's.
  bool is_exact() const { return parameters_off == "none"; }
  /// Over the moves of one kind, or "all".
  const VibrationFigures& over(const std::string& kind) const { return kind == "all" ? all : kinds.at(kind); }
  std::optional<double> ratio(const std::string& to, const std::string& figure) const;
};

/// The PD that every method has.
struct VibrationControl {
  double bandwidth_hz = 0, damping = 0, tick_s = 0;
  double encoder_step = 0, settling_band = 0;             ///< [rad | m]
  double late_s = 0;                                      ///< from the stop as asked for to residual_late
  std::vector<double> grid_bandwidths_hz, grid_dampings;  ///< of which it is the best; empty: of no grid
};

/// Fixed point against double in the loop, as shares of the motors' remaining error.
struct NumbersCompared {
  double error_change = 0, path_difference = 0;
};

/// Content of vibration.json. A drive's has controller and methods alone.
struct VibrationResult {
  std::optional<std::string> project_hash;
  nlohmann::json made_from;  ///< see project/provenance.hpp; null: not known
  VibrationControl control;
  std::vector<VibrationMethod> methods;
  /// By feedforward: model, and where gears bend model_elastic, ..
  std::map<std::string, NumbersCompared> fixed_against_double;
};
nlohmann::json to_json(const VibrationResult& result);
VibrationResult vibration_of(const nlohmann::json& file);

/// For the terminal.
std::string vibration_table(const VibrationResult& result);

}  // namespace fxdyn
