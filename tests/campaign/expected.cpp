#include "tests/campaign/expected.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "host_tools/effects/effects.hpp"
#include "host_tools/effects/identified_model.hpp"
#include "host_tools/effects/robot_columns.hpp"
#include "host_tools/excite/effect_information.hpp"
#include "host_tools/regression/regressor.hpp"

namespace fxdyn::campaign {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double row_s = 0.01;  ///< one row of these stands for so much of the plan

/// Columns of all joints and motions one above the other, each joint in its noise.
class Stack {
 public:
  Stack(const Plan& plan, const NoiseLevel& noise) : stride_(stride(plan)) {
    for (const Motion& motion : plan.motions) samples_.push_back((motion.q.rows() - 1) / stride_ + 1);
    // One row stands for so many samples of the log.
    const double weight = std::sqrt(plan.motions.front().step_s * static_cast<double>(stride_) / noise.step_s);
    sigma_.resize(static_cast<Index>(plan.joints()));
    for (Index j = 0; j < sigma_.size(); ++j)
      sigma_[j] = noise.per_sample() * plan.healthy.joints[static_cast<std::size_t>(j)].rated_torque / weight;
  }
  Index rows() const { return std::accumulate(samples_.begin(), samples_.end(), Index{0}) * sigma_.size(); }
  void put(Eigen::Ref<MatrixXd> to, std::size_t motion, Index joint, const MatrixXd& columns) const {
    const Index before =
        std::accumulate(samples_.begin(), samples_.begin() + static_cast<std::ptrdiff_t>(motion), Index{0});
    to.middleRows(before * sigma_.size() + joint * samples_[motion], samples_[motion]) =
        columns(Eigen::seqN(0, samples_[motion], stride_), Eigen::all) / sigma_[joint];
  }

 private:
  static Index stride(const Plan& plan) {
    return std::max<Index>(1, static_cast<Index>(std::llround(row_s / plan.motions.front().step_s)));
  }
  Index stride_;
  std::vector<Index> samples_;
  VectorXd sigma_;
};

/// A sign that is narrower than the joint's own is that one (ShapeValues::least_of_sign).
bool is_the_sign(const EffectInfo& info, const std::vector<double>& shape, double sign_width) {
  for (std::size_t i = 0; i < info.shape.size(); ++i) {
    if (shape[i] < info.shape[i].values.least_of_sign * sign_width) return true;
  }
  return false;
}

std::vector<std::pair<EffectCandidate, std::string>> rivals(const Plan& plan, const std::vector<std::string>& names,
                                                            std::size_t joint) {
  std::vector<MatrixXd> structural;
  IdentifiedModel rigid = plan.healthy;
  for (JointFit& fit : rigid.joints) fit.effects.clear();
  for (const Motion& motion : plan.motions) structural.push_back(torque_of(rigid, motion));
  std::vector<std::pair<EffectCandidate, std::string>> list;
  for (const EffectInfo& info : effect_infos()) {
    const std::string name(info.name);
    if (!info.sought() || std::find(names.begin(), names.end(), name) != names.end()) continue;
    // A sine of one chosen wavenumber explains no other effect; free ones would have to be searched.
    if (name == "ripple") continue;
    for (const auto& shape : typical_shapes(name, joint, plan.healthy.robot, plan.motions, plan.torque, structural)) {
      if (!is_the_sign(info, shape, plan.healthy.joints[joint].sign_width))
        list.push_back({{name, joint, shape}, name});
    }
  }
  return list;
}

/// All that identification is free to move.
MatrixXd nuisance(const Plan& plan, bool baseline, const Stack& stack) {
  const auto n = static_cast<Index>(plan.joints());
  const DhChain chain = to_dh(plan.healthy.robot);
  const BaseSet base = baseline ? BaseSet{} : find_base(chain);
  const auto base_size = static_cast<Index>(base.columns.size());
  const Index own = baseline ? 3 : 4;
  MatrixXd all = MatrixXd::Zero(stack.rows(), base_size + own * n);
  Regressor regressor(chain);
  for (std::size_t m = 0; m < plan.motions.size(); ++m) {
    const Motion& motion = plan.motions[m];
    std::vector<MatrixXd> rows(plan.joints(), MatrixXd(motion.q.rows(), base_size));
    for (Index k = 0; k < motion.q.rows() && base_size > 0; ++k) {
      const MatrixXd& y = regressor(motion.q.row(k), motion.dq.row(k), motion.ddq.row(k));
      for (Index j = 0; j < n; ++j) {
        for (Index c = 0; c < base_size; ++c)
          rows[static_cast<std::size_t>(j)](k, c) = y(j, base.columns[static_cast<std::size_t>(c)]);
      }
    }
    for (Index j = 0; j < n; ++j) {
      if (base_size > 0) stack.put(all.leftCols(base_size), m, j, rows[static_cast<std::size_t>(j)]);
      MatrixXd friction(motion.q.rows(), own);
      const double width = plan.healthy.joints[static_cast<std::size_t>(j)].sign_width;
      friction.col(0) = motion.dq.col(j);
      friction.col(1) = (motion.dq.col(j).array() / width).tanh();
      friction.col(2).setOnes();
      if (!baseline) friction.col(3) = motion.ddq.col(j);
      stack.put(all.middleCols(base_size + own * j, own), m, j, friction);
    }
  }
  return all;
}

/// Removes from `columns` what `basis` can take of them. Directions that are rounding are left out.
void project_out(const MatrixXd& basis, MatrixXd& columns) {
  const VectorXd norm = basis.colwise().norm().transpose().cwiseMax(1e-300);
  const MatrixXd unit = basis * norm.cwiseInverse().asDiagonal();
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(unit.transpose() * unit);
  const VectorXd& values = eigen.eigenvalues();
  const VectorXd inverse = values.unaryExpr([&](double v) { return v > 1e-10 * values.maxCoeff() ? 1 / v : 0.0; });
  for (int pass = 0; pass < 2; ++pass) {  // the second one takes the rounding of the first
    const MatrixXd product = eigen.eigenvectors().transpose() * (unit.transpose() * columns);
    columns -= unit * (eigen.eigenvectors() * (inverse.asDiagonal() * product));
  }
}

/// An effect of one coefficient that would have to be below its bound is no rival: less friction is no Stribeck effect.
bool is_impossible(const std::string& effect, const Eigen::Ref<const MatrixXd>& columns, const VectorXd& wanted) {
  const EffectInfo& info = *find_effect(effect);
  return info.linear.size() == 1 && info.linear[0].lower >= 0 && columns.cols() == 1 && columns.col(0).dot(wanted) < 0;
}

}  // namespace

double NoiseLevel::per_sample() const {
  return std::sqrt(white * white + coloured * coloured * (1 + pole) / (1 - pole));
}

Expected expect(const Plan& plan, const std::vector<MatrixXd>& change, const std::vector<std::string>& names,
                std::size_t joint, bool baseline, const NoiseLevel& noise) {
  const Stack stack(plan, noise);
  const auto n = static_cast<Index>(plan.joints());
  const auto candidates = rivals(plan, names, joint);
  std::vector<Index> first{1};
  for (const auto& [candidate, name] : candidates)
    first.push_back(first.back() + static_cast<Index>(column_names(name, JointType::revolute).size()));
  MatrixXd all = MatrixXd::Zero(stack.rows(), first.back());
  for (std::size_t m = 0; m < plan.motions.size(); ++m) {
    for (Index j = 0; j < n; ++j) stack.put(all.leftCols(1), m, j, change[m].col(j));
    const RobotColumns columns(plan.healthy, plan.motions[m]);
    for (std::size_t i = 0; i < candidates.size(); ++i) {
      const EffectColumns full = columns(candidates[i].first);
      for (Index j = 0; j < n; ++j) {
        const MatrixXd& c = full.joints[static_cast<std::size_t>(j)];
        if (c.size() > 0) stack.put(all.middleCols(first[i], c.cols()), m, j, c);
      }
    }
  }
  const double before = all.col(0).norm();
  project_out(nuisance(plan, baseline, stack), all);

  Expected expected;
  expected.chi = expected.rival_chi = all.col(0).norm();
  expected.share = before > 0 ? expected.chi / before : 0;
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    const auto columns = all.middleCols(first[i], first[i + 1] - first[i]);
    if (is_impossible(candidates[i].second, columns, all.col(0))) continue;
    MatrixXd left = all.leftCols(1);
    project_out(columns, left);
    if (left.norm() >= expected.rival_chi) continue;
    expected.rival_chi = left.norm();
    expected.rival = candidates[i].second;
  }
  return expected;
}

std::string to_string(const Expected& expected) {
  if (expected.chi < visible_chi) return "hidden";
  return expected.rival_chi < distinct_chi ? "ambiguous" : "visible";
}

}  // namespace fxdyn::campaign
