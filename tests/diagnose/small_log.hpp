#pragma once

#include <cmath>
#include <numbers>

#include "host_tools/regression/dataset.hpp"
#include "host_tools/support/random.hpp"
#include "tests/simulate/support.hpp"
#include "tests/support/filter.hpp"

namespace fxdyn::test {

inline constexpr double small_log_step_s = 0.004, small_log_s = 20;

/// A PUMA 560, or the first of its joints, without friction, its joints on sines, and the model's torque with white
/// noise of 0.1 N*m.
/// @param second amplitude of a faster sine, whose phase depends on the seed, so that no position comes twice [rad]
inline ProcessedLog small_log(const IdentifiedModel& model, Role role, std::uint64_t seed, double second = 0) {
  const auto samples = static_cast<Eigen::Index>(small_log_s / small_log_step_s);
  Log log;
  log.file = "small.csv";
  log.role = role;
  log.step_s = small_log_step_s;
  log.to_s = small_log_s;
  log.t = Eigen::VectorXd::LinSpaced(samples, 0, small_log_s - small_log_step_s);
  const auto n = static_cast<Eigen::Index>(model.robot.size());
  log.q.resize(samples, n);
  for (Eigen::Index j = 0; j < n; ++j) {
    const double w = 2 * std::numbers::pi * (0.2 + 0.05 * static_cast<double>(j));
    log.q.col(j) = (0.8 - second) * (w * log.t.array()).sin() +
                   second * (2.618 * w * log.t.array() + static_cast<double>(seed)).sin();
  }
  log.tau = Eigen::MatrixXd::Zero(samples, n);
  ProcessedLog processed = process(log, filter_of(20, 10, 0.3));
  Random random(seed);
  processed.tau = predict(model, processed);
  for (double& torque : processed.tau.reshaped()) torque += 0.1 * random.normal();
  return processed;
}

}  // namespace fxdyn::test
