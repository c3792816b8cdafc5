#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "host_tools/diagnose/linearised.hpp"

namespace fxdyn::diagnosis {

/// Whether an effect works on what others do: on the position that their torque follows, or in proportion to a torque.
bool works_on_others(const Group& group);

/// The model of a problem without some of its named effects. Leaving out their columns is not enough where they work on
/// what others do, as those columns are of a model that has the effect: inertias seen through a gear that bends may do
/// its work.
std::unique_ptr<Linearised> without(const Linearised& problem, const std::vector<std::size_t>& groups);

}  // namespace fxdyn::diagnosis
