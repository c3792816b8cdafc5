#pragma once

#include <memory>
#include <string>
#include <vector>

#include "host_tools/diagnose/finding.hpp"
#include "host_tools/diagnose/lack_of_fit.hpp"
#include "host_tools/diagnose/models.hpp"
#include "host_tools/diagnose/search.hpp"

namespace fxdyn::diagnosis {

/// What a search came to.
struct Outcome {
  Models models;
  std::vector<Finding> found;
  std::unique_ptr<Linearised> problem;  ///< around the models, without candidates
  std::vector<Eigen::MatrixXd> features;
  std::vector<LackOfFit> lack;
  std::vector<std::vector<std::string>> not_identifiable;  ///< per joint, and of the robot
  std::vector<Eigen::VectorXd> whitening;
  bool dropped = false;  ///< the last pass took an effect back

  bool structured() const;  ///< at any joint
  bool structured(std::size_t joint) const;
  /// Linearises around the models again and looks for lack of fit.
  void look_again(const std::vector<SessionLog>& logs);
  /// Until look_again(): problem and features are by far the largest part.
  void put_down();
};

/// Search, name, fit again around what was named; again where that left structure or found several effects.
/// @param passes at most
Outcome explore(const Models& models, const std::vector<SessionLog>& logs, const SearchTask& task, int passes,
                Progress& progress);
/// One such pass around an outcome in which the rival of a finding is in that finding's place.
Outcome explore_rival(const Outcome& outcome, const Finding& finding, const std::vector<SessionLog>& logs,
                      const SearchTask& task, Progress& progress);
/// One such pass around an outcome, which stays as it is.
Outcome explore_again(const Outcome& outcome, const std::vector<SessionLog>& logs, const SearchTask& task,
                      Progress& progress);

}  // namespace fxdyn::diagnosis
