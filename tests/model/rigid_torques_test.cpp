#include "host_tools/effects/rigid_torques.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>

#include "host_tools/effects/evaluator.hpp"
#include "host_tools/excite/nominal.hpp"
#include "host_tools/support/random.hpp"
#include "host_tools/support/vectors.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

/// A robot with one sliding joint, as a tilted base and a load have it.
IdentifiedModel robot() {
  const std::vector<double> rated{97.6, 186.4, 89.4, 24.2, 20.1, 21.3}, velocity{1.6, 1.5, 2.2, 4, 3.6, 4};
  Robot puma = read_urdf(FXDYN_SOURCE_DIR "/host_tools/demo/puma560.urdf");
  puma.joints[2].type = JointType::prismatic;
  IdentifiedModel model = nominal_from_urdf(puma, rated, velocity).model;
  EffectFit tilt, load;
  tilt.effect = "gravity_tilt";
  tilt.linear = {0.1, -0.2};
  load.effect = "payload";
  load.linear = {1.5, 0.01, 0.02, 0.1};
  model.body = {tilt, load};
  return model;
}

struct Rows {
  MatrixXd q, dq, ddq;
  explicit Rows(Index samples) {
    Random random(static_cast<std::uint64_t>(samples));
    for (MatrixXd* m : {&q, &dq, &ddq}) *m = MatrixXd::NullaryExpr(samples, 6, [&] { return 3 * random.normal(); });
    q.row(0).setZero();  // signs of zeros
    dq.row(0).setConstant(-0.0);
    ddq.row(0).setZero();
  }
};

/// Samples: fewer than the shortest vector, whole vectors, a rest.
class RigidTorquesOf : public testing::TestWithParam<Index> {};

TEST_P(RigidTorquesOf, HaveTheBitsOfOneSampleAtATime) {
  const IdentifiedModel model = unlimited(robot());
  const Rows rows(GetParam());
  Evaluator<Real> one_by_one(model, 0.001);
  MatrixXd expected(rows.q.rows(), 6);
  std::vector<JointState<Real>> states(6);
  for (Index k = 0; k < expected.rows(); ++k) {
    for (Index j = 0; j < 6; ++j) states[static_cast<std::size_t>(j)] = {rows.q(k, j), rows.dq(k, j), rows.ddq(k, j)};
    const auto tau = one_by_one.rigid_body(states);
    for (Index j = 0; j < 6; ++j) expected(k, j) = tau[static_cast<std::size_t>(j)];
  }
  const int widest = at_once;
  for (const int width : {2, 4, 8}) {
    at_once = std::min(widest, width);
    MatrixXd tau = MatrixXd::Constant(expected.rows() + 1, 6, 7);
    rigid_torques(rigid_body_of(model), rows.q, rows.dq, rows.ddq, tau.topRows(expected.rows()));
    EXPECT_EQ(tau.topRows(expected.rows()), expected) << width;
    EXPECT_EQ(tau.bottomRows(1), MatrixXd::Constant(1, 6, 7)) << "written beyond the end, " << width;
  }
  at_once = widest;
}

INSTANTIATE_TEST_SUITE_P(Samples, RigidTorquesOf, testing::Values(1, 2, 3, 7, 8, 16, 29));

}  // namespace
}  // namespace fxdyn
