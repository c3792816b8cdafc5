#include "host_tools/regression/bls_rows.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "host_tools/support/random.hpp"
#include "host_tools/support/vectors.hpp"
#include "model/broad_learning.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

constexpr double step = 0.002;

ProcessedLog log_of(Index samples, double cutoff_hz) {
  Log log;
  log.step_s = step;
  log.t = Eigen::VectorXd::LinSpaced(samples, 0, step * static_cast<double>(samples - 1));
  log.q.resize(samples, 2);
  log.q.col(0).setZero();
  // fast and slow, with reversals
  for (Index k = 0; k < samples; ++k) log.q(k, 1) = std::sin(3 * log.t[k]) + 0.02 * std::sin(40 * log.t[k] + 1);
  FilterFit filter;
  filter.position_cutoff_hz = 100;
  filter.torque_cutoff_hz = cutoff_hz;
  filter.edge_s = 0.2;
  return process(std::move(log), filter);
}

template <class Inputs>
BroadLearningFit bls_of(Index nodes) {
  BroadLearningFit bls;
  bls.inputs = Inputs::name;
  bls.reference_velocity = 0.05;
  bls.span = 5;
  bls.distances = {3e-4, 1e-3, 3e-3};
  bls.velocity = 3;
  bls.stribeck = 0.1;
  bls.share = 0.6;
  bls.weights.resize(nodes, Inputs::size + 1);
  Random random(3);
  for (double& w : bls.weights.reshaped()) w = random.uniform(-6, 6);
  return bls;
}

/// The model's own functions, sample by sample.
template <class Inputs>
MatrixXd one_by_one(const BroadLearningFit& bls, const ProcessedLog& log, Index joint) {
  constexpr Index inputs = Inputs::size;
  const auto nodes = static_cast<std::size_t>(bls.nodes());
  const auto stored = Inputs::stored(bls, step);
  std::vector<double> words(stored.begin(), stored.end());
  for (Index k = 0; k < bls.nodes(); ++k) {
    words.push_back(bls.weights(k, inputs));
    for (Index i = 0; i < inputs; ++i) words.push_back(bls.weights(k, i));
  }
  const MotionRows motion = log.joint_motion(joint);
  MatrixXd columns(log.samples(), inputs + bls.nodes());
  std::vector<double> scratch(nodes);
  typename Inputs::template State<Real> state;
  Saturations none;
  for (Index k = 0; k < log.samples(); ++k) {
    const JointInput<Real> u{motion.q(k, 0), motion.dq(k, 0), motion.ddq(k, 0), 0.5, 0.0};
    broad_learning_basis<Inputs, TanhNodes, Real>(
        nodes, u, Words<Real>{words.data()}, state, none, scratch,
        [&](auto, std::size_t i, double phi) { columns(k, static_cast<Index>(i)) = phi; });
  }
  return log.decimate(log.filter_columns(columns));
}

template <class Inputs>
void expect_the_models_columns() {
  for (const Index nodes : {1, 4, 8, 21}) {
    const BroadLearningFit bls = bls_of<Inputs>(nodes);
    ASSERT_TRUE(has_fast_rows(bls));
    for (const double cutoff : {12.0, 1000.0}) {  // 1000: no filter
      const ProcessedLog log = log_of(3001, cutoff);
      const MatrixXd rows = bls_rows(bls, log, 1), expected = one_by_one<Inputs>(bls, log, 1);
      ASSERT_EQ(rows.rows(), log.rows());
      ASSERT_EQ(rows.cols(), static_cast<Index>(Inputs::size) + nodes);
      EXPECT_GT(expected.cwiseAbs().maxCoeff(), 0.5);
      EXPECT_LT((rows - expected).cwiseAbs().maxCoeff(), 1e-13) << nodes << " nodes, " << cutoff << " Hz";
    }
  }
}
TEST(BlsRows, OfPhysicalInputsAreTheModelsColumns) { expect_the_models_columns<PhysicalInputs>(); }
TEST(BlsRows, OfBristlesAreTheModelsColumns) { expect_the_models_columns<BristlesInputs>(); }

template <class Inputs>
void expect_the_same_bits() {
  const ProcessedLog log = log_of(2000, 12);
  for (const Index nodes : {1, 4, 8, 21}) {
    const BroadLearningFit bls = bls_of<Inputs>(nodes);
    const MatrixXd rows = bls_rows(bls, log, 1);
    const int widest = at_once;
    for (const int width : {4, 2}) {
      at_once = std::min(widest, width);
      const MatrixXd narrow = bls_rows(bls, log, 1);
      at_once = widest;
      EXPECT_TRUE((rows.array() == narrow.array()).all()) << width;
    }
  }
}
TEST(BlsRows, OfPhysicalInputsHaveTheSameBitsWhateverTheProcessor) { expect_the_same_bits<PhysicalInputs>(); }
TEST(BlsRows, OfBristlesHaveTheSameBitsWhateverTheProcessor) { expect_the_same_bits<BristlesInputs>(); }

}  // namespace
}  // namespace fxdyn
