#pragma once

#include <filesystem>

#include "tests/campaign/case.hpp"
#include "tests/campaign/draw.hpp"
#include "tests/campaign/expected.hpp"
#include "tests/campaign/outside.hpp"
#include "tests/campaign/session.hpp"

namespace fxdyn::campaign {

/// What was put into a case, apart from what the diagnosis sees.
struct Ground {
  Plan plan;  ///< healthy robot with its background
  std::vector<std::pair<std::optional<std::size_t>, EffectFit>> background, effects;
  std::vector<Outside> outside;
  IdentifiedModel measured;  ///< with effects and changed friction; without what is outside the catalogue
};

/// A case that can't be had: no joint of the robot reaches the size.
struct NotPossible : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// Draws joints, shapes and sizes. `folder` takes the plan's files.
Ground plan_case(const Case& wanted, const std::filesystem::path& folder);

/// Writes a case: `data` gets robot.urdf, project.toml and logs; `truth` the scenarios, truth.json, the noise-free
/// torques and, under `exact`, the test logs with exact motion.
void generate(const Case& wanted, const std::filesystem::path& data, const std::filesystem::path& truth);

}  // namespace fxdyn::campaign
