#include "host_tools/regression/information.hpp"

#include <fmt/format.h>

#include <cmath>
#include <limits>

#include "host_tools/effects/effects.hpp"

namespace fxdyn {

ParameterColumns::ParameterColumns(const Robot& robot, const Eigen::VectorXd& sign_width)
    : chain_(to_dh(robot)), base_(find_base(chain_)), sign_width_(sign_width) {
  const auto n = static_cast<Eigen::Index>(robot.size());
  for (const Eigen::Index column : base_.columns) {
    names_.push_back(parameter_name(column));
    joints_.push_back(column / static_cast<Eigen::Index>(parameters_per_link));
  }
  for (Eigen::Index j = 0; j < n; ++j) {
    std::vector<Eigen::Index> inertial;  // a joint carries the links from its own on
    for (Eigen::Index k = 0; k < base_size(); ++k) {
      if (joints_[static_cast<std::size_t>(k)] >= j) inertial.push_back(k);
    }
    inertial_.push_back(inertial);
  }
  for (Eigen::Index j = 0; j < n; ++j) {
    std::vector<std::string> effects = nominal_effects();
    if (rotor_inertia_is_absorbed(chain_, base_, j)) std::erase_if(effects, in_base);
    own_.push_back(inertial_[static_cast<std::size_t>(j)]);
    for (const std::string& effect : effects) {
      own_.back().push_back(size());
      names_.push_back(fmt::format("{} {}", effect, j + 1));
      joints_.push_back(j);
    }
    effects_.push_back(effects);
  }
}

Eigen::MatrixXd ParameterColumns::information(const Motion& motion, const Eigen::VectorXd& scale) const {
  const Eigen::Index samples = motion.q.rows(), n = motion.q.cols();
  std::vector<Eigen::MatrixXd> rows;  // of each joint: samples x its own columns
  for (const auto& own : own_) rows.emplace_back(samples, static_cast<Eigen::Index>(own.size()));
  Regressor regressor(chain_);
  for (Eigen::Index k = 0; k < samples; ++k) {
    const Eigen::MatrixXd& y =
        regressor(motion.q.row(k).transpose(), motion.dq.row(k).transpose(), motion.ddq.row(k).transpose());
    for (std::size_t j = 0; j < rows.size(); ++j) {
      for (std::size_t c = 0; c < inertial_[j].size(); ++c) {
        rows[j](k, static_cast<Eigen::Index>(c)) =
            y(static_cast<Eigen::Index>(j), base_.columns[static_cast<std::size_t>(inertial_[j][c])]);
      }
    }
  }
  Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(size(), size());
  for (Eigen::Index j = 0; j < n; ++j) {
    const auto joint = static_cast<std::size_t>(j);
    const JointSeries series{motion.q.col(j), motion.dq.col(j), motion.ddq.col(j), {}, motion.step_s};
    auto column = static_cast<Eigen::Index>(inertial_[joint].size());
    for (const std::string& effect : effects_[joint]) {
      rows[joint].col(column++) = effect_columns(effect, {}, sign_width_[j], series).col(0);
    }
    const Eigen::Index own = rows[joint].cols();
    Eigen::MatrixXd gram = Eigen::MatrixXd::Zero(own, own);
    gram.selfadjointView<Eigen::Lower>().rankUpdate(rows[joint].transpose(), motion.step_s / (scale[j] * scale[j]));
    for (Eigen::Index a = 0; a < own; ++a) {
      for (Eigen::Index b = 0; b < own; ++b) {
        sum(own_[joint][static_cast<std::size_t>(a)], own_[joint][static_cast<std::size_t>(b)]) +=
            gram(std::max(a, b), std::min(a, b));
      }
    }
  }
  return sum;
}

double scaled_condition(const Eigen::MatrixXd& information) {
  constexpr double infinity = std::numeric_limits<double>::infinity();
  const Eigen::VectorXd diagonal = information.diagonal();
  if (!(diagonal.minCoeff() > 0)) return infinity;
  const Eigen::VectorXd inverse = diagonal.cwiseSqrt().cwiseInverse();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(inverse.asDiagonal() * information * inverse.asDiagonal(),
                                                             Eigen::EigenvaluesOnly);
  const double least = eigen.eigenvalues()[0], most = eigen.eigenvalues()[diagonal.size() - 1];
  return least > 1e-15 * most ? std::sqrt(most / least) : infinity;
}

double log_determinant(const Eigen::MatrixXd& information) {
  const Eigen::LDLT<Eigen::MatrixXd> factors(information);
  const Eigen::VectorXd d = factors.vectorD();
  if (!(d.minCoeff() > 0)) return -std::numeric_limits<double>::infinity();
  return d.array().log().sum();
}

std::vector<WeakParameter> weak_parameters(const Eigen::MatrixXd& information, const ParameterSizes& parameters,
                                           const Eigen::VectorXd& movement, double above) {
  const Eigen::Index p = information.rows();
  const auto& size = parameters.size;
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(size.asDiagonal() * information * size.asDiagonal());
  const Eigen::VectorXd& values = eigen.eigenvalues();
  const double least_information = 1 / (unidentifiable_error * unidentifiable_error);
  const double rounding = 1e-14 * std::max(values[p - 1], 0.0);
  std::vector<WeakParameter> weak;
  for (Eigen::Index i = 0; i < p; ++i) {
    double variance = 0, lost = 0;
    for (Eigen::Index k = 0; k < p; ++k) {
      const double part = eigen.eigenvectors()(i, k) * eigen.eigenvectors()(i, k);
      if (values[k] > rounding) {
        variance += part / values[k];
      } else if (part > 1e-9) {
        variance = std::numeric_limits<double>::infinity();
      }
      if (values[k] <= rounding || values[k] < least_information) lost += part;
    }
    const auto index = static_cast<std::size_t>(i);
    WeakParameter parameter{parameters.names[index], std::sqrt(variance), lost < 0.1, parameters.joints[index]};
    if (parameter.identifiable && parameter.error < above) continue;
    if (parameters.of_link[index]) movement.head(parameter.joint + 1).minCoeff(&parameter.joint);
    weak.push_back(parameter);
  }
  return weak;
}

}  // namespace fxdyn
