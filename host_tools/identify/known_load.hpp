#pragma once

#include <vector>

#include "host_tools/effects/forward.hpp"
#include "host_tools/identify/options.hpp"
#include "host_tools/logs/log.hpp"
#include "host_tools/regression/dataset.hpp"

namespace fxdyn {

/// What a known load says of one joint's torque.
struct JointGain {
  bool felt = false;    ///< the load showed in this joint's torque well enough; else the gain is unknown
  double factor = 1;    ///< torque over what the log calls torque [-]: torque_gain has to be multiplied by it
  double std = 0;       ///< of the factor [-]; 0: the load does not show at all
  double load_rms = 0;  ///< torque of the load over the loaded log [N*m | N]
};

/// The gain of each joint's torque, from a load that is known.
///
/// The same robot is recorded without and with it. Of each joint by itself, in the unit of its own torque column,
///
///     tau - predict(model) = Y beta + F phi + c |carried| s + [loaded] (tau_load / factor + J psi + dc s + do)
///
/// Y: base columns of the rigid body, as gains that are wrong by different factors fit no one robot; F: linear columns
/// of the joint's own effects; carried: the torque without the model's friction; tau_load: of a point mass [N*m | N];
/// J: second moments of the load about its own centre, which nobody knows; dc, do: changes of Coulomb friction and
/// offset. Ordinary least squares; the factor is what that part of tau_load says which no other column imitates.
///
/// The standard deviation sums the products of that part and the residual over neighbouring rows (Newey, West 1987),
/// those of both logs at the same time taken together: what comes back with a motion that is repeated cancels, as it
/// does in the fit.
/// @throws InputError: the mass is not positive, the model has a payload already, a log has no torque. DataError: too
/// short a log, or a load that no joint feels.
std::vector<JointGain> identify_gains(const IdentifiedModel& model, const Load& load, const ProcessedLog& unloaded,
                                      const ProcessedLog& loaded, const LoadOptions& options = {});

}  // namespace fxdyn
