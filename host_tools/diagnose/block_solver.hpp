#pragma once

#include <Eigen/Dense>
#include <vector>

#include "host_tools/diagnose/blocks.hpp"

namespace fxdyn::diagnosis {

/// Sums of products of some rows' columns.
struct Sums {
  Eigen::MatrixXd gram;
  Eigen::VectorXd projection;
  double square = 0, rows = 0;

  /// Takes in columns: `from` of x are in the sums already, the others are not.
  void append(const Eigen::Ref<const Eigen::MatrixXd>& x, const Eigen::Ref<const Eigen::VectorXd>& y,
              Eigen::Index from);
};

/// One joint's equations y = x theta + noise, noise white, and their sums of products by block.
struct JointRows {
  Eigen::MatrixXd x;
  Eigen::VectorXd y;
  Eigen::MatrixXd extra_x;  ///< rows of every fit, of no block: what eliminating a Background adds
  Eigen::VectorXd extra_y;
  std::vector<Eigen::Index> column;  ///< of each column of x: its place in the whole
  std::vector<Eigen::Index> local;   ///< the inverse, -1: the joint does not feel it
  std::vector<Sums> sums;            ///< by block
  Sums extra;                        ///< of the extra rows

  /// Place of a column of the whole in x; -1: the joint does not feel it.
  Eigen::Index place(Eigen::Index of_whole) const { return local[static_cast<std::size_t>(of_whole)]; }
  /// Products of the columns from `from` on.
  void sum_up(const std::vector<Block>& blocks, Eigen::Index from);
};

/// What is known of a column's coefficient beforehand; std 0: nothing.
struct Prior {
  double mean = 0, std = 0;
};

/// A fit of chosen columns.
struct LinearFit {
  std::vector<Eigen::Index> columns;
  Eigen::VectorXd x;
  Eigen::VectorXd square;  ///< per joint: of the residual
  Eigen::VectorXd rows;    ///< per joint
  Eigen::MatrixXd information;
};

/// Least squares of chosen columns on chosen blocks:
///   min sum_j w_j |y_j - X_j theta|^2 + sum_c ((theta_c - mean_c) / std_c)^2,
/// w_j one over the variance of joint j's noise. A joint holds only the columns that it feels.
class BlockSolver {
 public:
  /// @param rows with x, y and column set; @param priors of the first columns
  BlockSolver(Blocks blocks, std::vector<JointRows> rows, Eigen::Index columns, std::vector<Prior> priors);

  std::size_t joints() const { return rows_.size(); }
  Eigen::Index columns() const { return columns_; }
  const Blocks& blocks() const { return blocks_; }
  /// Other folds of the same blocks.
  void judge_by(std::vector<Fold> folds) { blocks_.folds = std::move(folds); }
  const JointRows& rows(std::size_t joint) const { return rows_[joint]; }
  /// One over the variance of each joint's residual.
  const Eigen::VectorXd& weights() const { return weights_; }
  void set_weights(const Eigen::VectorXd& weights) { weights_ = weights; }

  /// Other rows for a joint's columns, which stay the same; the extra ones may be empty. Safe from several threads, a
  /// joint each.
  void replace_rows(std::size_t joint, Eigen::MatrixXd x, Eigen::VectorXd y, Eigen::MatrixXd extra_x = {},
                    Eigen::VectorXd extra_y = {});
  /// Appends groups of columns, by group and joint: rows of all blocks, the joint's extra ones below; 0 x 0 where
  /// nothing is felt. They are taken joint by joint: all of them together are as large as what they become.
  /// @returns by group: its first column
  std::vector<Eigen::Index> append(std::vector<std::vector<Eigen::MatrixXd>> groups);
  /// Weights and coefficients of all columns, by turns. @returns the fit with the weights that it led to
  LinearFit estimate_weights() { return estimate_weights(blocks_.fit); }
  LinearFit estimate_weights(const std::vector<std::size_t>& blocks);

  LinearFit solve(const std::vector<Eigen::Index>& columns, const std::vector<std::size_t>& blocks) const;
  LinearFit solve(const std::vector<Eigen::Index>& columns) const { return solve(columns, blocks_.fit); }
  /// Squared residual of a fit on blocks, per joint; and their rows.
  Eigen::VectorXd square(const LinearFit& fit, const std::vector<std::size_t>& blocks) const;
  Eigen::VectorXd row_count(const std::vector<std::size_t>& blocks) const;
  /// Residual of a joint, all rows; of its extra rows.
  Eigen::VectorXd residual(std::size_t joint, const LinearFit& fit) const;
  Eigen::VectorXd extra_residual(std::size_t joint, const LinearFit& fit) const;
  /// X^T W X and X^T W y with the priors.
  void normal(const std::vector<Eigen::Index>& columns, const std::vector<std::size_t>& blocks, Eigen::MatrixXd& gram,
              Eigen::VectorXd& projection) const;
  /// On the blocks that fit: X^T W X between `columns` (rows) and those from `from` on (columns).
  Eigen::MatrixXd cross(const std::vector<Eigen::Index>& columns, Eigen::Index from) const;
  /// .. X^T W y of the columns from `from` on.
  Eigen::VectorXd projection(Eigen::Index from) const;
  /// .. X^T W X of successive columns.
  Eigen::MatrixXd gram(Eigen::Index first, Eigen::Index count) const;

 private:
  Blocks blocks_;
  std::vector<JointRows> rows_;
  Eigen::Index columns_;
  std::vector<Prior> priors_;
  Eigen::VectorXd weights_;
};

}  // namespace fxdyn::diagnosis
