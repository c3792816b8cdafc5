#include "host_tools/vibration/nonnegative.hpp"

#include <limits>
#include <vector>

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Of the gram matrix's mean diagonal, added to the diagonal: makes a solution unique where many are equally good.
constexpr double ridge = 1e-9;
/// Slope that counts as none, of the gram matrix's mean diagonal.
constexpr double flat = 1e-10;

/// The least x' gram x with sum 1 among the free elements, whatever their signs.
VectorXd unsigned_least(const MatrixXd& gram, const std::vector<Index>& free) {
  const MatrixXd part = gram(free, free);
  const VectorXd x = part.ldlt().solve(VectorXd::Ones(part.rows()));
  return x / x.sum();
}

}  // namespace

VectorXd least_on_simplex(const MatrixXd& given) {
  const Index n = given.rows();
  const double size = given.trace() / static_cast<double>(n);
  const MatrixXd gram = given + ridge * size * MatrixXd::Identity(n, n);
  VectorXd x = VectorXd::Zero(n);
  Index first = 0;
  gram.diagonal().minCoeff(&first);
  x[first] = 1;
  std::vector<Index> free{first};
  // Each round lowers x' gram x, so that no set of free elements comes twice; the bound is for rounding alone.
  for (Index round = 0; round < 20 * n; ++round) {
    // at the least one every free element has the same slope, and no other a smaller one
    const VectorXd slope = gram * x;
    const double level = x.dot(slope);
    Index next = 0;
    if (slope.minCoeff(&next) >= level - flat * size) break;
    if (x[next] > 0) break;
    free.push_back(next);
    for (;;) {
      const VectorXd wanted = unsigned_least(gram, free);
      double share = 1;
      Index stops = -1;
      for (std::size_t i = 0; i < free.size(); ++i) {
        const double from = x[free[i]], to = wanted[static_cast<Index>(i)];
        if (to > 0 || from - to <= share * std::numeric_limits<double>::min()) continue;
        if (from / (from - to) < share) {
          share = from / (from - to);
          stops = static_cast<Index>(i);
        }
      }
      for (std::size_t i = 0; i < free.size(); ++i) x[free[i]] += share * (wanted[static_cast<Index>(i)] - x[free[i]]);
      if (stops < 0) break;
      x[free[static_cast<std::size_t>(stops)]] = 0;
      free.erase(free.begin() + stops);
    }
  }
  return x;
}

}  // namespace fxdyn
