#pragma once

#include <Eigen/Dense>
#include <vector>

#include "host_tools/effects/forward.hpp"

namespace fxdyn {

/// LuGre friction in its physical parameters (Canudas de Wit et al. 1995, paper Eqs. 20-21), integrated as an ordinary
/// differential equation: the plants' own code, which judges the model's effect `lugre` and shares nothing with it.
///   dz/dt = v - sigma0 |v| z / g(v),  g(v) = Fc + (Fs - Fc) exp(-(v / vs)^2),  F = sigma0 z + sigma1 dz/dt
class LuGreBristles {
 public:
  /// @param effect fit of the effect `lugre`
  explicit LuGreBristles(const EffectFit& effect);
  /// Over `seconds` in which the velocity goes from v0 to v1 linearly, in steps of at most 20 us, one of them ending
  /// where the velocity turns: fourth-order Runge-Kutta. Where bristles settle within a step it would diverge; there a
  /// step is the solution for the velocity in its middle. @return F at the end [N*m | N]
  double advance(double v0, double v1, double seconds);
  double coulomb() const { return coulomb_; }  ///< Fc [N*m | N]

 private:
  void integrate(double v0, double v1, double seconds);
  double sliding(double v) const;         ///< g(v) [N*m | N]
  double rate(double z, double v) const;  ///< dz/dt [rad/s | m/s]

  double sigma0_, sigma1_, coulomb_, static_, stribeck_;
  double z_ = 0;  ///< bristle deflection [rad | m]
};

/// Whether a joint of the plant has the effect.
bool has_lugre(const IdentifiedModel& plant);

/// Takes the effect out of all joints: what is left is the model's own evaluator's.
void take_out_lugre(std::vector<JointFit>& joints);

/// Torque of the plant's `lugre` effects on a sampled motion whose velocity is linear between samples, samples x
/// joints: F - Fc s, s the joint's Coulomb sign, so that it adds up with the effect `coulomb` as the model's does.
Eigen::MatrixXd lugre_torque(const IdentifiedModel& plant, const Eigen::MatrixXd& dq, double step_s);

}  // namespace fxdyn
