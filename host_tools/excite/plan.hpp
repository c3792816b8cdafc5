#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "host_tools/excite/limits.hpp"
#include "host_tools/excite/motions.hpp"
#include "host_tools/regression/information.hpp"
#include "host_tools/signals/fourier.hpp"
#include "host_tools/signals/motion.hpp"
#include "host_tools/support/progress.hpp"

namespace fxdyn {

/// A trajectory that starts and ends at rest, sampled at the plan's step.
struct PlannedTrajectory : Motion {
  std::string kind;  ///< fast, slow, reversals: a Fourier series per joint; static: poses with dwell
  std::vector<FourierJoint> series;
  double period_s = 0;          ///< of the series
  int periods = 1;              ///< played one after the other
  Eigen::MatrixXd poses;        ///< static: poses x joints [rad | m]
  std::vector<double> moves_s;  ///< static: durations of the moves between them; dwell_s at each pose
  double dwell_s = 0;
};

/// How well conditioned an identification would be, see ParameterColumns and scaled_condition().
struct Conditioning {
  double base = 0;             ///< base parameters only
  double all = 0;              ///< with friction, offset and rotor inertia
  double log_determinant = 0;  ///< of all columns' information (per second, rows in units of noise)
};

struct Plan {
  std::vector<PlannedTrajectory> trajectories;
  Conditioning after;              ///< the plan
  Conditioning before;             ///< the best of `random_plans` random feasible plans of the same kinds, each figure
  Conditioning trajectory_after;   ///< the first trajectory alone
  Conditioning trajectory_before;  ///< the best of as many random feasible trajectories of its kind
  std::vector<WeakParameter> parameters;  ///< all of the columns', with the error that a fit would have
  Eigen::MatrixXd information;            ///< of `parameters` over the plan, with `noise` at the plan's step
  Eigen::VectorXd noise;                  ///< standard deviation of the torque that was assumed [N*m | N]
  Eigen::VectorXd rated;                  ///< torque that errors are measured in [N*m | N]
  std::vector<Usage> usage;
  std::vector<std::string> notes;
};

inline constexpr int random_plans = 100;

/// Plans the trajectories of project.excite within its limits, each optimised with those before it taken into account:
/// the largest log det of the information and the smallest scaled condition number. The same seed gives the same plan.
/// `directory`: where model.json may be.
/// @throws InputError: limits that no pose meets, naming limit and joint. DataError: parameters that the best plan
/// can't determine, naming them and the joint to move.
Plan make_plan(const Project& project, const std::filesystem::path& directory, Progress& progress);

}  // namespace fxdyn
