#include "host_tools/diagnose/deflection_rows.hpp"

#include <algorithm>

#include "host_tools/diagnose/autoregression.hpp"
#include "host_tools/diagnose/models.hpp"
#include "host_tools/effects/model_parts.hpp"
#include "host_tools/regression/regressor.hpp"
#include "host_tools/regression/solver.hpp"
#include "host_tools/support/parallel.hpp"

namespace fxdyn::diagnosis {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

Index stride_of(const ProcessedLog& log, Rows rows) {
  if (rows == Rows::all) return 1;
  const double rows_a_period = 1 / (log.step_s * static_cast<double>(log.decimation) * log.filter.torque_cutoff_hz);
  return std::max<Index>(1, static_cast<Index>(rows_a_period / 2));
}

}  // namespace

std::vector<MatrixXd> rigid_loads(const IdentifiedModel& model, const std::vector<ProcessedLog>& logs) {
  ModelValue rigid = model;
  for (JointFit& fit : joints_of(rigid)) fit.effects.clear();
  filter_of(rigid).torque_lead_s = 0;
  std::vector<MatrixXd> out(logs.size());
  parallel_for(logs.size(), [&](std::size_t l) {
    if (logs[l].qlink.size() > 0) out[l] = predict(rigid, logs[l]);
  });
  return out;
}

DeflectionRows::DeflectionRows(const IdentifiedModel& model, const std::vector<LinkedLog>& logs, std::size_t joint,
                               Rows rows)
    : joint_(joint), width_(joints_of(model)[joint].sign_width) {
  const auto j = static_cast<Index>(joint);
  Index total = 0;
  for (const auto& [log, load] : logs) {
    const MotionRows m = log->joint_motion(j);
    series_.push_back({m.q, m.dq, m.ddq, load->col(j), log->step_s});
    logs_.push_back(log);
    first_.push_back(total);
    stride_.push_back(stride_of(*log, rows));
    count_.push_back((log->rows() + stride_.back() - 1) / stride_.back());
    total += count_.back();
  }
  delta_.resize(total);
  for (std::size_t l = 0; l < logs_.size(); ++l)
    delta_.segment(first_[l], count_[l]) = kept(l, (logs_[l]->q - logs_[l]->qlink).col(j));
}

MatrixXd DeflectionRows::kept(std::size_t log, const MatrixXd& full) const {
  const MatrixXd rows = logs_[log]->decimate(logs_[log]->filter_columns(full));
  return rows(Eigen::seqN(0, count_[log], stride_[log]), Eigen::all);
}

MatrixXd DeflectionRows::columns(std::string_view effect, const std::vector<double>& shape) const {
  MatrixXd out;
  for (std::size_t l = 0; l < logs_.size(); ++l) {
    const MatrixXd part = kept(l, effect_columns(effect, shape, width_, series_[l]));
    if (l == 0) out.resize(delta_.size(), part.cols());
    out.middleRows(first_[l], count_[l]) = part;
  }
  return out;
}

MatrixXd DeflectionRows::offsets() const {
  MatrixXd out = MatrixXd::Zero(delta_.size(), static_cast<Index>(logs_.size()));
  for (std::size_t l = 0; l < logs_.size(); ++l) out.block(first_[l], static_cast<Index>(l), count_[l], 1).setOnes();
  return out;
}

MatrixXd DeflectionRows::whiten(const MatrixXd& x, const VectorXd& coefficients) const {
  MatrixXd out(x.rows(), x.cols());
  for (std::size_t l = 0; l < logs_.size(); ++l)
    out.middleRows(first_[l], count_[l]) = prewhitened(x.middleRows(first_[l], count_[l]), coefficients);
  return out;
}

VectorXd DeflectionRows::colour(const VectorXd& e) const {
  std::vector<VectorXd> parts;
  for (std::size_t l = 0; l < logs_.size(); ++l) parts.emplace_back(e.segment(first_[l], count_[l]));
  return autoregression(parts);
}

double DeflectionRows::largest_load() const {
  double most = 1e-6;
  for (const JointSeries& s : series_) most = std::max(most, s.structural.cwiseAbs().maxCoeff());
  return most;
}

void DeflectionRows::move(const VectorXd& z) {
  for (std::size_t l = 0; l < logs_.size(); ++l) series_[l].structural += slopes_[l] * (z - z_);
  z_ = z;
}

MatrixXd DeflectionRows::slope_rows() const {
  MatrixXd out(delta_.size(), z_.size());
  for (std::size_t l = 0; l < logs_.size(); ++l) out.middleRows(first_[l], count_[l]) = kept(l, slopes_[l]);
  return out;
}

VectorXd DeflectionRows::load_rows() const {
  VectorXd out(delta_.size());
  for (std::size_t l = 0; l < logs_.size(); ++l) out.segment(first_[l], count_[l]) = kept(l, series_[l].structural);
  return out;
}

/// Half of what a rotor can have at most, 0 where the base parameters have none.
double DeflectionRows::half_of_hidden_rotor(const IdentifiedModel& model) const {
  if (hidden_rotor(model, joint_).size() == 0) return 0;
  std::vector<const MatrixXd*> q;
  for (const ProcessedLog* log : logs_) q.push_back(&log->q);
  return 0.5 * least_inertia(model, joint_, q);
}

MatrixXd DeflectionRows::slopes_of(std::size_t log, const IdentifiedModel& model, const LoadUncertainty& u) const {
  Regressor regressor(to_dh(robot_of(model)));
  const MotionRows m = logs_[log]->motion();
  MatrixXd own(logs_[log]->samples(), static_cast<Index>(u.columns.size()));
  for (Index k = 0; k < own.rows(); ++k) {
    const MatrixXd& y = regressor(m.q.row(k), m.dq.row(k), m.ddq.row(k));
    for (Index c = 0; c < own.cols(); ++c)
      own(k, c) = y(static_cast<Index>(joint_), u.columns[static_cast<std::size_t>(c)]);
  }
  MatrixXd out(own.rows(), u.spread.cols() + (u.rotor > 0));
  out.leftCols(u.spread.cols()) = own * u.spread;
  if (u.rotor > 0) out.rightCols(1) = -u.rotor * series_[log].ddq;
  return out;
}

void DeflectionRows::add_slopes(const IdentifiedModel& model, const LoadUncertainty& uncertainty) {
  slopes_.clear();
  for (std::size_t l = 0; l < logs_.size(); ++l) slopes_.push_back(slopes_of(l, model, uncertainty));
  z_ = VectorXd::Zero(slopes_.front().cols());
}

void DeflectionRows::drop_slopes() {
  slopes_.clear();
  z_.resize(0);
}

LoadUncertainty DeflectionRows::add_uncertainty(const IdentifiedModel& model, const MatrixXd& covariance,
                                                const DeflectionOptions& options, bool with_rotor) {
  const double little = options.load_uncertainty;
  LoadUncertainty u;
  const auto j = static_cast<Index>(joint_);
  std::vector<Index> mine;  // those of links from the joint on
  for (std::size_t k = 0; k < base_of(model).size(); ++k) {
    const auto column = static_cast<Index>(base_of(model)[k].column);
    if (column < j * static_cast<Index>(parameters_per_link)) continue;
    mine.push_back(static_cast<Index>(k));
    u.columns.push_back(column);
  }
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(covariance(mine, mine));
  u.spread = eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0).cwiseSqrt().asDiagonal();
  add_slopes(model, u);
  MatrixXd gram = MatrixXd::Zero(z_.size(), z_.size());
  double load = 0;
  for (std::size_t l = 0; l < logs_.size(); ++l) {
    gram += slopes_[l].transpose() * slopes_[l];
    load += series_[l].structural.squaredNorm();
  }
  const Eigen::SelfAdjointEigenSolver<MatrixXd> principal(gram);
  std::vector<Index> kept;
  for (Index i = 0; i < gram.rows(); ++i) {
    if (principal.eigenvalues()[i] > little * little * load) kept.push_back(i);
  }
  u.spread = u.spread * principal.eigenvectors()(Eigen::all, kept);
  if (with_rotor) u.rotor = half_of_hidden_rotor(model);
  add_slopes(model, u);
  return u;
}

VectorXd residual(const MatrixXd& x, const VectorXd& y) {
  return y - x * SymmetricSolver(x.transpose() * x).solve(x.transpose() * y);
}

}  // namespace fxdyn::diagnosis
