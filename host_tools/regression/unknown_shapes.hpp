#pragma once

#include <vector>

#include "host_tools/effects/effects.hpp"
#include "host_tools/effects/joint_fit.hpp"

namespace fxdyn {

/// Whether the shape can be an unknown of the fit: a width, a distance or a share, not an index or a count.
bool is_continuous(const ParameterInfo& shape);

/// A shape that is an unknown, in a design.
struct UnknownShape {
  double* value;
  double least, most;
  void set(double to) const;
};

/// A joint's shapes that are unknowns: the sign's width first. The design must outlive them.
std::vector<UnknownShape> unknown_shapes(JointFit& design);

}  // namespace fxdyn
