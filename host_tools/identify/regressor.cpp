#include "host_tools/identify/regressor.hpp"

#include <array>
#include <numbers>

#include "host_tools/model/identified_model.hpp"
#include "host_tools/random.hpp"

namespace fxdyn {

Regressor::Regressor(const DhChain& chain)
    : chain_(chain),
      base_(base_motion<Real>({chain.up.x(), chain.up.y(), chain.up.z()})),
      motions_(chain.links.size()),
      y_(Eigen::MatrixXd::Zero(joints(), joints() * static_cast<Eigen::Index>(parameters_per_link))) {}

const Eigen::MatrixXd& Regressor::operator()(const Eigen::VectorXd& q, const Eigen::VectorXd& dq,
                                             const Eigen::VectorXd& ddq) {
  const std::size_t n = chain_.links.size();
  for (std::size_t i = 0; i < n; ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    motions_[i] =
        link_motion<Real>(AnyLink{}, chain_.links[i], i == 0 ? base_ : motions_[i - 1], {q[k], dq[k], ddq[k]});
  }
  for (std::size_t link = 0; link < n; ++link) {
    for (std::size_t p = 0; p < parameters_per_link; ++p) {
      std::array<double, parameters_per_link> unit{};
      unit[p] = 1;
      Wrench<Real> wrench = link_wrench<Real>(AnyLink{}, to_inertia(unit), motions_[link]);
      const auto column = static_cast<Eigen::Index>(link * parameters_per_link + p);
      for (std::size_t i = link + 1; i-- > 0;) {
        y_(static_cast<Eigen::Index>(i), column) = joint_torque<Real>(AnyLink{}, chain_.links[i], wrench);
        if (i > 0) {
          Wrench<Real> parent;
          add_to_parent<Real>(AnyLink{}, parent, wrench, chain_.links[i], motions_[i]);
          wrench = parent;
        }
      }
    }
  }
  return y_;
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

bool rotor_inertia_is_absorbed(const DhChain& chain, const BaseSet& base, Eigen::Index joint) {
  const RandomMotions motions = random_motions(chain);
  const Eigen::Index n = motions.ddq.cols();
  Eigen::VectorXd column = Eigen::VectorXd::Zero(motions.y.rows());
  for (Eigen::Index k = 0; k < motions.ddq.rows(); ++k) column[k * n + joint] = motions.ddq(k, joint);
  const Eigen::MatrixXd y = motions.y(Eigen::all, base.columns);
  const Eigen::VectorXd rest =
      column - y * Eigen::ColPivHouseholderQR<Eigen::MatrixXd>(y).solve(Eigen::MatrixXd(column)).col(0);
  return rest.norm() < 1e-8 * column.norm();
}

std::string parameter_name(Eigen::Index column) {
  static constexpr std::array names{"m", "hx", "hy", "hz", "Jxx", "Jyy", "Jzz", "Jxy", "Jxz", "Jyz"};
  const auto per_link = static_cast<Eigen::Index>(parameters_per_link);
  return names[static_cast<std::size_t>(column % per_link)] + std::to_string(column / per_link + 1);
}

}  // namespace fxdyn
