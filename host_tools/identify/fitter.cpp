#include "host_tools/identify/fitter.hpp"

#include <fmt/format.h>

#include <cmath>

#include "host_tools/error.hpp"
#include "model/broad_learning.hpp"

namespace fxdyn {
namespace {

constexpr int blocks_of_one_log = 5;

Eigen::MatrixXd bls_columns(const BroadLearningFit& bls, double sign_width, const JointSeries& series) {
  std::vector<double> words{1 / bls.reference_velocity, 1 / bls.span};
  for (const double distance : bls.distances) words.push_back(series.step_s / distance);
  for (Eigen::Index k = 0; k < bls.weights.rows(); ++k) {
    words.push_back(bls.weights(k, bls.weights.cols() - 1));
    for (Eigen::Index i = 0; i + 1 < bls.weights.cols(); ++i) words.push_back(bls.weights(k, i));
  }
  const auto nodes = static_cast<std::size_t>(bls.nodes());
  Eigen::MatrixXd columns(series.q.size(),
                          static_cast<Eigen::Index>(BroadLearningLayout::coefficient_words(nodes, false)));
  std::vector<double> scratch(nodes);
  BroadLearningState<Real> state;
  Saturations none;
  for (Eigen::Index k = 0; k < series.q.size(); ++k) {
    const JointInput<Real> u{series.q[k], series.dq[k], series.ddq[k], tanh_of(series.dq[k] / sign_width), 0.0};
    broad_learning_basis<Real>(
        nodes, u, Words<Real>{words.data()}, state, none, scratch,
        [&](auto, std::size_t i, double phi) { columns(k, static_cast<Eigen::Index>(i)) = phi; });
  }
  return columns;
}

Eigen::Index own_count(const JointFit& design) {
  Eigen::Index count = 0;
  for (const EffectFit& fit : design.effects)
    count += static_cast<Eigen::Index>(find_effect(fit.effect)->linear.size());
  if (design.bls) count += design.bls->nodes() + static_cast<Eigen::Index>(BroadLearningLayout::inputs);
  return count;
}

}  // namespace

Eigen::MatrixXd design_columns(const JointFit& design, const JointSeries& series) {
  Eigen::MatrixXd columns(series.q.size(), own_count(design));
  Eigen::Index at = 0;
  const auto append = [&](const Eigen::MatrixXd& part) {
    columns.middleCols(at, part.cols()) = part;
    at += part.cols();
  };
  for (const EffectFit& fit : design.effects) append(effect_columns(fit.effect, fit.shape, design.sign_width, series));
  if (design.bls) append(bls_columns(*design.bls, design.sign_width, series));
  return columns;
}

Fitter::Fitter(const Robot& robot, std::vector<ProcessedLog> logs, std::vector<JointFit> design)
    : robot_(robot), logs_(std::move(logs)), design_(std::move(design)) {
  const DhChain chain = to_dh(robot_);
  base_ = find_base(chain);
  Regressor regressor(chain);
  const auto n = static_cast<Eigen::Index>(robot_.size());
  const auto nb = static_cast<Eigen::Index>(base_.columns.size());

  Eigen::Index train_rows = 0;
  for (Eigen::Index j = 0; j < n; ++j) {
    double range = 0;
    bool moves = false;
    for (const ProcessedLog& log : logs_) {
      if (log.role != Role::train) continue;
      range = std::max(range, log.q_range[j]);
      // Noise alone looks like motion of a few times what the filter took out.
      moves |= log.q_range[j] > std::max(1e-4, 20 * log.q_noise[j]);
    }
    if (!moves) {
      throw DataError(
          fmt::format("joint {} ({}) never moves in the train logs (range {:.1e} {}): record a log in which it does",
                      j + 1, robot_.joints[static_cast<std::size_t>(j)].name, range,
                      robot_.joints[static_cast<std::size_t>(j)].position_unit()));
    }
  }
  for (const ProcessedLog& log : logs_) {
    if (log.role == Role::train) train_rows += log.rows();
    std::vector<Eigen::MatrixXd> rows;
    std::vector<Eigen::VectorXd> torque;
    std::vector<Eigen::MatrixXd> full(static_cast<std::size_t>(n), Eigen::MatrixXd(log.q.rows(), nb));
    for (Eigen::Index k = 0; k < log.q.rows(); ++k) {
      const Eigen::MatrixXd& y = regressor(log.q.row(k), log.dq.row(k), log.ddq.row(k));
      for (Eigen::Index j = 0; j < n; ++j) {
        for (Eigen::Index c = 0; c < nb; ++c)
          full[static_cast<std::size_t>(j)](k, c) = y(j, base_.columns[static_cast<std::size_t>(c)]);
      }
    }
    const Eigen::MatrixXd tau = log.decimate(log.tau);
    for (Eigen::Index j = 0; j < n; ++j) {
      rows.push_back(log.decimate(log.filter_columns(full[static_cast<std::size_t>(j)])));
      full[static_cast<std::size_t>(j)].resize(0, 0);
      torque.emplace_back(tau.col(j));
    }
    base_rows_.push_back(std::move(rows));
    torque_rows_.push_back(std::move(torque));
  }

  for (const ProcessedLog& log : logs_) split_.has_validation |= log.role == Role::validate;
  const bool by_log = !split_.has_validation && logs_.size() > 1;
  split_.kind = split_.has_validation ? "validate logs"
                : by_log              ? "each train log judged by a fit of the others (no log has the role validate)"
                         : "blocks of the train log (no log has the role validate, and there is one trajectory only)";
  const int parts = split_.has_validation || by_log ? 1 : blocks_of_one_log;
  for (std::size_t l = 0; l < logs_.size(); ++l) {
    const Eigen::Index rows = logs_[l].rows();
    for (int part = 0; part < parts; ++part) {
      blocks_.push_back({l, rows * part / parts, rows * (part + 1) / parts, logs_[l].role == Role::train});
    }
  }
  const std::size_t folds = split_.has_validation ? 1 : blocks_.size();
  split_.fit.resize(folds);
  split_.judge.resize(folds);
  for (std::size_t b = 0; b < blocks_.size(); ++b) {
    for (std::size_t fold = 0; fold < folds; ++fold) {
      const bool judges = split_.has_validation ? !blocks_[b].train : b == fold;
      (judges ? split_.judge : split_.fit)[fold].push_back(b);
    }
  }

  Eigen::Index parameters = nb;
  for (const JointFit& joint : design_) parameters += own_count(joint);
  if (train_rows * n < 2 * parameters) {
    throw DataError(
        fmt::format("{} rows (after filtering) for {} parameters: record a longer log", train_rows * n, parameters));
  }
  weights_ = Eigen::VectorXd::Ones(n);
  moments_.resize(joints());
  for (std::size_t j = 0; j < joints(); ++j) moments_[j] = moments(j, design_[j]);
}

Eigen::MatrixXd Fitter::own_columns(std::size_t log, std::size_t joint, const JointFit& design) const {
  const ProcessedLog& l = logs_[log];
  const auto j = static_cast<Eigen::Index>(joint);
  const JointSeries series{l.q.col(j), l.dq.col(j), l.ddq.col(j), {}, l.step_s};
  return l.decimate(l.filter_columns(design_columns(design, series)));
}

std::vector<Moments> Fitter::moments(std::size_t joint, const JointFit& design) const {
  const auto nb = static_cast<Eigen::Index>(base_.columns.size());
  std::vector<Eigen::MatrixXd> own;
  for (std::size_t l = 0; l < logs_.size(); ++l) own.push_back(own_columns(l, joint, design));
  std::vector<Moments> out;
  for (const Block& block : blocks_) {
    const Eigen::Index rows = block.to - block.from, count = own[block.log].cols();
    Eigen::MatrixXd x(rows, nb + count);
    x.leftCols(nb) = base_rows_[block.log][joint].middleRows(block.from, rows);
    x.rightCols(count) = own[block.log].middleRows(block.from, rows);
    const Eigen::VectorXd y = torque_rows_[block.log][joint].segment(block.from, rows);
    Moments m{Eigen::MatrixXd::Zero(nb + count, nb + count), x.transpose() * y, y.squaredNorm(), rows};
    m.gram.selfadjointView<Eigen::Lower>().rankUpdate(x.transpose());
    m.gram.triangularView<Eigen::StrictlyUpper>() = m.gram.transpose();
    out.push_back(std::move(m));
  }
  return out;
}

std::vector<Fitter::Dependent> Fitter::dependent_effects() const {
  // Cholesky of the normalised gram in the order base, joint 1, joint 2, ..: a column whose pivot vanishes is a sum of
  // those before it.
  const auto nb = static_cast<Eigen::Index>(base_.columns.size());
  std::vector<Dependent> found;
  Eigen::MatrixXd base = Eigen::MatrixXd::Zero(nb, nb);
  for (std::size_t j = 0; j < joints(); ++j) {
    for (const std::size_t b : train_blocks()) base += moments_[j][b].gram.topLeftCorner(nb, nb);
  }
  for (std::size_t j = 0; j < joints(); ++j) {
    Eigen::MatrixXd gram = moments_[j][0].gram * 0;
    for (const std::size_t b : train_blocks()) gram += moments_[j][b].gram;
    gram.topLeftCorner(nb, nb) = base;  // base columns show up in all joints' rows, the effects in their own only
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
      const auto own = static_cast<std::size_t>(k - nb);
      if (k >= nb && dependent && own < effect_of.size()) {
        const Dependent it{j, effect_of[own]};
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
  design_[joint] = std::move(design);
  moments_[joint] = moments(joint, design_[joint]);
}

Eigen::VectorXd Fitter::ridge_of(const JointFit& design, double ridge, Eigen::Index count) {
  Eigen::VectorXd out = Eigen::VectorXd::Zero(count);
  if (design.bls)
    out.tail(design.bls->nodes() + static_cast<Eigen::Index>(BroadLearningLayout::inputs)).setConstant(ridge);
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

double square_error(const Moments& m, const Eigen::VectorXd& beta, const Eigen::VectorXd& theta) {
  Eigen::VectorXd x(beta.size() + theta.size());
  x << beta, theta;
  return std::max(0.0, m.square - 2 * x.dot(m.projection) + x.dot(m.gram * x));
}

}  // namespace

NormalEquations Fitter::assemble(const std::vector<std::size_t>& blocks,
                                 const std::vector<const std::vector<Moments>*>& all,
                                 const std::vector<const JointFit*>& design) const {
  const auto nb = static_cast<Eigen::Index>(base_.columns.size());
  std::vector<Eigen::Index> offset{nb};
  for (std::size_t j = 0; j < joints(); ++j) offset.push_back(offset.back() + (*all[j])[0].gram.rows() - nb);
  const Eigen::Index p = offset.back();
  Eigen::MatrixXd gram = Eigen::MatrixXd::Zero(p, p);
  Eigen::VectorXd projection = Eigen::VectorXd::Zero(p), ridge = Eigen::VectorXd::Zero(p);
  for (std::size_t j = 0; j < joints(); ++j) {
    const double w = weights_[static_cast<Eigen::Index>(j)];
    const Eigen::Index at = offset[j], own = offset[j + 1] - at;
    Eigen::Index rows = 0;
    for (const std::size_t b : blocks) {
      const Moments& m = (*all[j])[b];
      gram.topLeftCorner(nb, nb) += w * m.gram.topLeftCorner(nb, nb);
      gram.block(0, at, nb, own) += w * m.gram.topRightCorner(nb, own);
      gram.block(at, at, own, own) += w * m.gram.bottomRightCorner(own, own);
      projection.head(nb) += w * m.projection.head(nb);
      projection.segment(at, own) += w * m.projection.tail(own);
      rows += m.count;
    }
    // Paper Eq. 30: mean square error + ridge |W|^2
    ridge.segment(at, own) =
        w * static_cast<double>(rows) * ridge_of(*design[j], design[j]->bls ? design[j]->bls->ridge : 0, own);
  }
  gram.triangularView<Eigen::StrictlyLower>() = gram.transpose();
  gram.diagonal() += ridge;
  return {gram, projection};
}

Solution Fitter::solve(const std::vector<std::size_t>& blocks, const std::vector<const std::vector<Moments>*>& all,
                       const std::vector<const JointFit*>& design, bool with_std) const {
  const auto nb = static_cast<Eigen::Index>(base_.columns.size());
  std::vector<Eigen::Index> offset{nb};
  for (std::size_t j = 0; j < joints(); ++j) offset.push_back(offset.back() + (*all[j])[0].gram.rows() - nb);
  const auto [gram, projection] = assemble(blocks, all, design);
  const Eigen::Index p = offset.back();

  // Equal scales; the small diagonal keeps directions that the data does not excite finite, and the refinement takes
  // its effect out of all others.
  Eigen::VectorXd scale = gram.diagonal().cwiseSqrt();
  for (Eigen::Index i = 0; i < p; ++i) scale[i] = scale[i] > 0 ? 1 / scale[i] : 0;
  const Eigen::MatrixXd scaled = scale.asDiagonal() * gram * scale.asDiagonal();
  const Eigen::LDLT<Eigen::MatrixXd> ldlt(scaled + 1e-12 * Eigen::MatrixXd::Identity(p, p));
  const auto solve_scaled = [&](const Eigen::VectorXd& rhs) { return Eigen::VectorXd(ldlt.solve(rhs)); };
  const Eigen::VectorXd rhs = scale.cwiseProduct(projection);
  Eigen::VectorXd x = solve_scaled(rhs);
  for (int round = 0; round < 2; ++round) x += solve_scaled(rhs - scaled * x);
  x = scale.cwiseProduct(x);

  Solution solution;
  solution.beta = x.head(nb);
  for (std::size_t j = 0; j < joints(); ++j)
    solution.theta.emplace_back(x.segment(offset[j], offset[j + 1] - offset[j]));
  if (with_std) {
    // Sandwich: the residual's variance of each joint, whatever the weights were. Filtered samples are correlated: only
    // two in a period of the cut-off are independent.
    const Eigen::MatrixXd inverse =
        scale.asDiagonal() * ldlt.solve(Eigen::MatrixXd::Identity(p, p)) * scale.asDiagonal();
    Eigen::MatrixXd middle = Eigen::MatrixXd::Zero(p, p);
    for (std::size_t j = 0; j < joints(); ++j) {
      const double w = weights_[static_cast<Eigen::Index>(j)];
      const Eigen::Index at = offset[j], own = offset[j + 1] - at;
      double square = 0;
      Eigen::Index rows = 0;
      for (const std::size_t b : blocks) {
        square += square_error((*all[j])[b], solution.beta, solution.theta[j]);
        rows += (*all[j])[b].count;
      }
      const double factor = w * w * square / static_cast<double>(rows);
      for (const std::size_t b : blocks) {
        const Moments& m = (*all[j])[b];
        middle.topLeftCorner(nb, nb) += factor * m.gram.topLeftCorner(nb, nb);
        middle.block(0, at, nb, own) += factor * m.gram.topRightCorner(nb, own);
        middle.block(at, 0, own, nb) += factor * m.gram.bottomLeftCorner(own, nb);
        middle.block(at, at, own, own) += factor * m.gram.bottomRightCorner(own, own);
      }
    }
    const ProcessedLog& log = logs_.front();
    const double row_rate = 1 / (log.step_s * static_cast<double>(log.decimation));
    const double correlated = std::max(1.0, row_rate / (2 * log.filter.torque_cutoff_hz));
    const Eigen::VectorXd std = (correlated * (inverse * middle * inverse).diagonal().cwiseMax(0)).cwiseSqrt();
    solution.beta_std = std.head(nb);
    for (std::size_t j = 0; j < joints(); ++j)
      solution.theta_std.emplace_back(std.segment(offset[j], offset[j + 1] - offset[j]));
  }
  return solution;
}

bool Judgement::beats(const Judgement& other, double worth) const {
  if (!(rmse < (1 - (blocks_of_one_log ? 4 : 1) * worth) * other.rmse) || !physical) return false;
  std::size_t better = 0;
  for (std::size_t b = 0; b < blocks.size(); ++b) better += blocks[b] < other.blocks[b];
  return blocks_of_one_log ? better == blocks.size() : 4 * better >= 3 * blocks.size();
}

std::vector<Judgement> Fitter::judged(std::size_t first, std::size_t last,
                                      const std::vector<const std::vector<Moments>*>& all,
                                      const std::vector<const JointFit*>& design) const {
  std::vector<Judgement> out(last - first);
  std::vector<double> sum(out.size(), 0), count(out.size(), 0);
  for (std::size_t fold = 0; fold < split_.fit.size(); ++fold) {
    const Solution solution = solve(split_.fit[fold], all, design, false);
    for (std::size_t j = first; j < last; ++j) {
      Judgement& judgement = out[j - first];
      for (const std::size_t b : split_.judge[fold]) {
        const Moments& m = (*all[j])[b];
        const double square = square_error(m, solution.beta, solution.theta[j]);
        judgement.blocks.push_back(std::sqrt(square / static_cast<double>(m.count)));
        sum[j - first] += square;
        count[j - first] += static_cast<double>(m.count);
      }
      judgement.physical &= last_is_physical(*design[j], solution.theta[j]);
      if (design[j]->bls) {
        const Eigen::Index own = design[j]->bls->nodes() + static_cast<Eigen::Index>(BroadLearningLayout::inputs);
        judgement.coefficient_sum = std::max(judgement.coefficient_sum, solution.theta[j].tail(own).cwiseAbs().sum());
      }
    }
  }
  for (std::size_t i = 0; i < out.size(); ++i) {
    out[i].rmse = std::sqrt(sum[i] / count[i]);
    out[i].blocks_of_one_log = logs_.size() == 1;
  }
  return out;
}

std::vector<Judgement> Fitter::held_out() const {
  std::vector<const std::vector<Moments>*> all;
  std::vector<const JointFit*> design;
  for (std::size_t j = 0; j < joints(); ++j) {
    all.push_back(&moments_[j]);
    design.push_back(&design_[j]);
  }
  return judged(0, joints(), all, design);
}

std::vector<Judgement> Fitter::held_out_with(std::size_t joint, const JointFit& candidate,
                                             const std::vector<double>& ridges) const {
  const std::vector<Moments> own = moments(joint, candidate);
  JointFit design = candidate;
  std::vector<const std::vector<Moments>*> all;
  std::vector<const JointFit*> designs;
  for (std::size_t j = 0; j < joints(); ++j) {
    all.push_back(j == joint ? &own : &moments_[j]);
    designs.push_back(j == joint ? &design : &design_[j]);
  }
  std::vector<Judgement> out;
  for (const double ridge : ridges) {
    if (design.bls) design.bls->ridge = ridge;
    out.push_back(judged(joint, joint + 1, all, designs)[0]);
  }
  return out;
}

std::vector<std::size_t> Fitter::train_blocks() const {
  std::vector<std::size_t> blocks;
  for (std::size_t b = 0; b < blocks_.size(); ++b) {
    if (blocks_[b].train) blocks.push_back(b);
  }
  return blocks;
}

Solution Fitter::fit() const {
  std::vector<const std::vector<Moments>*> all;
  std::vector<const JointFit*> design;
  for (std::size_t j = 0; j < joints(); ++j) {
    all.push_back(&moments_[j]);
    design.push_back(&design_[j]);
  }
  return solve(train_blocks(), all, design, true);
}

NormalEquations Fitter::normal_equations() const {
  std::vector<const std::vector<Moments>*> all;
  std::vector<const JointFit*> design;
  for (std::size_t j = 0; j < joints(); ++j) {
    all.push_back(&moments_[j]);
    design.push_back(&design_[j]);
  }
  return assemble(train_blocks(), all, design);
}

void Fitter::reweight() {
  for (int round = 0; round < 2; ++round) {
    const Solution solution = fit();
    for (std::size_t j = 0; j < joints(); ++j) {
      double sum = 0, square = 0;
      Eigen::Index count = 0;
      for (const std::size_t b : train_blocks()) {
        sum += square_error(moments_[j][b], solution.beta, solution.theta[j]);
        square += moments_[j][b].square;
        count += moments_[j][b].count;
      }
      // Noise-free data: no more than 1e-9 of the signal, so that weights stay finite and of one size.
      weights_[static_cast<Eigen::Index>(j)] = static_cast<double>(count) / std::max(sum, 1e-18 * square + 1e-300);
    }
  }
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

IdentifiedModel Fitter::to_model(const Solution& solution) const {
  IdentifiedModel model;
  model.robot = robot_;
  std::vector<std::array<double, parameters_per_link>> links(joints());
  for (std::size_t i = 0; i < base_.columns.size(); ++i) {
    const auto column = static_cast<std::size_t>(base_.columns[i]);
    const auto k = static_cast<Eigen::Index>(i);
    links[column / parameters_per_link][column % parameters_per_link] = solution.beta[k];
    model.base.push_back({column, parameter_name(base_.columns[i]), solution.beta[k],
                          solution.beta_std.size() > 0 ? solution.beta_std[k] : 0.0, expression(base_, k)});
  }
  for (const auto& link : links) model.inertia.push_back(to_inertia(link));
  for (std::size_t j = 0; j < joints(); ++j) {
    JointFit joint = design_[j];
    Eigen::Index at = 0;
    for (EffectFit& fit : joint.effects) {
      const std::size_t count = find_effect(fit.effect)->linear.size();
      fit.linear.clear();
      fit.linear_std.clear();
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
