#pragma once

#include <Eigen/Dense>
#include <memory>
#include <vector>

#include "host_tools/effects/effects.hpp"
#include "host_tools/effects/forward.hpp"
#include "host_tools/effects/joint_fit.hpp"
#include "host_tools/regression/base_prior.hpp"
#include "host_tools/regression/dataset.hpp"
#include "host_tools/regression/fit_data.hpp"
#include "host_tools/regression/judgement.hpp"
#include "host_tools/regression/products.hpp"
#include "host_tools/regression/regressor.hpp"
#include "host_tools/regression/square_root.hpp"

namespace fxdyn {

/// Sums of products over the rows of one block for one joint: base columns that act on the joint, its own columns, and
/// torque. The base part does not change with the joint's design.
struct BaseMoments {
  Eigen::MatrixXd gram;
  Eigen::VectorXd projection;
  double square = 0;  ///< of the torque
  double count = 0;   ///< rows, by their weights
};

/// Linear parameters of one fit.
struct Solution {
  Eigen::VectorXd beta;
  std::vector<Eigen::VectorXd> theta;  ///< per joint, the joint's own columns
  Eigen::VectorXd beta_std;
  std::vector<Eigen::VectorXd> theta_std;
  std::vector<bool> essential;  ///< per base parameter; empty: all
  std::vector<double> sign_width_std;
  std::vector<std::vector<std::vector<double>>> shape_std;  ///< [joint][effect][shape], 0: not estimated
  Eigen::MatrixXd covariance;                               ///< of x (NormalEquations)
  std::vector<double> freedom;                              ///< per joint: degrees of freedom of its estimate
};

/// The normal equations X^T W X x = X^T W y of a fit, x = [beta; theta of joint 1; theta of joint 2; ..].
struct NormalEquations {
  Eigen::MatrixXd information;
  Eigen::VectorXd projection;
  std::vector<Eigen::Index> offset;  ///< of each joint's theta in x; one more element: the number of unknowns
};

/// Structure and effects of all joints fitted together by weighted least squares, with moments kept by block so that a
/// fold costs one small solve. The design of a joint (its effects' shapes, its BLS) can be replaced at any time.
/// Copies share the regressor.
class Fitter {
 public:
  /// `logs` must outlive the fitter and its copies.
  /// @throws DataError: a joint that never moves, fewer rows than parameters.
  Fitter(const Robot& robot, const std::vector<ProcessedLog>& logs, std::vector<JointFit> design);
  Fitter(const Robot& robot, std::vector<ProcessedLog>&& logs, std::vector<JointFit> design) = delete;

  std::size_t joints() const { return design_.size(); }
  const BaseSet& base() const { return data_->base; }
  const DhChain& chain() const { return data_->chain; }
  const std::vector<ProcessedLog>& logs() const { return *data_->logs; }
  const JointFit& design(std::size_t joint) const { return design_[joint]; }
  /// What judges, in words.
  const std::string& gate() const { return data_->split.kind; }
  /// Whether logs judge that fit nothing.
  bool has_validation() const { return data_->split.has_validation; }

  void set_design(std::size_t joint, JointFit design);
  /// Of all joints, in parallel.
  void set_designs(std::vector<JointFit> designs);
  /// The torque columns are this far ahead of the motion (FilterFit::torque_lead_s).
  /// `filtered`: filtered_torque(), which does not change with the lead; made here if it is empty.
  void set_torque_lead(double seconds, const std::vector<Eigen::MatrixXd>& filtered = {});
  std::vector<Eigen::MatrixXd> filtered_torque() const;
  double torque_lead_s() const { return torque_lead_s_; }
  /// Of all logs.
  Eigen::Index rows() const { return data_->load_rows.front().size(); }

  /// Effects whose columns are, on the train rows, sums of base columns and of the effects before them (relative 1e-5):
  /// these logs can't separate them.
  struct Dependent {
    std::size_t joint, effect;
  };
  std::vector<Dependent> dependent_effects() const;
  /// Weights are one over the residual's variance of each joint (1 for ordinary least squares).
  void set_weights(const Eigen::VectorXd& weights) { weights_ = weights; }
  const Eigen::VectorXd& weights() const { return weights_; }
  /// What was known of the base parameters before these logs: part of every fit from now on. Its information is in the
  /// units of weights that are one over the residual's variance.
  void set_prior(BasePrior prior) { prior_ = std::move(prior); }
  const BasePrior& prior() const { return prior_; }
  /// Two rounds of reweighting from the residuals of the train logs.
  void reweight();
  /// Iteratively reweighted least squares (Huber's weights, 95 % efficient on normal noise; scale from the median of
  /// the residual's magnitude), eight rounds: rows that stick out count less. Weights of joints as in reweight().
  void reweight_rows();

  /// Each joint on the judging blocks.
  std::vector<Judgement> held_out() const;
  /// One joint with another design in place of the current one, for each ridge value of its BLS.
  std::vector<Judgement> held_out_with(std::size_t joint, const JointFit& design,
                                       const std::vector<double>& ridges) const;
  /// The same for the first `sizes[s]` nodes of the design's BLS each (paper's incremental learning): one set of
  /// moments and one Cholesky factor that grows, see GrowingSolver. [s][r]: size s, ridge r.
  std::vector<std::vector<Judgement>> held_out_with(std::size_t joint, const JointFit& design,
                                                    const std::vector<Eigen::Index>& sizes,
                                                    const std::vector<double>& ridges) const;

  /// The same with base parameters that are known: each joint's own coefficients are fitted to the other blocks.
  /// @param beta of the logs of all blocks: it flatters every design alike
  std::vector<Judgement> held_out_beside(const Eigen::VectorXd& beta) const;

  /// Rigid-body torque in the logs [samples x joints], for inputs of a BLS that need it. Of a model that was identified
  /// before: where the fit ends elsewhere, once more with that.
  void set_structural(std::vector<Eigen::MatrixXd> torque);
  /// Inputs of a BLS (its weights do not matter) in the rows of the train logs.
  Eigen::MatrixXd bls_inputs(std::size_t joint, const BroadLearningFit& bls) const;

  /// Rows of the train logs count `forgetting` per second of their age, as recursive() forgets them.
  void forget(double forgetting);
  /// Widths and distances of all joints to the least squares of the train rows, from where they are (Gauss and Newton
  /// over shapes and coefficients together; a joint whose step does not help tries a shorter one).
  void polish();

  /// The fit on all train rows, with standard deviations: a sandwich of the residual's autocorrelation, so that
  /// filtered (correlated) noise counts as what it is; shapes are unknowns there like the coefficients.
  Solution fit() const;
  /// The same values, nothing else.
  Solution estimate() const { return solve(normal_equations()); }
  /// The same without standard deviations by recursive least squares (square-root information form) over the train rows
  /// in their order. What was known a second ago counts `forgetting` (1: nothing is forgotten, and the last estimate is
  /// fit()'s). `start`: the information of other logs, with the same unknowns; empty: nothing is known. `trace`: x at
  /// `points` moments.
  struct Recursion {
    Solution solution;
    Eigen::VectorXd t;      ///< seconds of training data taken in
    Eigen::MatrixXd trace;  ///< moments x unknowns
    SquareRootInformation information;
  };
  Recursion recursive(double forgetting, Eigen::Index points,
                      const SquareRootInformation& start = SquareRootInformation()) const;
  /// Information of the train rows and the prior with the current weights, a BLS's ridge included: what a recursion
  /// over later logs starts from.
  SquareRootInformation information() const;
  /// Each joint's own coefficients beside known base parameters, of the train rows.
  /// @param bounded those of effects keep the catalogue's bounds
  Solution estimate_beside(const Eigen::VectorXd& beta, bool bounded) const;
  /// x as beta and theta.
  Solution split(const Eigen::VectorXd& x) const { return split(offsets(), x); }
  /// Names of the unknowns: of base parameters, then "joint: effect, parameter".
  std::vector<std::string> unknowns() const;
  /// Of the train rows with the current weights.
  NormalEquations normal_equations() const;
  /// Sum over the train rows of the weighted squared residual, and the prior's share.
  double weighted_square(const Solution& solution) const;
  /// RMS of each joint's residual over the train rows, by their weights [N*m | N].
  std::vector<double> fitted_rmse(const Solution& solution) const;
  /// Rows of all joints in the train logs, by their weights.
  double train_rows() const;
  double train_rows(std::size_t joint) const;
  IdentifiedModel to_model(const Solution& solution) const;
  /// Rows that are left out since the drive was at its limit, of each joint.
  std::vector<Eigen::Index> saturated_rows() const;

 private:
  using MomentsByBlock = std::vector<JointMoments>;  ///< by block

  JointSeries joint_series(std::size_t joint, std::size_t log) const;
  Eigen::MatrixXd own_rows(std::size_t joint, const std::vector<JointFit>& designs) const;
  /// But for what the torque enters.
  void make_base_moments(std::size_t joint);
  void project_torque(std::size_t joint);
  MomentsByBlock own_moments(std::size_t joint, const Eigen::MatrixXd& own) const;
  Eigen::VectorXd residual(std::size_t joint, const Solution& solution) const;
  /// Where x has its parts: NormalEquations::offset.
  std::vector<Eigen::Index> offsets() const;
  /// What is known before any row: the prior, and ties of parameters (tie.hpp).
  SquareRootInformation prior_information() const;
  /// Adds rows [from, from + count) with these weights (of all rows), and their share of the ridge.
  void take_in(Eigen::Index from, Eigen::Index count, const std::vector<Eigen::VectorXd>& row_weights,
               SquareRootInformation& information) const;
  static Eigen::VectorXd ridge_of(const JointFit& design, double ridge, Eigen::Index count);
  double square_error(std::size_t joint, std::size_t block, const JointMoments& own, const Solution& solution) const;
  NormalEquations assemble(const std::vector<std::size_t>& blocks, const std::vector<const MomentsByBlock*>& own,
                           const std::vector<const JointFit*>& design) const;
  Solution solve(const NormalEquations& equations) const;
  Solution solve_beside(const NormalEquations& equations, const Eigen::VectorXd& beta, bool bounded) const;
  Solution split(const std::vector<Eigen::Index>& offset, const Eigen::VectorXd& x) const;
  /// d(torque) / d(log shape) of the joint's sign width and of its effects' widths and distances, rows x shapes.
  Eigen::MatrixXd shape_rows(std::size_t joint, const Eigen::VectorXd& theta) const;
  /// The normal equations of coefficients and shapes together at a solution; projection is X^T W residual.
  NormalEquations with_shapes(const Solution& solution, std::vector<Eigen::MatrixXd>& shape_rows) const;
  void add_standard_deviations(Solution& solution) const;
  /// weighted_square() by joint, without the prior.
  std::vector<double> weighted_squares(const Solution& solution) const;
  /// Where polish() would take the logarithms of the shapes. `offset`: where each joint's begin.
  Eigen::VectorXd shape_step(const Solution& solution, double square, std::vector<Eigen::Index>& offset) const;
  /// Judgements of some joints, added up fold by fold.
  struct Tally {
    std::vector<Judgement> judgements;
    std::vector<double> square, count;

    explicit Tally(std::size_t joints) : judgements(joints), square(joints, 0), count(joints, 0) {}
    /// One more fold of joint number `i` of these.
    void add(std::size_t i, const Fitter& fitter, std::size_t joint, std::size_t fold, const MomentsByBlock& own,
             const JointFit& design, const Solution& solution);
    std::vector<Judgement> done(bool one_log);
  };
  /// Joints `first` .. `last` - 1.
  std::vector<Judgement> judged(std::size_t first, std::size_t last, const std::vector<const MomentsByBlock*>& own,
                                const std::vector<const JointFit*>& design) const;
  std::vector<std::size_t> train_blocks() const;
  std::vector<const MomentsByBlock*> current() const;
  std::vector<const JointFit*> designs() const;

  std::shared_ptr<const FitData> data_;
  std::vector<JointFit> design_;
  std::shared_ptr<const std::vector<Eigen::MatrixXd>> structural_;  ///< set_structural(); none: not known
  double torque_lead_s_ = 0;
  bool robust_ = false;                                 ///< row weights are Huber's
  std::vector<Eigen::VectorXd> torque_rows_;            ///< per joint, without known loads
  std::vector<Eigen::VectorXd> row_weights_;            ///< per joint and row
  std::vector<std::vector<BaseMoments>> base_moments_;  ///< [joint][block]
  std::vector<Eigen::MatrixXd> own_rows_;               ///< per joint: rows x own columns
  std::vector<MomentsByBlock> own_moments_;             ///< [joint][block]
  Eigen::VectorXd weights_;
  BasePrior prior_;  ///< empty: none
};

}  // namespace fxdyn
