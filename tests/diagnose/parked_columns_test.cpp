#include "host_tools/diagnose/parked_columns.hpp"

#include <gtest/gtest.h>

namespace fxdyn::diagnosis {
namespace {

using Eigen::MatrixXd;

std::vector<ProcessedLog> logs_to_park() {
  std::vector<ProcessedLog> logs(2);
  for (ProcessedLog& log : logs) {
    log.q = MatrixXd::Random(1000, 3);
    log.tau = MatrixXd::Random(1000, 3);
  }
  logs[1].lost_velocity = MatrixXd::Random(1000, 3);
  return logs;
}

TEST(ParkedColumns, ComeBackAsTheyWere) {
  std::vector<ProcessedLog> logs = logs_to_park();
  const std::vector<ProcessedLog> before = logs;
  ParkedColumns parked(logs, 2000);
  for (const ProcessedLog& log : logs) {
    EXPECT_EQ(log.q.size() + log.tau.size() + log.lost_velocity.size(), 0);
    EXPECT_EQ(log.samples(), 1000);
  }
  parked.take_back();
  for (std::size_t l = 0; l < logs.size(); ++l) {
    EXPECT_EQ(logs[l].q, before[l].q);
    EXPECT_EQ(logs[l].tau, before[l].tau);
    EXPECT_EQ(logs[l].lost_velocity, before[l].lost_velocity);
  }
}

TEST(ParkedColumns, ShortLogsStay) {
  std::vector<ProcessedLog> logs = logs_to_park();
  ParkedColumns parked(logs, 2001);
  EXPECT_EQ(logs[0].q.cols(), 3);
  parked.take_back();
  EXPECT_EQ(logs[0].q.cols(), 3);
}

TEST(ParkedColumns, LogsWithEncodersOfLinksStay) {
  std::vector<ProcessedLog> logs = logs_to_park();
  logs[1].qlink = logs[1].q;
  const ParkedColumns parked(logs, 0);
  EXPECT_EQ(logs[0].tau.cols(), 3);
}

TEST(ParkedColumns, OfAnOutcomeComeBackWhereTheyFillMuch) {
  std::vector<MatrixXd> features{MatrixXd::Random(100, 7), {}, MatrixXd::Random(50, 2)};
  const std::vector<MatrixXd> before = features;
  ParkedColumns small(features, 6401);
  EXPECT_EQ(features[0].size(), 700);
  ParkedColumns parked(features, 6400);
  EXPECT_EQ(features[0].size() + features[2].size(), 0);
  parked.take_back();
  EXPECT_EQ(features[0], before[0]);
  EXPECT_EQ(features[1].size(), 0);
  EXPECT_EQ(features[2], before[2]);
}

}  // namespace
}  // namespace fxdyn::diagnosis
