#pragma once

#include <Eigen/Dense>
#include <cmath>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "host_tools/effects/effects.hpp"
#include "host_tools/effects/identified_model.hpp"
#include "host_tools/effects/robot_columns.hpp"
#include "host_tools/regression/dataset.hpp"
#include "host_tools/regression/regressor.hpp"
#include "host_tools/signals/motion.hpp"

namespace fxdyn::diagnosis {

/// A rotor that is part of the base parameters: what only the link's torque does (friction in proportion to the load, a
/// gear that bends) tells them apart. See name().
struct Rotor {
  std::size_t joint = 0;
  Eigen::VectorXd in_base;      ///< base parameters of a rotor of 1 kg m^2 (kg)
  double inertia = 0, std = 0;  ///< known beforehand, from a link encoder; std 0: it is not
};

/// Of a payload [kg], whose centre is first moment over mass.
inline constexpr double least_mass = 1e-6;

/// Two states of one robot: before (the baseline, a session known to be healthy) and now. Base parameters are the same;
/// friction may differ a little, named effects are in `current` only. Without a baseline `healthy` is not used.
struct Models {
  IdentifiedModel healthy, current;
  bool has_baseline = false;
  std::vector<EffectCandidate> fixed;   ///< what a link encoder gave: the torque does not change it
  std::vector<std::size_t> background;  ///< joints whose healthy session has structure that no effect explains
  std::vector<EffectCandidate> held;    ///< unnamed effects that stay what the healthy session's fit gave
  std::vector<Rotor> rotors;
  double smallest_step_s = 1;  ///< of all logs and of the drive's tick: what bounds a delay
};

/// An effect of Models::current: of joints[joint].effects, or of body.
struct EffectId {
  bool body = false;
  std::size_t joint = 0, effect = 0;
  bool operator==(const EffectId&) const = default;
};

/// What a log's motion alone makes of rows, kept from one linearisation to the next: filtered and decimated, as it is
/// before whitening.
struct RowCache {
  struct Features {
    Eigen::VectorXd scales;
    Eigen::MatrixXd rows;
  };
  struct AllFeatures {
    Features of_motion, of_model;
  };
  std::once_flag made;
  std::vector<Eigen::MatrixXd> base;  ///< per joint: its base columns, nothing following in the torque's path
  std::vector<AllFeatures> features;  ///< per joint, see features()
};

/// A log of one of the two sessions. Rows are decimated to `log.decimation`.
struct SessionLog {
  ProcessedLog log;
  bool healthy = false;   ///< of the baseline
  bool fits = true;       ///< else it judges only (validate)
  double age_s = 0;       ///< of the session when the log begins: what drifts has drifted so far
  double bending_hz = 0;  ///< gears bend by the load of the motion below; 0: of all of it
  std::shared_ptr<RowCache> cache = std::make_shared<RowCache>();
};

/// One scalar that is fitted.
struct Unknown {
  enum class Kind {
    base,    ///< base parameter
    linear,  ///< coefficient of an effect
    width,   ///< logarithm of a joint's sign width
    shape,   ///< logarithm of an effect's shape parameter
    rotor,   ///< inertia that is the rotor's and not the link's: the base parameters give what it takes
  };
  Kind kind = Kind::base;
  std::size_t joint = 0, effect = 0, index = 0;  ///< base: index; shape and linear: of the current model's effect
  std::size_t healthy_effect = 0;                ///< the same in the healthy model
  bool body = false;                             ///< effect of IdentifiedModel::body
  bool change = false;                           ///< what the current session has more than the healthy one
  double lower = 0, upper = 1e300;               ///< shape: what it may be at least and at most
  Eigen::VectorXd in_base{};                     ///< rotor: see Rotor
  double value = 0;                              ///< in the model; 0 for logarithms, whose steps are fitted
  double prior = 0, prior_std = 0;               ///< std 0: none
};

/// Columns of one effect with one shape: a candidate, or one that the model has by name.
struct Group {
  EffectCandidate candidate;
  bool on_body = false;
  bool in_model = false;  ///< columns are d torque / d (unknown) around the named effect `id`
  EffectId id{};
  Eigen::Index first = 0;                ///< column
  Eigen::Index count = 0;                ///< columns
  int nonlinear = 0;                     ///< shape parameters that were searched
  std::shared_ptr<const Rotor> rotor{};  ///< of a candidate that would tell it from the base parameters, else null
  double rotor_inertia = 0;              ///< .. what of them is taken for the rotor's [kg m^2 | kg]
  double log_grid = 0;                   ///< ln of the number of independent shapes tried
  std::vector<double> lower{};           ///< bounds of the coefficients
};

/// Rows that are used or left out together.
struct Block {
  std::size_t log = 0;
  Eigen::Index first = 0, count = 0;
  bool healthy = false, fits = true;
};
struct Fold {
  std::vector<std::size_t> fit, judge;  ///< blocks
};

/// Functions of the state that a healthy joint has already and no effect explains, with a prior that keeps each to the
/// size of the noise: |y - X x - B b|^2 + prior |b|^2. Their coefficients are never of interest, so b is eliminated
/// once: with C(v) = (B^T B + prior)^-1 B^T v of the rows that fit, every column v becomes v - B C(v) and gets rows
/// more, - sqrt(prior) C(v). Sums of products of such columns are those of the whole problem less b.
struct Background {
  static constexpr double prior = 4;
  Eigen::MatrixXd b;        ///< rows x functions, of RMS 1
  Eigen::MatrixXd inverse;  ///< (B^T B + prior)^-1
};

/// One joint's whitened rows and their sums of products by block.
struct JointRows {
  Eigen::MatrixXd x;
  Eigen::VectorXd y;
  Eigen::MatrixXd more_x;  ///< what a Background adds
  Eigen::VectorXd more_y;
  std::vector<Eigen::Index> column;  ///< of each column of x: its place in the whole
  std::vector<Eigen::Index> local;   ///< the inverse, -1: the joint does not feel it
  struct Sums {
    Eigen::MatrixXd gram;
    Eigen::VectorXd projection;
    double square = 0, rows = 0;
  };
  std::vector<Sums> sums;
  Sums more;  ///< of more_x and more_y; empty without a background
};

/// A fit of chosen columns.
struct LinearFit {
  std::vector<Eigen::Index> columns;
  Eigen::VectorXd x;
  Eigen::VectorXd square;  ///< per joint: of the whitened residual
  Eigen::VectorXd rows;    ///< per joint
  Eigen::MatrixXd information;
};

/// The measurement as a linear function of what may be fitted, around two models:
///   y = tau - predict(model) + J x0 = J x + noise,
/// torque and columns filtered and decimated alike, then prewhitened per joint by an autoregressive model of the noise.
/// J has the nuisance (base parameters, nominal effects and widths, their change since the baseline), the named effects
/// of the model, and candidates of the catalogue.
class Linearised {
 public:
  /// @param whitening per joint the autoregressive coefficients; empty: from the residual of the nuisance and the
  /// model's named effects (of the healthy session where there is one).
  Linearised(const Models& models, const std::vector<SessionLog>& logs, std::vector<Eigen::VectorXd> whitening = {});

  std::size_t joints() const { return rows_.size(); }
  Eigen::Index columns() const { return columns_; }
  const std::vector<Unknown>& unknowns() const { return unknowns_; }  ///< of the nuisance and of named effects
  const std::vector<Eigen::Index>& nuisance() const { return nuisance_; }
  const std::vector<Group>& groups() const { return groups_; }
  /// The nuisance's columns and those of groups, in that order. A rotor's is left out where no effect of the link's
  /// torque tells it from the base parameters: around an effect that is not among the groups it would do its work.
  std::vector<Eigen::Index> columns_of(const std::vector<std::size_t>& groups) const;
  const JointRows& rows(std::size_t joint) const { return rows_[joint]; }
  const std::vector<Block>& blocks() const { return blocks_; }
  const std::vector<Fold>& folds() const { return folds_; }
  const std::vector<std::size_t>& fit_blocks() const { return fit_blocks_; }
  const std::vector<SessionLog>& logs() const { return *logs_; }
  const std::vector<Eigen::VectorXd>& whitening() const { return whitening_; }
  const Models& models() const { return models_; }
  const Motion& motion(std::size_t log) const { return *motions_[log]; }
  const RobotColumns& robot_columns(std::size_t log) const { return *robot_[log]; }
  /// One over the variance of each joint's whitened residual.
  const Eigen::VectorXd& weights() const { return weights_; }
  void set_weights(const Eigen::VectorXd& weights) { weights_ = weights; }

  /// Columns of candidates (current session), whitened: per joint rows x columns, below them those that the joint's
  /// background adds; 0 x 0 where nothing is felt. Safe from several threads.
  std::vector<Eigen::MatrixXd> make(const Group& group) const;
  /// Appends them as a group; returns its index.
  std::size_t add(const Group& group, const std::vector<Eigen::MatrixXd>& columns);
  void add_all(std::vector<Group> groups);

  /// Least squares of the columns on some blocks, with the priors of the unknowns.
  LinearFit solve(const std::vector<Eigen::Index>& columns, const std::vector<std::size_t>& blocks) const;
  LinearFit solve(const std::vector<Eigen::Index>& columns) const { return solve(columns, fit_blocks_); }
  /// Squared whitened residual of a fit on blocks, per joint; and their rows.
  Eigen::VectorXd square(const LinearFit& fit, const std::vector<std::size_t>& blocks) const;
  Eigen::VectorXd row_count(const std::vector<std::size_t>& blocks) const;
  /// Whitened residual of a joint, all rows.
  Eigen::VectorXd residual(std::size_t joint, const LinearFit& fit) const;
  /// .. with what the joint's background explains still in it.
  Eigen::VectorXd residual_with_background(std::size_t joint, const LinearFit& fit) const;
  /// Share of a joint's rows in which the friction that an uncertain velocity makes is more than the noise.
  double doubtful(std::size_t joint) const;
  bool is_doubtful(std::size_t joint, Eigen::Index row) const { return row_scale_[joint][row] < std::sqrt(0.5); }
  /// Sum of ln(row scale) of the rows that fit, see doubt(): part of their likelihood.
  double log_scale(std::size_t joint) const;
  /// Null: the joint has none.
  const Background* background(std::size_t joint) const { return background_[joint].get(); }
  /// X^T W X and X^T W y.
  void normal(const std::vector<Eigen::Index>& columns, const std::vector<std::size_t>& blocks, Eigen::MatrixXd& gram,
              Eigen::VectorXd& projection) const;
  /// Between `columns` (rows) and those from `from` on (columns), joints weighted.
  Eigen::MatrixXd cross(const std::vector<Eigen::Index>& columns, Eigen::Index from) const;
  /// Of single columns with y.
  Eigen::VectorXd projection(Eigen::Index from) const;
  Eigen::MatrixXd gram(Eigen::Index first, Eigen::Index count) const;

  /// Whitened and scaled: rows of a log for a joint that are filtered and decimated already.
  Eigen::MatrixXd finish(std::size_t log, std::size_t joint, const Eigen::MatrixXd& rows) const;
  /// Filtered, decimated, whitened: full-rate columns of a log for a joint.
  Eigen::MatrixXd prepare(std::size_t log, std::size_t joint, const Eigen::Ref<const Eigen::MatrixXd>& full) const;
  /// Rows of a log.
  const Block& log_rows(std::size_t log) const { return log_rows_[log]; }

 private:
  void make_unknowns();
  void make_blocks();
  void make_rows();
  void add_background(std::size_t joint);
  Eigen::MatrixXd without_background(std::size_t joint, const Eigen::MatrixXd& x) const;
  void sum_up(JointRows& rows, Eigen::Index from) const;
  Eigen::VectorXd doubt(std::size_t log, std::size_t joint, double sigma) const;
  Eigen::MatrixXd whiten(std::size_t joint, Eigen::MatrixXd columns) const;
  Eigen::MatrixXd follow(std::size_t log, std::size_t joint, Eigen::MatrixXd columns) const;
  Eigen::Index first_base(std::size_t joint) const;
  std::vector<Eigen::MatrixXd> base_columns(std::size_t log, const std::vector<std::size_t>& of) const;
  Eigen::MatrixXd base_rows(std::size_t log, std::size_t joint) const;
  EffectColumns full_rate(std::size_t log, const EffectCandidate& candidate, const RobotColumns& of) const;
  EffectColumns full_rate(std::size_t log, const EffectCandidate& candidate) const {
    return full_rate(log, candidate, *robot_[log]);
  }
  std::shared_ptr<const RobotColumns> columns_for(std::size_t log, const Group& group) const;
  Eigen::MatrixXd torque_of(std::size_t log, IdentifiedModel model) const;

  Models models_;
  const std::vector<SessionLog>* logs_;
  DhChain chain_;
  BaseSet base_;
  std::vector<Unknown> unknowns_;
  std::vector<Eigen::Index> nuisance_;
  std::vector<Group> groups_;
  Eigen::Index columns_ = 0;
  std::vector<std::unique_ptr<Motion>> motions_;
  std::vector<std::unique_ptr<Motion>> slow_;  ///< by log: its motion below bending_hz; null: the same
  std::vector<std::shared_ptr<const RobotColumns>> robot_;
  /// By log, joint, the rotor's inertia, and whether the effect bends.
  mutable std::map<std::tuple<std::size_t, std::size_t, double, bool>, std::shared_ptr<const RobotColumns>> for_group_;
  mutable std::mutex for_group_mutex_;
  std::vector<JointRows> rows_;
  std::vector<Block> blocks_, log_rows_;
  std::vector<Fold> folds_;
  std::vector<std::size_t> fit_blocks_;
  std::vector<Eigen::VectorXd> whitening_;
  std::vector<Eigen::VectorXd> row_scale_;  ///< per joint: one over the root of what doubt() adds to a row's variance
  Eigen::VectorXd weights_;
  std::vector<std::unique_ptr<Background>> background_;  ///< per joint
};

/// What a shape parameter may be at least and at most, as far as these logs can tell: a delay is so many steps of the
/// finest log, and what happens within a step of the encoder does not show.
std::pair<double, double> shape_limits(const Models& models, std::size_t joint, const EffectInfo& info,
                                       const ParameterInfo& shape);

/// The base parameters of a model as a set of columns; its grouping is not there.
BaseSet base_of(const IdentifiedModel& model);

/// Whether an effect works on the link's torque, in which the rotor has no part: it tells the two apart.
bool tells_rotor(std::string_view effect);

/// What of a joint's own inertia is the same in every pose, at most: the smallest element M_jj of the mass matrix along
/// positions (samples x joints each). A rotor has no more.
double least_inertia(const IdentifiedModel& model, std::size_t joint, const std::vector<const Eigen::MatrixXd*>& q);

/// Of the base parameters, whatever else is fitted.
Eigen::MatrixXd base_covariance(const Linearised& at);

/// Adds to a base parameter of a model and to the inertia that stands for it.
void add_to_base(IdentifiedModel& model, std::size_t parameter, double step);
/// Takes a rotor's inertia from the base parameters.
void take_from_base(IdentifiedModel& model, const Eigen::VectorXd& rotor_in_base, double inertia);

/// What a fit over nuisance and named effects makes of the models: x at `columns` (places of unknowns).
void update(Models& models, const Linearised& at, const LinearFit& fit, double share);

}  // namespace fxdyn::diagnosis
