#include "host_tools/forward/refine.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include "host_tools/effects/effects.hpp"
#include "host_tools/effects/link_parameters.hpp"
#include "host_tools/regression/gauss_newton.hpp"
#include "host_tools/simulate/closed_loop.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/parallel.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Of the torque, from which the fit starts at the largest: the next one starts where the one before ended.
constexpr std::array weights{10.0, 1.0, 0.1, 0.01, 0.0};
/// Share of the joint's range; an open loop that is off by more has run away.
constexpr double away = 0.3;
/// Share of the torque's RMSE; by how much a coefficient moves the torque for a finite difference.
constexpr double small = 0.01;
constexpr int most_iterations = 20;
/// Share of the cost; less gained by a step is the end.
constexpr double converged = 1e-4;
/// Of a log; more say nothing new, and cost memory.
constexpr Index most_rows = 4000;

/// Where a coefficient is in the model.
struct Place {
  std::optional<std::size_t> base;
  std::size_t joint = 0, effect = 0, linear = 0;
};

std::vector<Place> places(const IdentifiedModel& model) {
  std::vector<Place> out;
  for (std::size_t i = 0; i < model.base.size(); ++i) out.push_back({i});
  const IdentifiedModel plant = forward_plant(model);
  for (std::size_t j = 0; j < model.joints.size(); ++j) {
    for (std::size_t e = 0; e < model.joints[j].effects.size(); ++e) {
      const EffectFit& fit = model.joints[j].effects[e];
      if (plant.joints[j].find(fit.effect) == nullptr) continue;
      for (std::size_t k = 0; k < fit.linear.size(); ++k) out.push_back({{}, j, e, k});
    }
  }
  return out;
}

double& at(IdentifiedModel& model, const Place& place) {
  return place.base ? model.base[*place.base].value
                    : model.joints[place.joint].effects[place.effect].linear[place.linear];
}

IdentifiedModel with(IdentifiedModel model, const std::vector<Place>& where, const VectorXd& x) {
  for (std::size_t i = 0; i < where.size(); ++i) at(model, where[i]) = x[static_cast<Index>(i)];
  for (const BaseParameter& base : model.base) {
    LinkInertia<Real>& link = model.inertia[base.column / parameters_per_link];
    auto values = to_array(link);
    values[base.column % parameters_per_link] = base.value;
    link = to_inertia(values);
  }
  return model;
}

/// Part of a log.
struct Stretch {
  const ForwardLog* log = nullptr;
  Index from = 0, to = 0;
};
using Stretches = std::vector<Stretch>;

Stretches whole(const std::vector<ForwardLog>& logs) {
  Stretches out;
  for (const ForwardLog& log : logs) out.push_back({&log, 0, log.raw.samples()});
  return out;
}

/// One half of each log: 0 or 1.
Stretches halves(const std::vector<ForwardLog>& logs, int which) {
  Stretches out;
  for (const ForwardLog& log : logs) {
    const Index middle = log.raw.samples() / 2;
    out.push_back({&log, which == 0 ? 0 : middle, which == 0 ? middle : log.raw.samples()});
  }
  return out;
}

/// The fit on some stretches of logs.
class SimulationFit {
 public:
  SimulationFit(const IdentifiedModel& model, const std::vector<Place>& where, Stretches stretches, Index given,
                Loop loop)
      : model_(model), where_(where), stretches_(std::move(stretches)), given_(given), loop_(loop) {
    start_.resize(static_cast<Index>(where.size()));
    for (std::size_t i = 0; i < where.size(); ++i) start_[static_cast<Index>(i)] = at(model_, where[i]);
    const VectorXd unit = VectorXd::Ones(joints());
    position_scale_ = rms_of_columns(positions(model_, unit));
    torque_scale_ = rms_of_columns(torques(model_, unit));
    torque_ = torques(model_, torque_scale_);
    columns_.resize(torque_.size(), start_.size());
    parallel_for(where.size(), [&](std::size_t i) {
      const auto k = static_cast<Index>(i);
      const double step = std::max(std::fabs(start_[k]), 1e-3);  // the torque is linear in it
      VectorXd x = start_;
      x[k] += step;
      columns_.col(k) = (torques(with(model_, where_, x), torque_scale_) - torque_) / step;
    });
    step_ = VectorXd::Zero(start_.size());
    const double rows = std::sqrt(static_cast<double>(torque_.size()));
    for (Index k = 0; k < start_.size(); ++k) {
      if (const double size = columns_.col(k).norm() / rows; size > 0) step_[k] = small / size;
    }
  }

  const VectorXd& start() const { return start_; }

  /// The minimum without simulation: what the torque of these stretches alone says.
  VectorXd by_torque() const {
    MatrixXd h = columns_.transpose() * columns_;
    h.diagonal() *= 1 + 1e-9;
    h.diagonal().array() += 1e-12 * h.diagonal().maxCoeff();
    return start_ - h.ldlt().solve(columns_.transpose() * torque_);
  }

  /// The minimum beside `x`, by Levenberg's and Marquardt's damped steps.
  VectorXd minimum(VectorXd x, double weight) const {
    double damping = 1e-3;
    VectorXd e = simulated(x);
    double cost = e.squaredNorm() / size(e) + weight * torque_cost(x);
    struct Normal {
      MatrixXd hessian;
      VectorXd gradient;
    };
    const auto step = [&](const VectorXd& at, int) {
      const MatrixXd slope = sensitivities(at, e);
      const double of_torque = weight / size(torque_);
      return std::optional(Normal{
          slope.transpose() * slope / size(e) + of_torque * columns_.transpose() * columns_,
          slope.transpose() * e / size(e) + of_torque * columns_.transpose() * (torque_ + columns_ * (at - start_))});
    };
    const auto move = [&](const VectorXd& from, const Normal& normal, double) {
      MatrixXd damped = normal.hessian;
      const auto diagonal = normal.hessian.diagonal().array();
      damped.diagonal() += damping * (diagonal + 1e-12 * diagonal.maxCoeff()).matrix();
      return VectorXd(from - damped.ldlt().solve(normal.gradient));
    };
    const auto accept = [&](const VectorXd&, const VectorXd& next, int) {
      auto moved = attempt_at(next);
      const double then = moved ? moved->squaredNorm() / size(*moved) + weight * torque_cost(next)
                                : std::numeric_limits<double>::infinity();
      const bool better = then < cost;
      damping *= better ? 0.3 : 5;
      if (!better) return Trial::rejected;
      const bool done = then > (1 - converged) * cost;
      e = std::move(*moved);
      cost = then;
      return done ? Trial::converged : Trial::accepted;
    };
    return gauss_newton(std::move(x), {.most_rounds = most_iterations, .most_tries = 8}, step, move, accept);
  }

  /// Per joint, of the position [rad | m]; empty: it ran away.
  VectorXd rmse(const VectorXd& x) const {
    try {
      return rms_of_columns(positions(with(model_, where_, x), VectorXd::Ones(joints())));
    } catch (const DataError&) {
      return {};
    }
  }

 private:
  static double size(const VectorXd& rows) { return static_cast<double>(rows.size()); }
  Index joints() const { return static_cast<Index>(model_.joints.size()); }

  /// Joints that never err, as those that stand still, count as one that errs by nothing worth fitting.
  VectorXd rms_of_columns(const VectorXd& stacked) const {
    const auto rows = Eigen::Map<const MatrixXd>(stacked.data(), stacked.size() / joints(), joints());
    return rows.colwise().norm().transpose() / std::sqrt(static_cast<double>(rows.rows()));
  }

  /// Rows of all stretches, joint after joint, each joint's divided by its scale.
  VectorXd stacked(const std::vector<MatrixXd>& parts, const VectorXd& scale) const {
    Index rows = 0;
    for (const MatrixXd& part : parts) rows += part.rows();
    MatrixXd all(rows, joints());
    rows = 0;
    for (const MatrixXd& part : parts) {
      all.middleRows(rows, part.rows()) = part;
      rows += part.rows();
    }
    const double least = 1e-9 * scale.maxCoeff();
    for (Index j = 0; j < joints(); ++j) all.col(j) /= std::max({scale[j], least, 1e-300});
    return Eigen::Map<const VectorXd>(all.data(), all.size());
  }

  VectorXd positions(const IdentifiedModel& model, const VectorXd& scale) const {
    std::vector<MatrixXd> parts;
    for (const Stretch& stretch : stretches_) {
      const ForwardLog& log = *stretch.log;
      const MatrixXd q = simulated_positions(model, log.raw, log.processed, stretch.from, stretch.to, given_, loop_);
      const MatrixXd left = q - log.raw.q.middleRows(stretch.from, q.rows());
      const Index judged = left.rows() - given_, every = judged / most_rows + 1;
      MatrixXd part(judged / every, joints());
      for (Index k = 0; k < part.rows(); ++k) part.row(k) = left.row(given_ + k * every);
      parts.push_back(std::move(part));
    }
    return stacked(parts, scale);
  }

  VectorXd torques(const IdentifiedModel& model, const VectorXd& scale) const {
    std::vector<MatrixXd> parts;
    for (const Stretch& stretch : stretches_) {
      const ProcessedLog& log = stretch.log->processed;
      const MatrixXd left = log.filter_columns(predict(model, log) - log.tau);
      const Index from = std::max(stretch.from, log.first), to = std::min(stretch.to, log.last);
      const Index every = std::max<Index>(log.decimation, (to - from) / most_rows + 1);
      MatrixXd part(std::max<Index>(0, (to - from) / every), joints());
      for (Index k = 0; k < part.rows(); ++k) part.row(k) = left.row(from + k * every);
      parts.push_back(std::move(part));
    }
    return stacked(parts, scale);
  }

  VectorXd simulated(const VectorXd& x) const { return positions(with(model_, where_, x), position_scale_); }
  std::optional<VectorXd> attempt_at(const VectorXd& x) const {
    try {
      VectorXd e = simulated(x);
      return e.allFinite() ? std::optional(std::move(e)) : std::nullopt;
    } catch (const DataError&) {  // no plant, or it runs away
      return {};
    }
  }
  double torque_cost(const VectorXd& x) const {
    return (torque_ + columns_ * (x - start_)).squaredNorm() / size(torque_);
  }

  MatrixXd sensitivities(const VectorXd& x, const VectorXd& e) const {
    MatrixXd out = MatrixXd::Zero(e.size(), x.size());
    parallel_for(static_cast<std::size_t>(x.size()), [&](std::size_t i) {
      const auto k = static_cast<Index>(i);
      for (const double step : {step_[k], -step_[k]}) {
        if (step == 0) return;
        VectorXd moved = x;
        moved[k] += step;
        if (const auto there = attempt_at(moved)) {
          out.col(k) = (*there - e) / step;
          return;
        }
      }
    });
    return out;
  }

  IdentifiedModel model_;
  std::vector<Place> where_;
  Stretches stretches_;
  Index given_;
  Loop loop_;
  VectorXd start_, position_scale_, torque_scale_, torque_, step_;
  MatrixXd columns_;  ///< the torque's derivatives
};

std::string name_of(const IdentifiedModel& model, const Place& place) {
  if (place.base) return model.base[*place.base].name;
  const EffectFit& fit = model.joints[place.joint].effects[place.effect];
  return fmt::format("{}: {} {}", model.robot.joints[place.joint].name, fit.effect,
                     find_effect(fit.effect)->linear[place.linear].name);
}

std::string unit_of(const IdentifiedModel& model, const Place& place) {
  if (place.base) return {};
  const Joint& joint = model.robot.joints[place.joint];
  const auto& info = find_effect(model.joints[place.joint].effects[place.effect].effect)->linear[place.linear];
  return std::string(joint.type == JointType::prismatic ? info.unit_prismatic : info.unit);
}

/// Why the open loop says nothing; empty: it does.
std::string why_closed(const IdentifiedModel& model, const std::vector<ForwardLog>& train, Index given) {
  for (const ForwardLog& log : train) {
    const Forward forward = simulate_forward(model, log.raw, log.processed, given);
    if (!forward.open.why_failed.empty()) return log.processed.name + ": " + forward.open.why_failed;
    for (Index j = 0; j < log.raw.joints(); ++j) {
      const double range = log.raw.q.col(j).maxCoeff() - log.raw.q.col(j).minCoeff();
      if (forward.open.rmse[j] > away * range && range > 0)
        return fmt::format("{}: joint {} is off by {:.2g} of its range in open loop", log.processed.name, j + 1,
                           forward.open.rmse[j] / range);
    }
  }
  return {};
}

/// ln of the RMSE over that with `by_torque`, mean over the joints that err.
double held_out(const SimulationFit& judge, const VectorXd& by_torque, const VectorXd& x) {
  const VectorXd before = judge.rmse(by_torque), after = judge.rmse(x);
  if (before.size() == 0 || after.size() == 0 || !after.allFinite()) return std::numeric_limits<double>::infinity();
  double sum = 0;
  Index count = 0;
  for (Index j = 0; j < before.size(); ++j) {
    if (!(before[j] > 0)) continue;
    sum += std::log(std::max(after[j], 1e-12 * before[j]) / before[j]);
    ++count;
  }
  return count == 0 ? 0 : sum / static_cast<double>(count);
}

}  // namespace

Refinement refine(const IdentifiedModel& model, const std::vector<ForwardLog>& train,
                  const std::vector<ForwardLog>& validate, Index given, Progress& progress) {
  for (const std::vector<ForwardLog>* logs : {&train, &validate}) {
    for (const ForwardLog& log : *logs) {
      if (log.raw.samples() / 2 > 2 * given) continue;
      throw InputError(fmt::format("{}: has {} samples, too few beside the {} that are given (--given)",
                                   log.processed.name, log.raw.samples(), given));
    }
  }
  Refinement out;
  out.why_closed = why_closed(model, train, given);
  out.loop = out.why_closed.empty() ? Loop::open : Loop::closed;
  const std::vector<Place> where = places(model);
  const auto fit_on = [&](Stretches stretches) {
    return SimulationFit(model, where, std::move(stretches), given, out.loop);
  };

  struct Fold {
    SimulationFit fit, judge;
  };
  std::vector<Fold> folds;
  if (!validate.empty()) {
    folds.push_back({fit_on(whole(train)), fit_on(whole(validate))});
  } else {
    for (const int half : {0, 1}) folds.push_back({fit_on(halves(train, half)), fit_on(halves(train, 1 - half))});
  }
  progress.stage("how much the torque counts", weights.size() * folds.size());
  for (const double weight : weights) out.tried.push_back({weight, 0});
  for (const Fold& fold : folds) {
    // What the fit is compared with must have seen as little as the fit itself.
    const VectorXd by_torque = fold.fit.by_torque();
    VectorXd x = by_torque;
    for (TriedWeight& tried : out.tried) {
      x = fold.fit.minimum(x, tried.weight);
      tried.held_out += held_out(fold.judge, by_torque, x) / static_cast<double>(folds.size());
      progress.step();
    }
  }
  for (TriedWeight& tried : out.tried) tried.held_out = std::exp(tried.held_out);
  const TriedWeight best = *std::min_element(out.tried.begin(), out.tried.end(),
                                             [](const auto& a, const auto& b) { return a.held_out < b.held_out; });
  out.kept = best.held_out < 1;
  out.weight = best.weight;

  progress.stage("parameters by simulation", weights.size());
  const SimulationFit all = fit_on(whole(train));
  VectorXd x = all.start();
  for (const double weight : weights) {
    if (out.kept && weight >= best.weight) x = all.minimum(x, weight);
    progress.step();
  }
  progress.done();
  out.model = out.kept ? with(model, where, x) : model;
  out.before = all.rmse(all.start());
  out.after = all.rmse(x);
  for (std::size_t i = 0; i < where.size(); ++i) {
    const auto k = static_cast<Index>(i);
    out.parameters.push_back({name_of(model, where[i]), unit_of(model, where[i]), all.start()[k], x[k]});
  }
  return out;
}

}  // namespace fxdyn
