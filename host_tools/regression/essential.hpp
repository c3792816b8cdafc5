#pragma once

#include "host_tools/regression/fitter.hpp"

namespace fxdyn {

/// Base parameters that the data does not need: the one whose value is the smallest multiple of its standard deviation
/// is left out and all others are fitted anew, as long as that multiple is below three (relative deviation above 33 %).
/// What remains are the essential parameters (Khalil, Dombre, "Modeling, Identification and Control of Robots", sec.
/// 12.4.2). Returns the solution of the smaller set: those left out are zero, with `essential` false.
Solution essential_parameters(const Solution& solution, const NormalEquations& equations);

}  // namespace fxdyn
