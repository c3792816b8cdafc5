#include "host_tools/regression/judgement.hpp"

#include "host_tools/effects/effects.hpp"
#include "host_tools/effects/joint_fit.hpp"

namespace fxdyn {

bool Judgement::beats(const Judgement& other, double worth, const JudgementOptions& options) const {
  if (!(rmse < (1 - (blocks_of_one_log ? options.of_one_log : 1) * worth) * other.rmse) || !physical) return false;
  std::size_t better = 0;
  for (std::size_t b = 0; b < blocks.size(); ++b) better += blocks[b] < other.blocks[b];
  const double least = (blocks_of_one_log ? 1 : options.better_blocks) * static_cast<double>(blocks.size());
  return static_cast<double>(better) >= least;
}

bool last_is_physical(const JointFit& design, const Eigen::VectorXd& theta, const JudgementOptions& options) {
  if (design.effects.empty() || design.bls) return true;
  const auto& parameters = find_effect(design.effects.back().effect)->linear;
  Eigen::Index at = theta.size();
  for (std::size_t i = parameters.size(); i-- > 0;) {
    --at;
    if (theta[at] < parameters[i].lower || theta[at] > parameters[i].upper) return false;
  }
  // It takes the place of another one (presliding that of Coulomb's sign): much less of it is something else.
  const std::string_view replaced = find_effect(design.effects.back().effect)->replaces;
  for (std::size_t i = 0; i < design.effects.size(); ++i) {
    if (design.effects[i].effect == replaced)
      return theta[at] > options.least_of_replaced * theta[static_cast<Eigen::Index>(i)];
  }
  return true;
}

}  // namespace fxdyn
