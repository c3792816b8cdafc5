#include "host_tools/page/class_means.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

namespace fxdyn {

using Eigen::Index;
using Eigen::VectorXd;

ClassMeans class_means(const VectorXd& x, const VectorXd& y, Index classes) {
  std::vector<Index> order;
  for (Index k = 0; k < x.size(); ++k) {
    if (!std::isnan(x[k]) && !std::isnan(y[k])) order.push_back(k);
  }
  std::sort(order.begin(), order.end(), [&](Index a, Index b) { return x[a] < x[b]; });
  const auto count = static_cast<Index>(order.size()), bins = std::min(classes, count);
  ClassMeans out{VectorXd::Zero(bins), VectorXd::Zero(bins), VectorXd::Zero(bins)};
  double within = 0, mean = 0, whole = 0, square = 0;
  for (const Index k : order) mean += y[k] / static_cast<double>(count);
  for (Index b = 0; b < bins; ++b) {
    const Index from = b * count / bins, to = (b + 1) * count / bins;
    const auto of = [&](Index k) { return order[static_cast<std::size_t>(k)]; };
    for (Index k = from; k < to; ++k) {
      out.x[b] += x[of(k)] / static_cast<double>(to - from);
      out.y[b] += y[of(k)] / static_cast<double>(to - from);
    }
    double squares = 0;
    for (Index k = from; k < to; ++k) squares += std::pow(y[of(k)] - out.y[b], 2);
    out.spread[b] = std::sqrt(squares / static_cast<double>(to - from));
    within += squares;
  }
  for (const Index k : order) {
    whole += std::pow(y[k] - mean, 2);
    square += y[k] * y[k];
  }
  // what a constant differs from its mean by is rounding
  constexpr double rounding = 1e-24;
  out.explained = whole > rounding * square ? 1 - within / whole : 0;
  return out;
}

}  // namespace fxdyn
