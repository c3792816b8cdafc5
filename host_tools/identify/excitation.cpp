#include "host_tools/identify/excitation.hpp"

#include <algorithm>
#include <cmath>

#include "host_tools/support/random.hpp"

namespace fxdyn {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

std::vector<WeakParameter> weak_in_logs(const Fitter& fitter, const Solution& solution,
                                        const StructureOptions& options) {
  const auto n = static_cast<Index>(fitter.joints());
  const auto& columns = fitter.base().columns;
  const auto nb = static_cast<Index>(columns.size());

  // Share of rated torque that one unit of each parameter can take.
  VectorXd share = VectorXd::Zero(nb);
  Regressor regressor(fitter.chain());
  Random random(5);
  for (int motion = 0; motion < 300; ++motion) {
    VectorXd q(n), dq(n), ddq(n);
    for (Index j = 0; j < n; ++j) {
      const JointFit& joint = fitter.design(static_cast<std::size_t>(j));
      q[j] = random.uniform(joint.q_lower, joint.q_upper);
      dq[j] = random.uniform(-joint.dq_limit, joint.dq_limit);
      ddq[j] = random.uniform(-joint.ddq_limit, joint.ddq_limit);
    }
    const MatrixXd& y = regressor(q, dq, ddq);
    for (Index j = 0; j < n; ++j) {
      const double rated = fitter.design(static_cast<std::size_t>(j)).rated_torque;
      for (Index c = 0; c < nb; ++c)
        share[c] = std::max(share[c], std::fabs(y(j, columns[static_cast<std::size_t>(c)])) / rated);
    }
  }

  // How much each joint moved, of what its limits allow.
  VectorXd movement = VectorXd::Zero(n);
  for (const ProcessedLog& log : fitter.logs()) {
    if (log.role != Role::train) continue;
    for (Index j = 0; j < n; ++j) {
      if (log.is_left_out(j)) continue;
      const JointFit& joint = fitter.design(static_cast<std::size_t>(j));
      const double fastest = log.joint_motion(j).dq.cwiseAbs().maxCoeff();
      movement[j] = std::max(movement[j], log.q_range[j] / (joint.q_upper - joint.q_lower) * fastest / joint.dq_limit);
    }
  }

  // Directions without information: eigenvectors of the base parameters' part, columns of length one.
  const MatrixXd information = fitter.normal_equations().information.topLeftCorner(nb, nb);
  const VectorXd scale = information.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(scale.asDiagonal() * information * scale.asDiagonal());
  std::vector<WeakParameter> weak;
  for (Index c = 0; c < nb; ++c) {
    double lost = 0;
    for (Index k = 0; k < nb && eigen.eigenvalues()[k] < options.no_information; ++k)
      lost += eigen.eigenvectors()(c, k) * eigen.eigenvectors()(c, k);
    const Index column = columns[static_cast<std::size_t>(c)];
    WeakParameter parameter;
    parameter.name = parameter_name(column);
    parameter.error = solution.beta_std[c] * share[c];
    parameter.identifiable = lost < options.lost;
    if (parameter.identifiable && parameter.error < options.worrying_error) continue;
    // all joints up to its link move it
    movement.head(column / static_cast<Index>(parameters_per_link) + 1).minCoeff(&parameter.joint);
    weak.push_back(parameter);
  }
  return weak;
}

}  // namespace fxdyn
