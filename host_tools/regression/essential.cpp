#include "host_tools/regression/essential.hpp"

#include <cmath>

#include "host_tools/regression/solver.hpp"

namespace fxdyn {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

Solution essential_parameters(const Solution& solution, const NormalEquations& equations) {
  constexpr double least_multiple = 3;
  const MatrixXd& a = equations.information;
  // covariance = A^-1 M A^-1: what the noise puts into the right-hand side
  const MatrixXd middle = a * solution.covariance * a;
  const Index nb = solution.beta.size();
  std::vector<Index> kept(static_cast<std::size_t>(a.rows()));
  for (std::size_t k = 0; k < kept.size(); ++k) kept[k] = static_cast<Index>(k);
  VectorXd x, std;
  while (true) {
    const SymmetricSolver solver(a(kept, kept));
    x = solver.solve(VectorXd(equations.projection(kept)));
    const MatrixXd inverse = solver.inverse();
    std = (inverse * middle(kept, kept) * inverse).diagonal().cwiseMax(0).cwiseSqrt();
    std::size_t worst = kept.size();
    double least = least_multiple;
    for (std::size_t k = 0; k < kept.size() && kept[k] < nb; ++k) {
      const auto i = static_cast<Index>(k);
      const double multiple = std::fabs(x[i]) / std::max(std[i], 1e-300);
      if (multiple >= least) continue;
      least = multiple;
      worst = k;
    }
    if (worst == kept.size()) break;
    kept.erase(kept.begin() + static_cast<std::ptrdiff_t>(worst));
  }
  Solution out = solution;
  out.essential.assign(static_cast<std::size_t>(nb), false);
  out.beta.setZero();
  out.beta_std.setZero();
  for (std::size_t k = 0; k < kept.size(); ++k) {
    const auto i = static_cast<Index>(k);
    if (kept[k] < nb) {
      out.essential[static_cast<std::size_t>(kept[k])] = true;
      out.beta[kept[k]] = x[i];
      out.beta_std[kept[k]] = std[i];
      continue;
    }
    std::size_t j = 0;
    while (kept[k] >= equations.offset[j + 1]) ++j;
    out.theta[j][kept[k] - equations.offset[j]] = x[i];
    out.theta_std[j][kept[k] - equations.offset[j]] = std[i];
  }
  return out;
}

}  // namespace fxdyn
