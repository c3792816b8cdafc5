// The fit of all unknowns around a model, where one joint's friction is of no form that the model knows.

#include "host_tools/diagnose/refit.hpp"

#include <gtest/gtest.h>

#include <functional>

#include "host_tools/diagnose/base_parameters.hpp"
#include "host_tools/diagnose/plain_error.hpp"
#include "host_tools/effects/effects.hpp"
#include "tests/diagnose/small_problem.hpp"

namespace fxdyn::diagnosis {
namespace {

using Eigen::ArrayXd;

/// Share of the squared error of PUMA's second joint, which has an offset more than the model, that a fit leaves.
/// @param friction that the first joint has more than the model, of its velocity
/// @param sign_width with which the model's own begins there [rad/s]
double left_at_second_joint(const std::function<ArrayXd(const ArrayXd&)>& friction, double sign_width) {
  IdentifiedModel nominal = test::fitted_puma();
  std::vector<SessionLog> logs;
  for (const auto& [role, seed] : {std::pair{Role::train, 1}, std::pair{Role::validate, 2}}) {
    logs.push_back(test::small_session_log(nominal, role, static_cast<std::uint64_t>(seed)));
    ProcessedLog& log = logs.back().log;
    log.tau.col(0).array() += friction(log.motion(0, log.samples()).dq.col(0).array());
    log.tau.col(1).array() += 3;
  }
  nominal.joints[0].sign_width = sign_width;
  Models models = test::around(nominal);
  const double before = plain_error(models.current, logs)[1];
  refit(models, logs, test::no_whitening(), 8);
  return plain_error(models.current, logs)[1] / before;
}

// No width of the first joint's sign function is any good there, and a step towards another one makes its error rise.
TEST(Refit, FitsAJointWhateverAnotherOneLacks) {
  for (const double width : {0.02, 0.3, 2.0}) {
    EXPECT_LT(left_at_second_joint([](const ArrayXd& dq) -> ArrayXd { return 0 * dq; }, width), 0.01) << width;
    EXPECT_LT(left_at_second_joint([](const ArrayXd& dq) -> ArrayXd { return 2 * dq.cube() - 3 * dq; }, width), 0.01)
        << width;
    EXPECT_LT(left_at_second_joint([](const ArrayXd& dq) -> ArrayXd { return 20 * (6 * dq).sin(); }, width), 0.01)
        << width;
  }
}

// The second joint's offset is fitted, and nothing else moves although the first one's has changed as well.
TEST(Refit, OfSomeJointsLeavesAllElseAsItIs) {
  const IdentifiedModel nominal = test::fitted_puma();
  std::vector<SessionLog> logs{test::small_session_log(nominal, Role::train, 1)};
  logs[0].log.tau.col(0).array() += 3;
  logs[0].log.tau.col(1).array() += 3;
  Models models = test::around(nominal);
  refit(models, logs, test::no_whitening(), 8, {false, true, false, false, false, false});
  const auto offset = [](const IdentifiedModel& model, std::size_t j) { return model.joints[j].effects[2].linear[0]; };
  EXPECT_NEAR(offset(models.current, 1) - offset(nominal, 1), 3, 0.02);
  EXPECT_EQ(offset(models.current, 0), offset(nominal, 0));
  for (std::size_t c = 0; c < nominal.base.size(); ++c)
    EXPECT_EQ(models.current->base[c].value, nominal.base[c].value) << c;
}

/// A PUMA whose first joint has friction in proportion to the link's load, in which the rotor has no part.
Models with_rotor(Rotor rotor, double inertia) {
  Models models = test::around(test::fitted_puma());
  models.current->joints[0].effects.push_back(test::named_effect("load_friction", {}, {0.3}));
  rotor.in_base = hidden_rotor(models.current, 0);
  bring_rotor(models, rotor, inertia);
  return models;
}

// What such a fit leaves is what one leaves that knows the rotor.
TEST(Refit, ARotorHasNoMoreThanTheJointsInertia) {
  constexpr double least = 0.3;
  const IdentifiedModel robot = with_rotor({}, 2.5).current;
  const std::vector<SessionLog> logs{test::small_session_log(robot, Role::train, 1),
                                     test::small_session_log(robot, Role::validate, 2)};
  const auto fitted = [&](const Rotor& rotor, double start) {
    Models models = with_rotor(rotor, start);
    refit(models, logs, test::no_whitening(), 8);
    return std::pair(rotor_of(models.current->joints[0])->linear[0], plain_error(models.current, logs)[0]);
  };
  EXPECT_NEAR(fitted({}, least).first, 2.5, 0.1);
  const double known = fitted({.inertia = least, .std = 1e-6}, least).second;
  for (const double start : {0.1, least}) {
    const auto [inertia, left] = fitted({.most = least}, start);
    EXPECT_EQ(inertia, least) << start;
    EXPECT_LT(left, 1.01 * known) << start;
  }
}

}  // namespace
}  // namespace fxdyn::diagnosis
