#include "host_tools/identify/shape_search.hpp"

#include <fmt/format.h>

#include <cmath>

#include "host_tools/effects/effects.hpp"
#include "host_tools/support/error.hpp"

namespace fxdyn {
namespace {

std::vector<double> geometric(double from, double to, int count) {
  std::vector<double> values;
  for (int i = 0; i < count; ++i) values.push_back(from * std::pow(to / from, static_cast<double>(i) / (count - 1)));
  return values;
}

/// The best of one shape parameter: a geometric grid, then two refinements around its best point.
template <class Set>
Candidate search(const Fitter& fitter, std::size_t joint, const JointFit& start, double from, double to, Set&& set) {
  Candidate best{start, {}};
  double best_value = from;
  const auto attempt = [&](double value) {
    JointFit design = start;
    set(design, value);
    const Judgement judgement = fitter.held_out_with(joint, design, {0.0})[0];
    if (judgement.rmse < best.judgement.rmse) {
      best = {design, judgement};
      best_value = value;
    }
  };
  constexpr int points = 12;
  for (const double value : geometric(from, to, points)) attempt(value);
  double step = std::pow(to / from, 0.5 / (points - 1));
  for (int round = 0; round < 2; ++round, step = std::sqrt(step)) {
    const double centre = best_value;
    attempt(std::max(from, centre / step));
    attempt(std::min(to, centre * step));
  }
  return best;
}

MotionScales motion_scales(const Scales& scales) {
  MotionScales out;
  out.speed = scales.velocity;
  out.range = scales.range;
  return out;
}

/// Of a coupling: the shape parameters after the other joint's index, a width as wide as the joint's sign.
std::vector<std::vector<double>> further_shapes(const EffectInfo& info, double sign_width) {
  std::vector<std::vector<double>> values;
  for (const ParameterInfo& shape : info.shape.subspan(1)) {
    const ValueList listed = shape.values.search == ShapeSearch::list ? shape.values.judged({}) : ValueList{sign_width};
    values.emplace_back(listed.begin(), listed.end());
  }
  return combinations(values);
}

/// The joint's design with the motor that it shares with a neighbour, at the best of neighbours, directions and widths.
Candidate search_coupling(const Fitter& fitter, std::size_t joint, std::string_view effect, const Scales& scales) {
  if (fitter.joints() < 2) throw InputError(fmt::format("effect '{}' needs a second joint", effect));
  const EffectInfo& info = *find_effect(effect);
  const int refined = info.refined_shape();
  const double now = fitter.held_out()[joint].rmse;
  Candidate best{fitter.design(joint), {}};
  for (const std::size_t k : {joint - 1, joint + 1}) {
    if (k >= fitter.joints()) continue;
    for (const std::vector<double>& more : further_shapes(info, fitter.design(joint).sign_width)) {
      JointFit design = fitter.design(joint);
      EffectFit fit;
      fit.effect = effect;
      fit.shape = {static_cast<double>(k + 1)};
      fit.shape.insert(fit.shape.end(), more.begin(), more.end());
      design.effects.push_back(fit);
      const Judgement judgement = fitter.held_out_with(joint, design, {0.0})[0];
      if (judgement.rmse < best.judgement.rmse) best = {design, judgement};
    }
  }
  if (refined < 0 || best.design.effects.empty() || best.design.effects.back().effect != effect) return best;
  // only what comes near being kept is worth a search
  if (best.judgement.rmse > (1 - 0.5 * worth_keeping) * now) return best;
  const auto index = static_cast<std::size_t>(refined);
  const ShapeRange range = info.shape[index].values.fitted(motion_scales(scales));
  Candidate better = search(fitter, joint, best.design, range.from, range.to,
                            [index](JointFit& d, double value) { d.effects.back().shape[index] = value; });
  return better.judgement.rmse < best.judgement.rmse ? better : best;
}

}  // namespace

Candidate search_width(const Fitter& fitter, std::size_t joint, const Scales& scales) {
  return search(fitter, joint, fitter.design(joint), 1e-4 * scales.velocity, 0.3 * scales.velocity,
                [](JointFit& design, double value) { design.sign_width = value; });
}

Candidate search_effect(const Fitter& fitter, std::size_t joint, std::string_view effect, const Scales& scales) {
  JointFit design = fitter.design(joint);
  const EffectInfo& info = *find_effect(effect);
  if (info.needs_peers) return search_coupling(fitter, joint, effect, scales);
  EffectFit fit;
  fit.effect = effect;
  fit.shape.resize(info.shape.size());
  design.effects.push_back(fit);
  if (info.shape.empty()) return {design, fitter.held_out_with(joint, design, {0.0})[0]};
  // One shape: why_not_identified() lets no other effects through.
  const ShapeRange range = info.shape[0].values.fitted(motion_scales(scales));
  const double to = std::min(info.shape[0].upper, range.to);
  return search(fitter, joint, design, range.from, to,
                [](JointFit& d, double value) { d.effects.back().shape[0] = value; });
}

}  // namespace fxdyn
