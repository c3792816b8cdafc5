#include "host_tools/effects/effects.hpp"

#include <algorithm>
#include <array>
#include <type_traits>

#include "host_tools/effects/effect_library.hpp"
#include "host_tools/effects/joint_fit.hpp"
#include "host_tools/support/error.hpp"
#include "model/catalogue.hpp"

#include <fmt/format.h>

namespace fxdyn {
namespace {

void check(const EffectInfo& effect, std::span<const double> shape, const JointSeries& series) {
  if (shape.size() != effect.shape.size()) {
    throw InputError(
        fmt::format("effect '{}' has {} shape parameters, not {}", effect.name, effect.shape.size(), shape.size()));
  }
  const auto need = [&](bool needed, const auto& columns, std::string_view what) {
    if (needed && columns.size() == 0)
      throw InputError(fmt::format("effect '{}' needs {}, which is not known here", effect.name, what));
  };
  need(effect.needs_structural, series.structural, "the rigid-body torque");
  need(effect.needs_total, series.total, "the torque of the effects before it");
  for (const Eigen::MatrixXd* peers : {&series.peers_q, &series.peers_dq, &series.peers_sign, &series.peers_ddq})
    need(effect.needs_peers, *peers, "the motion of the other joints");
}

template <class E>
Eigen::MatrixXd columns_of(std::span<const double> shape, double sign_width, const JointSeries& series) {
  check(*find_effect(E::name), shape, series);
  std::vector<double> words;
  for (std::size_t i = 0; i < E::shape.size(); ++i) words.push_back(E::stored_shape(i, shape[i], series.step_s));
  if constexpr (E::traits.most_ticks > 0) {
    if (words[0] > E::traits.most_ticks * (1 + 1e-9)) {  // a step from time stamps is off by rounding
      throw InputError(
          fmt::format("{} of {} s: at most {} steps of {} s", E::name, shape[0], E::traits.most_ticks, series.step_s));
    }
  }
  typename E::template State<Real> state{};
  Saturations saturations;
  Eigen::MatrixXd columns(series.q.size(), static_cast<Eigen::Index>(E::linear.size()));
  std::vector<JointInput<Real>> peers(needs_peers<E> ? static_cast<std::size_t>(series.peers_dq.cols()) : 0);
  for (Eigen::Index k = 0; k < series.q.size(); ++k) {
    for (std::size_t i = 0; i < peers.size(); ++i) {
      const auto joint = static_cast<Eigen::Index>(i);
      peers[i].q = series.peers_q(k, joint);
      peers[i].dq = series.peers_dq(k, joint);
      peers[i].sign = series.peers_sign(k, joint);
      peers[i].ddq = series.peers_ddq(k, joint);
    }
    const JointInput<Real> u{series.q[k],
                             series.dq[k],
                             series.ddq[k],
                             series.sign.size() > 0 ? series.sign[k] : tanh_of(series.dq[k] / sign_width),
                             series.structural.size() > 0 ? series.structural[k] : 0.0,
                             series.total.size() > 0 ? series.total[k] : 0.0,
                             peers};
    E::template basis<Real>(u, Words<Real>{words.data()}, state, saturations,
                            [&](auto, std::size_t i, double phi) { columns(k, static_cast<Eigen::Index>(i)) = phi; });
  }
  return columns;
}

}  // namespace

namespace {

/// Every phi of three ticks from an input.
template <class E>
std::vector<double> three_ticks(JointInput<Real> u) {
  std::vector<double> words, phis;
  for (std::size_t i = 0; i < E::shape.size(); ++i)
    words.push_back(E::stored_shape(i, std::clamp(1e-3, E::shape[i].lower, E::shape[i].upper), 0.002));
  typename E::template State<Real> state{};
  Saturations none;
  const std::array<JointInput<Real>, 1> peers{u};
  u.peers = peers;
  for (int tick = 0; tick < 3; ++tick) {
    u.q += 0.01;
    E::template basis<Real>(u, Words<Real>{words.data()}, state, none,
                            [&](auto, std::size_t, double phi) { phis.push_back(phi); });
  }
  return phis;
}

/// Whether another sign of the velocity changes any phi of the effect.
template <class E>
bool uses_sign() {
  return three_ticks<E>({0.3, 0.02, 0.5, 0.2, 1.0, 2.0, {}}) != three_ticks<E>({0.3, 0.02, 0.5, 0.9, 1.0, 2.0, {}});
}

/// Whether a phi of the effect is 1 whatever the input.
template <class E>
bool has_constant() {
  const std::vector<double> phis = three_ticks<E>({0.3, 0.02, 0.5, 0.2, 1.5, 2.5, {}}),
                            others = three_ticks<E>({-0.7, -0.3, 0.8, -0.6, -3.0, 4.0, {}});
  const std::size_t count = E::linear.size();
  for (std::size_t i = 0; i < count; ++i) {
    bool constant = true;
    for (std::size_t k = i; k < phis.size(); k += count) constant &= phis[k] == 1 && others[k] == 1;
    if (constant) return true;
  }
  return false;
}

/// Base parameters, which are no effect, are confused with effects too.
const EffectTraits& traits_of(std::string_view name) {
  static constexpr EffectTraits of_base{.words = "inertia of the links",
                                        .experiments = {experiments::hopeless, experiments::wide_range_or_baseline}};
  const EffectInfo* info = find_effect(name);
  return info == nullptr ? of_base : *info;
}

}  // namespace

const std::vector<EffectInfo>& effect_infos() {
  static const std::vector<EffectInfo> list = [] {
    std::vector<EffectInfo> all;
    const auto add = [&]<class E>() {
      bool sign = false, constant = false, memory = false;
      if constexpr (acts_on<E> != ActsOn::body) {
        sign = uses_sign<E>();
        constant = has_constant<E>();
        memory = !std::is_empty_v<typename E::template State<Real>>;
      }
      all.push_back({E::traits, E::name, E::equation, E::shape, E::linear, acts_on<E>, needs_structural<E>,
                     needs_total<E>, needs_peers<E>, sign, constant, memory});
    };
    Catalogue::for_each(add);
    BodyEffects::for_each(add);
    return all;
  }();
  return list;
}

const EffectInfo* find_effect(std::string_view name) {
  for (const EffectInfo& info : effect_infos()) {
    if (info.name == name) return &info;
  }
  return nullptr;
}

std::vector<std::string_view> effect_names() {
  std::vector<std::string_view> names;
  for (const EffectInfo& info : effect_infos()) names.push_back(info.name);
  return names;
}

std::vector<std::string_view> joint_effect_names() {
  std::vector<std::string_view> names = effect_names();
  names.resize(Catalogue::size);
  return names;
}

std::vector<std::size_t> EffectInfo::refined_shapes() const {
  std::vector<std::size_t> found;
  for (std::size_t i = 0; i < shape.size(); ++i) {
    if (shape[i].values.search != ShapeSearch::list) found.push_back(i);
  }
  return found;
}

int EffectInfo::refined_shape() const {
  const std::vector<std::size_t> all = refined_shapes();
  return all.empty() ? -1 : static_cast<int>(all.front());
}

const std::vector<std::string>& nominal_effects() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> all;
    for (const EffectInfo& info : effect_infos()) {
      if (info.nominal) all.emplace_back(info.name);
    }
    return all;
  }();
  return names;
}

std::vector<std::string> nominal_effects_and(std::initializer_list<std::string_view> others) {
  std::vector<std::string> names = nominal_effects();
  names.insert(names.end(), others.begin(), others.end());
  return names;
}

std::vector<std::string_view> identified_effects() {
  std::vector<const EffectInfo*> found;
  for (const EffectInfo& info : effect_infos()) {
    if (info.identified > 0) found.push_back(&info);
  }
  std::stable_sort(found.begin(), found.end(),
                   [](const EffectInfo* a, const EffectInfo* b) { return a->identified < b->identified; });
  std::vector<std::string_view> names;
  names.reserve(found.size());
  for (const EffectInfo* info : found) names.push_back(info->name);
  return names;
}

std::string_view telling_experiment(const EffectTraits& a, const EffectTraits& b) {
  NamedExperiment best;
  for (const NamedExperiment& own : a.experiments) {
    if (b.named_experiment(own) && (best.text.empty() || own.order < best.order)) best = own;
  }
  return best.text;
}

std::string cure(std::string_view e, std::string_view f) {
  const EffectTraits &one = traits_of(e), &other = traits_of(f);
  if (const std::string_view telling = telling_experiment(one, other); !telling.empty()) return std::string(telling);
  if (e == base_parameters_name || f == base_parameters_name)
    return "the same motions recorded without it (role = \"baseline\"), or inertias known beforehand";
  const bool couples =
      one.named_experiment(experiments::one_at_a_time) || other.named_experiment(experiments::one_at_a_time);
  return std::string((couples ? experiments::one_at_a_time : experiments::all_poses).text);
}

bool in_base(std::string_view effect) { return find_effect(effect)->in_base; }
bool drifts(std::string_view effect) { return find_effect(effect)->drifts(); }

const EffectFit* rotor_of(const JointFit& joint) {
  for (const EffectFit& fit : joint.effects) {
    if (in_base(fit.effect)) return &fit;
  }
  return nullptr;
}

double upper_bound(const EffectInfo& info, const ParameterInfo& shape, double step_s) {
  return info.most_ticks > 0 ? std::min(shape.upper, info.most_ticks * step_s) : shape.upper;
}

std::vector<std::vector<double>> combinations(const std::vector<std::vector<double>>& values) {
  std::vector<std::vector<double>> out{{}};
  for (const std::vector<double>& of_one : values) {
    std::vector<std::vector<double>> more;
    for (const double value : of_one) {
      for (std::vector<double> before : out) {
        before.push_back(value);
        more.push_back(std::move(before));
      }
    }
    out = std::move(more);
  }
  return out;
}

std::string why_not_identified(const EffectInfo& info) {
  const auto reason = [&](std::string_view what) {
    return fmt::format("effect '{}' {}: identify can't fit such effects yet", info.name, what);
  };
  if (info.acts_on == ActsOn::body) return reason("acts on the rigid body");
  if (info.acts_on == ActsOn::position) return reason("acts on the joint's position");
  if (info.needs_total) return reason("needs the torque of the effects before it");
  if (info.needs_structural) return reason("needs the rigid-body torque");
  if (info.curve) return reason("is a free curve, whose knots diagnosis chooses");
  if (info.needs_peers) return {};  // the neighbours are tried
  for (const ParameterInfo& shape : info.shape) {
    if (!shape.values.fitted.given())
      return fmt::format("effect '{}': the search of its {} is not built yet", info.name, shape.name);
  }
  return {};
}

std::string_view effect_library() {
#ifdef FXDYN_EFFECT_LIBRARY
  return FXDYN_EFFECT_LIBRARY;
#else
  return {};
#endif
}

Eigen::MatrixXd effect_columns(std::string_view effect, std::span<const double> shape, double sign_width,
                               const JointSeries& series) {
  Eigen::MatrixXd columns;
  bool found = false;
  Catalogue::for_each([&]<class E>() {
    if (E::name != effect) return;
    found = true;
    columns = columns_of<E>(shape, sign_width, series);
  });
  if (!found) throw InputError(fmt::format("unknown effect '{}': see `fxdyn effects`", effect));
  return columns;
}

}  // namespace fxdyn
