#pragma once

#include "tests/campaign/plan.hpp"

namespace fxdyn::campaign {

/// What can be told of a torque change beforehand, from the motion and the noise alone.
struct Expected {
  double chi = 0;        ///< standard deviations by which it stands out once the nuisance has taken its part
  double share = 0;      ///< what the nuisance leaves of it (RMS)
  std::string rival;     ///< effect of the catalogue that comes nearest to it
  double rival_chi = 0;  ///< standard deviations that the best rival leaves: how well it is told from all others
};

/// Noise that counts against an effect, per sample, share of rated torque: white noise and, at the frequencies of
/// motions, the level of the coloured one.
struct NoiseLevel {
  double white = 0.01, coloured = 0.003, pole = 0.95, step_s = 0.002;
  double per_sample() const;
};

/// @param names what it is truly called, not counted as a rival
/// @param joint where rivals are tried, beside those on the body
/// The nuisance is friction (viscous, coulomb, offset) where a healthy recording fixes the rest, else all that is
/// nominal.
Expected expect(const Plan& plan, const std::vector<Eigen::MatrixXd>& change, const std::vector<std::string>& names,
                std::size_t joint, bool baseline, const NoiseLevel& noise);

constexpr double visible_chi = 8, distinct_chi = 5;
/// "visible", "ambiguous" (another effect explains it as well) or "hidden"
std::string to_string(const Expected& expected);

}  // namespace fxdyn::campaign
