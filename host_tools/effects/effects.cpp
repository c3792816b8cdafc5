#include "host_tools/effects/effects.hpp"

#include <algorithm>
#include <array>

#include "host_tools/support/error.hpp"

#include <fmt/format.h>

namespace fxdyn {
namespace {

void check(const EffectInfo& effect, const JointSeries& series) {
  const auto need = [&](bool needed, const auto& columns, std::string_view what) {
    if (needed && columns.size() == 0)
      throw InputError(fmt::format("effect '{}' needs {}, which is not known here", effect.name, what));
  };
  need(effect.needs_structural, series.structural, "the rigid-body torque");
  need(effect.needs_total, series.total, "the torque of the effects before it");
  for (const Eigen::MatrixXd* peers : {&series.peers_dq, &series.peers_sign, &series.peers_ddq})
    need(effect.needs_peers, *peers, "the motion of the other joints");
}

template <class E>
Eigen::MatrixXd columns_of(std::span<const double> shape, double sign_width, const JointSeries& series) {
  check(*find_effect(E::name), series);
  std::vector<double> words;
  for (std::size_t i = 0; i < E::shape.size(); ++i) words.push_back(E::stored_shape(i, shape[i], series.step_s));
  if constexpr (std::is_same_v<E, Delay>) {
    if (words[0] > Delay::largest * (1 + 1e-9)) {  // a step from time stamps is off by rounding
      throw InputError(fmt::format("delay of {} s: at most {} steps of {} s", shape[0], Delay::largest, series.step_s));
    }
  }
  typename E::template State<Real> state{};
  Saturations saturations;
  Eigen::MatrixXd columns(series.q.size(), static_cast<Eigen::Index>(E::linear.size()));
  std::vector<JointInput<Real>> peers(needs_peers<E> ? static_cast<std::size_t>(series.peers_dq.cols()) : 0);
  for (Eigen::Index k = 0; k < series.q.size(); ++k) {
    for (std::size_t i = 0; i < peers.size(); ++i) {
      const auto joint = static_cast<Eigen::Index>(i);
      peers[i].dq = series.peers_dq(k, joint);
      peers[i].sign = series.peers_sign(k, joint);
      peers[i].ddq = series.peers_ddq(k, joint);
    }
    const JointInput<Real> u{series.q[k],
                             series.dq[k],
                             series.ddq[k],
                             tanh_of(series.dq[k] / sign_width),
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

/// Whether another sign of the velocity changes any phi of the effect.
template <class E>
bool uses_sign() {
  std::vector<double> words;
  for (std::size_t i = 0; i < E::shape.size(); ++i)
    words.push_back(E::stored_shape(i, std::clamp(1e-3, E::shape[i].lower, E::shape[i].upper), 0.002));
  std::array<std::vector<double>, 2> phis;
  for (std::size_t k = 0; k < 2; ++k) {
    typename E::template State<Real> state{};
    Saturations none;
    JointInput<Real> u{0.3, 0.02, 0.5, k == 0 ? 0.2 : 0.9, 1.0, 2.0, {}};
    const std::array<JointInput<Real>, 1> peers{u};
    u.peers = peers;
    for (int tick = 0; tick < 3; ++tick) {
      u.q += 0.01;
      E::template basis<Real>(u, Words<Real>{words.data()}, state, none,
                              [&](auto, std::size_t, double phi) { phis[k].push_back(phi); });
    }
  }
  return phis[0] != phis[1];
}

}  // namespace

const std::vector<EffectInfo>& effect_infos() {
  static const std::vector<EffectInfo> list = [] {
    std::vector<EffectInfo> all;
    const auto add = [&]<class E>() {
      bool sign = false;
      if constexpr (acts_on<E> != ActsOn::body) sign = uses_sign<E>();
      all.push_back({E::name, E::equation, E::shape, E::linear, acts_on<E>, needs_structural<E>, needs_total<E>,
                     needs_peers<E>, sign});
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

std::string why_not_identified(const EffectInfo& info) {
  const auto reason = [&](std::string_view what) {
    return fmt::format("effect '{}' {}: identify can't fit such effects yet", info.name, what);
  };
  if (info.acts_on == ActsOn::body) return reason("acts on the rigid body");
  if (info.acts_on == ActsOn::position) return reason("acts on the joint's position");
  if (info.needs_total) return reason("needs the torque of the effects before it");
  if (info.needs_structural) return reason("needs the rigid-body torque");
  if (info.needs_peers) return {};  // the neighbours are tried
  // The search of shapes knows the scales of velocities and distances.
  for (const ParameterInfo& shape : info.shape) {
    if (shape.quantity == Quantity::inverse_velocity || shape.quantity == Quantity::inverse_path) continue;
    return fmt::format("effect '{}': the search of its {} is not built yet", info.name, shape.name);
  }
  return {};
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
