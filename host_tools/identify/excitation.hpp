#pragma once

#include "host_tools/identify/options.hpp"
#include "host_tools/regression/fitter.hpp"
#include "host_tools/regression/information.hpp"

namespace fxdyn {

/// Base parameters that the train logs determine poorly, by the torque that their standard deviation stands for: the
/// largest at random motions within the model's limits, as a share of rated torque. `error`: that share; from
/// `worrying_error` on. Not identifiable: the information has (next to) nothing in a direction that the parameter has
/// part in.
std::vector<WeakParameter> weak_in_logs(const Fitter& fitter, const Solution& solution,
                                        const StructureOptions& options);

}  // namespace fxdyn
