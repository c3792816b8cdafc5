#include "host_tools/signals/fourier.hpp"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "host_tools/excite/evolution.hpp"
#include "host_tools/excite/excite.hpp"
#include "host_tools/support/files.hpp"
#include "host_tools/support/random.hpp"
#include "tests/support/files.hpp"

namespace fxdyn {
namespace {

TEST(BoundaryNullSpace, EveryCombinationStartsAndEndsAtRest) {
  Random random(3);
  for (const int order : {2, 3, 5, 8, 20}) {
    const FourierNullSpace null = boundary_null_space(order);
    ASSERT_EQ(null.size(), 2 * order - 3);
    EXPECT_TRUE((null.a.transpose() * null.a).isIdentity(1e-12));
    EXPECT_TRUE((null.b.transpose() * null.b).isIdentity(1e-12));
    FourierJoint joint{0.7, Eigen::VectorXd::Zero(order), Eigen::VectorXd::Zero(order)};
    for (Eigen::Index i = 0; i < null.a.cols(); ++i) joint.a += random.normal() * null.a.col(i);
    for (Eigen::Index i = 0; i < null.b.cols(); ++i) joint.b += random.normal() * null.b.col(i);
    for (const double t : {0.0, 4.0}) {
      const FourierState at = evaluate(joint, 4.0, t);
      EXPECT_NEAR(at.q, 0.7, 1e-12) << order;
      EXPECT_NEAR(at.dq, 0, 1e-12) << order;
      EXPECT_NEAR(at.ddq, 0, 1e-10) << order;
    }
  }
}

TEST(BoundaryNullSpace, IsWhereTheProjectionLeads) {
  Random random(4);
  const int order = 6;
  const FourierNullSpace null = boundary_null_space(order);
  FourierJoint joint{0, Eigen::VectorXd(order), Eigen::VectorXd(order)};
  for (int i = 0; i < order; ++i) joint.a[i] = random.normal(), joint.b[i] = random.normal();
  FourierJoint projected = joint;
  project_onto_boundary_conditions(projected);
  EXPECT_LT((projected.a - null.a * (null.a.transpose() * joint.a)).norm(), 1e-12);
  EXPECT_LT((projected.b - null.b * (null.b.transpose() * joint.b)).norm(), 1e-12);
}

TEST(Evolution, FindsTheBottomOfARotatedEllipsoid) {
  // Axes of lengths 1 .. 1000: steepest descent would still be at it.
  Eigen::MatrixXd mix(8, 8);
  Random random(5);
  for (double& x : mix.reshaped()) x = random.normal();
  const Eigen::MatrixXd q = Eigen::HouseholderQR<Eigen::MatrixXd>(mix).householderQ();
  const Eigen::VectorXd weights =
      Eigen::VectorXd::LinSpaced(8, 0, 6).unaryExpr([](double e) { return std::pow(10, e); });
  const Eigen::VectorXd bottom = Eigen::VectorXd::Constant(8, 0.4);
  int generations = 0;
  const auto found = minimise([&](const Eigen::VectorXd& x) { return weights.dot((q * (x - bottom)).cwiseAbs2()); },
                              Eigen::VectorXd::Zero(8), {800, 10, 0.3, 7}, [&] { ++generations; });
  EXPECT_LT((found - bottom).norm(), 1e-6);
  EXPECT_EQ(generations, 800);
}

TEST(Evolution, NeverReturnsWorseThanItsStart) {
  const Eigen::VectorXd start = Eigen::VectorXd::Constant(3, 1);
  const auto spike = [&](const Eigen::VectorXd& x) { return x == start ? -1.0 : x.squaredNorm(); };
  EXPECT_EQ(minimise(spike, start, {20, 6, 0.1, 1}, [] {}), start);
}

// Figures of the project's study of the paper, to the digits given there.
TEST(PaperTable1, ViolatesItsBoundaryConditionsAndIsProjectedOntoThem) {
  const Table1 table = paper_table1();
  const Motion &printed = table.printed_motion, &projected = table.projected_motion;
  ASSERT_EQ(printed.q.rows(), 5001);
  EXPECT_NEAR(printed.q.row(0).minCoeff(), -2.86, 0.005);
  EXPECT_NEAR(printed.q.row(0).maxCoeff(), 2.96, 0.005);
  EXPECT_NEAR(printed.dq.row(0).cwiseAbs().maxCoeff(), 2.68, 0.005);
  EXPECT_NEAR(printed.ddq.row(0).cwiseAbs().maxCoeff(), 11.2, 0.05);
  double least_a = 1, most_a = 0, least_b = 1, most_b = 0;
  for (std::size_t j = 0; j < 6; ++j) {
    const double a = (table.projected[j].a - table.printed[j].a).norm() / table.printed[j].a.norm();
    const double b = (table.projected[j].b - table.printed[j].b).norm() / table.printed[j].b.norm();
    least_a = std::min(least_a, a), most_a = std::max(most_a, a);
    least_b = std::min(least_b, b), most_b = std::max(most_b, b);
    EXPECT_NEAR(projected.q(0, static_cast<Eigen::Index>(j)), table.printed[j].centre, 1e-12);
  }
  EXPECT_NEAR(least_a, 0.02, 0.005);
  EXPECT_NEAR(most_a, 0.65, 0.005);
  EXPECT_NEAR(least_b, 0.26, 0.005);
  EXPECT_NEAR(most_b, 0.97, 0.005);
  for (const Eigen::Index k : {Eigen::Index{0}, projected.q.rows() - 1}) {
    EXPECT_LT(projected.dq.row(k).norm(), 1e-12);
    EXPECT_LT(projected.ddq.row(k).norm(), 1e-10);
  }
  EXPECT_NEAR(projected.q.minCoeff(), -3.95, 0.005);
  EXPECT_NEAR(projected.q.maxCoeff(), 2.65, 0.005);
  EXPECT_NEAR(projected.dq.cwiseAbs().maxCoeff(), 5.37, 0.005);
  EXPECT_NEAR(projected.ddq.cwiseAbs().maxCoeff(), 9.7, 0.05);
}

TEST(PaperTable1, IsWritten) {
  const auto directory = test::folder() / "paper";
  excite_paper(directory);
  const auto json = nlohmann::json::parse(read_file(directory / "table1.json"));
  ASSERT_EQ(json.at("joints").size(), 6U);
  EXPECT_NEAR(json["joints"][4]["start_printed"]["q_less_q0"].get<double>(), -3.2975, 1e-3);
  EXPECT_NEAR(json["joints"][4]["start_projected"]["q_less_q0"].get<double>(), 0, 1e-12);
  for (const char* name : {"table1_printed", "table1_projected"}) {
    EXPECT_TRUE(std::filesystem::exists(directory / (std::string(name) + ".csv")));
    EXPECT_NE(read_file(directory / (std::string(name) + ".svg")).find("<svg"), std::string::npos);
  }
}

}  // namespace
}  // namespace fxdyn
