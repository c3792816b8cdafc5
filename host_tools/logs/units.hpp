#pragma once

#include "host_tools/logs/log.hpp"

namespace fxdyn {

/// Degrees for radians and milliseconds for seconds, as far as motions show it: dq against the slope of q, how far and
/// how fast a joint turns, how many of them turn more than twice, all of them hardly moving in rows far apart.
/// `time_is_known`: the unit of the stamps was written down.
/// @throws InputError: says which column to multiply by what
void check_units(const Log& log, const std::vector<bool>& revolute, const std::string& where,
                 bool time_is_known = false);

}  // namespace fxdyn
