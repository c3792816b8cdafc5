#include "host_tools/regression/base_prior.hpp"

#include <fmt/format.h>

#include "host_tools/regression/pseudo_inertia.hpp"
#include "host_tools/support/error.hpp"

namespace fxdyn {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

BasePrior prior_of_urdf(const Robot& robot, const DhChain& chain, const BaseSet& base, double relative_error) {
  constexpr auto ten = static_cast<Index>(parameters_per_link);
  const Index all = base.grouping.cols();
  MatrixXd covariance = MatrixXd::Zero(all, all);
  VectorXd mean = VectorXd::Zero(all);
  for (std::size_t i = 0; i < robot.size(); ++i) {
    const auto& given = robot.joints[i].inertial;
    if (!given) throw InputError(fmt::format("link {} has no <inertial> in the URDF", robot.joints[i].link));
    const Eigen::Matrix4d body = pseudo_inertia(to_link_inertia(possible_body(*given), chain.urdf_in_dh[i]));
    const Index at = static_cast<Index>(i) * ten;
    mean.segment(at, ten) = pseudo_inertia_parameters(body);
    covariance.block(at, at, ten, ten) = relative_error * relative_error * barrier_hessian(body.inverse()).inverse();
  }
  BasePrior prior;
  prior.mean = base.grouping * mean;
  const MatrixXd of_base = base.grouping * covariance * base.grouping.transpose();
  prior.information = Eigen::LLT<MatrixXd>(of_base).solve(MatrixXd::Identity(of_base.rows(), of_base.cols()));
  for (Index j = 0; j < static_cast<Index>(robot.size()); ++j) {
    const VectorXd rotor = rotor_in_base(chain, base, j);
    if (rotor.size() == 0) continue;
    const VectorXd taken = prior.information * rotor;
    prior.information -= taken * taken.transpose() / rotor.dot(taken);
  }
  prior.information = ((prior.information + prior.information.transpose()) / 2).eval();
  return prior;
}

}  // namespace fxdyn
