#pragma once

#include <array>

#include "host_tools/effects/forward.hpp"
#include "host_tools/effects/joint_fit.hpp"
#include "host_tools/identify/options.hpp"
#include "host_tools/regression/dataset.hpp"
#include "host_tools/robot/robot.hpp"

namespace fxdyn {

struct LoadParameter {
  const char *name, *unit;
  double value = 0, std = 0;
  bool identifiable = false;  ///< this motion separates it from the others; else the value is a guess
};

/// A load on the last link, from what it adds to the torque of a model without it.
struct LoadFit {
  Inertial body;                             ///< in the last link's URDF frame, P > 0
  std::array<LoadParameter, 10> parameters;  ///< mass, centre, tensor about the centre, same frame
  bool constrained = false;                  ///< the least squares solution itself was not a possible body
  Eigen::VectorXd coulomb, coulomb_std;      ///< change of Coulomb friction with the load [N*m | N]
  Eigen::VectorXd offset;                    ///< change of the offset [N*m | N]
  /// RMS of the filtered torque that the model misses [N*m | N]: without load; with it and the changes of friction;
  /// with mass and centre alone, as `effect` has them.
  Eigen::VectorXd before, after, with_effect;
  EffectFit effect;  ///< `payload`
};

/// What every look at a load asks for.
/// @throws InputError: the model has a payload already, or the log has no torque.
void check_weighable(const IdentifiedModel& model, const ProcessedLog& log);

/// Weighted least squares of tau - predict(model) on the ten parameters of the last link, a Coulomb and an offset
/// column a joint beside them (friction changes with the load), all filtered alike; made physically consistent.
/// Standard deviations count the residual's autocorrelation.
/// @throws DataError: the motion does not determine the mass, or there is none to be seen. InputError: the model has a
/// payload already, or the log has no torque.
LoadFit identify_load(const IdentifiedModel& model, const ProcessedLog& log, const LoadOptions& options = {});

}  // namespace fxdyn
