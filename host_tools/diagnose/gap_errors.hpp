#pragma once

#include <Eigen/Dense>
#include <string>
#include <vector>

#include "host_tools/diagnose/verdict.hpp"

namespace fxdyn::diagnosis {

/// Filtered error of a joint over a log, full rate [N*m | N]. @param torque of a model, of that joint
Eigen::VectorXd error_of(const ProcessedLog& log, const Eigen::Ref<const Eigen::VectorXd>& torque, std::size_t joint);

/// RMS errors of a joint [N*m | N]: of the model before and with what was found.
struct GapFigures {
  double before = 0, after = 0;            ///< on the logs that are shown
  double gate_before = 0, gate_after = 0;  ///< on the logs that judged the names
  double floor = 0;                        ///< of the noise
};

/// Both models' errors on the logs that are shown and on those that judged.
class GapErrors {
 public:
  explicit GapErrors(const Conclusion& conclusion);

  GapFigures operator()(std::size_t joint) const;
  /// For people: which logs are shown.
  const std::string& figures_on() const { return figures_on_; }
  const ProcessedLog& first_shown() const { return *shown_.logs.front(); }
  /// Torque of the model with what was found.
  const Eigen::MatrixXd& first_after() const { return first_after_; }

 private:
  struct Set {
    std::vector<const ProcessedLog*> logs;
    std::vector<Eigen::VectorXd> before, after;  ///< by log: squares of both models' errors, by joint
  };
  /// Both models' errors, as sums: torques of all logs are as large as the logs.
  void sum_up(Set& set) const;
  double error(const Set& set, const std::vector<Eigen::VectorXd>& squares, std::size_t joint) const;
  /// Errors of what was fitted come out too small by the square root of this.
  double judged_over_fitted(const Eigen::VectorXd& judged, const Eigen::VectorXd& fitted, std::size_t joint) const;

  const Conclusion& conclusion_;
  std::string figures_on_;
  bool blocks_judge_ = false;  ///< train logs judged one another
  Set shown_, judges_;         ///< no judges: they are those that are shown
  Eigen::MatrixXd first_after_;
};

}  // namespace fxdyn::diagnosis
