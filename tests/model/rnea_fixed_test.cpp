#include <gtest/gtest.h>

#include "host_tools/effects/evaluator.hpp"
#include "host_tools/effects/identified_model.hpp"
#include "host_tools/effects/link_parameters.hpp"
#include "host_tools/export/export.hpp"
#include "host_tools/export/proof.hpp"
#include "host_tools/regression/regressor.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/random.hpp"

namespace fxdyn {
namespace {

/// PUMA 560, or the same arm with its third joint sliding.
IdentifiedModel arm(bool prismatic) {
  IdentifiedModel model;
  model.robot = read_urdf(FXDYN_SOURCE_DIR "/host_tools/demo/puma560.urdf");
  if (prismatic) model.robot.joints[2].type = JointType::prismatic;
  const DhChain chain = to_dh(model.robot);
  const double rated[] = {97.6, 186.4, 89.4, 24.2, 20.1, 21.3};
  for (std::size_t j = 0; j < model.robot.size(); ++j) {
    model.inertia.push_back(to_link_inertia(*model.robot.joints[j].inertial, chain.urdf_in_dh[j]));
    JointFit fit;
    fit.rated_torque = rated[j];
    fit.tau_limit = 5 * rated[j];
    fit.q_lower = prismatic && j == 2 ? -0.5 : -2.8;
    fit.q_upper = -fit.q_lower;
    fit.dq_limit = 4;
    fit.ddq_limit = 20;
    model.joints.push_back(fit);
  }
  return model;
}

TickStates random_states(const IdentifiedModel& model, int count, std::uint64_t seed) {
  Random random(seed);
  const auto n = static_cast<Eigen::Index>(model.robot.size());
  TickStates s{"random", Eigen::VectorXd::LinSpaced(count, 0, 1), Eigen::MatrixXd(count, n), Eigen::MatrixXd(count, n),
               Eigen::MatrixXd(count, n)};
  for (Eigen::Index k = 0; k < count; ++k) {
    for (Eigen::Index j = 0; j < n; ++j) {
      const JointFit& fit = model.joints[static_cast<std::size_t>(j)];
      const bool corner = k % 4 == 0;
      s.q(k, j) = random.uniform(fit.q_lower, fit.q_upper);
      s.dq(k, j) = fit.dq_limit * (corner ? (random.uniform() < 0.5 ? -1 : 1) : random.uniform(-1, 1));
      s.ddq(k, j) = fit.ddq_limit * (corner ? (random.uniform() < 0.5 ? -1 : 1) : random.uniform(-1, 1));
    }
  }
  return s;
}

TEST(RneaFixed, StaysWithinAHundredThousandthOfRatedTorque) {
  for (const bool prismatic : {false, true}) {
    const IdentifiedModel model = arm(prismatic);
    const Formats formats = choose_formats(model);
    const QuantisationError error = quantisation_error(model, formats, {random_states(model, 20'000, 9)});
    EXPECT_EQ(error.saturations, 0U);
    for (std::size_t j = 0; j < model.joints.size(); ++j) {
      EXPECT_LT(error.largest[static_cast<Eigen::Index>(j)], 1e-5 * model.joints[j].rated_torque) << "joint " << j + 1;
    }
  }
}

/// The arm with other sizes: inertia times `mass`, limits times `speed`, rated torque as it comes; base parameters
/// instead of the links' own if `base` (they put m = 0 and make forces tiny against moments).
IdentifiedModel sized_arm(bool prismatic, double mass, double speed, bool base) {
  IdentifiedModel model = arm(prismatic);
  const BaseSet set = find_base(to_dh(model.robot));
  Eigen::VectorXd parameters(60);
  for (std::size_t i = 0; i < 6; ++i) {
    const auto values = to_array(model.inertia[i]);
    for (std::size_t p = 0; p < parameters_per_link; ++p)
      parameters[static_cast<Eigen::Index>(10 * i + p)] = mass * values[p];
  }
  if (base) {
    const Eigen::VectorXd beta = set.grouping * parameters;
    parameters.setZero();
    for (std::size_t i = 0; i < set.columns.size(); ++i)
      parameters[set.columns[i]] = beta[static_cast<Eigen::Index>(i)];
  }
  for (std::size_t i = 0; i < 6; ++i) {
    std::array<double, parameters_per_link> values{};
    for (std::size_t p = 0; p < parameters_per_link; ++p) values[p] = parameters[static_cast<Eigen::Index>(10 * i + p)];
    model.inertia[i] = to_inertia(values);
  }
  for (JointFit& joint : model.joints) {
    joint.dq_limit *= speed;
    joint.ddq_limit *= speed * speed;
    joint.tau_limit = unbounded;
  }
  const TickStates states = random_states(model, 500, 3);
  const Eigen::MatrixXd torque = predict(model, states.q, states.dq, states.ddq, 0.002);
  for (std::size_t j = 0; j < 6; ++j) {
    model.joints[j].rated_torque = torque.col(static_cast<Eigen::Index>(j)).cwiseAbs().maxCoeff();
    model.joints[j].tau_limit = 2 * model.joints[j].rated_torque;
  }
  return model;
}

TEST(RneaFixed, FormatsFitRobotsOfAnySizeAndSpeed) {
  // A 64-bit sum that wraps gives the same garbage on host and target: only the comparison with double shows it.
  for (const bool prismatic : {false, true}) {
    for (const bool base : {false, true}) {
      for (const double mass : {1e-4, 1e-2, 1.0, 1e2}) {
        for (const double speed : {0.01, 0.1, 0.3, 1.0, 3.0}) {
          const IdentifiedModel model = sized_arm(prismatic, mass, speed, base);
          const Formats formats = choose_formats(model);
          const QuantisationError error = quantisation_error(model, formats, {random_states(model, 300, 9)});
          // The last joint carries next to nothing: judged against the largest, whose formats it shares.
          double largest = 0;
          for (const JointFit& joint : model.joints) largest = std::max(largest, joint.rated_torque);
          EXPECT_EQ(error.saturations, 0U) << mass << " " << speed;
          EXPECT_LT(error.largest.maxCoeff(), 2e-6 * largest)
              << prismatic << base << " mass " << mass << " speed " << speed;
        }
      }
    }
  }
}

TEST(RneaFixed, FormatsThatAreTooNarrowFailTheProof) {
  const IdentifiedModel model = arm(false);
  Formats formats = choose_formats(model);
  EXPECT_TRUE(prove(model, &formats).too_large.empty());
  formats[Quantity::force] += 5;
  const std::vector<Kind> too_large = prove(model, &formats).too_large;
  ASSERT_EQ(too_large.size(), 1U);
  EXPECT_EQ(too_large[0].quantity, Quantity::force);
  // and where such a number really overflows, the host says so instead of wrapping
  const TickStates states = random_states(model, 200, 9);
  EXPECT_THROW(quantisation_error(model, formats, {states}), DataError);
}

TEST(RneaFixed, SetpointsBeyondTheLimitsAreCutAndCounted) {
  const IdentifiedModel model = arm(false);
  const Formats formats = choose_formats(model);
  TickStates states = random_states(model, 200, 9);
  states.q *= 1e6;
  states.dq *= -1e6;
  EXPECT_GT(quantisation_error(model, formats, {states}).saturations, 2000U);
}

TEST(RneaFixed, ProvenBoundsHoldForRandomMotion) {
  for (const bool prismatic : {false, true}) {
    for (const bool base : {false, true}) {
      const IdentifiedModel model = sized_arm(prismatic, 1, 1, base);
      const Formats formats = choose_formats(model);
      const Proof proof = prove(model, &formats);
      const QuantisationError error = quantisation_error(model, formats, {within_limits(model, 20'000, 3)});
      const Attained attained = attain(model);
      const Eigen::VectorXd structural = prove_structural(model, attained.structural, 1, 2000);
      for (Eigen::Index j = 0; j < 6; ++j) {
        EXPECT_LE(error.largest[j], proof.error[j]) << "joint " << j + 1;
        EXPECT_LE(proof.error[j], 100 * error.largest[j]) << "joint " << j + 1;
        EXPECT_LE(attained.structural[j], structural[j]) << "joint " << j + 1;
        EXPECT_LE(structural[j], proof.torque[j]) << "joint " << j + 1;
      }
    }
  }
}

TEST(Regressor, TimesParametersIsRnea) {
  for (const bool prismatic : {false, true}) {
    const IdentifiedModel model = arm(prismatic);
    Regressor regressor(to_dh(model.robot));
    const TickStates states = random_states(model, 200, 13);
    const Eigen::MatrixXd torque = predict(model, states.q, states.dq, states.ddq, 0.002);
    Eigen::VectorXd parameters(60);
    for (std::size_t i = 0; i < 6; ++i) {
      const auto values = to_array(model.inertia[i]);
      for (std::size_t p = 0; p < parameters_per_link; ++p)
        parameters[static_cast<Eigen::Index>(10 * i + p)] = values[p];
    }
    for (Eigen::Index k = 0; k < states.q.rows(); ++k) {
      const Eigen::VectorXd product = regressor(states.q.row(k), states.dq.row(k), states.ddq.row(k)) * parameters;
      ASSERT_LT((product - torque.row(k).transpose()).norm(), 1e-11 * torque.row(k).norm());
    }
  }
}

TEST(Regressor, BaseParametersOfThePuma560) {
  const DhChain chain = to_dh(arm(false).robot);
  const BaseSet base = find_base(chain);
  EXPECT_EQ(base.columns.size(), 36U);
  std::size_t rotors = 0;
  for (Eigen::Index j = 0; j < 6; ++j) rotors += !rotor_inertia_is_absorbed(chain, base, j);
  EXPECT_EQ(base.columns.size() + rotors, 40U);  // J3 .. J6 have one of their own
}

TEST(Regressor, TheRepresentativeGivesTheSameTorque) {
  const IdentifiedModel model = arm(false);
  const BaseSet base = find_base(to_dh(model.robot));
  Eigen::VectorXd parameters(60);
  for (std::size_t i = 0; i < 6; ++i) {
    const auto values = to_array(model.inertia[i]);
    for (std::size_t p = 0; p < parameters_per_link; ++p) parameters[static_cast<Eigen::Index>(10 * i + p)] = values[p];
  }
  const Eigen::VectorXd beta = base.grouping * parameters;
  IdentifiedModel representative = model;
  std::vector<std::array<double, parameters_per_link>> links(6);
  for (std::size_t i = 0; i < base.columns.size(); ++i) {
    const auto column = static_cast<std::size_t>(base.columns[i]);
    links[column / 10][column % 10] = beta[static_cast<Eigen::Index>(i)];
  }
  for (std::size_t i = 0; i < 6; ++i) representative.inertia[i] = to_inertia(links[i]);
  const TickStates states = random_states(model, 300, 17);
  const Eigen::MatrixXd a = predict(model, states.q, states.dq, states.ddq, 0.002);
  const Eigen::MatrixXd b = predict(representative, states.q, states.dq, states.ddq, 0.002);
  EXPECT_LT((a - b).norm(), 1e-10 * a.norm());
}

}  // namespace
}  // namespace fxdyn
