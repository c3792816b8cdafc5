// What a fit says of itself: standard deviations, robust and recursive fits, saturated torque, essential parameters.

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <numbers>

#include "host_tools/effects/evaluator.hpp"
#include "host_tools/effects/identified_model.hpp"
#include "host_tools/effects/link_parameters.hpp"
#include "host_tools/identify/identify.hpp"
#include "host_tools/regression/essential.hpp"
#include "host_tools/regression/solver.hpp"
#include "host_tools/signals/filter.hpp"
#include "host_tools/signals/fourier.hpp"
#include "host_tools/support/parallel.hpp"
#include "host_tools/support/random.hpp"
#include "tests/support/chains.hpp"
#include "tests/support/filter.hpp"
#include "tests/support/sanitizers.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

const FilterFit filter = test::filter_of(25, 12, 0.3);
constexpr double width = 0.03;

EffectFit effect(const char* name, std::vector<double> linear, std::vector<double> shape = {}) {
  EffectFit fit;
  fit.effect = name;
  fit.linear = std::move(linear);
  fit.shape = std::move(shape);
  return fit;
}

/// The PUMA 560 with friction, offsets and, where it is not absorbed, rotor inertia; presliding on joint 3.
IdentifiedModel plant() {
  IdentifiedModel model;
  model.robot = read_urdf(test::puma560);
  const DhChain chain = to_dh(model.robot);
  for (std::size_t j = 0; j < model.robot.size(); ++j) {
    model.inertia.push_back(to_link_inertia(model.robot.joints[j].inertial.value_or(Inertial{}), chain.urdf_in_dh[j]));
    JointFit joint;
    joint.rated_torque = model.robot.joints[j].limits->effort;
    joint.sign_width = width;
    joint.effects = {effect("viscous", {0.02 * joint.rated_torque}), effect("coulomb", {0.04 * joint.rated_torque}),
                     effect("offset", {0.01 * joint.rated_torque})};
    if (j >= 2) joint.effects.push_back(effect("rotor_inertia", {0.2}));
    if (j == 2) joint.effects.push_back(effect("presliding", {0.02 * joint.rated_torque}, {0.004}));
    model.joints.push_back(joint);
  }
  return model;
}

/// 20 s of excitation at 250 Hz, without noise.
Log record(const IdentifiedModel& model) {
  Log log;
  log.file = "log.csv";
  log.step_s = 0.004;
  constexpr Index samples = 5000;
  const auto n = static_cast<Index>(model.robot.size());
  log.t = VectorXd::LinSpaced(samples, 0, log.step_s * (samples - 1));
  log.to_s = log.step_s * samples;
  log.q.resize(samples, n);
  log.dq = log.ddq = log.q;
  for (Index j = 0; j < n; ++j) {
    const FourierJoint joint = random_fourier(40 + static_cast<std::uint64_t>(j), 5, 10, {-2, 2, 2, 10}, 1);
    for (Index k = 0; k < samples; ++k) {
      const FourierState state = evaluate(joint, 10, log.t[k]);
      log.q(k, j) = state.q;
      log.dq(k, j) = state.dq;
      log.ddq(k, j) = state.ddq;
    }
  }
  log.tau = predict(model, log.q, log.dq, log.ddq, log.step_s);
  return log;
}

void add_noise(Log& log, const IdentifiedModel& model, double share, std::uint64_t seed) {
  Random random(seed);
  for (Index j = 0; j < log.joints(); ++j) {
    for (Index k = 0; k < log.samples(); ++k)
      log.tau(k, j) += share * model.joints[static_cast<std::size_t>(j)].rated_torque * random.normal();
  }
}

/// Base parameters of the plant, then all coefficients, as Solution has them.
VectorXd truth_of(const IdentifiedModel& model, const Fitter& fitter) {
  VectorXd pi(static_cast<Index>(10 * model.inertia.size()));
  for (std::size_t i = 0; i < model.inertia.size(); ++i) {
    const auto values = to_array(model.inertia[i]);
    pi.segment(static_cast<Index>(10 * i), 10) = Eigen::Map<const VectorXd>(values.data(), 10);
  }
  std::vector<double> all;
  const VectorXd beta = fitter.base().grouping * pi;
  all.assign(beta.begin(), beta.end());
  for (const JointFit& joint : model.joints) {
    for (const EffectFit& fit : joint.effects) all.insert(all.end(), fit.linear.begin(), fit.linear.end());
  }
  return Eigen::Map<const VectorXd>(all.data(), static_cast<Index>(all.size()));
}

VectorXd stacked(const VectorXd& beta, const std::vector<VectorXd>& theta) {
  std::vector<double> all(beta.begin(), beta.end());
  for (const VectorXd& part : theta) all.insert(all.end(), part.begin(), part.end());
  return Eigen::Map<const VectorXd>(all.data(), static_cast<Index>(all.size()));
}

TEST(Statistics, NinetyFivePercentIntervalsHoldTheTruthOverTwoHundredSeeds) {
  const IdentifiedModel model = plant();
  const Log exact = record(model);
  constexpr std::size_t seeds = test::sanitized ? 4 : 200;
  std::vector<VectorXd> inside(seeds);
  VectorXd shapes = VectorXd::Zero(static_cast<Index>(seeds));
  parallel_for(seeds, [&](std::size_t seed) {
    Log log = exact;
    add_noise(log, model, 0.01, 1000 + seed);
    const std::vector<ProcessedLog> logs{process(log, filter)};
    // The shapes start off the truth and are found.
    std::vector<JointFit> design = model.joints;
    for (JointFit& joint : design) joint.sign_width *= 1.2;
    design[2].effects.back().shape[0] *= 0.8;
    Fitter fitter(model.robot, logs, design);
    fitter.reweight();
    fitter.polish();
    fitter.reweight();
    const Solution solution = fitter.fit();
    const VectorXd error = stacked(solution.beta, solution.theta) - truth_of(model, fitter);
    const VectorXd std = stacked(solution.beta_std, solution.theta_std);
    inside[seed] = (error.cwiseAbs().array() <= 1.96 * std.array()).cast<double>();
    shapes[static_cast<Index>(seed)] =
        std::fabs(fitter.design(2).effects.back().shape[0] - 0.004) <= 1.96 * solution.shape_std[2].back()[0];
  });
  VectorXd coverage = VectorXd::Zero(inside[0].size());
  for (const VectorXd& one : inside) coverage += one / static_cast<double>(seeds);
  fmt::print("coverage of {} parameters: mean {:.3f}, lowest {:.3f}; of the presliding distance {:.3f}\n",
             coverage.size(), coverage.mean(), coverage.minCoeff(), shapes.mean());
  if (test::sanitized) return;
  EXPECT_GE(coverage.mean(), 0.92);
  EXPECT_LE(coverage.mean(), 0.97);
  EXPECT_GE(coverage.minCoeff(), 0.88);
  EXPECT_GE(shapes.mean(), 0.88);
}

TEST(Statistics, ShapesAndCoefficientsComeBackFromNoiseFreeData) {
  const IdentifiedModel model = plant();
  const std::vector<ProcessedLog> logs{process(record(model), test::filter_of(1000, 1000, 0.1))};
  std::vector<JointFit> design = model.joints;
  for (JointFit& joint : design) joint.sign_width *= 1.3;
  design[2].effects.back().shape[0] *= 0.7;
  Fitter fitter(model.robot, logs, design);
  fitter.reweight();
  fitter.polish();
  for (std::size_t j = 0; j < 6; ++j) EXPECT_NEAR(fitter.design(j).sign_width, width, 1e-8 * width) << j;
  EXPECT_NEAR(fitter.design(2).effects.back().shape[0], 0.004, 1e-8);
  const Solution solution = fitter.estimate();
  const VectorXd truth = truth_of(model, fitter);
  EXPECT_LT((stacked(solution.beta, solution.theta) - truth).cwiseAbs().maxCoeff(), 1e-8 * truth.cwiseAbs().maxCoeff());
}

TEST(Statistics, RecursiveLeastSquaresEndsAtTheWeightedSolution) {
  const IdentifiedModel model = plant();
  Log log = record(model);
  add_noise(log, model, 0.01, 7);
  const std::vector<ProcessedLog> logs{process(log, filter)};
  Fitter fitter(model.robot, logs, model.joints);
  fitter.reweight();
  const Fitter::Recursion recursion = fitter.recursive(1, 100);
  const Solution batch = fitter.estimate();
  const VectorXd x = stacked(batch.beta, batch.theta);
  EXPECT_LT((stacked(recursion.solution.beta, recursion.solution.theta) - x).cwiseAbs().maxCoeff(),
            1e-6 * x.cwiseAbs().maxCoeff());
  ASSERT_EQ(recursion.trace.rows(), 100);
  EXPECT_NEAR(recursion.t[99], 19.4, 0.1);
  // it settles: the second half moves less than the first
  const auto distance = [&](Index k) { return (recursion.trace.row(k).transpose() - x).norm(); };
  EXPECT_LT(distance(90), distance(30));
  EXPECT_NEAR(distance(99), 0, 1e-5 * x.norm());
}

TEST(Statistics, RecursionGoesOnFromWhatOtherLogsTold) {
  // Log A, then log B from its stored triangle, as if both had been fitted together; a BLS with its ridge on one joint.
  const IdentifiedModel model = plant();
  Log a = record(model), b = a;
  add_noise(a, model, 0.01, 21);
  b.q = b.q.rowwise().reverse().eval();  // another motion
  b.dq = b.dq.rowwise().reverse().eval();
  b.ddq = b.ddq.rowwise().reverse().eval();
  b.tau = predict(model, b.q, b.dq, b.ddq, b.step_s);
  add_noise(b, model, 0.01, 22);
  std::vector<JointFit> design = model.joints;
  Random random(5);
  BroadLearningFit bls;
  bls.reference_velocity = 0.05;
  bls.weights = Eigen::MatrixXd::NullaryExpr(8, 5, [&] { return random.uniform(-2, 2); });
  bls.ridge = 1e-3;
  design[1].bls = bls;
  const ProcessedLog first = process(a, filter), second = process(b, filter);
  const std::vector<ProcessedLog> only_a{first}, only_b{second}, together{first, second};
  Fitter before(model.robot, only_a, design), after(model.robot, only_b, design), both(model.robot, together, design);
  before.reweight();
  after.set_weights(before.weights());
  both.set_weights(before.weights());
  const auto of = [](const Solution& solution) { return stacked(solution.beta, solution.theta); };
  const VectorXd batch = of(both.estimate()), alone = of(before.estimate());
  const SquareRootInformation known = before.information();
  EXPECT_LT((known.solve() - alone).cwiseAbs().maxCoeff(), 1e-8 * alone.cwiseAbs().maxCoeff());
  EXPECT_GT((batch - alone).cwiseAbs().maxCoeff(), 1e-4 * batch.cwiseAbs().maxCoeff());  // B does tell something

  const Fitter::Recursion recursion = after.recursive(1, 0, known);
  EXPECT_LT((of(recursion.solution) - batch).cwiseAbs().maxCoeff(), 1e-8 * batch.cwiseAbs().maxCoeff());
  // The triangle holds as much as both logs' rows: information, residual and count.
  const NormalEquations equations = both.normal_equations();
  EXPECT_LT((recursion.information.information() - equations.information).norm(), 1e-8 * equations.information.norm());
  EXPECT_NEAR(recursion.information.rows(), both.train_rows(), 1e-6);
  const Solution fit = both.estimate();
  const double rest = recursion.information.variance_of_row() * both.train_rows();
  const double ridge =  // its penalty counts as a residual
      before.weights()[1] * both.train_rows() / 6 * bls.ridge * fit.theta[1].tail(12).squaredNorm();
  EXPECT_NEAR(rest, both.weighted_square(fit) + ridge, 1e-6 * rest);

  // What is forgotten counts by its age, whichever log it came from.
  const double seconds = static_cast<double>(second.rows()) * second.step_s * static_cast<double>(second.decimation);
  SquareRootInformation faded = known;
  faded.forget(std::pow(0.9, seconds));
  after.forget(0.9);
  Fitter fresh(model.robot, only_b, design);
  fresh.set_weights(before.weights());
  const VectorXd by_recursion = of(fresh.recursive(0.9, 0, known).solution);
  const NormalEquations late = after.normal_equations();
  const VectorXd by_batch =
      SymmetricSolver(faded.information() + late.information).solve(faded.projection() + late.projection);
  EXPECT_LT((by_recursion - by_batch).cwiseAbs().maxCoeff(), 1e-8 * by_batch.cwiseAbs().maxCoeff());
}

TEST(Statistics, UnknownsThatStayZeroAndOthersThatStayWhereTheyAre) {
  const IdentifiedModel model = plant();
  Log log = record(model);
  add_noise(log, model, 0.01, 23);
  const std::vector<ProcessedLog> logs{process(log, filter)};
  Fitter fitter(model.robot, logs, model.joints);
  fitter.reweight();
  SquareRootInformation known = fitter.information();
  // Least squares over the other unknowns alone.
  const NormalEquations equations = fitter.normal_equations();
  const std::vector<Index> zeros{3, 7};
  std::vector<Index> others;
  for (Index i = 0; i < known.unknowns(); ++i) {
    if (i != 3 && i != 7) others.push_back(i);
  }
  VectorXd expected = VectorXd::Zero(known.unknowns());
  expected(others) = SymmetricSolver(equations.information(others, others)).solve(equations.projection(others));
  const VectorXd x = known.solve_without(zeros);
  EXPECT_EQ(x[3], 0);
  EXPECT_EQ(x[7], 0);
  EXPECT_LT((x - expected).cwiseAbs().maxCoeff(), 1e-8 * expected.cwiseAbs().maxCoeff());
  // Deviations are those of the inverse.
  const VectorXd inverse = SymmetricSolver(equations.information).inverse().diagonal().cwiseSqrt();
  EXPECT_LT(((known.deviations() - inverse).array() / inverse.array()).abs().maxCoeff(), 1e-6);
  // Around another solution, with the same information.
  const VectorXd elsewhere = 1.1 * known.solve();
  const Eigen::MatrixXd before = known.information();
  known.recentre(elsewhere);
  EXPECT_LT((known.solve() - elsewhere).cwiseAbs().maxCoeff(), 1e-9 * elsewhere.cwiseAbs().maxCoeff());
  EXPECT_EQ((known.information() - before).norm(), 0);
}

TEST(Statistics, ForgettingFollowsAChange) {
  const IdentifiedModel before = plant();
  IdentifiedModel after = before;
  after.joints[0].effects[1].linear[0] *= 1.5;
  Log log = record(before);
  log.tau.bottomRows(2500) = predict(after, log.q, log.dq, log.ddq, log.step_s).bottomRows(2500);
  add_noise(log, before, 0.005, 8);
  const std::vector<ProcessedLog> logs{process(log, filter)};
  Fitter fitter(before.robot, logs, before.joints);
  fitter.reweight();
  const double changed = after.joints[0].effects[1].linear[0];
  const double remembered = fitter.recursive(1, 1).solution.theta[0][1];
  const double forgot = fitter.recursive(0.5, 1).solution.theta[0][1];
  EXPECT_LT(remembered, 0.95 * changed);
  EXPECT_NEAR(forgot, changed, 0.05 * changed);
  // the same as least squares that weighs by age
  fitter.forget(0.5);
  EXPECT_NEAR(fitter.estimate().theta[0][1], forgot, 1e-6 * changed);
}

TEST(Statistics, RobustFitIsNotMovedByBursts) {
  const IdentifiedModel model = plant();
  Log log = record(model);
  add_noise(log, model, 0.005, 9);
  for (Index k = 500; k < log.samples(); k += 700)  // a touch now and then
    log.tau.col(1).segment(k, 40).array() += 0.6 * model.joints[1].rated_torque;
  const std::vector<ProcessedLog> logs{process(log, filter)};
  Fitter fitter(model.robot, logs, model.joints);
  fitter.reweight();
  const VectorXd truth = truth_of(model, fitter);
  const auto error = [&] {
    const Solution s = fitter.estimate();
    return (stacked(s.beta, s.theta) - truth).norm();
  };
  const double plain = error();
  fitter.reweight_rows();
  EXPECT_LT(error(), 0.4 * plain);
}

TEST(Statistics, SaturatedTorqueIsFoundAndLeftOut) {
  const IdentifiedModel model = plant();
  Log log = record(model);
  const double limit = 0.8 * log.tau.col(2).cwiseAbs().maxCoeff();
  log.tau.col(2) = log.tau.col(2).cwiseMax(-limit).cwiseMin(limit);
  const ProcessedLog processed = process(log, filter);
  EXPECT_TRUE(processed.saturated[0].empty());
  ASSERT_FALSE(processed.saturated[2].empty());
  const std::vector<ProcessedLog> logs{processed};
  Fitter fitter(model.robot, logs, model.joints);
  fitter.reweight();
  EXPECT_GT(fitter.saturated_rows()[2], 0);
  EXPECT_EQ(fitter.saturated_rows()[1], 0);
  const Solution with = fitter.estimate();
  EXPECT_NEAR(with.theta[2][1], model.joints[2].effects[1].linear[0], 0.01 * model.joints[2].effects[1].linear[0]);

  // A coarse torque that peaks smoothly is not saturated.
  Log coarse = record(model);
  const double step = 0.02 * coarse.tau.col(2).cwiseAbs().maxCoeff();
  coarse.tau = (coarse.tau / step).array().round() * step;
  for (const auto& runs : process(coarse, filter).saturated) EXPECT_TRUE(runs.empty());
}

TEST(Statistics, EssentialParametersPredictAsWellWithFewer) {
  const IdentifiedModel model = plant();
  Log log = record(model);
  add_noise(log, model, 0.005, 11);
  const std::vector<ProcessedLog> logs{process(log, filter)};
  Fitter fitter(model.robot, logs, model.joints);
  fitter.reweight();
  const Solution all = fitter.fit(), few = essential_parameters(all, fitter.normal_equations());
  const auto kept = std::count(few.essential.begin(), few.essential.end(), true);
  EXPECT_LT(kept, static_cast<long>(few.essential.size()));
  EXPECT_GT(kept, 8);
  for (std::size_t k = 0; k < few.essential.size(); ++k) {
    const auto i = static_cast<Index>(k);
    if (few.essential[k]) {
      EXPECT_GE(std::fabs(few.beta[i]), 3 * few.beta_std[i]);
    } else {
      EXPECT_EQ(few.beta[i], 0);
    }
  }
  EXPECT_LT(fitter.weighted_square(few), 1.05 * fitter.weighted_square(all));
}

TEST(Statistics, AKnownLoadIsNotCountedAsLink) {
  const IdentifiedModel model = plant();
  IdentifiedModel loaded = model;
  loaded.body.push_back(effect("payload", {3, 0.02, -0.03, 0.1}));
  Log log = record(loaded);
  log.load = Load{3, {0.02, -0.03, 0.1}};
  const std::vector<ProcessedLog> logs{process(log, test::filter_of(1000, 1000, 0.1))};
  const Fitter fitter(model.robot, logs, model.joints);
  const Solution solution = fitter.estimate();
  const VectorXd truth = truth_of(model, fitter);
  EXPECT_LT((stacked(solution.beta, solution.theta) - truth).cwiseAbs().maxCoeff(), 1e-8 * truth.cwiseAbs().maxCoeff());
}

TEST(Statistics, TorqueThatRunsAheadIsAligned) {
  const IdentifiedModel model = plant();
  Log log = record(model);
  log.tau = at_other_times(log.tau, 0.6);  // 2.4 ms
  std::vector<ProcessedLog> logs{process(log, filter)};
  Fitter fitter(model.robot, logs, model.joints);
  const double off = fitter.held_out()[1].rmse;
  fitter.set_torque_lead(0.0024, fitter.filtered_torque());
  EXPECT_LT(fitter.held_out()[1].rmse, 0.05 * off);
}

/// 20 s of one joint at `hz` with `amplitude` rad, and 17 bits.
Log swing(const std::vector<std::pair<double, double>>& hz_and_amplitude) {
  Log log;
  log.step_s = 0.002;
  constexpr Index samples = 10000;
  log.t = VectorXd::LinSpaced(samples, 0, log.step_s * (samples - 1));
  log.q = VectorXd::Zero(samples);
  for (const auto& [hz, amplitude] : hz_and_amplitude)
    log.q.col(0) += amplitude * (2 * std::numbers::pi * hz * log.t.array()).sin().matrix();
  const double step = 2 * std::numbers::pi / (1 << 17);
  log.q = (log.q / step).array().round() * step;
  return log;
}

// A slow log in which the joint jerks now and then does not open the band for its noise; what is fast and large does.
TEST(Filter, BandIsThatOfAllLogsTogether) {
  std::vector<std::pair<double, double>> jerks{{0.2, 0.05}};
  for (double hz = 0.6; hz < 12; hz += 0.4) jerks.emplace_back(hz, 1e-4);
  const Log fast = swing({{2, 0.5}}), slow = swing(jerks),
            both = swing({{2, 0.5}, {2.4, 0.05}, {2.8, 0.05}, {3.2, 0.05}, {3.6, 0.05}, {4, 0.05}});
  const auto band = [](const std::vector<Log>& logs) { return choose_filter(logs, {}); };
  EXPECT_GT(band({slow}).excited_hz, 10);
  EXPECT_NEAR(band({fast}).excited_hz, 2, 0.5);
  EXPECT_NEAR(band({fast, slow}).excited_hz, 2, 0.5);
  EXPECT_NEAR(band({fast, slow}).torque_cutoff_hz, 5 * band({fast, slow}).excited_hz, 1e-9);
  EXPECT_NEAR(band({both, slow}).excited_hz, 4, 0.5);
}

}  // namespace
}  // namespace fxdyn
