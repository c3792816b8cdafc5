#include "host_tools/signals/same_motion.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace fxdyn {
namespace {

/// One joint on a sine; it rests in its last fifth.
Log swing(double phase) {
  constexpr Eigen::Index n = 1000;
  Log log;
  log.t = Eigen::VectorXd::LinSpaced(n, 0, 2);
  log.q.resize(n, 1);
  log.tau.resize(n, 1);
  for (Eigen::Index k = 0; k < n; ++k) {
    const double angle = 3 * log.t[std::min<Eigen::Index>(k, 800)] + phase;
    log.q(k, 0) = std::sin(angle);
    log.tau(k, 0) = 5 * std::cos(angle);
  }
  return log;
}

TEST(SameMotion, ACopyWithOtherStampsHasTheSameRows) {
  const Log log = swing(0);
  Log later = log;
  later.t.array() += 1000;
  const auto prints = row_prints(log);
  EXPECT_EQ(prints.size(), 800U);  // those in which it rests tell nothing
  EXPECT_EQ(rows_in_common(prints, row_prints(later)), prints.size());
  later.q = Eigen::MatrixXd(log.q.bottomRows(700));
  later.tau = Eigen::MatrixXd(log.tau.bottomRows(700));
  later.t = Eigen::VectorXd(log.t.head(700));
  EXPECT_EQ(rows_in_common(prints, row_prints(later)), 500U);
}

TEST(SameMotion, TheSamePathWithOtherTorqueHasNone) {
  const auto prints = row_prints(swing(0));
  EXPECT_EQ(rows_in_common(prints, row_prints(swing(1.1))), 0U);
  Log noisy = swing(0);
  for (Eigen::Index k = 0; k < noisy.samples(); ++k) noisy.tau(k, 0) += 1e-3 * std::sin(static_cast<double>(k * k));
  EXPECT_LT(rows_in_common(prints, row_prints(noisy)), 20U);
}

}  // namespace
}  // namespace fxdyn
