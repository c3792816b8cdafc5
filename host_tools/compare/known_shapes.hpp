#pragma once

#include <cstdint>

#include "host_tools/effects/forward.hpp"
#include "host_tools/identify/gate_data.hpp"
#include "host_tools/project/project.hpp"

namespace fxdyn {

/// What these train logs allow at best: structure and shapes are those of the scenario's truth, and only the linear
/// parameters are fitted. With shapes known and white torque noise, least squares has the variance of the Cramer-Rao
/// bound: no unbiased estimate of them does better on average.
/// @param draw 0: the torque that was measured; else the truth's on the measured motion with white noise drawn anew, as
///   large as the log's
IdentifiedModel with_known_shapes(const Project& project, GateData data, const IdentifiedModel& truth,
                                  std::uint64_t draw);

}  // namespace fxdyn
