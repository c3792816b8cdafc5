#pragma once

#include <Eigen/Dense>
#include <array>
#include <optional>
#include <vector>

#include "host_tools/effects/robot_columns.hpp"
#include "host_tools/regression/dataset.hpp"
#include "host_tools/regression/regressor.hpp"
#include "host_tools/signals/motion.hpp"
#include "host_tools/support/progress.hpp"

namespace fxdyn {

/// What the nominal model has on every joint beside the base parameters.
inline constexpr std::array nominal_effects{"viscous", "coulomb", "offset", "rotor_inertia"};

/// The columns [first, first + count) of one effect with one shape.
struct Block {
  EffectCandidate candidate;
  bool on_body = false;
  Eigen::Index first = 0, count = 0;
  std::vector<Eigen::MatrixXd> raw{};  ///< per joint: mean of phi phi^T, unfiltered; 0 x 0 where it does not reach
};

/// Shapes for which an effect at a joint is judged, the typical one first:
///   Stribeck velocity 2.5, 1, 5 % of the joint's largest velocity; presliding distance 3, 1, 9 mrad (1e-4, 3e-5, 3e-4
///   m if prismatic); ripple 20, 4, 100 rad^-1 (600, 120, 3000 m^-1); time constant of drift 1, 0.3, 3 times the
///   longest motion; saturation at 85, 70, 95 % of the largest torque; every other joint for couplings, the one before
///   first; delay 2, 1, 4 ms; relaxation of elasticity 1, 5 ms; torque scale of backlash 5, 2, 10 % of the largest
///   rigid torque.
/// @param torque, structural of RobotColumns, one a motion
/// @throws InputError: a shape parameter for which no typical value is known
std::vector<std::vector<double>> typical_shapes(std::string_view effect, std::size_t joint, const Robot& robot,
                                                const std::vector<Motion>& motions,
                                                const std::vector<Eigen::MatrixXd>& torque,
                                                const std::vector<Eigen::MatrixXd>& structural);

/// first, first + 1, .. first + count - 1
std::vector<Eigen::Index> columns_from(Eigen::Index first, Eigen::Index count);

/// Columns of all effects over all motions, as information: sums over rows of products, weighted so that the unit is
/// one over a coefficient's variance.
struct Information {
  /// @param noise, torque_cutoff_hz: see SightSettings
  Information(const IdentifiedModel& nominal, const std::vector<Motion>& motions, const Eigen::VectorXd& noise,
              std::optional<double> torque_cutoff_hz, Progress& progress);

  FilterFit filter;
  double seconds = 0, independent_samples = 0;
  Eigen::VectorXd noise;      ///< within the cut-off [N*m | N]
  Eigen::Index base = 0;      ///< base parameters: the first columns
  std::vector<Block> blocks;  ///< of the effects; nominal ones first
  std::size_t nominal_blocks = 0;
  Eigen::MatrixXd gram;

 private:
  void add_blocks(const IdentifiedModel& nominal, const std::vector<Motion>& motions,
                  const std::vector<RobotColumns>& columns);
  void add_motion(const Motion& motion, const Log& log, const RobotColumns& columns, const Eigen::VectorXd& noise,
                  const DhChain& chain, const BaseSet& base_set, Progress& progress);
};

}  // namespace fxdyn
