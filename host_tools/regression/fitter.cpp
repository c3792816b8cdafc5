#include "host_tools/regression/fitter.hpp"

#include <fmt/format.h>

#include <cmath>
#include <optional>

#include "host_tools/effects/broad_learning_types.hpp"
#include "host_tools/regression/bls_rows.hpp"
#include "host_tools/regression/row_ranges.hpp"
#include "host_tools/regression/solver.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/parallel.hpp"

namespace fxdyn {
namespace {

/// The inputs, then the nodes, at full rate.
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

}  // namespace

namespace {

/// Effects that need other joints' motion, without memory of their own: in blocks, as those motions are large.
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
    series.peers_dq = std::move(motion.dq);
    series.peers_ddq = std::move(motion.ddq);
    out.middleRows(block.row, block.rows) =
        block.filter_and_keep(log, effect_columns(fit.effect, fit.shape, designs[joint].sign_width, series));
  }
  return out;
}

}  // namespace

Fitter::Fitter(const Robot& robot, const std::vector<ProcessedLog>& logs, std::vector<JointFit> design)
    : design_(std::move(design)) {
  const auto data = std::make_shared<Data>();
  data->robot = robot;
  data->logs = &logs;
  const DhChain chain = to_dh(robot);
  data->chain = chain;
  data->base = find_base(chain);
  const auto n = static_cast<Eigen::Index>(robot.size());
  const auto& columns = data->base.columns;
  const auto nb = static_cast<Eigen::Index>(columns.size());
  const auto per_link = static_cast<Eigen::Index>(parameters_per_link);

  const std::vector<bool> moving = moving_joints(logs);
  for (Eigen::Index j = 0; j < n; ++j) {
    if (!moving[static_cast<std::size_t>(j)] && !logs.front().is_left_out(j)) {
      double range = 0;
      for (const ProcessedLog& log : logs) range = std::max(range, log.role == Role::train ? log.q_range[j] : 0.0);
      throw DataError(
          fmt::format("joint {} ({}) never moves in the train logs (range {:.1e} {}): record a log in which it does",
                      j + 1, robot.joints[static_cast<std::size_t>(j)].name, range,
                      robot.joints[static_cast<std::size_t>(j)].position_unit()));
    }
    // Links before a joint do not load it.
    const auto first = std::lower_bound(columns.begin(), columns.end(), j * per_link);
    data->first_base.push_back(first - columns.begin());
  }

  Eigen::Index rows = 0, train_rows = 0, parameters = nb;
  for (const ProcessedLog& log : logs) {
    data->first_row.push_back(rows);
    rows += log.rows();
    if (log.role == Role::train) train_rows += log.rows();
  }
  for (const JointFit& joint : design_) parameters += own_count(joint);
  if (train_rows * n < 2 * parameters) {
    throw DataError(
        fmt::format("{} rows (after filtering) for {} parameters: record a longer log", train_rows * n, parameters));
  }

  // All columns of all joints side by side; joint j's are columns starts[j] .. starts[j + 1] - 1, the torque of a known
  // load the last.
  std::vector<Eigen::Index> starts{0};
  for (Eigen::Index j = 0; j < n; ++j)
    starts.push_back(starts.back() + nb - data->first_base[static_cast<std::size_t>(j)] + 1);
  for (Eigen::Index j = 0; j < n; ++j) {
    data->base_rows.emplace_back(rows, nb - data->first_base[static_cast<std::size_t>(j)]);
    data->load_rows.emplace_back(rows);
    data->usable.emplace_back(Eigen::VectorXd::Ones(rows));
  }
  struct Piece {
    const ProcessedLog* log;
    Eigen::Index row;
    RowBlock block;
  };
  std::vector<Piece> pieces;
  for (std::size_t l = 0; l < logs.size(); ++l) {
    for (const RowBlock& block : row_blocks(logs[l])) pieces.push_back({&logs[l], data->first_row[l], block});
  }
  parallel_for(pieces.size(), [&](std::size_t p) {
    const auto& [log, first_row, block] = pieces[p];
    Regressor regressor(chain);
    const MotionRows motion = log->link_motion(block.begin, block.samples);
    Eigen::MatrixXd full(block.samples, starts.back());
    Eigen::VectorXd load = Eigen::VectorXd::Zero(per_link);
    if (log->load) {
      const auto values = to_array(with_load({}, log->load->mass, log->load->com, chain));
      load = Eigen::Map<const Eigen::VectorXd>(values.data(), per_link);
    }
    for (Eigen::Index k = 0; k < block.samples; ++k) {
      const Eigen::MatrixXd& y = regressor(motion.q.row(k), motion.dq.row(k), motion.ddq.row(k));
      for (Eigen::Index j = 0; j < n; ++j) {
        Eigen::Index at = starts[static_cast<std::size_t>(j)];
        for (Eigen::Index c = data->first_base[static_cast<std::size_t>(j)]; c < nb; ++c)
          full(k, at++) = y(j, columns[static_cast<std::size_t>(c)]);
        full(k, at) = y.row(j).tail(per_link).dot(load);
      }
    }
    const Eigen::MatrixXd kept = block.filter_and_keep(*log, full);
    for (Eigen::Index j = 0; j < n; ++j) {
      const auto k = static_cast<std::size_t>(j);
      const Eigen::Index count = starts[k + 1] - starts[k] - 1;
      data->base_rows[k].middleRows(first_row + block.row, kept.rows()) = kept.middleCols(starts[k], count);
      data->load_rows[k].segment(first_row + block.row, kept.rows()) = kept.col(starts[k] + count);
    }
  });
  for (std::size_t l = 0; l < logs.size(); ++l) {
    for (Eigen::Index j = 0; j < n; ++j) {
      if (logs[l].is_left_out(j))
        data->usable[static_cast<std::size_t>(j)].segment(data->first_row[l], logs[l].rows()).setZero();
      if (logs[l].saturated[static_cast<std::size_t>(j)].empty()) continue;
      for (Eigen::Index r = 0; r < logs[l].rows(); ++r) {
        if (logs[l].is_saturated(j, r)) data->usable[static_cast<std::size_t>(j)][data->first_row[l] + r] = 0;
      }
    }
  }

  Split& split = data->split;
  for (const ProcessedLog& log : logs) split.has_validation |= log.role == Role::validate;
  const bool by_log = !split.has_validation && logs.size() > 1;
  split.kind = split.has_validation ? "validate logs"
               : by_log             ? "each train log judged by a fit of the others (no log has the role validate)"
                        : "blocks of the train log (no log has the role validate, and there is one trajectory only)";
  const int parts = split.has_validation || by_log ? 1 : blocks_of_one_log;
  auto& blocks = data->blocks;
  for (std::size_t l = 0; l < logs.size(); ++l) {
    const Eigen::Index count = logs[l].rows(), first = data->first_row[l];
    for (const RowRange& range : cut({first, count}, parts))
      blocks.push_back({l, range.first, range.first + range.count, logs[l].role == Role::train});
  }
  const std::size_t folds = split.has_validation ? 1 : blocks.size();
  split.fit.resize(folds);
  split.judge.resize(folds);
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    for (std::size_t fold = 0; fold < folds; ++fold) {
      const bool judges = split.has_validation ? !blocks[b].train : b == fold;
      (judges ? split.judge : split.fit)[fold].push_back(b);
    }
  }
  data_ = data;

  row_weights_ = data->usable;
  weights_ = Eigen::VectorXd::Ones(n);
  base_moments_.resize(joints());
  own_rows_.resize(joints());
  own_moments_.resize(joints());
  torque_rows_.resize(joints());
  parallel_for(joints(), [&](std::size_t j) { make_base_moments(j); });
  set_torque_lead(logs.front().filter.torque_lead_s);
  set_designs(design_);
}

std::vector<Eigen::MatrixXd> Fitter::filtered_torque() const {
  std::vector<Eigen::MatrixXd> out;
  for (const ProcessedLog& log : logs()) out.push_back(log.filter_columns(log.tau));
  return out;
}

void Fitter::set_torque_lead(double seconds, const std::vector<Eigen::MatrixXd>& filtered) {
  torque_lead_s_ = seconds;
  parallel_for(joints(), [&](std::size_t j) {
    const auto k = static_cast<Eigen::Index>(j);
    torque_rows_[j].resize(data_->load_rows[j].size());
    for (std::size_t l = 0; l < logs().size(); ++l) {
      const ProcessedLog& log = logs()[l];
      const Eigen::MatrixXd tau =
          filtered.empty() ? log.filter_columns(log.tau.col(k)) : Eigen::MatrixXd(filtered[l].col(k));
      torque_rows_[j].segment(data_->first_row[l], log.rows()) =
          log.decimate(at_other_times(tau, -seconds / log.step_s));
    }
    torque_rows_[j] -= data_->load_rows[j];  // a load that is known is not looked for
    project_torque(j);
  });
}

void Fitter::project_torque(std::size_t joint) {
  for (std::size_t b = 0; b < data_->blocks.size(); ++b) {
    const Block& block = data_->blocks[b];
    const Eigen::Index count = block.to - block.from;
    const auto y = torque_rows_[joint].segment(block.from, count);
    const Eigen::VectorXd wy = row_weights_[joint].segment(block.from, count).cwiseProduct(y);
    BaseMoments& m = base_moments_[joint][b];
    m.projection = data_->base_rows[joint].middleRows(block.from, count).transpose() * wy;
    m.square = wy.dot(y);
    if (!own_moments_[joint].empty())
      own_moments_[joint][b].projection = own_rows_[joint].middleRows(block.from, count).transpose() * wy;
  }
}

JointSeries Fitter::joint_series(std::size_t joint, std::size_t l) const {
  const auto j = static_cast<Eigen::Index>(joint);
  MotionRows motion = logs()[l].joint_motion(j);
  JointSeries series{std::move(motion.q), std::move(motion.dq), std::move(motion.ddq), {}, logs()[l].step_s};
  if (structural_) series.structural = (*structural_)[l].col(j);
  return series;
}

void Fitter::set_structural(std::vector<Eigen::MatrixXd> torque) {
  structural_ = std::make_shared<const std::vector<Eigen::MatrixXd>>(std::move(torque));
  bool any = false;
  for (const JointFit& joint : design_) any |= joint.bls.has_value();
  if (any) set_designs(design_);
}

Eigen::MatrixXd Fitter::bls_inputs(std::size_t joint, const BroadLearningFit& bls) const {
  BroadLearningFit without = bls;
  without.weights.resize(0, fxdyn::bls_inputs(bls) + 1);
  Eigen::MatrixXd out(0, without.input_count());
  for (std::size_t l = 0; l < logs().size(); ++l) {
    const ProcessedLog& log = logs()[l];
    if (log.role != Role::train) continue;
    const Eigen::MatrixXd u = log.decimate(bls_columns(without, design_[joint].sign_width, joint_series(joint, l)));
    out.conservativeResize(out.rows() + u.rows(), Eigen::NoChange);
    out.bottomRows(u.rows()) = u;
  }
  return out;
}

Eigen::MatrixXd Fitter::own_rows(std::size_t joint, const std::vector<JointFit>& designs) const {
  const JointFit& design = designs[joint];
  // Columns of effects that are as in the current design need not be made again.
  std::vector<Eigen::Index> kept(design.effects.size(), -1);
  if (own_rows_[joint].size() > 0) {
    const auto same_width = [&](std::size_t j) { return designs[j].sign_width == design_[j].sign_width; };
    for (std::size_t e = 0; e < design.effects.size(); ++e) {
      const EffectFit& wanted = design.effects[e];
      const EffectInfo& info = *find_effect(wanted.effect);
      if (info.uses_sign && !same_width(joint)) continue;
      if (info.needs_peers && !same_width(static_cast<std::size_t>(wanted.shape[0]) - 1)) continue;
      Eigen::Index at = 0;
      for (const EffectFit& fit : design_[joint].effects) {
        if (fit.effect == wanted.effect && fit.shape == wanted.shape) kept[e] = at;
        at += static_cast<Eigen::Index>(find_effect(fit.effect)->linear.size());
      }
    }
  }
  Eigen::MatrixXd out(data_->load_rows[joint].size(), own_count(design));
  for (std::size_t l = 0; l < logs().size(); ++l) {
    const ProcessedLog& log = logs()[l];
    std::optional<JointSeries> series;  // made where a column is
    Eigen::Index at = 0;
    const auto fill = [&](Eigen::Index count, auto&& rows) {
      out.block(data_->first_row[l], at, log.rows(), count) = rows();
      at += count;
    };
    for (std::size_t e = 0; e < design.effects.size(); ++e) {
      const EffectFit& fit = design.effects[e];
      const auto count = static_cast<Eigen::Index>(find_effect(fit.effect)->linear.size());
      if (kept[e] >= 0) {
        fill(count, [&] { return own_rows_[joint].block(data_->first_row[l], kept[e], log.rows(), count); });
      } else {
        fill(count, [&] {
          if (find_effect(fit.effect)->needs_peers) return rows_with_peers(log, joint, fit, designs);
          if (!series) series = joint_series(joint, l);
          return log.decimate(log.filter_columns(effect_columns(fit.effect, fit.shape, design.sign_width, *series)));
        });
      }
    }
    if (!design.bls) continue;
    fill(out.cols() - at, [&] {
      if (has_fast_rows(*design.bls)) return bls_rows(*design.bls, log, static_cast<Eigen::Index>(joint));
      if (!series) series = joint_series(joint, l);
      return log.decimate(log.filter_columns(bls_columns(*design.bls, design.sign_width, *series)));
    });
  }
  return out;
}

void Fitter::make_base_moments(std::size_t joint) {
  auto& moments = base_moments_[joint];
  moments.clear();
  for (const Block& block : data_->blocks) {
    const Eigen::Index count = block.to - block.from;
    const auto x = data_->base_rows[joint].middleRows(block.from, count);
    const auto w = row_weights_[joint].segment(block.from, count);
    BaseMoments m;
    m.gram.setZero(x.cols(), x.cols());
    m.gram.triangularView<Eigen::Lower>() += x.transpose() * (w.asDiagonal() * x);
    m.gram.triangularView<Eigen::StrictlyUpper>() = m.gram.transpose();
    m.count = w.sum();
    moments.push_back(std::move(m));
  }
}

Fitter::Own Fitter::own_moments(std::size_t joint, const Eigen::MatrixXd& own) const {
  Own out;
  for (const Block& block : data_->blocks) {
    const Eigen::Index count = block.to - block.from;
    out.push_back(weighted_products(data_->base_rows[joint].middleRows(block.from, count),
                                    own.middleRows(block.from, count), row_weights_[joint].segment(block.from, count),
                                    torque_rows_[joint].segment(block.from, count)));
  }
  return out;
}

std::vector<Fitter::Dependent> Fitter::dependent_effects() const {
  // Cholesky of the normalised gram in the order base, joint 1, joint 2, ..: a column whose pivot vanishes is a sum of
  // those before it.
  const auto nb = static_cast<Eigen::Index>(base().columns.size());
  std::vector<Dependent> found;
  Eigen::MatrixXd common = Eigen::MatrixXd::Zero(nb, nb);
  for (std::size_t j = 0; j < joints(); ++j) {
    const Eigen::Index acting = nb - data_->first_base[j];
    for (const std::size_t b : train_blocks()) common.bottomRightCorner(acting, acting) += base_moments_[j][b].gram;
  }
  for (std::size_t j = 0; j < joints(); ++j) {
    const Eigen::Index own = own_count(design_[j]), acting = nb - data_->first_base[j];
    Eigen::MatrixXd gram = Eigen::MatrixXd::Zero(nb + own, nb + own);
    for (const std::size_t b : train_blocks()) {
      const OwnMoments& m = own_moments_[j][b];
      gram.block(nb - acting, nb, acting, own) += m.cross;
      gram.bottomRightCorner(own, own) += m.gram;
    }
    gram.bottomLeftCorner(own, nb) = gram.topRightCorner(nb, own).transpose();
    gram.topLeftCorner(nb, nb) = common;  // base columns show up in all joints' rows, the effects in their own only
    const Eigen::VectorXd scale = gram.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
    gram = scale.asDiagonal() * gram * scale.asDiagonal();
    const Eigen::Index p = gram.rows();
    std::vector<std::size_t> effect_of;  // of each own column
    for (const EffectFit& fit : design_[j].effects)
      effect_of.insert(effect_of.end(), find_effect(fit.effect)->linear.size(),
                       static_cast<std::size_t>(&fit - design_[j].effects.data()));
    for (Eigen::Index k = 0; k < p; ++k) {
      const double pivot = gram(k, k);
      const bool dependent = pivot < 1e-10;
      const auto mine = static_cast<std::size_t>(k - nb);
      if (k >= nb && dependent && mine < effect_of.size()) {
        const Dependent it{j, effect_of[mine]};
        const bool named = !found.empty() && found.back().joint == j && found.back().effect == it.effect;
        if (!named) found.push_back(it);
      }
      if (dependent) continue;
      const Eigen::Index rest = p - k - 1;
      gram.bottomRightCorner(rest, rest) -= gram.col(k).tail(rest) * gram.col(k).tail(rest).transpose() / pivot;
    }
  }
  return found;
}

void Fitter::set_design(std::size_t joint, JointFit design) {
  std::vector<JointFit> designs = design_;
  designs[joint] = std::move(design);
  own_rows_[joint] = own_rows(joint, designs);
  design_[joint] = std::move(designs[joint]);
  own_moments_[joint] = own_moments(joint, own_rows_[joint]);
}

void Fitter::set_designs(std::vector<JointFit> designs) {
  std::vector<Eigen::MatrixXd> rows(joints());
  parallel_for(joints(), [&](std::size_t j) { rows[j] = own_rows(j, designs); });
  own_rows_ = std::move(rows);
  design_ = std::move(designs);
  parallel_for(joints(), [&](std::size_t j) { own_moments_[j] = own_moments(j, own_rows_[j]); });
}

Eigen::VectorXd Fitter::ridge_of(const JointFit& design, double ridge, Eigen::Index count) {
  Eigen::VectorXd out = Eigen::VectorXd::Zero(count);
  if (design.bls) out.tail(design.bls->coefficient_count()).setConstant(ridge);
  return out;
}

namespace {

/// Whether the linear parameters of the last effect keep their bounds. Only those: viscous friction that is zero in
/// truth comes out a little negative, and that must not keep another effect out. (With a BLS beside it, one coefficient
/// means nothing.)
bool last_is_physical(const JointFit& design, const Eigen::VectorXd& theta) {
  if (design.effects.empty() || design.bls) return true;
  const auto& parameters = find_effect(design.effects.back().effect)->linear;
  Eigen::Index at = theta.size();
  for (std::size_t i = parameters.size(); i-- > 0;) {
    --at;
    if (theta[at] < parameters[i].lower || theta[at] > parameters[i].upper) return false;
  }
  // Presliding takes the place of Coulomb's sign change (amplitude = Coulomb's): much less of it is something else.
  if (design.effects.back().effect != Presliding::name) return true;
  for (std::size_t i = 0; i < design.effects.size(); ++i) {
    if (design.effects[i].effect == Coulomb::name) return theta[at] > 0.5 * theta[static_cast<Eigen::Index>(i)];
  }
  return true;
}

}  // namespace

double Fitter::square_error(std::size_t joint, std::size_t block, const OwnMoments& own,
                            const Solution& solution) const {
  const BaseMoments& m = base_moments_[joint][block];
  const Eigen::VectorXd beta = solution.beta.tail(m.projection.size());
  const Eigen::VectorXd& theta = solution.theta[joint];
  return std::max(0.0, m.square - 2 * (beta.dot(m.projection) + theta.dot(own.projection)) + beta.dot(m.gram * beta) +
                           2 * beta.dot(own.cross * theta) + theta.dot(own.gram * theta));
}

NormalEquations Fitter::assemble(const std::vector<std::size_t>& blocks, const std::vector<const Own*>& all,
                                 const std::vector<const JointFit*>& design) const {
  const auto nb = static_cast<Eigen::Index>(base().columns.size());
  NormalEquations out;
  out.offset = {nb};
  for (std::size_t j = 0; j < joints(); ++j) out.offset.push_back(out.offset.back() + (*all[j])[0].gram.rows());
  const Eigen::Index p = out.offset.back();
  out.information = Eigen::MatrixXd::Zero(p, p);
  out.projection = Eigen::VectorXd::Zero(p);
  for (std::size_t j = 0; j < joints(); ++j) {
    const double w = weights_[static_cast<Eigen::Index>(j)];
    const Eigen::Index first = data_->first_base[j], acting = nb - first;
    const Eigen::Index at = out.offset[j], own = out.offset[j + 1] - at;
    double rows = 0;
    for (const std::size_t b : blocks) {
      const BaseMoments& m = base_moments_[j][b];
      const OwnMoments& o = (*all[j])[b];
      out.information.block(first, first, acting, acting) += w * m.gram;
      out.information.block(first, at, acting, own) += w * o.cross;
      out.information.block(at, at, own, own) += w * o.gram;
      out.projection.segment(first, acting) += w * m.projection;
      out.projection.segment(at, own) += w * o.projection;
      rows += m.count;
    }
    // Paper Eq. 30: mean square error + ridge |W|^2
    out.information.diagonal().segment(at, own) +=
        w * rows * ridge_of(*design[j], design[j]->bls ? design[j]->bls->ridge : 0, own);
  }
  out.information.triangularView<Eigen::StrictlyLower>() = out.information.transpose();
  return out;
}

Solution Fitter::solve(const NormalEquations& equations) const {
  const SymmetricSolver solver(equations.information);
  return split(equations.offset, solver.solve(equations.projection));
}

std::vector<Eigen::Index> Fitter::offsets() const {
  std::vector<Eigen::Index> offset{static_cast<Eigen::Index>(base().columns.size())};
  for (std::size_t j = 0; j < joints(); ++j) offset.push_back(offset.back() + own_rows_[j].cols());
  return offset;
}

Solution Fitter::split(const std::vector<Eigen::Index>& offset, const Eigen::VectorXd& x) const {
  Solution solution;
  solution.beta = x.head(offset[0]);
  for (std::size_t j = 0; j < joints(); ++j)
    solution.theta.emplace_back(x.segment(offset[j], offset[j + 1] - offset[j]));
  return solution;
}

Eigen::VectorXd Fitter::residual(std::size_t joint, const Solution& solution) const {
  const Eigen::MatrixXd& x = data_->base_rows[joint];
  return torque_rows_[joint] - x * solution.beta.tail(x.cols()) - own_rows_[joint] * solution.theta[joint];
}

bool Judgement::beats(const Judgement& other, double worth) const {
  if (!(rmse < (1 - (blocks_of_one_log ? 4 : 1) * worth) * other.rmse) || !physical) return false;
  std::size_t better = 0;
  for (std::size_t b = 0; b < blocks.size(); ++b) better += blocks[b] < other.blocks[b];
  return blocks_of_one_log ? better == blocks.size() : 4 * better >= 3 * blocks.size();
}

void Fitter::Tally::add(std::size_t i, const Fitter& fitter, std::size_t joint, std::size_t fold, const Own& own,
                        const JointFit& design, const Solution& solution) {
  Judgement& judgement = judgements[i];
  for (const std::size_t b : fitter.data_->split.judge[fold]) {
    const double error = fitter.square_error(joint, b, own[b], solution), rows = fitter.base_moments_[joint][b].count;
    judgement.blocks.push_back(std::sqrt(error / std::max(rows, 1.0)));
    square[i] += error;
    count[i] += rows;
  }
  const Eigen::VectorXd& theta = solution.theta[joint];
  judgement.physical &= last_is_physical(design, theta);
  if (design.bls)
    judgement.coefficient_sum =
        std::max(judgement.coefficient_sum, theta.tail(design.bls->coefficient_count()).cwiseAbs().sum());
}

std::vector<Judgement> Fitter::Tally::done(bool one_log) {
  for (std::size_t i = 0; i < judgements.size(); ++i) {
    judgements[i].rmse = std::sqrt(square[i] / std::max(count[i], 1.0));
    judgements[i].blocks_of_one_log = one_log;
  }
  return std::move(judgements);
}

std::vector<Judgement> Fitter::judged(std::size_t first, std::size_t last, const std::vector<const Own*>& all,
                                      const std::vector<const JointFit*>& design) const {
  Tally tally(last - first);
  for (std::size_t fold = 0; fold < data_->split.fit.size(); ++fold) {
    const Solution solution = solve(assemble(data_->split.fit[fold], all, design));
    for (std::size_t j = first; j < last; ++j) tally.add(j - first, *this, j, fold, *all[j], *design[j], solution);
  }
  return tally.done(logs().size() == 1);
}

std::vector<const Fitter::Own*> Fitter::current() const {
  std::vector<const Own*> all;
  for (const Own& own : own_moments_) all.push_back(&own);
  return all;
}

std::vector<const JointFit*> Fitter::designs() const {
  std::vector<const JointFit*> all;
  for (const JointFit& joint : design_) all.push_back(&joint);
  return all;
}

std::vector<Judgement> Fitter::held_out() const { return judged(0, joints(), current(), designs()); }

std::vector<Judgement> Fitter::held_out_with(std::size_t joint, const JointFit& candidate,
                                             const std::vector<double>& ridges) const {
  std::vector<JointFit> designs_with = design_;
  designs_with[joint] = candidate;
  const Own own = own_moments(joint, own_rows(joint, designs_with));
  JointFit design = candidate;
  std::vector<const Own*> all = current();
  std::vector<const JointFit*> used = designs();
  all[joint] = &own;
  used[joint] = &design;
  std::vector<Judgement> out;
  for (const double ridge : ridges) {
    if (design.bls) design.bls->ridge = ridge;
    out.push_back(judged(joint, joint + 1, all, used)[0]);
  }
  return out;
}

std::vector<std::vector<Judgement>> Fitter::held_out_with(std::size_t joint, const JointFit& candidate,
                                                          const std::vector<Eigen::Index>& sizes,
                                                          const std::vector<double>& ridges) const {
  std::vector<JointFit> designs_with = design_;
  designs_with[joint] = candidate;
  const Own own = own_moments(joint, own_rows(joint, designs_with));
  JointFit whole = candidate;
  whole.bls->ridge = 0;  // comes last
  std::vector<const Own*> all = current();
  std::vector<const JointFit*> used = designs();
  all[joint] = &own;
  used[joint] = &whole;
  const Eigen::Index coefficients = candidate.bls->coefficient_count(), inputs = candidate.bls->input_count();
  const Eigen::Index theta = own_count(candidate), effects = theta - coefficients;

  // Of each size: its design, and the leading part of the moments.
  std::vector<JointFit> design(sizes.size(), candidate);
  std::vector<Own> part(sizes.size(), own);
  std::vector<std::vector<Tally>> tallies(sizes.size(), std::vector<Tally>(ridges.size(), Tally(1)));
  for (std::size_t s = 0; s < sizes.size(); ++s) {
    design[s].bls->weights = candidate.bls->weights.topRows(sizes[s]);
    const Eigen::Index count = effects + inputs + sizes[s];
    for (OwnMoments& m : part[s]) {
      m.cross = m.cross.leftCols(count).eval();
      m.gram = m.gram.topLeftCorner(count, count).eval();
      m.projection = m.projection.head(count).eval();
    }
  }
  for (std::size_t fold = 0; fold < data_->split.fit.size(); ++fold) {
    const NormalEquations equations = assemble(data_->split.fit[fold], all, used);
    // The BLS's unknowns behind all others: they grow.
    const Eigen::Index p = equations.offset.back(), fixed = p - coefficients;
    const Eigen::Index at = equations.offset[joint] + effects;
    Eigen::VectorXi order(p);
    for (Eigen::Index i = 0; i < p; ++i)
      order[i] = static_cast<int>(i < at ? i : (i < fixed ? i + coefficients : at + i - fixed));
    const Eigen::MatrixXd a = equations.information(order, order);
    const Eigen::VectorXd b = equations.projection(order);
    double rows = 0;
    for (const std::size_t block : data_->split.fit[fold]) rows += base_moments_[joint][block].count;
    GrowingSolver structure(a, b);
    structure.grow(fixed);
    for (std::size_t r = 0; r < ridges.size(); ++r) {
      GrowingSolver grown = structure;
      grown.set_ridge(weights_[static_cast<Eigen::Index>(joint)] * rows * ridges[r]);
      for (std::size_t s = 0; s < sizes.size(); ++s) {
        const Eigen::Index known = fixed + inputs + sizes[s];
        Eigen::VectorXd x = Eigen::VectorXd::Zero(p);
        x(order.head(known)) = grown.solve(known);
        Solution solution = split(equations.offset, x);
        solution.theta[joint].conservativeResize(effects + inputs + sizes[s]);
        tallies[s][r].add(0, *this, joint, fold, part[s], design[s], solution);
      }
    }
  }
  std::vector<std::vector<Judgement>> out(sizes.size());
  for (std::size_t s = 0; s < sizes.size(); ++s) {
    for (Tally& tally : tallies[s]) out[s].push_back(tally.done(logs().size() == 1)[0]);
  }
  return out;
}

std::vector<std::size_t> Fitter::train_blocks() const {
  std::vector<std::size_t> blocks;
  for (std::size_t b = 0; b < data_->blocks.size(); ++b) {
    if (data_->blocks[b].train) blocks.push_back(b);
  }
  return blocks;
}

NormalEquations Fitter::normal_equations() const { return assemble(train_blocks(), current(), designs()); }

double Fitter::train_rows() const {
  double rows = 0;
  for (const auto& joint : base_moments_) {
    for (const std::size_t b : train_blocks()) rows += joint[b].count;
  }
  return rows;
}

Solution Fitter::fit() const {
  const NormalEquations equations = normal_equations();
  Solution solution = solve(equations);
  add_standard_deviations(solution);
  return solution;
}

void Fitter::reweight() {
  for (int round = 0; round < 2; ++round) {
    const Solution solution = solve(normal_equations());
    for (std::size_t j = 0; j < joints(); ++j) {
      double sum = 0, square = 0, count = 0;
      for (const std::size_t b : train_blocks()) {
        sum += square_error(j, b, own_moments_[j][b], solution);
        square += base_moments_[j][b].square;
        count += base_moments_[j][b].count;
      }
      // Noise-free data: no more than 1e-9 of the signal, so that weights stay finite and of one size.
      weights_[static_cast<Eigen::Index>(j)] = count / std::max(sum, 1e-18 * square + 1e-300);
    }
  }
}

std::vector<Eigen::Index> Fitter::saturated_rows() const {
  std::vector<Eigen::Index> out;
  for (const Eigen::VectorXd& usable : data_->usable) out.push_back((usable.array() == 0).count());
  return out;
}

namespace {

/// The standard parameters that make up base parameter `row`, in columns' order.
std::string expression(const BaseSet& base, Eigen::Index row) {
  std::string text;
  for (Eigen::Index column = 0; column < base.grouping.cols(); ++column) {
    const double factor = base.grouping(row, column);
    if (std::fabs(factor) < 1e-9) continue;
    text += text.empty() ? (factor < 0 ? "-" : "") : (factor < 0 ? " - " : " + ");
    if (std::fabs(std::fabs(factor) - 1) > 1e-9) text += fmt::format("{:.6g} ", std::fabs(factor));
    text += parameter_name(column);
  }
  return text;
}

}  // namespace

std::vector<std::string> Fitter::unknowns() const {
  std::vector<std::string> names;
  for (const Eigen::Index column : base().columns) names.push_back(parameter_name(column));
  for (std::size_t j = 0; j < joints(); ++j) {
    const std::string& joint = data_->robot.joints[j].name;
    const std::size_t before = names.size();
    for (const EffectFit& fit : design_[j].effects) {
      for (const ParameterInfo& parameter : find_effect(fit.effect)->linear)
        names.push_back(fmt::format("{}: {}, {}", joint, fit.effect, parameter.name));
    }
    while (names.size() < before + static_cast<std::size_t>(own_rows_[j].cols()))
      names.push_back(fmt::format("{}: bls", joint));
  }
  return names;
}

IdentifiedModel Fitter::to_model(const Solution& solution) const {
  IdentifiedModel model;
  model.robot = data_->robot;
  std::vector<std::array<double, parameters_per_link>> links(joints());
  for (std::size_t i = 0; i < base().columns.size(); ++i) {
    const auto column = static_cast<std::size_t>(base().columns[i]);
    const auto k = static_cast<Eigen::Index>(i);
    links[column / parameters_per_link][column % parameters_per_link] = solution.beta[k];
    model.base.push_back({column, parameter_name(base().columns[i]), solution.beta[k],
                          solution.beta_std.size() > 0 ? solution.beta_std[k] : 0.0,
                          solution.essential.empty() || solution.essential[i], expression(base(), k)});
  }
  for (const auto& link : links) model.inertia.push_back(to_inertia(link));
  for (std::size_t j = 0; j < joints(); ++j) {
    JointFit joint = design_[j];
    if (j < solution.sign_width_std.size()) joint.sign_width_std = solution.sign_width_std[j];
    Eigen::Index at = 0;
    for (EffectFit& fit : joint.effects) {
      const std::size_t count = find_effect(fit.effect)->linear.size();
      fit.linear.clear();
      fit.linear_std.clear();
      if (j < solution.shape_std.size())
        fit.shape_std = solution.shape_std[j][static_cast<std::size_t>(&fit - joint.effects.data())];
      for (std::size_t i = 0; i < count; ++i, ++at) {
        fit.linear.push_back(solution.theta[j][at]);
        fit.linear_std.push_back(j < solution.theta_std.size() ? solution.theta_std[j][at] : 0.0);
      }
    }
    if (joint.bls) joint.bls->coefficients = solution.theta[j].tail(solution.theta[j].size() - at);
    model.joints.push_back(joint);
  }
  return model;
}

}  // namespace fxdyn
