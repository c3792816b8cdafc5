#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "host_tools/project/project.hpp"
#include "host_tools/report/comparison_result.hpp"

namespace fxdyn {

/// `fxdyn compare`: every method on the same train and validate logs, judged on the test logs; writes compare.json.
///
/// Errors are against the noise-free torque where the logs come from a scenario (<log>.truth.csv beside them), else
/// against the measurement; both filtered as the model's rows are. Per method:
///   rmse, peak           per joint [N*m | N], over all test logs
///   percent_rated        rmse, % of rated torque
///   smoothness           RMS of d(torque)/dt over that of the reference's, mean over the joints: 1 is as smooth
///   macs_per_tick        multiplications of one tick, all joints; the rigid body counts as the PUMA's, 142 a joint
///   train_s              wall time from the logs to the model, null where a killed run's search went on; named_bls: of
///                        diagnose and train when they last ran in DIR, null where that is not known
///   fixed_error          largest |fixed - double| on the test logs, share of rated; null: not for firmware
/// Methods: rigid_ls friction_ls rls mlp bls_default bls_pso bls_pso_friction bls_pso_physical dahl_stribeck lugre
/// named_bls oracle noise_floor; the last two only where the truth is known.
/// Beside compare.json it draws DIR/plots/compare_*.svg, what the paper's Figs. 5 to 11 show.
/// The swarms keep their last generation in DIR/compare.bls_pso.pso.json, compare.bls_pso_friction.pso.json and
/// compare.bls_pso_physical.pso.json: a killed run goes on from there.
/// @throws DataError: no test log, no validate log, generations of another project or other logs
ComparisonResult compare(const std::filesystem::path& project, const std::filesystem::path& directory);

/// Some of these methods, and six more. bls_physical: bls_pso_physical with a small grid in place of the swarm.
/// lugre_physical: lugre with links that are possible bodies. named: what diagnosis finds, without a BLS;
/// named_trained: with a BLS where it helps. known_shapes: what the logs allow at best (known_shapes.hpp), where the
/// truth is known; bound: of eight draws of the noise. Writes nothing.
/// @param from of which project file the logs are (named_bls continues from DIR/model.json)
ComparisonResult compare_methods(const Project& project, const std::filesystem::path& directory,
                                 const std::vector<std::string>& methods);

}  // namespace fxdyn
