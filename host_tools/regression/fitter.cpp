#include "host_tools/regression/fitter.hpp"

#include <fmt/format.h>

#include <cmath>
#include <optional>

#include "host_tools/effects/braking.hpp"
#include "host_tools/effects/broad_learning_types.hpp"
#include "host_tools/effects/effects.hpp"
#include "host_tools/effects/identified_model.hpp"
#include "host_tools/effects/link_parameters.hpp"
#include "host_tools/regression/bls_rows.hpp"
#include "host_tools/regression/joint_weight.hpp"
#include "host_tools/regression/own_columns.hpp"
#include "host_tools/regression/solver.hpp"
#include "host_tools/regression/tie.hpp"
#include "host_tools/signals/filter.hpp"
#include "host_tools/support/parallel.hpp"

namespace fxdyn {

Fitter::Fitter(const Robot& robot, const std::vector<ProcessedLog>& logs, std::vector<JointFit> design)
    : design_(std::move(design)) {
  Eigen::Index own_parameters = 0;
  for (const JointFit& joint : design_) own_parameters += own_count(joint);
  data_ = std::make_shared<const FitData>(make_fit_data(robot, logs, own_parameters));
  row_weights_ = data_->usable;
  weights_ = Eigen::VectorXd::Ones(static_cast<Eigen::Index>(robot.size()));
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
    const LogBlock& block = data_->blocks[b];
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
  for (const LogBlock& block : data_->blocks) {
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

Fitter::MomentsByBlock Fitter::own_moments(std::size_t joint, const Eigen::MatrixXd& own) const {
  MomentsByBlock out;
  for (const LogBlock& block : data_->blocks) {
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
      const JointMoments& m = own_moments_[j][b];
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

double Fitter::square_error(std::size_t joint, std::size_t block, const JointMoments& own,
                            const Solution& solution) const {
  const BaseMoments& m = base_moments_[joint][block];
  const Eigen::VectorXd beta = solution.beta.tail(m.projection.size());
  const Eigen::VectorXd& theta = solution.theta[joint];
  return std::max(0.0, m.square - 2 * (beta.dot(m.projection) + theta.dot(own.projection)) + beta.dot(m.gram * beta) +
                           2 * beta.dot(own.cross * theta) + theta.dot(own.gram * theta));
}

NormalEquations Fitter::assemble(const std::vector<std::size_t>& blocks, const std::vector<const MomentsByBlock*>& all,
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
      const JointMoments& o = (*all[j])[b];
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
    if (const auto tie = tie_of(*design[j])) {
      const double weight = rows_of_tie * w * rows;
      out.information(at + tie->part, at + tie->part) += weight;
      out.information(at + tie->whole, at + tie->whole) += weight * tie->share * tie->share;
      out.information(at + std::min(tie->part, tie->whole), at + std::max(tie->part, tie->whole)) -=
          weight * tie->share;
    }
  }
  if (!prior_.empty()) {
    out.information.topLeftCorner(nb, nb) += prior_.information;
    out.projection.head(nb) += prior_.information * prior_.mean;
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

std::vector<const Fitter::MomentsByBlock*> Fitter::current() const {
  std::vector<const MomentsByBlock*> all;
  for (const MomentsByBlock& own : own_moments_) all.push_back(&own);
  return all;
}

std::vector<const JointFit*> Fitter::designs() const {
  std::vector<const JointFit*> all;
  for (const JointFit& joint : design_) all.push_back(&joint);
  return all;
}

std::vector<std::size_t> Fitter::train_blocks() const {
  std::vector<std::size_t> blocks;
  for (std::size_t b = 0; b < data_->blocks.size(); ++b) {
    if (data_->blocks[b].train) blocks.push_back(b);
  }
  return blocks;
}

NormalEquations Fitter::normal_equations() const { return assemble(train_blocks(), current(), designs()); }

double Fitter::train_rows(std::size_t joint) const {
  double rows = 0;
  for (const std::size_t b : train_blocks()) rows += base_moments_[joint][b].count;
  return rows;
}

double Fitter::train_rows() const {
  double rows = 0;
  for (std::size_t j = 0; j < joints(); ++j) rows += train_rows(j);
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
      weights_[static_cast<Eigen::Index>(j)] = joint_weight(count, sum, square);
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
    // Bristles that would drive the joint fit noise: nobody could read such a model.
    let_it_brake(joint);
    model.joints.push_back(joint);
  }
  return model;
}

}  // namespace fxdyn
