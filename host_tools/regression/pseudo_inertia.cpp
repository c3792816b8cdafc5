#include "host_tools/regression/pseudo_inertia.hpp"

#include <array>

#include "host_tools/effects/link_parameters.hpp"

namespace fxdyn {

using Eigen::Index;
using Eigen::Matrix4d;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

constexpr auto ten = static_cast<Index>(parameters_per_link);

/// The position of each parameter in the upper triangle of P.
constexpr std::array<std::array<int, 2>, 10> places{
    {{3, 3}, {0, 3}, {1, 3}, {2, 3}, {0, 0}, {1, 1}, {2, 2}, {0, 1}, {0, 2}, {1, 2}}};

}  // namespace

Matrix4d pseudo_inertia(const Eigen::Ref<const VectorXd>& body) {
  Matrix4d p;
  for (Index k = 0; k < ten; ++k) {
    const auto [r, c] = places[static_cast<std::size_t>(k)];
    p(r, c) = p(c, r) = body[k];
  }
  return p;
}

VectorXd pseudo_inertia_parameters(const Matrix4d& p) {
  VectorXd body(ten);
  for (Index k = 0; k < ten; ++k) {
    const auto [r, c] = places[static_cast<std::size_t>(k)];
    body[k] = p(r, c);
  }
  return body;
}

VectorXd inner_products(const Matrix4d& m) {
  VectorXd out(ten);
  for (Index k = 0; k < ten; ++k) {
    const auto [r, c] = places[static_cast<std::size_t>(k)];
    out[k] = r == c ? m(r, c) : 2 * m(r, c);
  }
  return out;
}

MatrixXd barrier_hessian(const Matrix4d& m) {
  MatrixXd out(ten, ten);
  for (Index k = 0; k < ten; ++k) {
    const auto [r, c] = places[static_cast<std::size_t>(k)];
    Matrix4d product = m.col(r) * m.row(c);
    if (r != c) product += m.col(c) * m.row(r);
    out.row(k) = inner_products((product + product.transpose()) / 2).transpose();
  }
  return out;
}

Matrix4d pseudo_inertia(const LinkInertia<Real>& link) {
  const auto values = to_array(link);
  return pseudo_inertia(Eigen::Map<const VectorXd>(values.data(), ten));
}

LinkInertia<Real> from_pseudo_inertia(const Matrix4d& p) {
  std::array<double, parameters_per_link> values;
  Eigen::Map<VectorXd>(values.data(), ten) = pseudo_inertia_parameters(p);
  return to_inertia(values);
}

Inertial possible_body(const Inertial& body) {
  const Eigen::Matrix3d second = 0.5 * body.tensor.trace() * Eigen::Matrix3d::Identity() - body.tensor;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(second);
  constexpr double smallest = 2e-3;  // radius of gyration [m]
  const double floor = std::max(1e-3 * second.trace(), body.mass * smallest * smallest);
  if (solver.eigenvalues().minCoeff() >= floor) return body;
  const Eigen::Matrix3d raised =
      solver.eigenvectors() * solver.eigenvalues().cwiseMax(floor).asDiagonal() * solver.eigenvectors().transpose();
  Inertial out = body;
  out.tensor = raised.trace() * Eigen::Matrix3d::Identity() - raised;
  return out;
}

}  // namespace fxdyn
