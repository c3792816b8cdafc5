#include "host_tools/history/student.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace fxdyn::history {

double two_sided_p(double t, int degrees) {
  constexpr double rounding = 1e-15;
  const double angle = std::atan(std::fabs(t) / std::sqrt(degrees)), c = std::cos(angle), s = std::sin(angle);
  const bool odd = degrees % 2 == 1;
  // 1 + (1/2) c^2 + (1 3)/(2 4) c^4 .. for even degrees, c + (2/3) c^3 + (2 4)/(3 5) c^5 .. for odd ones
  double term = odd ? c : 1, sum = degrees == 1 ? 0 : term;
  for (int k = odd ? 3 : 2; k <= degrees - 2; k += 2) {
    term *= c * c * (k - 1) / k;
    sum += term;
  }
  const double within = odd ? 2 / std::numbers::pi * (angle + s * sum) : s * sum;
  return std::clamp(1 - within, rounding, 1.0);
}

double two_sided_quantile(double p, int degrees) {
  double low = 0, high = 1;
  while (two_sided_p(high, degrees) > p) high *= 2;
  for (int i = 0; i < 200 && high - low > 1e-12 * high; ++i) {
    const double middle = 0.5 * (low + high);
    (two_sided_p(middle, degrees) > p ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

}  // namespace fxdyn::history
