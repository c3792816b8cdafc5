#include "host_tools/regression/own_columns.hpp"

#include <fmt/format.h>

#include "host_tools/effects/broad_learning_types.hpp"
#include "host_tools/support/error.hpp"

namespace fxdyn {

Eigen::MatrixXd bls_columns(const BroadLearningFit& bls, double sign_width, const JointSeries& series) {
  Eigen::MatrixXd columns(series.q.size(), bls.coefficient_count());
  with_bls_types(bls, [&]<class Inputs, class Activation>() {
    if (Inputs::needs_structural && series.structural.size() == 0)
      throw InputError(
          fmt::format("BLS inputs \"{}\" need the rigid-body torque, which is not known here", bls.inputs));
    const auto stored = Inputs::stored(bls, series.step_s);
    std::vector<double> words(stored.begin(), stored.end());
    for (Eigen::Index k = 0; k < bls.nodes(); ++k) {
      words.push_back(bls.weights(k, bls.input_count()));
      for (Eigen::Index i = 0; i < bls.input_count(); ++i) words.push_back(bls.weights(k, i));
    }
    const auto nodes = static_cast<std::size_t>(bls.nodes());
    std::vector<double> scratch(nodes);
    typename Inputs::template State<Real> state;
    Saturations none;
    for (Eigen::Index k = 0; k < series.q.size(); ++k) {
      const JointInput<Real> u{series.q[k], series.dq[k], series.ddq[k], tanh_of(series.dq[k] / sign_width),
                               Inputs::needs_structural ? series.structural[k] : 0.0};
      broad_learning_basis<Inputs, Activation, Real>(
          nodes, u, Words<Real>{words.data()}, state, none, scratch,
          [&](auto, std::size_t i, double phi) { columns(k, static_cast<Eigen::Index>(i)) = phi; });
    }
  });
  return columns;
}

Eigen::Index own_count(const JointFit& design) {
  Eigen::Index count = 0;
  for (const EffectFit& fit : design.effects)
    count += static_cast<Eigen::Index>(find_effect(fit.effect)->linear.size());
  if (design.bls) count += design.bls->coefficient_count();
  return count;
}

// In blocks, as the motions of all joints are large.
Eigen::MatrixXd rows_with_peers(const ProcessedLog& log, std::size_t joint, const EffectFit& fit,
                                const std::vector<JointFit>& designs) {
  const EffectInfo& info = *find_effect(fit.effect);
  Eigen::MatrixXd out(log.rows(), static_cast<Eigen::Index>(info.linear.size()));
  for (const RowBlock& block : row_blocks(log)) {
    MotionRows motion = log.motion(block.begin, block.samples);
    const auto j = static_cast<Eigen::Index>(joint);
    JointSeries series{motion.q.col(j), motion.dq.col(j), motion.ddq.col(j), {}, log.step_s};
    series.peers_sign.resize(motion.dq.rows(), motion.dq.cols());
    for (std::size_t k = 0; k < designs.size(); ++k) {
      const auto peer = static_cast<Eigen::Index>(k);
      series.peers_sign.col(peer) = (motion.dq.col(peer) / designs[k].sign_width).array().tanh();
    }
    series.peers_q = std::move(motion.q);
    series.peers_dq = std::move(motion.dq);
    series.peers_ddq = std::move(motion.ddq);
    out.middleRows(block.row, block.rows) =
        block.filter_and_keep(log, effect_columns(fit.effect, fit.shape, designs[joint].sign_width, series));
  }
  return out;
}

}  // namespace fxdyn
