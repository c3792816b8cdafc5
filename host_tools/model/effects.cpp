#include "host_tools/model/effects.hpp"

#include "host_tools/error.hpp"

#include <fmt/format.h>

namespace fxdyn {
namespace {

const std::vector<EffectInfo>& infos() {
  static const std::vector<EffectInfo> list = [] {
    std::vector<EffectInfo> all;
    Catalogue::for_each([&]<class E>() { all.push_back({E::name, E::equation, E::shape, E::linear}); });
    return all;
  }();
  return list;
}

template <class E>
Eigen::MatrixXd columns_of(std::span<const double> shape, double sign_width, const JointSeries& series) {
  std::vector<double> words;
  for (std::size_t i = 0; i < E::shape.size(); ++i) words.push_back(E::stored_shape(i, shape[i], series.step_s));
  typename E::template State<Real> state{};
  Saturations saturations;
  Eigen::MatrixXd columns(series.q.size(), static_cast<Eigen::Index>(E::linear.size()));
  for (Eigen::Index k = 0; k < series.q.size(); ++k) {
    const JointInput<Real> u{series.q[k], series.dq[k], series.ddq[k], tanh_of(series.dq[k] / sign_width),
                             series.structural.size() > 0 ? series.structural[k] : 0.0};
    E::template basis<Real>(u, Words<Real>{words.data()}, state, saturations,
                            [&](auto, std::size_t i, double phi) { columns(k, static_cast<Eigen::Index>(i)) = phi; });
  }
  return columns;
}

}  // namespace

const EffectInfo* find_effect(std::string_view name) {
  for (const EffectInfo& info : infos()) {
    if (info.name == name) return &info;
  }
  return nullptr;
}

std::vector<std::string_view> effect_names() {
  std::vector<std::string_view> names;
  for (const EffectInfo& info : infos()) names.push_back(info.name);
  return names;
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
