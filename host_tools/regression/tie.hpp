#pragma once

#include <Eigen/Dense>
#include <optional>

#include "host_tools/effects/joint_fit.hpp"

namespace fxdyn {

/// Two linear parameters of a joint where one says the other. Of an effect that takes Coulomb's place and says which
/// share of it is left while sliding (LuGre: Fc = share Fs), Coulomb's amplitude is share times its first parameter:
/// the sign cancels, and neither its amplitude nor its width is free.
struct Tie {
  Eigen::Index part, whole;   ///< own columns of the joint: part = share * whole
  std::size_t effect, shape;  ///< where `share` is, in the design
  double share;
};

/// The tie of a joint; none where it has no such effect.
std::optional<Tie> tie_of(const JointFit& design);

/// How much a tie weighs, in rows: so much that the rows cannot bend it.
inline constexpr double rows_of_tie = 1e4;

}  // namespace fxdyn
