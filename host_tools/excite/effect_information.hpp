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

/// Information on columns that is left when those of a nuisance are fitted too: columns - cross^T nuisance^+ cross.
/// Rank of the nuisance: eigenvalues above 1e-12 of the largest, its diagonal normalised to 1.
Eigen::MatrixXd information_left(const Eigen::MatrixXd& columns, const Eigen::MatrixXd& cross,
                                 const Eigen::MatrixXd& nuisance);

/// first, first + 1, .. first + count - 1
std::vector<Eigen::Index> columns_from(Eigen::Index first, Eigen::Index count);

/// Columns of all effects over all motions, as information: sums over rows of products, weighted so that the unit is
/// one over a coefficient's variance.
struct Information {
  /// Of the whole catalogue with its typical shapes. @param noise, torque_cutoff_hz: see SightSettings
  Information(const IdentifiedModel& nominal, const std::vector<Motion>& motions, const Eigen::VectorXd& noise,
              std::optional<double> torque_cutoff_hz, Progress& progress);
  /// Of these alone, each a block after the nominal ones.
  Information(const IdentifiedModel& nominal, const std::vector<Motion>& motions, const Eigen::VectorXd& noise,
              std::optional<double> torque_cutoff_hz, const std::vector<EffectCandidate>& candidates);

  FilterFit filter;
  double seconds = 0, independent_samples = 0;
  Eigen::VectorXd noise;      ///< within the cut-off [N*m | N]
  Eigen::Index base = 0;      ///< base parameters: the first columns
  std::vector<Block> blocks;  ///< of the effects; nominal ones first
  std::size_t nominal_blocks = 0;
  Eigen::MatrixXd gram;

 private:
  void measure(const IdentifiedModel& nominal, const std::vector<Motion>& motions, const Eigen::VectorXd& noise,
               std::optional<double> torque_cutoff_hz, const std::vector<EffectCandidate>* candidates,
               Progress* progress);
  void add_blocks(const Robot& robot, const std::vector<EffectCandidate>& candidates);
  void add_motion(const Motion& motion, const Log& log, const RobotColumns& columns, const Eigen::VectorXd& noise,
                  const DhChain& chain, const BaseSet& base_set, Progress* progress);
};

}  // namespace fxdyn
