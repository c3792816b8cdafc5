#pragma once

#include <Eigen/Dense>
#include <memory>
#include <mutex>
#include <vector>

#include "host_tools/diagnose/background.hpp"
#include "host_tools/diagnose/block_solver.hpp"
#include "host_tools/diagnose/log_columns.hpp"
#include "host_tools/diagnose/noise_model.hpp"
#include "host_tools/diagnose/unknowns.hpp"

namespace fxdyn::diagnosis {

/// The measurement as a linear function of what may be fitted, around two models:
///   y = tau - predict(model) + J x0 = J x + noise,
/// torque and columns filtered and decimated alike, then prewhitened per joint by an autoregressive model of the noise.
/// J has the nuisance (base parameters, nominal effects and widths, their change since the baseline), the named effects
/// of the model, and candidates of the catalogue. Puts its parts together; each does its own work.
class Linearised {
 public:
  /// @param whitening per joint the autoregressive coefficients; empty: from the residual of the nuisance and the
  /// model's named effects (of the healthy session where there is one).
  Linearised(const Models& models, const std::vector<SessionLog>& logs, std::vector<Eigen::VectorXd> whitening = {});

  const Models& models() const { return log_columns_.models(); }
  const Options& options() const { return log_columns_.options(); }
  bool has_baseline() const { return log_columns_.has_baseline(); }
  const std::vector<SessionLog>& logs() const { return log_columns_.logs(); }
  std::size_t joints() const { return log_columns_.joints(); }
  const Motion& motion(std::size_t log) const { return log_columns_.motion(log); }
  const RobotColumns& robot_columns(std::size_t log) const { return log_columns_.robot(log); }

  /// The parts. Rows of the solver are whitened, and without the background.
  const LogColumns& log_columns() const { return log_columns_; }
  const Blocks& blocks() const { return solver_->blocks(); }
  /// Folds that compare models: the same ones, whatever effects they have. Those of blocks() judge this model alone.
  const std::vector<Fold>& comparing() const { return comparing_; }
  const NoiseModel& noise() const { return noise_; }
  /// Null: the joint has none.
  const Background* background(std::size_t joint) const { return background_[joint].get(); }
  const BlockSolver& solver() const { return *solver_; }
  BlockSolver& solver() { return *solver_; }

  /// Of the nuisance and of named effects: the solver's first columns.
  const std::vector<Unknown>& unknowns() const { return unknowns_.all; }
  const std::vector<Eigen::Index>& nuisance() const { return unknowns_.nuisance; }
  /// Columns of the unknowns, all of them.
  std::vector<Eigen::Index> unknown_columns() const;
  /// The model's named effects, then candidates.
  const std::vector<Group>& groups() const { return groups_; }
  /// The nuisance's columns and those of groups, in that order. A rotor's is left out where no effect of the link's
  /// torque separates it from the base parameters: around an effect that is not among the groups it would do its work.
  std::vector<Eigen::Index> columns_of(const std::vector<std::size_t>& groups) const;

  /// Columns of candidates (current session; `in_both`: of the healthy one as well), whitened: per joint rows x
  /// columns, below them those that the joint's background adds; 0 x 0 where nothing is felt. Safe from several
  /// threads.
  /// @param counts by log the factor of each row at full rate, before the filter; empty: 1
  std::vector<Eigen::MatrixXd> make(const Group& group, bool in_both = false,
                                    const std::vector<Eigen::VectorXd>& counts = {}) const;
  /// Columns of a load that is any body: d torque / d (mass, first moment, second moment: xx, yy, zz, and twice xy, xz,
  /// yz), as make() has them; made once. Safe from several threads.
  const std::vector<Eigen::MatrixXd>& load_columns() const;
  /// The same of a robot that is this model and nothing else, seen through the same encoders (seen_again()); null where
  /// they make no error. Made once. Safe from several threads.
  const Linearised* through_encoders() const;
  /// Its columns are as many as this one's: it is made again where it is asked for again.
  void forget_encoders() { seen_ = std::make_unique<Seen>(); }
  /// Appends them as a group; returns its index.
  std::size_t add(Group group, const std::vector<Eigen::MatrixXd>& columns);
  void add_all(std::vector<Group> groups);

 private:
  void whiten(std::size_t joint);
  void add_background(std::size_t joint);
  bool all_of(const std::vector<Fold>& folds, bool (Linearised::*holds)(const Fold&) const) const;
  /// Whether a fit of the others predicts what a fold's judge shows of the nuisance to within the noise.
  bool predicts_nuisance(const Fold& fold) const;
  /// .. has enough of each named effect. One that a single log excites is judged by parts of it.
  bool shows_named(const Fold& fold) const;
  bool rotor_is_separated(std::size_t joint, const std::vector<std::size_t>& groups) const;

  LogColumns log_columns_;
  Unknowns unknowns_;
  std::vector<Group> groups_;
  std::unique_ptr<BlockSolver> solver_;
  std::vector<Fold> comparing_;
  NoiseModel noise_;
  std::vector<std::unique_ptr<Background>> background_;  ///< per joint
  mutable std::once_flag load_made_;
  mutable std::vector<Eigen::MatrixXd> load_;
  struct Seen {
    std::once_flag made;
    std::vector<SessionLog> logs;
    std::unique_ptr<Linearised> problem;
  };
  std::unique_ptr<Seen> seen_ = std::make_unique<Seen>();
};

/// Covariance of the base parameters, whatever else is fitted.
Eigen::MatrixXd base_covariance(const Linearised& problem);

/// Groups of the model's named effects, in the model's order.
std::vector<std::size_t> in_model(const Linearised& problem);

}  // namespace fxdyn::diagnosis
