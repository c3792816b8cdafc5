#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "tests/train/swarm_runs.hpp"

// The seeds as a fleet: every one is a robot, whose program is swarm_peers itself.
namespace fxdyn::swarm_peers {

struct FleetOptions {
  std::filesystem::path fxdyn, self;  ///< programs
  std::filesystem::path folder;       ///< FOLDER/fleet has the results; what is done there is not done again
  int seeds = 10;
  std::uint64_t first_seed = 1;
  std::vector<std::size_t> joints;  ///< from 1; empty: all
  double duration_s = 0;            ///< of demo_of()
  Budget budget;
  std::vector<std::string> words;  ///< of `fxdyn fleet`
};

/// All methods with one seed on one joint.
struct SeedRun {
  std::size_t joint = 0;  ///< from 1
  std::vector<Trace> of_method;
};

/// By seed. @throws DataError: it was stopped, or a seed failed
std::vector<std::vector<SeedRun>> run_seeds(const FleetOptions& options);

/// What the fleet starts for a seed, which is [train] seed of the project: FOLDER/swarm.json, and the files by which a
/// fleet knows a robot. @throws InputError: no such joint
void run_seed(const std::filesystem::path& project, const std::filesystem::path& folder,
              const std::vector<std::size_t>& joints, const Budget& budget);

}  // namespace fxdyn::swarm_peers
