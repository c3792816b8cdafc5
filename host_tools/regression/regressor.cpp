#include "host_tools/regression/regressor.hpp"

#include <array>
#include <numbers>

#include "host_tools/effects/link_parameters.hpp"
#include "host_tools/support/random.hpp"

namespace fxdyn {

Regressor::Regressor(const DhChain& chain)
    : chain_(chain),
      base_(base_motion<Real>({chain.up.x(), chain.up.y(), chain.up.z()})),
      states_(chain.links.size()),
      axes_(chain.links.size()),
      y_(Eigen::MatrixXd::Zero(joints(), joints() * static_cast<Eigen::Index>(parameters_per_link))) {}

namespace {

/// visit(p, wrench of the unit parameter e_p) for all ten. The compiler sees the constants and drops what they make
/// zero (this file is compiled without signed zeros and infinities).
template <class Visit, std::size_t... p>
[[gnu::always_inline]] inline void for_unit_wrenches(const LinkMotion<Real>& motion, const Visit& visit,
                                                     std::index_sequence<p...>) {
  const auto unit = [](std::size_t k) {
    std::array<double, parameters_per_link> parameters{};
    parameters[k] = 1;
    return to_inertia(parameters);
  };
  (visit(p, link_wrench<Real>(AnyLink{}, unit(p), motion)), ...);
}

}  // namespace

[[gnu::flatten]] void Regressor::evaluate() {
  const std::size_t n = chain_.links.size();
  LinkMotion<Real> motion = base_;
  for (std::size_t i = 0; i < n; ++i) {
    motion = link_motion<Real>(AnyLink{}, chain_.links[i], motion, states_[i]);
    for (std::size_t j = 0; j < i; ++j) {
      Screw& axis = axes_[j];
      axis.moment =
          detail::to_child<Real>(AnyLink{}, chain_.links[i], motion, axis.moment + cross(axis.direction, motion.p));
      axis.direction = detail::to_child<Real>(AnyLink{}, chain_.links[i], motion, axis.direction);
    }
    const Vector3<double> z{0, 0, 1}, none{0, 0, 0};
    axes_[i] = AnyLink::revolute(chain_.links[i]) ? Screw{z, none} : Screw{none, z};
    for (std::size_t j = 0; j <= i; ++j) {
      const Screw axis = axes_[j];
      double* const columns = &y_(static_cast<Eigen::Index>(j), static_cast<Eigen::Index>(i * parameters_per_link));
      for_unit_wrenches(
          motion,
          [&](std::size_t p, const Wrench<Real>& wrench) {
            columns[p * n] = dot(axis.direction, wrench.moment) + dot(axis.moment, wrench.force);
          },
          std::make_index_sequence<parameters_per_link>{});
    }
  }
}

namespace {

struct RandomMotions {
  Eigen::MatrixXd y;    ///< (motions n) x 10 n
  Eigen::MatrixXd ddq;  ///< motions x n
};

RandomMotions random_motions(const DhChain& chain) {
  Regressor regressor(chain);
  const Eigen::Index n = regressor.joints();
  constexpr Eigen::Index motions = 60;
  Random random(1);
  RandomMotions out{Eigen::MatrixXd(motions * n, n * static_cast<Eigen::Index>(parameters_per_link)),
                    Eigen::MatrixXd(motions, n)};
  for (Eigen::Index k = 0; k < motions; ++k) {
    Eigen::VectorXd q(n), dq(n), ddq(n);
    for (Eigen::Index i = 0; i < n; ++i) {
      q[i] = random.uniform(-std::numbers::pi, std::numbers::pi);
      dq[i] = random.normal() * 2;
      ddq[i] = random.normal() * 5;
    }
    out.y.middleRows(k * n, n) = regressor(q, dq, ddq);
    out.ddq.row(k) = ddq.transpose();
  }
  return out;
}

}  // namespace

BaseSet find_base(const DhChain& chain) {
  const Eigen::MatrixXd y = random_motions(chain).y;
  const Eigen::Index p = y.cols();
  const Eigen::VectorXd norms = y.colwise().norm();
  const double threshold = 1e-9;
  Eigen::VectorXd inverse(p);
  for (Eigen::Index j = 0; j < p; ++j) inverse[j] = norms[j] > threshold * norms.maxCoeff() ? 1 / norms[j] : 0;
  const Eigen::MatrixXd scaled = y * inverse.asDiagonal();
  Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(scaled);
  qr.setThreshold(threshold);

  BaseSet base;
  for (Eigen::Index i = 0; i < qr.rank(); ++i) base.columns.push_back(qr.colsPermutation().indices()[i]);
  std::sort(base.columns.begin(), base.columns.end());
  const Eigen::MatrixXd independent = scaled(Eigen::all, base.columns);
  base.grouping = Eigen::ColPivHouseholderQR<Eigen::MatrixXd>(independent).solve(scaled);
  for (Eigen::Index i = 0; i < base.grouping.rows(); ++i) {
    for (Eigen::Index j = 0; j < p; ++j) {
      double& value = base.grouping(i, j);
      value = std::fabs(value) < threshold ? 0 : value * norms[j] / norms[base.columns[static_cast<std::size_t>(i)]];
    }
  }
  return base;
}

Eigen::VectorXd rotor_in_base(const DhChain& chain, const BaseSet& base, Eigen::Index joint) {
  if (base.columns.empty()) return {};
  const RandomMotions motions = random_motions(chain);
  const Eigen::Index n = motions.ddq.cols();
  Eigen::VectorXd column = Eigen::VectorXd::Zero(motions.y.rows());
  for (Eigen::Index k = 0; k < motions.ddq.rows(); ++k) column[k * n + joint] = motions.ddq(k, joint);
  const Eigen::MatrixXd y = motions.y(Eigen::all, base.columns);
  Eigen::VectorXd c = Eigen::ColPivHouseholderQR<Eigen::MatrixXd>(y).solve(Eigen::MatrixXd(column)).col(0);
  return (column - y * c).norm() < 1e-8 * column.norm() ? c : Eigen::VectorXd();
}

bool rotor_inertia_is_absorbed(const DhChain& chain, const BaseSet& base, Eigen::Index joint) {
  return rotor_in_base(chain, base, joint).size() > 0;
}

std::string parameter_name(Eigen::Index column) {
  static constexpr std::array names{"m", "hx", "hy", "hz", "Jxx", "Jyy", "Jzz", "Jxy", "Jxz", "Jyz"};
  const auto per_link = static_cast<Eigen::Index>(parameters_per_link);
  return names[static_cast<std::size_t>(column % per_link)] + std::to_string(column / per_link + 1);
}

}  // namespace fxdyn
