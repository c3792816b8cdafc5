#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

namespace fxdyn {

/// What a method comes to on the test logs, see compare().
struct MethodResult {
  std::string name;
  std::vector<double> rmse, percent_rated, peak;  ///< per joint
  double mean_percent_rated = 0, smoothness = 0, macs_per_tick = 0;
  std::optional<double> train_s;
  double predict_us = 0;              ///< of one sample, all joints
  std::optional<double> fixed_error;  ///< share of rated torque
};

/// Content of compare.json.
struct ComparisonResult {
  bool against_truth = true;  ///< else against the measurement
  std::string project_hash;
  nlohmann::json made_from;  ///< see project/provenance.hpp
  bool paper = false;        ///< figures as the paper has them
  std::vector<MethodResult> methods;
};
nlohmann::json to_json(const ComparisonResult& result);
ComparisonResult comparison_of(const nlohmann::json& file);

/// For the terminal.
std::string compare_table(const ComparisonResult& result);

}  // namespace fxdyn
