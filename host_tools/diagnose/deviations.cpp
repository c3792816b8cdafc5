#include "host_tools/diagnose/deviations.hpp"

#include <algorithm>
#include <cmath>

#include "host_tools/diagnose/explore.hpp"
#include "host_tools/diagnose/models.hpp"
#include "host_tools/effects/effect_roles.hpp"
#include "host_tools/effects/effects.hpp"
#include "host_tools/effects/model_parts.hpp"
#include "host_tools/regression/solver.hpp"
#include "host_tools/signals/whole.hpp"

namespace fxdyn::diagnosis {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

double deviations_off_nothing(const Linearised& problem, const EffectId& id, const MatrixXd& covariance) {
  std::vector<Index> place, shapes;
  for (std::size_t c = 0; c < problem.unknowns().size(); ++c) {
    const Unknown& u = problem.unknowns()[c];
    const bool its = u.body == id.body && u.effect == id.effect && (id.body || u.joint == id.joint);
    if (its && u.kind == Unknown::Kind::linear && !u.change) place.push_back(static_cast<Index>(c));
    if (its && u.kind == Unknown::Kind::shape) shapes.push_back(static_cast<Index>(c));
  }
  if (place.empty()) return 0;
  VectorXd theta(static_cast<Index>(place.size()));
  for (std::size_t i = 0; i < place.size(); ++i)
    theta[static_cast<Index>(i)] = problem.unknowns()[static_cast<std::size_t>(place[i])].value;
  MatrixXd own = covariance(place, place);
  if (!shapes.empty()) {
    const MatrixXd with = covariance(shapes, place);
    own -= with.transpose() * SymmetricSolver(MatrixXd(covariance(shapes, shapes))).inverse() * with;
  }
  return std::sqrt(std::max(0.0, theta.dot(SymmetricSolver(own).solve(theta))));
}

/// The same of an effect whose only coefficient is 1: it is as far off nothing as its shapes are known, which are
/// logarithms (a delay of 0.7 +- 0.6 ms is none).
double deviations_of_shapes(const Linearised& problem, const EffectId& id, const MatrixXd& covariance) {
  double out = 1e300;
  for (std::size_t c = 0; c < problem.unknowns().size(); ++c) {
    const Unknown& u = problem.unknowns()[c];
    if (u.kind != Unknown::Kind::shape || u.body || u.joint != id.joint || u.effect != id.effect) continue;
    const double variance = covariance(static_cast<Index>(c), static_cast<Index>(c));
    out = variance > 0 ? std::min(out, 1 / std::sqrt(variance)) : 0;  // 0: the data know nothing of it
    if (!(variance > 0)) break;
  }
  return out;
}

/// Whether two models have the same effects in the same places.
bool same_unknowns(const IdentifiedModel& a, const IdentifiedModel& b) {
  const auto same = [](const std::vector<EffectFit>& of_a, const std::vector<EffectFit>& of_b) {
    return std::equal(of_a.begin(), of_a.end(), of_b.begin(), of_b.end(),
                      [](const EffectFit& x, const EffectFit& y) { return x.effect == y.effect; });
  };
  return same(body_of(a), body_of(b)) &&
         std::equal(joints_of(a).begin(), joints_of(a).end(), joints_of(b).begin(), joints_of(b).end(),
                    [&](const JointFit& x, const JointFit& y) { return same(x.effects, y.effects); });
}

}  // namespace

std::vector<double> deviations_off_nothing(const Linearised& problem, const std::vector<std::size_t>& groups) {
  std::vector<double> out(groups.size(), 1e300);
  if (groups.empty()) return out;
  const LinearFit fit = problem.solver().solve(problem.unknown_columns());
  const MatrixXd covariance = SymmetricSolver(fit.information).inverse();
  for (std::size_t i = 0; i < groups.size(); ++i) {
    const Group& group = problem.groups()[groups[i]];
    out[i] = find_effect(group.candidate.effect)->share ? deviations_of_shapes(problem, group.id, covariance)
                                                        : deviations_off_nothing(problem, group.id, covariance);
  }
  return out;
}

void add_deviations(Models& models, const Linearised& problem) {
  const LinearFit fit = problem.solver().solve(problem.unknown_columns());
  const MatrixXd covariance = SymmetricSolver(fit.information).inverse();
  IdentifiedModel& model = models.current;
  for (JointFit& joint : joints_of(model)) {
    for (EffectFit& effect : joint.effects) {
      if (find_effect(effect.effect)->acts_on == ActsOn::position && !effect.linear_std.empty())
        continue;  // from a link encoder
      effect.linear_std.assign(effect.linear.size(), 0.0);
      effect.shape_std.assign(effect.shape.size(), 0.0);
    }
  }
  for (EffectFit& effect : body_of(model)) effect.linear_std.assign(effect.linear.size(), 0.0);
  for (std::size_t c = 0; c < problem.unknowns().size(); ++c) {
    const Unknown& u = problem.unknowns()[c];
    const double variance = covariance(static_cast<Index>(c), static_cast<Index>(c));
    const double std = std::sqrt(std::max(variance, 0.0));
    if (u.kind == Unknown::Kind::base) {
      base_of(model)[u.index].std = std;
    } else if (u.kind == Unknown::Kind::width) {
      joints_of(model)[u.joint].sign_width_std = std * joints_of(model)[u.joint].sign_width;
    } else {
      EffectFit& effect = u.body ? body_of(model).at(u.effect) : joints_of(model)[u.joint].effects.at(u.effect);
      if (u.kind == Unknown::Kind::shape) {
        effect.shape_std[u.index] = std * effect.shape[u.index];
      } else {
        double& place = effect.linear_std[u.index];
        place = std;
        if (u.change) {
          // Right after the common part: their sum is today's.
          const auto i = static_cast<Index>(c);
          place = std::sqrt(std::max(0.0, variance + covariance(i - 1, i - 1) + 2 * covariance(i - 1, i)));
        }
        if (is_load(effect.effect) && u.index > 0) place = std / std::max(effect.linear[0], 1e-9);
      }
    }
  }
}

void back_to_start(Outcome& outcome, const Models& start, const std::vector<SessionLog>& logs) {
  Models& found = outcome.models;
  if (found.rotors.size() != start.rotors.size() || !same_unknowns(found.current, start.current)) {
    found = start;
    outcome.look_again(logs);
  }
  found.current = start.current;
  add_deviations(found, *outcome.problem);
}

void Dilution::add(const VectorXd& e, double row_s) {
  square_ += e.squaredNorm();
  const auto span = std::min<Index>(e.size(), whole(2 / row_s));
  for (Index lag = 1; lag < span; ++lag)
    lagged_ += 2 * (1 - static_cast<double>(lag) / static_cast<double>(span)) *
               e.head(e.size() - lag).dot(e.tail(e.size() - lag));
}

VectorXd diluted_weights(const Linearised& problem) {
  std::vector<Index> columns = problem.columns_of(in_model(problem));
  const LinearFit fit = problem.solver().solve(columns);
  VectorXd weights = problem.solver().weights();
  for (std::size_t j = 0; j < problem.joints(); ++j) {
    const VectorXd e = problem.solver().residual(j, fit);
    Dilution dilution;
    for (const std::size_t i : problem.blocks().fit) {
      const Block& b = problem.blocks().all[i];
      const ProcessedLog& log = problem.logs()[b.log].log;
      dilution.add(e.segment(b.first, b.count), log.step_s * static_cast<double>(log.decimation));
    }
    weights[static_cast<Index>(j)] /= dilution.value();
  }
  return weights;
}

}  // namespace fxdyn::diagnosis
