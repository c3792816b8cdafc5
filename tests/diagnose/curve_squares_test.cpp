// What a fit with a free curve says of rows that did not fit it.

#include "host_tools/diagnose/curve_squares.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "host_tools/regression/solver.hpp"
#include "tests/diagnose/small_problem.hpp"

namespace fxdyn::diagnosis {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr std::size_t judged_joint = 1;  // the joint

/// X of that joint on a log's rows: the columns, then curves.
MatrixXd rows_on(const Linearised& problem, const std::vector<Index>& columns, const MatrixXd& curves,
                 std::size_t log) {
  const JointRows& rows = problem.solver().rows(judged_joint);
  const Block& block = problem.blocks().of_log[log];
  MatrixXd out = MatrixXd::Zero(block.count, static_cast<Index>(columns.size()) + curves.cols());
  for (std::size_t c = 0; c < columns.size(); ++c) {
    if (const Index local = rows.place(columns[c]); local >= 0)
      out.col(static_cast<Index>(c)) = rows.x.col(local).segment(block.first, block.count);
  }
  out.rightCols(curves.cols()) = curves.middleRows(block.first, block.count);
  return out;
}

TEST(PredictiveDeviance, IsThatOfItsCovarianceWrittenOut) {
  const IdentifiedModel model = test::fitted_puma();
  const std::vector<SessionLog> logs{test::small_session_log(model, Role::train, 1),
                                     test::small_session_log(model, Role::validate, 2)};
  const Linearised problem(test::around(model), logs, test::no_whitening());
  const std::vector<Index> columns = problem.nuisance();
  MatrixXd curves(problem.blocks().rows(), 2);
  for (std::size_t l = 0; l < logs.size(); ++l) {
    const Block& block = problem.blocks().of_log[l];
    const Eigen::ArrayXd q = logs[l].log.decimate(logs[l].log.q.col(1)).array();
    curves.middleRows(block.first, block.count) << (5 * q).cos().matrix(), (9 * q).sin().matrix();
  }
  const Fold& fold = problem.blocks().folds.at(0);
  const double w = problem.solver().weights()[1];
  const VectorXd& y = problem.solver().rows(judged_joint).y;
  const Block &first = problem.blocks().of_log[0], &second = problem.blocks().of_log[1];
  const MatrixXd fitted = rows_on(problem, columns, curves, 0), judged = rows_on(problem, columns, curves, 1);
  const auto p = static_cast<Index>(columns.size());
  for (const double prior : {1.0, 1e4}) {
    MatrixXd whole = w * fitted.transpose() * fitted;
    VectorXd right = w * fitted.transpose() * y.segment(first.first, first.count);
    MatrixXd gram;
    VectorXd projection;
    problem.solver().normal(columns, fold.fit, gram, projection);
    const VectorXd alone = SymmetricSolver(gram).solve(projection);
    whole.topLeftCorner(p, p) = gram;
    right.head(p) = projection;
    // A millionth more to the diagonal, about the fit without curves.
    const VectorXd little = 1e-6 * gram.diagonal();
    whole.topLeftCorner(p, p).diagonal() += little;
    right.head(p) += little.cwiseProduct(alone);
    whole.bottomRightCorner(2, 2).diagonal().array() += prior;
    const Eigen::LDLT<MatrixXd> fit(whole);
    const VectorXd e = std::sqrt(w) * (y.segment(second.first, second.count) - judged * fit.solve(right));
    const MatrixXd s = MatrixXd::Identity(second.count, second.count) + w * judged * fit.solve(judged.transpose());
    const Eigen::LLT<MatrixXd> llt(s);
    const Deviance deviance = PredictiveDeviance(problem, judged_joint, columns, curves, fold)(prior);
    EXPECT_NEAR(deviance.square, e.dot(llt.solve(e)), 1e-3 * deviance.square) << prior;
    EXPECT_NEAR(deviance.log_determinant, 2 * llt.matrixLLT().diagonal().array().log().sum(), 1e-2) << prior;
  }
}

}  // namespace
}  // namespace fxdyn::diagnosis
