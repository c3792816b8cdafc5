#include "tests/campaign/plan.hpp"

#include "host_tools/effects/effects.hpp"
#include "host_tools/effects/evaluator.hpp"
#include "host_tools/effects/identified_model.hpp"

namespace fxdyn::campaign {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

MatrixXd torque_of(const IdentifiedModel& model, const Motion& motion, MatrixXd* deflections) {
  return predict(model, motion.q, motion.dq, motion.ddq, motion.step_s, deflections, motion.t[0]);
}

Plan make_plan(const IdentifiedModel& healthy, std::vector<Motion> motions) {
  Plan plan;
  plan.healthy = healthy;
  plan.motions = std::move(motions);
  IdentifiedModel rigid = healthy;
  for (JointFit& joint : rigid.joints) joint.effects.clear();
  const auto n = static_cast<Index>(plan.joints());
  plan.largest_velocity = plan.largest_torque = plan.largest_structural = VectorXd::Zero(n);
  plan.range = MatrixXd(n, 2);
  for (std::size_t m = 0; m < plan.motions.size(); ++m) {
    const Motion& motion = plan.motions[m];
    plan.torque.push_back(torque_of(healthy, motion));
    const MatrixXd structural = torque_of(rigid, motion);
    const auto raise = [](VectorXd& largest, const MatrixXd& columns) {
      largest = largest.cwiseMax(columns.cwiseAbs().colwise().maxCoeff().transpose());
    };
    raise(plan.largest_velocity, motion.dq);
    raise(plan.largest_torque, plan.torque.back());
    raise(plan.largest_structural, structural);
    const VectorXd low = motion.q.colwise().minCoeff(), high = motion.q.colwise().maxCoeff();
    plan.range.col(0) = m == 0 ? low : VectorXd(plan.range.col(0).cwiseMin(low));
    plan.range.col(1) = m == 0 ? high : VectorXd(plan.range.col(1).cwiseMax(high));
  }
  return plan;
}

IdentifiedModel with_effect(IdentifiedModel model, std::optional<std::size_t> joint, const EffectFit& fit) {
  (joint ? model.joints[*joint].effects : model.body).push_back(fit);
  return model;
}

std::vector<MatrixXd> torque_change(const Plan& plan, const IdentifiedModel& changed) {
  std::vector<MatrixXd> change;
  for (std::size_t m = 0; m < plan.motions.size(); ++m) {
    change.emplace_back(torque_of(changed, plan.motions[m]) - plan.torque[m]);
  }
  return change;
}

VectorXd shares_of_rated(const Plan& plan, const std::vector<MatrixXd>& torque) {
  VectorXd power = VectorXd::Zero(static_cast<Index>(plan.joints()));
  double samples = 0;
  for (const MatrixXd& piece : torque) {
    power += piece.colwise().squaredNorm().transpose();
    samples += static_cast<double>(piece.rows());
  }
  for (std::size_t j = 0; j < plan.joints(); ++j) {
    const auto col = static_cast<Index>(j);
    power[col] = std::sqrt(power[col] / samples) / plan.healthy.joints[j].rated_torque;
  }
  return power;
}

}  // namespace fxdyn::campaign
