#pragma once

#include <Eigen/Dense>
#include <optional>
#include <vector>

#include "host_tools/effects/forward.hpp"
#include "host_tools/effects/robot_columns.hpp"
#include "host_tools/regression/dataset.hpp"
#include "host_tools/regression/regressor.hpp"
#include "host_tools/signals/motion.hpp"
#include "host_tools/support/progress.hpp"

namespace fxdyn {

/// The columns [first, first + count) of one effect with one shape.
struct Block {
  EffectCandidate candidate;
  bool on_body = false;
  Eigen::Index first = 0, count = 0;
  std::vector<Eigen::MatrixXd> raw{};  ///< per joint: mean of phi phi^T, unfiltered; 0 x 0 where it does not reach
};

/// Shapes for which an effect at a joint is judged, the typical one first: what its parameters declare
/// (ShapeValues::judged) for the joint's motions.
/// @param torque, structural of RobotColumns, one a motion
/// @throws InputError: no such effect
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
