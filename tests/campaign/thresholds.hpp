#pragma once

#include <nlohmann/json_fwd.hpp>
#include <set>
#include <string>
#include <vector>

#include "host_tools/diagnose/options.hpp"
#include "tests/campaign/case.hpp"

namespace fxdyn::campaign {

/// A threshold that decides what a diagnosis answers.
struct Threshold {
  /// What a case must have for the threshold to be read at all.
  enum class Reads { always, with_baseline, without_baseline, with_link_encoders };
  std::string name, unit;
  double& (*of)(diagnosis::Options&);
  Reads reads = Reads::always;

  bool is_read(const Case& one) const;
};
/// All of them, 40 at most.
const std::vector<Threshold>& deciding_thresholds();

/// Forty small cases: two joints, four logs of 5 s a role, 250 Hz.
std::vector<Case> threshold_cases();

/// The part of a diagnosis that counts.
struct Answer {
  std::string verdict;            ///< of the robot
  std::set<std::string> effects;  ///< named
  std::set<std::size_t> joints;   ///< with a name or unexplained; 0: the robot
  bool right = false;             ///< as score() has it
};
/// @param report diagnosis.json
Answer answer_of(const nlohmann::json& truth, const nlohmann::json& report);

/// What one case answers: with the defaults, and with each threshold halved and doubled.
struct CaseAnswers {
  Answer normal;
  std::vector<Answer> halved, doubled;  ///< by threshold
};

nlohmann::json to_json(const CaseAnswers& answers);
CaseAnswers case_answers(const nlohmann::json& json);

/// One threshold over all cases.
struct ThresholdRow {
  struct Changed {
    std::size_t verdict = 0, effects = 0, joints = 0, right = 0;
  };
  std::string name, unit;
  double value = 0;
  std::size_t right = 0, cases = 0;
  Changed halved, doubled;

  bool without_effect() const;
};
std::vector<ThresholdRow> rows_of(const std::vector<Threshold>& thresholds, const std::vector<CaseAnswers>& answers);
/// A line of the page for each row, below two lines of head.
std::string to_markdown(const std::vector<ThresholdRow>& rows);

}  // namespace fxdyn::campaign
