#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "host_tools/report/evidence_result.hpp"

namespace fxdyn {

/// What is there, and what is left: `explained`, what is left is within the noise; `partly_explained`, effects are
/// there and structure is left; `unexplained`, structure is left, or a torque without a name, and nothing else is
/// there.
enum class Verdict { nothing_missing, explained, partly_explained, unexplained, not_excited };
std::string_view to_string(Verdict verdict);
/// @throws InputError: there is none of that name
Verdict verdict_of(std::string_view name);

/// A region of the motion in which a gap sits.
struct GapRegion {
  std::string signal;     ///< dq, speed, q, ddq, load, t, direction, frequency
  std::size_t joint = 0;  ///< from 1: the other joint whose q it is; 0: the joint's own signal
  double from = 0, to = 0;
  std::optional<double> share_of_gap, share_of_time;
  std::string log;  ///< empty: of all logs
};

/// Where a gap sits.
struct GapPlace {
  std::string sentence;  ///< "61 % of the gap is at reversals, below 0.05 rad/s, in 8 % of the time"
  std::vector<GapRegion> regions;
};

/// Share of a gap that no finding explains, and the interval that holds it with 95 %.
struct GapLeft {
  double share = 0, low = 0, high = 0;
};

/// A parameter of an effect that was named.
struct NamedParameter {
  std::string name, unit;
  double value = 0;
  std::optional<double> std;  ///< none: not known
};

/// An effect that is established or likely, at a joint or on the robot.
struct NamedEffect {
  std::string effect;
  std::vector<NamedParameter> parameters;
  double score = 0;
  std::optional<double> held_out_closure;
  std::string signal;  ///< "q - qlink": a deflection shows it; empty: the torque does
  std::vector<std::string> alternatives;
  bool established = false;  ///< else it is likely: in the model without a name, or not at all
  /// On data that did not fit it, log10 of the odds against nothing, whatever else is missing at its joint, and against
  /// the effect that comes nearest.
  double odds_nothing = 0;
  std::optional<double> odds_rival;                ///< none: no other comes near
  std::string rival;                               ///< that effect
  double model_share = 0;                          ///< of the model's torque
  std::optional<std::vector<std::size_t>> joints;  ///< on the robot: those that feel it, from 1
};

/// A free curve of what has no name at a joint: its variable is an answer, its form has no name.
struct CurveResult {
  struct Point {
    double x = 0;           ///< of the variable
    double y = 0, std = 0;  ///< [N*m | N], without the nominal effects' part of it
  };
  std::string effect;                ///< position_curve, velocity_curve, load_curve, .., time_curve
  std::string signal;                ///< its variable: q, dq, load, t
  std::size_t joint = 0;             ///< from 1: the other joint whose q it is; 0: the joint's own variable
  std::string unit;                  ///< of the variable
  bool friction = false;             ///< y is friction, and turns with the direction
  std::string sentence;              ///< "friction rises by 0.8 N*m between 0.85 and 1.05 rad"
  double from = 0, to = 0;           ///< that interval
  double odds_nothing = 0;           ///< log10, on data that did not fit it
  std::optional<double> odds_rival;  ///< .. against the best functions of another variable; none: there is none
  std::string rival;
  double closes = 0;      ///< share of the error's power, on data that did not fit it
  double closes_std = 0;  ///< of a curve over time; not in the file
  bool in_model = false;
  std::string log;  ///< whose clock t is of; empty: the session's
  std::vector<Point> points;

  bool of_motion() const { return signal != "t"; }
};

struct JointDiagnosis {
  std::string joint, unit;
  std::size_t index = 0;  ///< from 1
  Verdict verdict = Verdict::nothing_missing;
  std::optional<double> gap_before{}, gap_after{}, noise_floor{};  ///< [N*m | N]; none: it stands still
  /// The same on what judged the names.
  std::optional<double> gate_before{}, gate_after{};
  /// Whether the error falls on the test logs, too, or hardly rises. None: there are no such logs, or nothing was
  /// found.
  std::optional<bool> carries_over{};
  std::optional<double> closure{};  ///< none: the torque has nothing to close
  std::optional<GapLeft> left{};    ///< likewise
  GapPlace where{};
  std::vector<NamedEffect> effects{};
  /// Sets of which one effect is there for sure, and the data don't tell which. The model has the first, without a
  /// name.
  std::vector<std::vector<std::string>> undecided{};
  std::optional<CurveResult> curve{};  ///< of what is left
  std::vector<std::string> not_identifiable{};
  std::optional<double> state_p{}, time_p{};  ///< lack of fit
};

/// Content of diagnosis.json.
struct DiagnosisResult {
  Verdict verdict = Verdict::nothing_missing;
  std::vector<JointDiagnosis> joints;
  std::vector<NamedEffect> robot_effects;
  std::vector<std::vector<std::string>> undecided;  ///< on the robot
  std::vector<std::string> not_identifiable;
  std::string next_experiment, gate, figures_on;
  bool baseline = false;
  std::vector<std::string> notes;
  std::optional<HeldOutEvidence> evidence;  ///< none yet
};
nlohmann::json to_json(const DiagnosisResult& result);
DiagnosisResult diagnosis_of(const nlohmann::json& file);

}  // namespace fxdyn
