#include "host_tools/train/kept_effects.hpp"

#include <algorithm>
#include <cmath>

#include "host_tools/effects/effects.hpp"
#include "host_tools/effects/evaluator.hpp"
#include "host_tools/effects/identified_model.hpp"
#include "host_tools/regression/regressor.hpp"
#include "host_tools/signals/filter.hpp"
#include "host_tools/support/parallel.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

bool acts_on_position(const EffectFit& fit) { return find_effect(fit.effect)->acts_on == ActsOn::position; }
bool acts_on_total(const EffectFit& fit) { return find_effect(fit.effect)->needs_total; }

/// The torque before the joint's effects on the total, from what it is after them: the last one is undone first.
VectorXd before_total_effects(const JointFit& joint, VectorXd tau, double step_s) {
  const std::vector<const EffectFit*> effects = in_order(joint, true);
  for (auto it = effects.rbegin(); it != effects.rend(); ++it) {
    const EffectFit& fit = **it;
    switch (find_effect(fit.effect)->of_total) {
      case OfTotal::nothing:
      case OfTotal::clips:  // up to its limit the torque is the total; beyond it nothing is known, see mark_hidden()
        break;
      case OfTotal::scales:
        tau /= 1 + fit.linear[0];
        break;
      case OfTotal::delays:
        // share total(t - time) + (1 - share) total(t): share is 1 but for a few permille, and then a delay by
        // share * time to first order.
        tau = at_other_times(tau, fit.linear[0] * fit.shape[0] / step_s);
        break;
    }
  }
  return tau;
}

}  // namespace

KeptEffects::KeptEffects(IdentifiedModel diagnosed, const std::vector<ProcessedLog>& logs, bool keep_drift)
    : diagnosed_(std::move(diagnosed)), warm_(keep_drift) {
  for (const ProcessedLog& log : logs) warm_ |= age_of(diagnosed_, log) > 0;
  const DhChain chain = to_dh(diagnosed_.robot);
  BaseSet base;
  for (const BaseParameter& parameter : diagnosed_.base) base.columns.push_back(static_cast<Index>(parameter.column));
  for (std::size_t j = 0; j < diagnosed_.joints.size(); ++j)
    rotor_is_absorbed_.push_back(rotor_inertia_is_absorbed(chain, base, static_cast<Index>(j)));
  for (std::size_t j = 0; j < diagnosed_.joints.size(); ++j) {
    JointFit joint = diagnosed_.joints[j];
    joint.bls.reset();
    std::erase_if(joint.effects, [&](const EffectFit& fit) { return is_kept(j, fit); });
    design_.push_back(std::move(joint));
  }
}

bool KeptEffects::is_kept(std::size_t joint, const EffectFit& fit) const {
  const EffectInfo& info = *find_effect(fit.effect);
  if (info.in_base && rotor_is_absorbed_[joint]) return true;
  // Equal heights are an offset or dry friction: a fit without a prior can't tell them apart.
  if (info.curve) return true;
  // What the healthy session had of an effect that grew: today's logs show the sum only.
  const auto& effects = diagnosed_.joints[joint].effects;
  const bool grew = !fit.named && std::any_of(effects.begin(), effects.end(), [&](const EffectFit& other) {
    return other.named && other.effect == fit.effect;
  });
  if (grew) return true;
  // The Fitter's columns start cold with every log.
  return info.acts_on != ActsOn::torque || info.needs_structural || info.needs_total || (warm_ && info.drifts());
}

IdentifiedModel KeptEffects::restore(IdentifiedModel fitted) const {
  for (std::size_t j = 0; j < fitted.joints.size(); ++j) {
    std::vector<EffectFit>& now = fitted.joints[j].effects;
    const JointFit& found = diagnosed_.joints[j];
    std::vector<EffectFit> all;
    std::size_t next = 0;
    for (const EffectFit& fit : found.effects) {
      if (is_kept(j, fit)) {
        all.push_back(fit);
        continue;
      }
      EffectFit again = now[next++];
      again.shape_std.resize(fit.shape.size(), 0.0);
      for (std::size_t i = 0; i < fit.shape_std.size(); ++i) {
        if (again.shape_std[i] == 0) again.shape_std[i] = fit.shape_std[i];
      }
      all.push_back(std::move(again));
    }
    // What a link encoder gave stands at the end; diagnosis may have found the same.
    for (; next < now.size(); ++next) {
      if (found.find(now[next].effect) == nullptr) all.push_back(now[next]);
    }
    now = std::move(all);
    if (fitted.joints[j].sign_width_std == 0) fitted.joints[j].sign_width_std = found.sign_width_std;
  }
  fitted.body = diagnosed_.body;
  fitted.session = diagnosed_.session;
  fitted.logs = diagnosed_.logs;
  return fitted;
}

std::vector<MatrixXd> KeptEffects::torque(const IdentifiedModel& model, const std::vector<ProcessedLog>& logs) const {
  // Without the effects on the total, which are undone in the measurement; and without all that are kept.
  IdentifiedModel with = model, without = model;
  bool any = !model.body.empty();
  for (std::size_t j = 0; j < model.joints.size(); ++j) {
    any |= design_[j].effects.size() < diagnosed_.joints[j].effects.size();
    std::erase_if(with.joints[j].effects, acts_on_total);
    std::erase_if(without.joints[j].effects, [&](const EffectFit& fit) { return is_kept(j, fit); });
    with.joints[j].bls.reset();  // the same in both
    without.joints[j].bls.reset();
  }
  without.body.clear();
  std::vector<MatrixXd> out(logs.size());
  parallel_for(logs.size(), [&](std::size_t l) {
    const ProcessedLog& log = logs[l];
    MatrixXd& torque = out[l];  // first of what is kept, then of the rest: a long log's columns are held once
    torque.setZero(log.tau.rows(), log.tau.cols());
    if (any) {
      // Where there is a link encoder the Fitter's rigid body moves as the link does, bent gear included.
      IdentifiedModel seen = with;
      for (std::size_t j = 0; j < seen.joints.size(); ++j) {
        if (log.has_link[j]) std::erase_if(seen.joints[j].effects, acts_on_position);
      }
      add_prediction(1, seen, log, torque);
      add_prediction(-1, without, log, torque);
    }
    for (Index j = 0; j < torque.cols(); ++j) {
      MatrixXd tau = log.tau.col(j);
      if (any) tau = before_total_effects(diagnosed_.joints[static_cast<std::size_t>(j)], tau.col(0), log.step_s);
      torque.col(j) = log.filter_columns(tau - torque.col(j));
    }
  });
  return out;
}

void KeptEffects::mark_hidden(std::vector<ProcessedLog>& logs, const KeptOptions& options) const {
  for (std::size_t j = 0; j < diagnosed_.joints.size(); ++j) {
    const auto& effects = diagnosed_.joints[j].effects;
    const auto fit = std::find_if(effects.begin(), effects.end(), [](const EffectFit& one) {
      return find_effect(one.effect)->of_total == OfTotal::clips;
    });
    if (fit == effects.end()) continue;
    for (ProcessedLog& log : logs) {
      const auto beyond = [&](Index k) {
        return std::fabs(log.tau(k, static_cast<Index>(j))) > options.at_limit * fit->shape[0];
      };
      for (Index k = 0; k < log.samples();) {
        Index end = k;
        while (end < log.samples() && beyond(end)) ++end;
        if (end > k) log.saturated[j].push_back({k, end});
        k = end + 1;
      }
    }
  }
}

}  // namespace fxdyn
