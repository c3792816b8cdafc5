#include "host_tools/regression/fit_data.hpp"

#include <gtest/gtest.h>

#include "host_tools/effects/link_parameters.hpp"
#include "host_tools/support/error.hpp"
#include "tests/support/pendulum.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

const Robot robot = test::pendulum(2);
const IdentifiedModel plant = test::model_of(robot);
/// Base parameters of the plant.
VectorXd beta_of(const FitData& data) {
  VectorXd pi(data.base.grouping.cols());
  for (std::size_t i = 0; i < plant.inertia.size(); ++i) {
    const auto values = to_array(plant.inertia[i]);
    for (std::size_t p = 0; p < values.size(); ++p) pi[static_cast<Index>(i * parameters_per_link + p)] = values[p];
  }
  return data.base.grouping * pi;
}

VectorXd torque_rows(const ProcessedLog& log, Index joint) {
  return log.decimate(log.filter_columns(log.tau.col(joint)));
}

TEST(FitData, RowsTimesTheBaseParametersAreTheTorque) {
  const auto logs =
      test::processed({test::exact_log(plant, Role::train, 1), test::exact_log(plant, Role::validate, 2, 12)});
  const FitData data = make_fit_data(robot, logs, 0);
  const VectorXd beta = beta_of(data);
  ASSERT_EQ(data.first_row, (std::vector<Index>{0, logs[0].rows()}));
  for (Index j = 0; j < 2; ++j) {
    const auto k = static_cast<std::size_t>(j);
    VectorXd torque(logs[0].rows() + logs[1].rows());
    torque << torque_rows(logs[0], j), torque_rows(logs[1], j);
    ASSERT_EQ(data.base_rows[k].rows(), torque.size());
    EXPECT_LT((data.base_rows[k] * beta.tail(data.base_rows[k].cols()) - torque).norm(), 1e-9 * torque.norm()) << j;
    EXPECT_EQ(data.load_rows[k].norm(), 0);
    EXPECT_EQ(data.usable[k].minCoeff(), 1);
  }
  EXPECT_TRUE(data.split.has_validation);
  EXPECT_EQ(data.blocks.size(), 2U);
}

TEST(FitData, LinksBeforeAJointDoNotLoadIt) {
  const auto logs = test::processed({test::exact_log(plant, Role::train, 1)});
  const FitData data = make_fit_data(robot, logs, 0);
  EXPECT_EQ(data.first_base[0], 0);
  ASSERT_GT(data.first_base[1], 0);
  EXPECT_LT(data.base.columns[static_cast<std::size_t>(data.first_base[1] - 1)], 10);
  EXPECT_GE(data.base.columns[static_cast<std::size_t>(data.first_base[1])], 10);
  EXPECT_EQ(data.base_rows[1].cols(), static_cast<Index>(data.base.columns.size()) - data.first_base[1]);
}

TEST(FitData, AKnownLoadHasItsOwnTorque) {
  Log log = test::exact_log(plant, Role::train, 1);
  log.load = Load{1.5, {0.2, 0, 0.05}};
  const auto logs = test::processed({log});
  const FitData data = make_fit_data(robot, logs, 0);
  const Eigen::MatrixXd loaded = predict(plant, logs[0]);  // predict() adds the log's load by itself
  for (Index j = 0; j < 2; ++j) {
    const VectorXd expected = logs[0].decimate(logs[0].filter_columns(loaded.col(j) - log.tau.col(j)));
    ASSERT_GT(expected.norm(), 1);
    EXPECT_LT((data.load_rows[static_cast<std::size_t>(j)] - expected).norm(), 1e-9 * expected.norm()) << j;
  }
}

TEST(Prediction, IsAddedTimesAFactorAtItsOwnTimes) {
  const auto logs = test::processed({test::exact_log(plant, Role::train, 1)});
  for (const double lead_s : {0.0, 0.0017}) {
    IdentifiedModel model = plant;
    model.filter.torque_lead_s = lead_s;
    const Eigen::MatrixXd torque = predict(model, logs[0]);
    ASSERT_EQ(torque.rows(), logs[0].samples());
    Eigen::MatrixXd rest = logs[0].tau;
    add_prediction(-2, model, logs[0], rest);
    EXPECT_LT((rest - (logs[0].tau - 2 * torque)).norm(), 1e-12 * torque.norm());
    for (std::size_t j = 0; j < 2; ++j)
      EXPECT_EQ(predict_joint(model, logs[0], j), torque.col(static_cast<Index>(j))) << j;
    const double off = (torque - logs[0].tau).norm() / torque.norm();
    EXPECT_TRUE(lead_s == 0 ? off < 1e-6 : off > 1e-4) << off;
  }
}

// Windows of one recording are no trajectories of their own: its blocks judge one another.
TEST(FitData, PartsOfARecordingAreOneTrajectory) {
  auto logs = test::processed({test::exact_log(plant, Role::train, 1), test::exact_log(plant, Role::train, 2)});
  const FitData two = make_fit_data(robot, logs, 0);
  EXPECT_FALSE(two.one_recording);
  EXPECT_EQ(two.blocks.size(), 2U);
  logs[1].continues = true;
  const FitData one = make_fit_data(robot, logs, 0);
  EXPECT_TRUE(one.one_recording);
  EXPECT_EQ(one.blocks.size(), 5U);
  EXPECT_EQ(one.blocks.back().to, logs[0].rows() + logs[1].rows());
  EXPECT_EQ(one.first_row, two.first_row);
}

TEST(FitData, SaturatedRowsAndJointsThatAreLeftOutAreNotUsable) {
  auto logs = test::processed({test::exact_log(plant, Role::train, 1), test::exact_log(plant, Role::train, 2)});
  logs[0].saturated[0] = {{1000, 1200}};
  logs[1].left_out = {false, true};
  const FitData data = make_fit_data(robot, logs, 0);
  const Index split = logs[0].rows();
  // The torque's filter spreads a sample over 1 / 12 s: 20 samples more at either end.
  for (Index r = 0; r < split; ++r) {
    const Index sample = logs[0].first + r * logs[0].decimation;
    EXPECT_EQ(data.usable[0][r], sample >= 980 && sample < 1220 ? 0 : 1) << sample;
  }
  EXPECT_EQ(data.usable[0].tail(logs[1].rows()).minCoeff(), 1);
  EXPECT_EQ(data.usable[1].head(split).minCoeff(), 1);
  EXPECT_EQ(data.usable[1].tail(logs[1].rows()).maxCoeff(), 0);
}

std::string refusal(const std::vector<ProcessedLog>& logs, Index own_parameters = 0) {
  try {
    make_fit_data(robot, logs, own_parameters);
  } catch (const DataError& error) {
    return error.what();
  }
  return "";
}

TEST(FitData, AJointThatNeverMovesIsRefused) {
  Log log = test::exact_log(plant, Role::train, 1);
  log.q.col(1).setConstant(0.3);
  log.dq.col(1).setZero();
  log.ddq.col(1).setZero();
  // What the others record does not help: they fit nothing.
  auto logs = test::processed({log, test::exact_log(plant, Role::validate, 2)});
  EXPECT_EQ(refusal(logs),
            "joint 2 (joint_2) never moves in the train logs (range 0.0e+00 rad): record a log in which it does");
  logs[0].left_out = {false, true};
  EXPECT_EQ(refusal(logs), "");
}

TEST(FitData, FewerThanTwoRowsAParameterAreRefused) {
  const auto logs =
      test::processed({test::exact_log(plant, Role::train, 1), test::exact_log(plant, Role::validate, 2)});
  const auto base = static_cast<Index>(find_base(to_dh(robot)).columns.size());
  const Index most = logs[0].rows() * 2 / 2 - base;  // two joints' rows, two a parameter
  EXPECT_EQ(refusal(logs, most), "");
  EXPECT_NE(refusal(logs, most + 1).find("record a longer log"), std::string::npos);
}

}  // namespace
}  // namespace fxdyn
