#include "host_tools/regression/square_root.hpp"

#include <algorithm>
#include <cmath>

namespace fxdyn {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

/// A diagonal this small beside its column is what rounding leaves of a column that those before it make up.
constexpr double no_pivot = 1e-9;

bool is_known(const MatrixXd& upper, Index i) {
  return std::fabs(upper(i, i)) > no_pivot * upper.col(i).head(i + 1).norm();
}

/// R x = z from below; unknowns without a pivot are zero.
VectorXd solve_upper(const MatrixXd& upper, const VectorXd& z) {
  const Index p = upper.cols();
  VectorXd x = VectorXd::Zero(p);
  for (Index i = p; i-- > 0;) {
    if (is_known(upper, i)) x[i] = (z[i] - upper.row(i).tail(p - i - 1).dot(x.tail(p - i - 1))) / upper(i, i);
  }
  return x;
}

/// The triangle that asks the same as the rows.
MatrixXd triangle_of(MatrixXd rows) {
  const Index count = std::min(rows.rows(), rows.cols());
  const Eigen::HouseholderQR<Eigen::Ref<MatrixXd>> qr(rows);
  return qr.matrixQR().topRows(count).triangularView<Eigen::Upper>();
}

}  // namespace

void SquareRootInformation::forget(double share) {
  if (share == 1) return;
  triangle_ *= std::sqrt(share);
  rows_ *= share;
}

void SquareRootInformation::take_in(const MatrixXd& rows, const std::vector<Index>& columns, double weight) {
  const Index p = unknowns();
  const MatrixXd compact = rows.rows() > rows.cols() ? triangle_of(rows) : rows;
  VectorXd row(p + 1);
  for (Index k = 0; k < compact.rows(); ++k) {
    row.setZero();
    for (std::size_t c = 0; c < columns.size(); ++c) row[columns[c]] = compact(k, static_cast<Index>(c));
    row[p] = compact(k, compact.cols() - 1);
    // Givens
    for (Index i = 0; i <= p; ++i) {
      if (row[i] == 0) continue;
      const double length = std::hypot(triangle_(i, i), row[i]), c = triangle_(i, i) / length, s = row[i] / length;
      double* upper = &triangle_(i, i);
      double* lower = &row[i];
      for (Index m = 0; m <= p - i; ++m) {
        const double before = upper[m];
        upper[m] = c * before + s * lower[m];
        lower[m] = c * lower[m] - s * before;
      }
    }
  }
  rows_ += weight;
}

VectorXd SquareRootInformation::solve() const {
  const Index p = unknowns();
  return solve_upper(triangle_.topLeftCorner(p, p), triangle_.col(p).head(p));
}

VectorXd SquareRootInformation::solve_without(const std::vector<Index>& zeros) const {
  if (zeros.empty()) return solve();
  std::vector<Index> kept;
  for (Index i = 0; i < unknowns(); ++i) {
    if (std::find(zeros.begin(), zeros.end(), i) == zeros.end()) kept.push_back(i);
  }
  SquareRootInformation smaller(static_cast<Index>(kept.size()));
  std::vector<Index> all, columns = kept;
  for (std::size_t i = 0; i < kept.size(); ++i) all.push_back(static_cast<Index>(i));
  columns.push_back(unknowns());
  smaller.take_in(triangle_(Eigen::all, columns), all, 0);
  VectorXd x = VectorXd::Zero(unknowns());
  x(kept) = smaller.solve();
  return x;
}

void SquareRootInformation::recentre(const VectorXd& x) {
  const Index p = unknowns();
  triangle_.col(p).head(p) = triangle_.topLeftCorner(p, p).triangularView<Eigen::Upper>() * x;
}

MatrixXd SquareRootInformation::information() const {
  const MatrixXd r = triangle_.topLeftCorner(unknowns(), unknowns());
  return r.transpose() * r;
}

VectorXd SquareRootInformation::projection() const {
  const Index p = unknowns();
  return triangle_.topLeftCorner(p, p).transpose() * triangle_.col(p).head(p);
}

VectorXd SquareRootInformation::deviations() const {
  const Index p = unknowns();
  const MatrixXd r = triangle_.topLeftCorner(p, p);
  VectorXd out = VectorXd::Zero(p);
  // R^-1, column by column; its rows' lengths are the deviations.
  for (Index c = 0; c < p; ++c) {
    if (is_known(r, c)) out += solve_upper(r, VectorXd::Unit(p, c)).cwiseAbs2();
  }
  return out.cwiseSqrt();
}

double SquareRootInformation::variance_of_row() const {
  return rows_ > 0 ? triangle_(unknowns(), unknowns()) * triangle_(unknowns(), unknowns()) / rows_ : 0;
}

}  // namespace fxdyn
