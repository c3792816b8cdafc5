#include "tests/diagnosis/expected.hpp"

#include <algorithm>
#include <cmath>

#include "host_tools/excite/effect_information.hpp"
#include "host_tools/identify/regressor.hpp"
#include "host_tools/model/effects.hpp"
#include "host_tools/model/robot_columns.hpp"

namespace fxdyn::campaign {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr Index stride = 2;  ///< rows of the plan that are used

/// Columns of all joints one above the other, each joint in its noise.
class Stack {
 public:
  Stack(Index samples, VectorXd sigma) : samples_(samples), sigma_(std::move(sigma)) {}
  Index rows() const { return samples_ * sigma_.size(); }
  void put(Eigen::Ref<MatrixXd> to, Index joint, const MatrixXd& columns) const {
    to.middleRows(joint * samples_, samples_) = columns(Eigen::seqN(0, samples_, stride), Eigen::all) / sigma_[joint];
  }

 private:
  Index samples_;
  VectorXd sigma_;
};

std::vector<std::pair<EffectCandidate, std::string>> rivals(const Plan& plan, const std::vector<std::string>& names,
                                                            std::size_t joint, const RobotColumns& columns) {
  std::vector<std::pair<EffectCandidate, std::string>> list;
  for (const EffectInfo& info : effect_infos()) {
    const std::string name(info.name);
    const bool nominal = std::find(nominal_effects.begin(), nominal_effects.end(), name) != nominal_effects.end();
    if (nominal || std::find(names.begin(), names.end(), name) != names.end()) continue;
    // A sine of one chosen wavenumber explains no other effect; free ones would have to be searched.
    if (name == "ripple") continue;
    for (const auto& shape :
         typical_shapes(name, joint, plan.healthy.robot, plan.motions, {columns.torque()}, {columns.structural()}))
      list.push_back({{name, joint, shape}, name});
  }
  return list;
}

/// All that identification is free to move.
MatrixXd nuisance(const Plan& plan, const Motion& motion, bool baseline, const Stack& stack) {
  const auto n = static_cast<Index>(plan.joints());
  const DhChain chain = to_dh(plan.healthy.robot);
  const BaseSet base = baseline ? BaseSet{} : find_base(chain);
  const auto base_size = static_cast<Index>(base.columns.size());
  const Index own = baseline ? 3 : 4;
  MatrixXd all = MatrixXd::Zero(stack.rows(), base_size + own * n);
  if (!baseline) {
    Regressor regressor(chain);
    std::vector<MatrixXd> rows(plan.joints(), MatrixXd(motion.q.rows(), base_size));
    for (Index k = 0; k < motion.q.rows(); ++k) {
      const MatrixXd& y = regressor(motion.q.row(k), motion.dq.row(k), motion.ddq.row(k));
      for (Index j = 0; j < n; ++j) {
        for (Index c = 0; c < base_size; ++c)
          rows[static_cast<std::size_t>(j)](k, c) = y(j, base.columns[static_cast<std::size_t>(c)]);
      }
    }
    for (Index j = 0; j < n; ++j) stack.put(all.leftCols(base_size), j, rows[static_cast<std::size_t>(j)]);
  }
  for (Index j = 0; j < n; ++j) {
    MatrixXd friction(motion.q.rows(), own);
    const double width = plan.healthy.joints[static_cast<std::size_t>(j)].sign_width;
    friction.col(0) = motion.dq.col(j);
    friction.col(1) = (motion.dq.col(j).array() / width).tanh();
    friction.col(2).setOnes();
    if (!baseline) friction.col(3) = motion.ddq.col(j);
    stack.put(all.middleCols(base_size + own * j, own), j, friction);
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

}  // namespace

double NoiseLevel::per_sample() const {
  return std::sqrt(white * white + coloured * coloured * (1 + pole) / (1 - pole));
}

Expected expect(const Plan& plan, const std::vector<MatrixXd>& change, const std::vector<std::string>& names,
                std::size_t joint, bool baseline, const NoiseLevel& noise) {
  const Motion& motion = plan.motions.front();
  const Index samples = (motion.q.rows() - 1) / stride + 1;
  const auto n = static_cast<Index>(plan.joints());
  VectorXd sigma(n);
  // One row stands for so many samples of the log.
  const double weight = std::sqrt(motion.step_s * static_cast<double>(stride) / noise.step_s);
  for (Index j = 0; j < n; ++j)
    sigma[j] = noise.per_sample() * plan.healthy.joints[static_cast<std::size_t>(j)].rated_torque / weight;
  const Stack stack(samples, sigma);

  const RobotColumns columns(plan.healthy, motion);
  const auto candidates = rivals(plan, names, joint, columns);
  std::vector<EffectColumns> full;
  std::vector<Index> first;
  Index width = 1;
  for (const auto& [candidate, name] : candidates) {
    full.push_back(columns(candidate));
    first.push_back(width);
    for (const MatrixXd& c : full.back().joints) {
      if (c.size() == 0) continue;
      width += c.cols();
      break;
    }
  }
  first.push_back(width);
  MatrixXd all = MatrixXd::Zero(stack.rows(), width);
  for (Index j = 0; j < n; ++j) stack.put(all.leftCols(1), j, change.front().col(j));
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    for (Index j = 0; j < n; ++j) {
      const MatrixXd& c = full[i].joints[static_cast<std::size_t>(j)];
      if (c.size() > 0) stack.put(all.middleCols(first[i], c.cols()), j, c);
    }
  }
  const double before = all.col(0).norm();
  project_out(nuisance(plan, motion, baseline, stack), all);

  Expected expected;
  expected.chi = expected.rival_chi = all.col(0).norm();
  expected.share = before > 0 ? expected.chi / before : 0;
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    if (first[i + 1] == first[i]) continue;
    MatrixXd left = all.leftCols(1);
    project_out(all.middleCols(first[i], first[i + 1] - first[i]), left);
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
