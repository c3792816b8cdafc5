#include "host_tools/regression/metrics.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

namespace fxdyn {
namespace {

LogErrors log_of(Role role, double rmse, double relative, double noise) {
  return {"a.csv", role, 0.25, 8.5, {{"hip", "N*m", {rmse, relative, 1.5 * rmse, noise, -0.125}}}};
}

TEST(Metrics, WhatIsWrittenIsRead) {
  const std::vector<StageErrors> stages{{"friction", {log_of(Role::train, 0.1, 0.05, 0.01)}},
                                        {"bls", {log_of(Role::test, 1.0 / 3, 0.5, NAN)}}};
  const nlohmann::json metrics{{"stages", to_json(stages)}};
  const auto again = stages_of(nlohmann::json::parse(metrics.dump()));
  ASSERT_EQ(again.size(), 2);
  EXPECT_EQ(again[1].stage, "bls");
  EXPECT_EQ(again[1].logs[0].role, Role::test);
  EXPECT_EQ(again[1].logs[0].joints[0].metrics.rmse, 1.0 / 3);
  EXPECT_TRUE(std::isnan(again[1].logs[0].joints[0].metrics.noise_floor));
  EXPECT_EQ(nlohmann::json({{"stages", to_json(again)}}).dump(), metrics.dump());
}

TEST(Metrics, KeysAreThoseOfTheFile) {
  const nlohmann::json log = to_json(log_of(Role::validate, 0.1, 0.05, 0.01));
  EXPECT_EQ(log.at("role"), "validate");
  EXPECT_EQ(log.at("joints").at(0).at("index"), 1);
  EXPECT_EQ(log.at("joints").at(0).at("rmse_raw"), 1.5 * 0.1);
}

TEST(Metrics, ErrorsOfARoleArePooledAsMeanSquares) {
  const std::vector<LogErrors> logs{log_of(Role::test, 3, 0.3, 0.1), log_of(Role::test, 4, 0.2, 0.1),
                                    log_of(Role::train, 100, 1, 1)};
  const PooledError error = pooled_error(logs, Role::test, 0);
  EXPECT_DOUBLE_EQ(error.rmse, std::sqrt(12.5));
  EXPECT_DOUBLE_EQ(error.rms, std::sqrt((100.0 + 400.0) / 2));
  EXPECT_DOUBLE_EQ(error.noise_floor, 0.1);
}

TEST(Metrics, ValidationErrorIsTheMeanLogarithm) {
  const StageErrors stage{
      "bls", {log_of(Role::validate, 2, 1, 0), log_of(Role::validate, 8, 1, 0), log_of(Role::train, 1e6, 1, 0)}};
  EXPECT_DOUBLE_EQ(validation_error(stage), std::log(4));
  EXPECT_TRUE(std::isnan(validation_error({"bls", {}})));
}

TEST(Metrics, ARoleThatIsNoneIsRefused) { EXPECT_ANY_THROW(role_of("tset")); }

}  // namespace
}  // namespace fxdyn
