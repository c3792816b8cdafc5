#include "host_tools/diagnose/block_solver.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "host_tools/regression/solver.hpp"
#include "host_tools/support/parallel.hpp"

namespace fxdyn::diagnosis {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

/// Columns that a joint feels.
struct Felt {
  std::vector<Index> place;  ///< in the list asked for
  std::vector<Index> local;  ///< in the joint's x
};

Felt felt(const JointRows& rows, const std::vector<Index>& columns) {
  Felt out;
  for (std::size_t i = 0; i < columns.size(); ++i) {
    const Index local = rows.place(columns[i]);
    if (local < 0) continue;
    out.place.push_back(static_cast<Index>(i));
    out.local.push_back(local);
  }
  return out;
}

}  // namespace

void Sums::append(const Eigen::Ref<const MatrixXd>& x, const Eigen::Ref<const VectorXd>& y, Index from) {
  const Index cols = x.cols(), more = cols - from;
  gram.conservativeResize(cols, cols);
  const auto fresh = x.rightCols(more);
  gram.topRightCorner(from, more).noalias() = x.leftCols(from).transpose() * fresh;
  gram.bottomLeftCorner(more, from) = gram.topRightCorner(from, more).transpose();
  MatrixXd own = MatrixXd::Zero(more, more);
  own.selfadjointView<Eigen::Lower>().rankUpdate(fresh.transpose());
  gram.bottomRightCorner(more, more) = own.selfadjointView<Eigen::Lower>();
  projection.conservativeResize(cols);
  projection.tail(more) = fresh.transpose() * y;
  square = y.squaredNorm();
  rows = static_cast<double>(y.size());
}

void JointRows::sum_up(const std::vector<Block>& blocks, Index from) {
  sums.resize(blocks.size());
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    const Block& block = blocks[b];
    sums[b].append(x.middleRows(block.first, block.count), y.segment(block.first, block.count), from);
  }
  if (extra_y.size() > 0) extra.append(extra_x, extra_y, from);
}

BlockSolver::BlockSolver(Blocks blocks, std::vector<JointRows> rows, Index columns, std::vector<Prior> priors)
    : blocks_(std::move(blocks)),
      rows_(std::move(rows)),
      columns_(columns),
      priors_(std::move(priors)),
      weights_(VectorXd::Ones(static_cast<Index>(rows_.size()))) {
  parallel_for(joints(), [&](std::size_t j) {
    JointRows& of = rows_[j];
    of.local.assign(static_cast<std::size_t>(columns_), -1);
    for (std::size_t i = 0; i < of.column.size(); ++i)
      of.local[static_cast<std::size_t>(of.column[i])] = static_cast<Index>(i);
    of.sum_up(blocks_.all, 0);
  });
}

void BlockSolver::replace_rows(std::size_t joint, MatrixXd x, VectorXd y, MatrixXd extra_x, VectorXd extra_y) {
  JointRows& rows = rows_[joint];
  rows.x = std::move(x);
  rows.y = std::move(y);
  rows.extra_x = std::move(extra_x);
  rows.extra_y = std::move(extra_y);
  rows.sums.clear();
  rows.extra = {};
  rows.sum_up(blocks_.all, 0);
}

std::vector<Index> BlockSolver::append(std::vector<std::vector<MatrixXd>> groups) {
  std::vector<Index> first, count;
  for (const std::vector<MatrixXd>& made : groups) {
    Index most = 0;
    for (const MatrixXd& c : made) most = std::max(most, c.cols());
    first.push_back(columns_);
    count.push_back(most);
    columns_ += most;
  }
  parallel_for(joints(), [&](std::size_t j) {
    JointRows& rows = rows_[j];
    rows.local.resize(static_cast<std::size_t>(columns_), -1);
    const Index from = rows.x.cols();
    Index size = from;
    for (std::size_t g = 0; g < groups.size(); ++g) {
      if (groups[g][j].size() == 0) continue;
      for (Index i = 0; i < count[g]; ++i) {
        rows.local[static_cast<std::size_t>(first[g] + i)] = size++;
        rows.column.push_back(first[g] + i);
      }
    }
    if (size == from) return;
    rows.x.conservativeResize(Eigen::NoChange, size);
    rows.extra_x.conservativeResize(rows.extra_y.size(), size);
    for (std::size_t g = 0; g < groups.size(); ++g) {
      if (groups[g][j].size() == 0) continue;
      const Index place = rows.place(first[g]);
      rows.x.middleCols(place, count[g]) = groups[g][j].topRows(rows.x.rows());
      rows.extra_x.middleCols(place, count[g]) = groups[g][j].bottomRows(rows.extra_y.size());
      groups[g][j].resize(0, 0);
    }
    rows.sum_up(blocks_.all, from);
  });
  return first;
}

LinearFit BlockSolver::estimate_weights(const std::vector<std::size_t>& blocks) {
  std::vector<Index> all(static_cast<std::size_t>(columns_));
  std::iota(all.begin(), all.end(), Index{0});
  for (int round = 0; round < 2; ++round) {
    const LinearFit fit = solve(all, blocks);
    for (std::size_t j = 0; j < joints(); ++j) {
      double square = 0;
      for (const std::size_t b : blocks) square += rows_[j].sums[b].square;
      // noise-free: no more than 1e-9 of the signal
      const auto k = static_cast<Index>(j);
      weights_[k] = fit.rows[k] / std::max(fit.square[k], 1e-18 * square + 1e-300);
    }
  }
  return solve(all, blocks);
}

void BlockSolver::normal(const std::vector<Index>& columns, const std::vector<std::size_t>& blocks, MatrixXd& gram,
                         VectorXd& projection) const {
  const auto p = static_cast<Index>(columns.size());
  gram.setZero(p, p);
  projection.setZero(p);
  for (std::size_t j = 0; j < joints(); ++j) {
    const JointRows& rows = rows_[j];
    const auto [place, local] = felt(rows, columns);
    const double w = weights_[static_cast<Index>(j)];
    for (const std::size_t b : blocks) {
      gram(place, place) += w * rows.sums[b].gram(local, local);
      projection(place) += w * rows.sums[b].projection(local);
    }
    if (rows.extra_y.size() == 0) continue;
    gram(place, place) += w * rows.extra.gram(local, local);
    projection(place) += w * rows.extra.projection(local);
  }
  for (Index i = 0; i < p; ++i) {
    const auto c = static_cast<std::size_t>(columns[static_cast<std::size_t>(i)]);
    if (c >= priors_.size() || priors_[c].std == 0) continue;
    const double information = 1 / (priors_[c].std * priors_[c].std);
    gram(i, i) += information;
    projection[i] += information * priors_[c].mean;
  }
}

LinearFit BlockSolver::solve(const std::vector<Index>& columns, const std::vector<std::size_t>& blocks) const {
  LinearFit fit;
  fit.columns = columns;
  VectorXd projection;
  normal(columns, blocks, fit.information, projection);
  fit.x = SymmetricSolver(fit.information).solve(projection);
  fit.square = square(fit, blocks);
  fit.rows = row_count(blocks);
  return fit;
}

VectorXd BlockSolver::row_count(const std::vector<std::size_t>& blocks) const {
  VectorXd out = VectorXd::Zero(static_cast<Index>(joints()));
  for (std::size_t j = 0; j < joints(); ++j) {
    for (const std::size_t b : blocks) out[static_cast<Index>(j)] += rows_[j].sums[b].rows;
  }
  return out;
}

VectorXd BlockSolver::square(const LinearFit& fit, const std::vector<std::size_t>& blocks) const {
  VectorXd out = VectorXd::Zero(static_cast<Index>(joints()));
  for (std::size_t j = 0; j < joints(); ++j) {
    const VectorXd e = residual(j, fit);
    for (const std::size_t b : blocks)
      out[static_cast<Index>(j)] += e.segment(blocks_.all[b].first, blocks_.all[b].count).squaredNorm();
  }
  return out;
}

VectorXd BlockSolver::residual(std::size_t joint, const LinearFit& fit) const {
  const JointRows& rows = rows_[joint];
  VectorXd e = rows.y;
  for (std::size_t i = 0; i < fit.columns.size(); ++i) {
    const Index local = rows.place(fit.columns[i]);
    if (local >= 0) e -= fit.x[static_cast<Index>(i)] * rows.x.col(local);
  }
  return e;
}

VectorXd BlockSolver::extra_residual(std::size_t joint, const LinearFit& fit) const {
  const JointRows& rows = rows_[joint];
  VectorXd e = rows.extra_y;
  for (std::size_t i = 0; i < fit.columns.size(); ++i) {
    const Index local = rows.place(fit.columns[i]);
    if (local >= 0) e -= fit.x[static_cast<Index>(i)] * rows.extra_x.col(local);
  }
  return e;
}

MatrixXd BlockSolver::cross(const std::vector<Index>& columns, Index from) const {
  MatrixXd out = MatrixXd::Zero(static_cast<Index>(columns.size()), columns_ - from);
  std::vector<Index> last(static_cast<std::size_t>(columns_ - from));
  std::iota(last.begin(), last.end(), from);
  for (std::size_t j = 0; j < joints(); ++j) {
    const JointRows& rows = rows_[j];
    const Felt mine = felt(rows, columns), theirs = felt(rows, last);
    const double w = weights_[static_cast<Index>(j)];
    for (const std::size_t b : blocks_.fit)
      out(mine.place, theirs.place) += w * rows.sums[b].gram(mine.local, theirs.local);
    if (rows.extra_y.size() > 0) out(mine.place, theirs.place) += w * rows.extra.gram(mine.local, theirs.local);
  }
  return out;
}

VectorXd BlockSolver::projection(Index from) const {
  VectorXd out = VectorXd::Zero(columns_ - from);
  for (std::size_t j = 0; j < joints(); ++j) {
    const JointRows& rows = rows_[j];
    for (std::size_t i = 0; i < rows.column.size(); ++i) {
      const Index c = rows.column[i];
      if (c < from) continue;
      const auto local = static_cast<Index>(i);
      double sum = rows.extra_y.size() > 0 ? rows.extra.projection[local] : 0;
      for (const std::size_t b : blocks_.fit) sum += rows.sums[b].projection[local];
      out[c - from] += weights_[static_cast<Index>(j)] * sum;
    }
  }
  return out;
}

MatrixXd BlockSolver::gram(Index first, Index count) const {
  MatrixXd out = MatrixXd::Zero(count, count);
  for (std::size_t j = 0; j < joints(); ++j) {
    const JointRows& rows = rows_[j];
    const Index at = rows.place(first);
    if (at < 0) continue;
    const double w = weights_[static_cast<Index>(j)];
    for (const std::size_t b : blocks_.fit) out += w * rows.sums[b].gram.block(at, at, count, count);
    if (rows.extra_y.size() > 0) out += w * rows.extra.gram.block(at, at, count, count);
  }
  return out;
}

}  // namespace fxdyn::diagnosis
