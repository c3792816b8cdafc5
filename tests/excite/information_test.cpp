#include "host_tools/regression/information.hpp"

#include <gtest/gtest.h>

#include "host_tools/support/random.hpp"

namespace fxdyn {
namespace {

const std::filesystem::path ur10 = FXDYN_SOURCE_DIR "/tests/excite/ur10_like.urdf";

/// A matrix with orthonormal columns times the given singular values, as the information of its rows.
Eigen::MatrixXd of_singular_values(const Eigen::VectorXd& values) {
  const Eigen::Index p = values.size();
  Eigen::MatrixXd mix(p, p);
  Random random(2);
  for (double& x : mix.reshaped()) x = random.normal();
  const Eigen::MatrixXd v = Eigen::HouseholderQR<Eigen::MatrixXd>(mix).householderQ();
  return v * values.cwiseAbs2().asDiagonal() * v.transpose();
}

TEST(Conditioning, IgnoresTheUnitsOfTheColumns) {
  Eigen::Matrix3d m;
  m << 4, 1, 0, 1, 9, 2, 0, 2, 1;
  const Eigen::Vector3d units(1000, 1e-3, 7);
  const Eigen::Matrix3d scaled = units.asDiagonal() * m * units.asDiagonal();
  EXPECT_NEAR(scaled_condition(scaled), scaled_condition(m), 1e-9);
  EXPECT_NEAR(scaled_condition(Eigen::Matrix3d(Eigen::Vector3d(1, 100, 1e4).asDiagonal())), 1, 1e-12);
  // two columns at an angle with cosine c: sqrt((1 + c) / (1 - c))
  Eigen::Matrix2d pair;
  pair << 1, 0.6, 0.6, 1;
  EXPECT_NEAR(scaled_condition(pair), 2, 1e-12);
}

TEST(Conditioning, OfALostDirectionIsInfinite) {
  Eigen::Matrix2d same;
  same << 1, 1, 1, 1;
  EXPECT_TRUE(std::isinf(scaled_condition(same)));
  EXPECT_TRUE(std::isinf(scaled_condition(Eigen::Vector2d(1, 0).asDiagonal().toDenseMatrix())));
  EXPECT_NEAR(log_determinant(of_singular_values(Eigen::Vector3d(1, 10, 100))), 2 * std::log(1000), 1e-9);
}

TEST(ParameterColumns, InformationIsTheGramOfTheRegressorWithFriction) {
  const Robot robot = read_urdf(ur10);
  const double width = 0.05;
  const ParameterColumns columns(robot, Eigen::VectorXd::Constant(6, width));
  ASSERT_EQ(columns.base_size(), 36);  // Sec. 1 of the study: 36 for a UR5, 40 with rotor inertia, 3 more a joint
  ASSERT_EQ(columns.size(), 36 + 4 + 3 * 6);
  Random random(8);
  const Eigen::Index samples = 30;
  Motion motion{"", 0.01, Eigen::VectorXd::Zero(samples), Eigen::MatrixXd(samples, 6), {}, {}};
  for (double& x : motion.q.reshaped()) x = random.normal();
  motion.dq = motion.q.array().sin();
  motion.ddq = 3 * motion.q.array().cos();
  const Eigen::VectorXd scale = Eigen::VectorXd::LinSpaced(6, 1, 3);
  const Eigen::MatrixXd found = columns.information(motion, scale);

  const DhChain chain = to_dh(robot);
  const BaseSet base = find_base(chain);
  Regressor regressor(chain);
  Eigen::MatrixXd expected = Eigen::MatrixXd::Zero(columns.size(), columns.size());
  for (Eigen::Index k = 0; k < samples; ++k) {
    Eigen::MatrixXd rows = Eigen::MatrixXd::Zero(6, columns.size());
    rows.leftCols(36) = regressor(motion.q.row(k).transpose(), motion.dq.row(k).transpose(),
                                  motion.ddq.row(k).transpose())(Eigen::all, base.columns);
    for (Eigen::Index c = 36; c < columns.size(); ++c) {
      const std::string& name = columns.names()[static_cast<std::size_t>(c)];
      const Eigen::Index j = columns.joints()[static_cast<std::size_t>(c)];
      if (name.starts_with("viscous")) rows(j, c) = motion.dq(k, j);
      if (name.starts_with("coulomb")) rows(j, c) = std::tanh(motion.dq(k, j) / width);
      if (name.starts_with("offset")) rows(j, c) = 1;
      if (name.starts_with("rotor")) rows(j, c) = motion.ddq(k, j);
    }
    rows = scale.cwiseInverse().asDiagonal() * rows;
    expected += motion.step_s * rows.transpose() * rows;
  }
  EXPECT_LT((found - expected).norm(), 1e-9 * expected.norm());
}

ParameterSizes three_parameters() {
  return {{"m3", "viscous 1", "offset 2"}, {2, 0, 1}, {true, false, false}, Eigen::Vector3d(1, 2, 0.5)};
}

TEST(WeakParameters, GoodOnesAreNotNamed) {
  const Eigen::Vector3d movement(1, 1, 1);
  EXPECT_TRUE(weak_parameters(Eigen::Matrix3d::Identity() * 1e8, three_parameters(), movement).empty());
}

TEST(WeakParameters, ErrorIsTheStandardDeviationOfItsSize) {
  // std 0.005 x size for the second: weak, but told
  const Eigen::Vector3d information(1e8, std::pow(1 / (0.005 * 2), 2), 1e8);
  const auto weak = weak_parameters(information.asDiagonal(), three_parameters(), Eigen::Vector3d(1, 0.5, 0.2));
  ASSERT_EQ(weak.size(), 1U);
  EXPECT_EQ(weak[0].name, "viscous 1");
  EXPECT_NEAR(weak[0].error, 0.005, 1e-9);
  EXPECT_TRUE(weak[0].identifiable);
  EXPECT_EQ(weak[0].joint, 0);  // its own
}

TEST(WeakParameters, ALostCombinationNamesItsMembersAndTheLaziestJoint) {
  // m3 and offset 2 only ever occur together
  Eigen::Matrix3d information = Eigen::Matrix3d::Identity() * 1e8;
  information(0, 2) = information(2, 0) = 1e8;
  const auto weak = weak_parameters(information, three_parameters(), Eigen::Vector3d(1, 0.1, 0.4));
  ASSERT_EQ(weak.size(), 2U);
  EXPECT_EQ(weak[0].name, "m3");
  EXPECT_FALSE(weak[0].identifiable);
  EXPECT_EQ(weak[0].joint, 1);  // of the joints 1 .. 3 that move link 3
  EXPECT_EQ(weak[1].name, "offset 2");
  EXPECT_FALSE(weak[1].identifiable);
  // a column of zeros
  information.setIdentity();
  information *= 1e8;
  information(1, 1) = 0;
  const auto lost = weak_parameters(information, three_parameters(), Eigen::Vector3d(0, 1, 1));
  ASSERT_EQ(lost.size(), 1U);
  EXPECT_EQ(lost[0].name, "viscous 1");
  EXPECT_FALSE(lost[0].identifiable);
}

}  // namespace
}  // namespace fxdyn
