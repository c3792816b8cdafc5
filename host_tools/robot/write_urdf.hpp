#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "host_tools/robot/robot.hpp"

namespace fxdyn {

/// The URDF `original` with the inertia of every moving link replaced by `inertia` (DH frames, P > 0), 17 significant
/// digits. A moving link also stands for the links fixed to it, as in read_urdf(): theirs are removed. The rest of the
/// file stays as it is, byte by byte.
/// @param comments one a link, inside its <inertial>; empty: none
/// @throws InputError: `original` can't be read or is not the robot's.
void write_urdf(const std::filesystem::path& original, const std::filesystem::path& out, const Robot& robot,
                const DhChain& chain, const std::vector<LinkInertia<Real>>& inertia,
                const std::vector<std::string>& comments = {});

}  // namespace fxdyn
