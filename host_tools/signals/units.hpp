#pragma once

#include "host_tools/signals/log.hpp"

namespace fxdyn {

/// Degrees for radians and milliseconds for seconds, as far as motions show it: dq against the slope of q, how far and
/// how fast a joint turns, how many of them turn more than twice.
/// @throws InputError: says which column to multiply by what
void check_units(const Log& log, const std::vector<bool>& revolute, const std::string& where);

}  // namespace fxdyn
