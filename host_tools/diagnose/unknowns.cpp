#include "host_tools/diagnose/unknowns.hpp"
#include "host_tools/diagnose/base_parameters.hpp"
#include "host_tools/diagnose/models.hpp"
#include "host_tools/effects/braking.hpp"
#include "host_tools/effects/effect_roles.hpp"
#include "host_tools/effects/model_parts.hpp"

#include <algorithm>
#include <cmath>
#include <tuple>

namespace fxdyn::diagnosis {
namespace {

using Eigen::Index;

bool is_shape_free(const EffectInfo& info, std::size_t i) {
  // A time constant from one session's start is a guess by its end: the gate chooses it.
  return info.shape[i].values.search != ShapeSearch::list && !info.drifts();
}

EffectFit& effect_of(IdentifiedModel& model, const Unknown& u) {
  return u.body ? body_of(model)[u.effect] : joints_of(model)[u.joint].effects[u.effect];
}

double& value_of(IdentifiedModel& model, const Unknown& u) {
  EffectFit& fit = effect_of(model, u);
  return u.kind == Unknown::Kind::shape ? fit.shape[u.index] : fit.linear[u.index];
}

bool is_moment(const EffectFit& fit, const Unknown& u) {
  return is_load(fit.effect) && u.kind == Unknown::Kind::linear && u.index > 0;
}

/// Value of an unknown in a model: payload's centre counts as first moment.
double read(const IdentifiedModel& model, const Unknown& u) {
  const EffectFit& fit = effect_of(model, u);
  return is_moment(fit, u) ? fit.linear[0] * fit.linear[u.index] : fit.linear[u.index];
}

/// The list of unknowns as it grows.
class Builder {
 public:
  explicit Builder(const Models& models)
      : models_(models), now_(models.current), common_(models.of(models.has_baseline)) {}

  Unknowns build() {
    add_base();
    for (std::size_t j = 0; j < joints_of(now_).size(); ++j) {
      add_width(j);
      add_nominal_effects(j);
    }
    for (Index i = 0; i < size(); ++i) out_.nuisance.push_back(i);
    for (std::size_t j = 0; j < joints_of(now_).size(); ++j) {
      const std::vector<EffectFit>& effects = joints_of(now_)[j].effects;
      for (std::size_t e = 0; e < effects.size(); ++e) {
        if (effects[e].named && !is_in(models_.fixed, j, effects[e])) add_named(effects[e], {false, j, e});
      }
    }
    for (std::size_t e = 0; e < body_of(now_).size(); ++e) {
      if (body_of(now_)[e].named) add_named(body_of(now_)[e], {true, 0, e});
    }
    return std::move(out_);
  }

 private:
  static bool is_in(const std::vector<EffectCandidate>& list, std::size_t joint, const EffectFit& fit) {
    return std::any_of(list.begin(), list.end(),
                       [&](const EffectCandidate& c) { return c.joint == joint && c.effect == fit.effect; });
  }
  Index size() const { return static_cast<Index>(out_.all.size()); }

  void add_base() {
    for (std::size_t k = 0; k < base_of(now_).size(); ++k) {
      Unknown u;
      u.index = k;
      u.value = base_of(now_)[k].value;
      out_.all.push_back(u);
    }
  }

  void add_width(std::size_t joint) {
    const std::vector<EffectFit>& effects = joints_of(now_)[joint].effects;
    const bool signs = std::any_of(effects.begin(), effects.end(), [](const EffectFit& fit) {
      return !fit.named && find_effect(fit.effect)->uses_sign;
    });
    if (!signs) return;
    Unknown u;
    u.kind = Unknown::Kind::width;
    u.joint = joint;
    u.width = joints_of(now_)[joint].sign_width;
    if (joint < models_.least_width.size()) u.lower = models_.least_width[joint];
    // Beside a law of the nominal model most of a sign cancels. What is left of it only gets sharper: a wide one is no
    // dry friction any more, and does the work of effects of the velocity.
    const bool law = std::any_of(effects.begin(), effects.end(), [](const EffectFit& fit) {
      return !fit.named && find_effect(fit.effect)->unites_others();
    });
    if (law) u.upper = std::max(u.lower, u.width);
    out_.all.push_back(u);
  }

  void add_nominal_effects(std::size_t joint) {
    const std::vector<EffectFit>& effects = joints_of(now_)[joint].effects;
    std::size_t unnamed = 0;  // both models have the unnamed ones in one order
    for (std::size_t e = 0; e < effects.size(); ++e) {
      if (effects[e].named) continue;
      Unknown u;
      u.joint = joint;
      u.effect = e;
      u.healthy_effect = models_.has_baseline ? unnamed++ : e;
      if (is_in(models_.fixed, joint, effects[e]) || is_in(models_.held, joint, effects[e])) continue;
      add_coefficients(u);
      add_shapes(u);
    }
  }

  void add_coefficients(Unknown u) {
    const JointFit& joint = joints_of(now_)[u.joint];
    const EffectFit& fit = joint.effects[u.effect];
    const EffectInfo& info = *find_effect(fit.effect);
    for (u.index = 0; u.index < info.linear.size(); ++u.index) {
      Unknown shared = u;
      shared.kind = Unknown::Kind::linear;
      shared.value = joints_of(common_)[u.joint].effects[u.healthy_effect].linear[u.index];
      if (in_base(fit.effect)) make_rotor(shared);
      out_.all.push_back(shared);
      if (!models_.has_baseline || in_base(fit.effect)) continue;
      Unknown change = u;
      change.kind = Unknown::Kind::linear;
      change.change = true;
      change.prior_std = usual_change(shared, info.linear[u.index]);
      change.value = fit.linear[u.index] - shared.value;
      out_.all.push_back(change);
    }
  }

  /// An inertia that the base parameters have as well. Where the load is inertia alone nothing separates them.
  void make_rotor(Unknown& u) const {
    const auto rotor =
        std::find_if(models_.rotors.begin(), models_.rotors.end(), [&](const Rotor& r) { return r.joint == u.joint; });
    if (rotor == models_.rotors.end()) return;
    const JointFit& joint = joints_of(now_)[u.joint];
    u.kind = Unknown::Kind::rotor;
    u.in_base = rotor->in_base;
    u.upper = rotor->most;
    u.prior = rotor->inertia;
    u.prior_std = rotor->std > 0 ? rotor->std
                                 : models_.options.prior.rotor * joint.rated_torque / std::max(joint.ddq_limit, 1e-9);
  }

  /// Standard deviation of a coefficient from one healthy session to the next.
  double usual_change(const Unknown& shared, const ParameterInfo& parameter) const {
    const JointFit& joint = joints_of(now_)[shared.joint];
    const EffectFit* friction = dry_friction_of(joints_of(common_)[shared.joint]);
    const PriorOptions& prior = models_.options.prior;
    const bool in_proportion = parameter.quantity == Quantity::velocity;
    double scale = (in_proportion ? prior.friction_change : prior.dry_friction_change) * std::fabs(shared.value);
    if (joint.effects[shared.effect].effect == constant_effect().name && friction != nullptr)
      scale += prior.offset_change * std::fabs(friction->linear[0]);
    // Of motions of unit size: a coefficient's own scale. One without a unit is a factor of a torque.
    const double motion = in_proportion ? joint.dq_limit : parameter.unit == "-" ? joint.rated_torque : 1.0;
    return std::hypot(scale, prior.smallest_change * joint.rated_torque / std::max(motion, 1e-9));
  }

  /// @returns how many
  int add_shapes(Unknown u) {
    const EffectInfo& info = *find_effect(diagnosis::effect_of(now_, u).effect);
    int count = 0;
    u.kind = Unknown::Kind::shape;
    for (u.index = 0; u.index < info.shape.size(); ++u.index) {
      if (!is_shape_free(info, u.index)) continue;
      std::tie(u.lower, u.upper) = shape_limits(models_, u.joint, info, info.shape[u.index]);
      out_.all.push_back(u);
      ++count;
    }
    return count;
  }

  void add_named(const EffectFit& fit, const EffectId& id) {
    const EffectInfo& info = *find_effect(fit.effect);
    Group group;
    group.candidate = {fit.effect, id.joint, fit.shape};
    group.on_body = id.body;
    group.in_model = true;
    group.id = id;
    group.first = size();
    Unknown effect;
    effect.joint = id.joint;
    effect.effect = id.effect;
    effect.body = id.body;
    for (std::size_t i = 0; i < info.linear.size(); ++i) {
      Unknown u = effect;
      u.kind = Unknown::Kind::linear;
      u.index = i;
      u.value = read(now_, u);
      if (info.share) {
        u.prior = 1;
        u.prior_std = models_.options.prior.share;
      }
      if (is_moment(fit, u)) {
        const PriorOptions& prior = models_.options.prior;
        u.prior_std = prior.load_centre * std::max(fit.linear[0], prior.smallest_load);
      }
      // Equal heights are an offset, or friction without a curve: those have no prior, and take it.
      if (info.curve) u.prior_std = models_.curve_size.at(id.joint);
      out_.all.push_back(u);
      group.lower.push_back(info.linear[i].lower);
    }
    group.nonlinear = add_shapes(effect);
    group.lower.resize(group.lower.size() + static_cast<std::size_t>(group.nonlinear), -1e300);
    group.count = size() - group.first;
    out_.named.push_back(std::move(group));
  }

  const Models& models_;
  const IdentifiedModel &now_, &common_;
  Unknowns out_;
};

}  // namespace

std::vector<Prior> Unknowns::priors() const {
  std::vector<Prior> out;
  for (const Unknown& u : all) out.push_back({u.prior, u.prior_std});
  return out;
}

Unknowns make_unknowns(const Models& models) { return Builder(models).build(); }

std::pair<double, double> shape_limits(const Models& models, std::size_t joint, const EffectInfo& info,
                                       const ParameterInfo& shape) {
  const FilterFit& filter = filter_of(models.current);
  if (shape.values.seen_by_encoder && joint < filter.position_noise.size()) {
    // White noise is filtered; of a staircase nothing is, where the joint turns back.
    const double least = std::max(models.options.search.least_path * filter.encoder_step[joint],
                                  std::sqrt(12.0) * filter.position_noise[joint]);
    return {std::clamp(least, shape.lower, 0.1 * shape.upper), shape.upper};
  }
  if (shape.values.least_of_sign > 0) {
    const double width = shape.values.least_of_sign * joints_of(models.current)[joint].sign_width;
    return {std::clamp(width, shape.lower, 0.1 * shape.upper), shape.upper};
  }
  if (shape.values.most_of_load > 0 && joint < models.largest_load.size())
    return {shape.lower, std::clamp(shape.values.most_of_load * models.largest_load[joint], shape.lower, shape.upper)};
  return {shape.lower, upper_bound(info, shape, models.smallest_step_s)};
}

const EffectFit& effect_of(const IdentifiedModel& model, const Unknown& u) {
  return u.body ? body_of(model)[u.effect] : joints_of(model)[u.joint].effects[u.effect];
}

Unknown in_healthy(Unknown u) {
  u.effect = u.healthy_effect;
  return u;
}

void add_to(IdentifiedModel& model, const Unknown& u, double step) {
  switch (u.kind) {
    case Unknown::Kind::base:
      add_to_base(model, u.index, step);
      return;
    case Unknown::Kind::rotor: {
      double& inertia = value_of(model, u);
      const double risen = std::min(inertia + step, u.upper) - inertia;
      inertia += risen;
      take_from_base(model, u.in_base, risen);
      return;
    }
    case Unknown::Kind::width: {
      double& width = joints_of(model)[u.joint].sign_width;
      width = std::clamp(width * std::exp(step), u.lower, u.upper);
      return;
    }
    case Unknown::Kind::shape: {
      const ParameterInfo& info = find_effect(effect_of(model, u).effect)->shape[u.index];
      double& value = value_of(model, u);
      value = std::clamp(value * std::exp(step), std::max(info.lower, u.lower), std::min(info.upper, u.upper));
      return;
    }
    case Unknown::Kind::linear: {
      const EffectFit& fit = effect_of(model, u);
      if (is_moment(fit, u)) {
        value_of(model, u) += step / fit.linear[0];
      } else {
        value_of(model, u) += step;
      }
      return;
    }
  }
}

namespace {

/// Bristles whose damping drives the joint are no friction, however well they fit.
void keep_friction(IdentifiedModel& model) {
  for (JointFit& joint : joints_of(model)) let_it_brake(joint);
}

}  // namespace

void update(Models& models, const std::vector<Unknown>& unknowns, const LinearFit& fit, double share) {
  constexpr double longest_step = 0.4;  // of a logarithm
  for (std::size_t i = 0; i < fit.columns.size(); ++i) {
    const auto c = static_cast<std::size_t>(fit.columns[i]);
    if (c >= unknowns.size()) continue;
    const Unknown& u = unknowns[c];
    double step = share * (fit.x[static_cast<Index>(i)] - u.value);
    if (u.is_logarithm()) step = std::clamp(step, -longest_step, longest_step);
    // Payload's mass first: its centre is first moment over mass.
    if (!u.change && u.kind == Unknown::Kind::linear && u.body && u.index == 0 &&
        is_load(effect_of(models.current, u).effect)) {
      EffectFit& load = body_of(models.current)[u.effect];
      const double mass = std::max(least_mass, load.linear[0] + step);
      for (std::size_t k = 1; k < load.linear.size(); ++k) load.linear[k] *= load.linear[0] / mass;
      load.linear[0] = mass;
      continue;
    }
    add_to(models.current, u, step);
    const bool named =
        u.kind != Unknown::Kind::base && u.kind != Unknown::Kind::width && effect_of(models.current, u).named;
    if (models.has_baseline && !u.change && !named) add_to(models.healthy, in_healthy(u), step);
  }
  keep_friction(models.current);
  if (models.has_baseline) keep_friction(models.healthy);
}

}  // namespace fxdyn::diagnosis
