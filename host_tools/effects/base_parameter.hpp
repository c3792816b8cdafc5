#pragma once

#include <cmath>
#include <cstddef>
#include <string>

namespace fxdyn {

/// A base parameter: the standard parameter that stands for its group.
struct BaseParameter {
  std::size_t column = 0;  ///< 10 * link + parameter (model/rigid_body.hpp)
  std::string name;        ///< e.g. "hx3": first moment of link 3 about x, DH frame
  double value = 0, std = 0;
  bool essential = true;   ///< the data would be explained worse without it
  std::string expression;  ///< the sum of standard parameters that it is, e.g. "Jzz1 + Jxx2 + 0.18 m3"

  /// Standard deviation over value [-]; 0 where the value is 0.
  double relative_std() const { return value != 0 ? std::fabs(std / value) : 0.0; }
};

}  // namespace fxdyn
