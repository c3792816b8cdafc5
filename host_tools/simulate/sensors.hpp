#pragma once

#include "host_tools/logs/log.hpp"
#include "host_tools/signals/motion.hpp"

namespace fxdyn {

struct Scenario;
struct ScenarioLog;

/// The exact run of a plant on a uniform grid that starts with the log, samples x joints: what there is to measure.
struct PlantRun : MotionRows {  ///< of the motors
  double step_s = 0;
  Eigen::MatrixXd tau;          ///< [N*m | N]
  Eigen::MatrixXd deflections;  ///< motor minus link [rad | m]
};

/// The instants at which a log is sampled, since its start: every sample_s, each off by the jitter [s].
Eigen::VectorXd sampling_times(const Scenario& scenario, const ScenarioLog& log);

/// The run at those instants: exact where they fall on its grid, else by cubic (q, dq) and linear interpolation.
Log sampled(const Scenario& scenario, const PlantRun& run, const Eigen::VectorXd& times);

/// What the drives measure of it: encoder steps and noise.
void measure(const Scenario& scenario, const ScenarioLog& spec, Log& log);

}  // namespace fxdyn
