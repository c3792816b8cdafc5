#pragma once

#include <optional>
#include <string>
#include <vector>

#include "host_tools/report/section.hpp"

namespace fxdyn {

/// How a joint is drawn everywhere on the page. One rule:
/// what is left is at most `[report] good_enough` of rated torque: calm; above it structure that no finding explains:
/// red; above it, and the test logs disagree with the data that judged: amber; above it, and noise: calm. Unknown where
/// nothing judged it.
enum class Mood { calm, amber, red, unknown };
/// As CSS class, as in "good".
const char* css_class(Mood mood);
/// In words, for those who don't see the colour.
const char* in_words(Mood mood);

/// What the results say of one joint.
struct JointAnswer {
  std::string name, unit;
  double rated = 0;                        ///< [N*m | N]
  std::optional<double> before{}, left{};  ///< RMSE with nominal friction, and as exported, on the shown logs [N*m | N]
  Mood mood = Mood::unknown;
  bool noise_only = false;  ///< diagnosis says that what is left has no structure
  bool test_logs_disagree = false;
  std::string word{};                     ///< of its mood; "noise is left" where that is more than good_enough
  std::string found{}, brings{}, next{};  ///< sentences
  /// Of rated torque; none: not known.
  std::optional<double> share() const;
};

/// One a joint of the model.
std::vector<JointAnswer> joint_answers(const ReportInput& input);

/// The experiments that diagnosis proposes ("a; b; .."), without those for a single joint.
std::string experiments_for_the_robot(const std::string& all);

/// RMSE at most `[report] good_enough` of the joint's rated torque; false where that is not known.
bool is_good_enough(const ReportInput& input, std::size_t joint, double rmse);

}  // namespace fxdyn
