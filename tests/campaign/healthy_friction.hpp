#pragma once

#include <Eigen/Dense>

#include "tests/campaign/case.hpp"

namespace fxdyn::campaign {

/// Constants of a joint's dry friction, drawn by its size.
struct DryFriction {
  Friction kind = Friction::catalogue;
  double coulomb = 0;   ///< Fc [N*m | N]
  double width = 0;     ///< of the catalogue's sign [rad/s | m/s]
  double excess = 0;    ///< Fs / Fc - 1 (LuGre)
  double stribeck = 0;  ///< [rad/s | m/s] (LuGre, smooth sign)
  double distance = 0;  ///< presliding [rad | m]
  double damping = 0;   ///< sigma1 [N*m*s/rad | N*s/m] (LuGre)
};
DryFriction draw_friction(Friction kind, double coulomb, double width, double largest_velocity, double inertia,
                          bool turns, std::uint64_t seed);

/// Its torque over a joint's sampled motion less the catalogue's coulomb effect, Fc tanh(dq / width): what is to be
/// added to the torque of a scenario that has that. Code of the campaign's own.
///   lugre:   dz/dt = v - sigma0 |v| z / g(v), F = sigma0 z + sigma1 dz/dt; velocity linear between samples, implicit
///            midpoint in steps of 50 us at most
///   maxwell: six springs in parallel, each of which slips at a force of its own
///   smooth_sign: Fc v / sqrt(v^2 + w^2) (1 + excess / (1 + (v / vs)^2))
Eigen::VectorXd added_friction(const DryFriction& friction, const Eigen::VectorXd& t, const Eigen::VectorXd& dq);

}  // namespace fxdyn::campaign
