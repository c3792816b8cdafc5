#pragma once

#include <Eigen/Dense>
#include <algorithm>

#include "model/effects/curve.hpp"
#include "model/numbers.hpp"

namespace fxdyn::diagnosis {

/// The interval that a curve's knots (model/effects/curve.hpp) are spread over.
struct Knots {
  double from = 0, span = 1;
  double place(double x) const { return (x - from) / span; }  ///< 0 .. 1 between them
};

/// The heights' factors at values of the variable, values x heights.
inline Eigen::MatrixXd bumps(const Knots& knots, const Eigen::VectorXd& values) {
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(values.size(), static_cast<Eigen::Index>(curve_heights));
  const auto pieces = static_cast<double>(curve_pieces);
  for (Eigen::Index i = 0; i < values.size(); ++i) {
    const double x = std::clamp(pieces * knots.place(values[i]), 0.0, pieces);
    Curve<Real>::at(x).each(
        [&](auto, std::size_t height, double weight) { out(i, static_cast<Eigen::Index>(height)) = weight; });
  }
  return out;
}

}  // namespace fxdyn::diagnosis
