#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "host_tools/support/progress.hpp"
#include "host_tools/train/swarm.hpp"

namespace fxdyn {

/// Where a search by swarm keeps its last generation, so that a killed run goes on from there. Whoever has written the
/// outcome down removes it.
struct ResumeFile {
  std::filesystem::path path;
  std::string identity;  ///< of everything that the outcome depends on
  std::string inputs;    ///< of project and logs, which are known before the work starts
  /// @throws DataError: there is one, of other inputs
  void check_inputs() const;
  /// Removes a search that came to its end from another start than `identity`: a run that was stopped after it had
  /// written its outcome down leaves that behind.
  void drop_finished() const;
};

/// Plays swarms to their end, all generation by generation together: with few of them left their particles still fill
/// all cores. One step of progress for each swarm's generation.
/// @param fitness of swarm number s at x, asked for from any number of threads at once
/// @param resume continues from it where it exists, and writes each generation to it
/// @throws DataError: the resume file is not of this search
void search(std::vector<Swarm>& swarms, const std::function<double(std::size_t s, const Eigen::VectorXd& x)>& fitness,
            Progress& progress, const std::optional<ResumeFile>& resume);

}  // namespace fxdyn
