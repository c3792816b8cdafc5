#pragma once

#include <nlohmann/json.hpp>

namespace fxdyn::test {

/// A diagnosis.json with each verdict, an effect on the robot as a whole, and evidence.
inline nlohmann::json diagnosis() {
  return nlohmann::json::parse(R"({
 "schema": "fxdyn.diagnosis/2", "verdict": "unexplained", "gate": "", "figures_on": "test logs", "baseline": true, "notes": [],
 "not_identifiable": ["gravity_tilt"], "undecided": [["payload", "gravity_tilt"]],
 "joints": [
  {"joint": "shoulder", "index": 1, "unit": "N*m", "verdict": "explained", "gap_before": 1.9, "gap_after": 0.4,
   "noise_floor": 0.35, "closure": 0.83,
   "left": {"share": 0.17, "low": 0.12, "high": 0.22},
   "where": {"sentence": "61 % of the gap is at velocity -0.05 .. 0.05 rad/s, 8 % of the time",
     "regions": [{"signal": "dq", "from": -0.05, "to": 0.05, "share_of_gap": 0.61, "share_of_time": 0.08}]},
   "effects": [{"effect": "stribeck", "certainty": "established", "log10_odds_nothing": 40.2,
     "log10_odds_rival": 3.7, "rival": "presliding",
     "parameters": [{"name": "amplitude", "value": 2.1, "unit": "N*m", "std": 0.05},
                    {"name": "velocity", "value": 0.04, "unit": "rad/s", "std": 0.01}],
     "score": 412.0, "held_out_closure": 0.83, "alternatives": ["presliding"], "model_share": 0.4}],
   "undecided": [], "not_identifiable": ["spring"], "lack_of_fit": {"state_p": null, "time_p": null}},
  {"joint": "elbow", "index": 2, "unit": "N*m", "verdict": "unexplained", "gap_before": 0.9, "gap_after": 0.9,
   "noise_floor": 0.2, "closure": 0.0, "left": {"share": 1.0, "low": 0.8, "high": 1.0},
   "where": {"sentence": "90 % of the gap is in negative direction, 50 % of the time",
     "regions": [{"signal": "direction", "from": -1, "to": 0, "share_of_gap": 0.9, "share_of_time": 0.5}]},
   "undecided": [["presliding", "lugre"]], "not_identifiable": [], "lack_of_fit": {"state_p": null, "time_p": null},
   "effects": [{"effect": "saturation", "certainty": "likely", "log10_odds_nothing": 1.9, "log10_odds_rival": null,
     "rival": null, "parameters": [], "score": 4.0, "held_out_closure": 0.1, "alternatives": [], "model_share": 0.0}]},
  {"joint": "roll", "index": 3, "unit": "N*m", "verdict": "nothing_missing", "gap_before": 0.1, "gap_after": 0.1,
   "noise_floor": 0.1, "closure": 1.0, "left": null, "where": {"sentence": "", "regions": []}, "effects": [],
   "undecided": [], "not_identifiable": [], "lack_of_fit": {"state_p": null, "time_p": null}},
  {"joint": "slide", "index": 4, "unit": "N", "verdict": "not_excited", "gap_before": 3.0, "gap_after": 3.0,
   "noise_floor": 2.9, "closure": null, "left": null, "where": {"sentence": "", "regions": []}, "effects": [],
   "undecided": [], "not_identifiable": [], "lack_of_fit": {"state_p": null, "time_p": null}}],
 "robot_effects": [{"effect": "payload", "certainty": "established", "log10_odds_nothing": 90.0,
   "log10_odds_rival": null, "rival": null, "joints": [2, 3, 4], "held_out_closure": 0.8, "score": 800.0, "model_share": 0.1,
   "parameters": [{"name": "mass", "value": 2.0, "unit": "kg", "std": 0.1}], "alternatives": []}],
 "next_experiment": "slow reversals of joint 1 through +-0.02 rad would separate stribeck from presliding",
 "evidence": {
  "held_out": [{"file": "b.csv", "role": "test", "from_s": 0.0, "to_s": 8.0}],
  "joints": [
   {"joint": "shoulder", "index": 1, "unit": "N*m", "rms_before": 1.88, "rms_after": 0.41, "rms_after_fixed": 0.42,
    "noise_floor": 0.35},
   {"joint": "elbow", "index": 2, "unit": "N*m", "rms_before": 0.9, "rms_after": 0.9, "rms_after_fixed": null,
    "noise_floor": 0.2}],
  "fixed_point": {"computed": true, "notes": []},
  "forward": {"log": "b.csv", "from_s": 0.3, "seconds": 7.4, "joints": [
   {"joint": "shoulder", "index": 1, "tracking_before": 0.002, "tracking_after": 0.0003, "tracking_unit": "rad",
    "torque_before": 1.5, "torque_after": 0.2, "torque_unit": "N*m"},
   {"joint": "elbow", "index": 2, "tracking_before": 0.001, "tracking_after": null, "tracking_unit": "rad",
    "torque_before": 0.3, "torque_after": null, "torque_unit": "N*m"}],
   "failed": {"after": "the mass matrix is not positive definite"}}}
})");
}

}  // namespace fxdyn::test
