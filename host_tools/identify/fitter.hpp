#pragma once

#include <Eigen/Dense>
#include <vector>

#include "host_tools/identify/dataset.hpp"
#include "host_tools/identify/regressor.hpp"
#include "host_tools/model/effects.hpp"

namespace fxdyn {

/// Sums of products over the rows of one block for one joint: base columns, then the joint's own columns, and torque.
struct Moments {
  Eigen::MatrixXd gram;
  Eigen::VectorXd projection;
  double square = 0;  ///< of the torque
  Eigen::Index count = 0;
};

/// Linear parameters of one fit.
struct Solution {
  Eigen::VectorXd beta;
  std::vector<Eigen::VectorXd> theta;  ///< per joint, the joint's own columns
  Eigen::VectorXd beta_std;
  std::vector<Eigen::VectorXd> theta_std;
};

/// X^T W X and X^T W tau over [beta; all joints' own coefficients in chain order], the ridge of BLS included.
struct NormalEquations {
  Eigen::MatrixXd information;
  Eigen::VectorXd projection;
};

/// Which blocks fit and which judge. With `validate` logs: train fits, validate judges. Without: every train log is
/// judged by a fit of the others; a single one is cut into five contiguous blocks.
struct Split {
  std::vector<std::vector<std::size_t>> fit, judge;  ///< block numbers, one entry a fold
  bool has_validation = false;
  std::string kind;  ///< for people
};

/// How one joint did on the rows that judge.
struct Judgement {
  double rmse = 1e300;         ///< of the residual over all judging blocks [N*m | N]
  std::vector<double> blocks;  ///< RMSE of each judging block
  bool physical = true;        ///< the effect that was added last keeps its bounds in every fold
  double coefficient_sum = 0;  ///< sum of |c| of the BLS, most of any fold [N*m | N]

  bool blocks_of_one_log =
      false;  ///< the blocks resemble the fit's data: four times the improvement is asked for, on every block

  /// Better by `worth` over all, better at all on three blocks in four, and physical.
  bool beats(const Judgement& other, double worth) const;
};

/// Structure and effects of all joints fitted together by weighted least squares, with moments kept by block so that a
/// fold costs one small solve. The design of a joint (its effects' shapes, its BLS) can be replaced at any time.
class Fitter {
 public:
  /// @throws DataError: a joint that never moves, fewer rows than parameters.
  Fitter(const Robot& robot, std::vector<ProcessedLog> logs, std::vector<JointFit> design);

  std::size_t joints() const { return design_.size(); }
  const BaseSet& base() const { return base_; }
  const std::vector<ProcessedLog>& logs() const { return logs_; }
  const JointFit& design(std::size_t joint) const { return design_[joint]; }
  /// What judges, in words.
  const std::string& gate() const { return split_.kind; }

  void set_design(std::size_t joint, JointFit design);

  /// Effects whose columns are, on the train rows, sums of base columns and of the effects before them (relative 1e-5):
  /// these logs can't tell them apart.
  struct Dependent {
    std::size_t joint, effect;
  };
  std::vector<Dependent> dependent_effects() const;
  /// Weights are one over the residual's variance of each joint (1 for ordinary least squares).
  void set_weights(const Eigen::VectorXd& weights) { weights_ = weights; }
  /// Two rounds of reweighting from the residuals of the train logs.
  void reweight();

  /// Each joint on the judging blocks.
  std::vector<Judgement> held_out() const;
  /// One joint with another design in place of the current one, for each ridge value of its BLS.
  std::vector<Judgement> held_out_with(std::size_t joint, const JointFit& design,
                                       const std::vector<double>& ridges) const;

  /// The fit on all train rows.
  Solution fit() const;
  /// What fit() solves.
  NormalEquations normal_equations() const;
  IdentifiedModel to_model(const Solution& solution) const;

 private:
  struct Block {
    std::size_t log;
    Eigen::Index from, to;  ///< of the log's decimated rows
    bool train;
  };
  Eigen::MatrixXd own_columns(std::size_t log, std::size_t joint, const JointFit& design) const;
  std::vector<Moments> moments(std::size_t joint, const JointFit& design) const;
  static Eigen::VectorXd ridge_of(const JointFit& design, double ridge, Eigen::Index count);
  NormalEquations assemble(const std::vector<std::size_t>& blocks,
                           const std::vector<const std::vector<Moments>*>& moments,
                           const std::vector<const JointFit*>& design) const;
  Solution solve(const std::vector<std::size_t>& blocks, const std::vector<const std::vector<Moments>*>& moments,
                 const std::vector<const JointFit*>& design, bool with_std) const;
  /// Joints `first` .. `last` - 1.
  std::vector<Judgement> judged(std::size_t first, std::size_t last,
                                const std::vector<const std::vector<Moments>*>& moments,
                                const std::vector<const JointFit*>& design) const;
  std::vector<std::size_t> train_blocks() const;

  Robot robot_;
  std::vector<ProcessedLog> logs_;
  std::vector<JointFit> design_;
  BaseSet base_;
  std::vector<std::vector<Eigen::MatrixXd>> base_rows_;    ///< [log][joint]: rows x base
  std::vector<std::vector<Eigen::VectorXd>> torque_rows_;  ///< [log][joint]
  std::vector<Block> blocks_;
  Split split_;
  std::vector<std::vector<Moments>> moments_;  ///< [joint][block]
  Eigen::VectorXd weights_;
};

/// phi of all a joint's columns at full rate: its effects in order, then the BLS.
Eigen::MatrixXd design_columns(const JointFit& design, const JointSeries& series);

}  // namespace fxdyn
