#include "host_tools/diagnose/autoregression.hpp"

namespace fxdyn::diagnosis {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

/// Order of the model (decision 0005).
constexpr Index order = 6;
/// Share of the variance that is added to it: the equations stay regular for a pure tone.
constexpr double ridge = 1e-4;

}  // namespace

VectorXd autoregression(const std::vector<VectorXd>& residuals) {
  VectorXd r = VectorXd::Zero(order + 1);
  for (const VectorXd& e : residuals) {
    for (Index lag = 0; lag <= order && lag < e.size(); ++lag)
      r[lag] += e.head(e.size() - lag).dot(e.tail(e.size() - lag));
  }
  if (!(r[0] > 0)) return VectorXd::Zero(order);
  MatrixXd toeplitz(order, order);
  for (Index i = 0; i < order; ++i) {
    for (Index k = 0; k < order; ++k) toeplitz(i, k) = r[std::abs(i - k)];
  }
  toeplitz.diagonal() *= 1 + ridge;
  return toeplitz.ldlt().solve(r.tail(order));
}

MatrixXd prewhitened(const Eigen::Ref<const MatrixXd>& rows, const VectorXd& coefficients) {
  MatrixXd out = rows;
  for (Index lag = 1; lag <= coefficients.size() && lag < rows.rows(); ++lag)
    out.bottomRows(rows.rows() - lag) -= coefficients[lag - 1] * rows.topRows(rows.rows() - lag);
  out.topRows(std::min(rows.rows(), coefficients.size())).setZero();
  return out;
}

}  // namespace fxdyn::diagnosis
