#include "host_tools/identify/shape_search.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "host_tools/effects/effects.hpp"
#include "host_tools/regression/search_beside.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/parallel.hpp"

namespace fxdyn {
namespace {

std::vector<double> geometric(double from, double to, int count) {
  std::vector<double> values;
  values.reserve(static_cast<std::size_t>(count));
  for (int i = 0; i < count; ++i) values.push_back(from * std::pow(to / from, static_cast<double>(i) / (count - 1)));
  return values;
}

/// Whether what was tried is the best so far, and is from now on.
bool takes(Candidate& best, Candidate tried) {
  if (!(tried.judgement.rmse < best.judgement.rmse)) return false;
  best = std::move(tried);
  return true;
}

/// The best of one shape parameter: a geometric grid, then two refinements around its best point.
template <class Set>
Candidate search(const Fitter& fitter, std::size_t joint, const JointFit& start, double from, double to, Set&& set) {
  Candidate best{start, {}};
  double best_value = from;
  const auto make = [&](double value) {
    JointFit design = start;
    set(design, value);
    const Judgement judgement = fitter.held_out_with(joint, design, {0.0})[0];
    return Candidate{std::move(design), judgement};
  };
  const auto accept = [&](Candidate tried) { return takes(best, std::move(tried)); };
  constexpr int points = 12, rounds = 2;
  const std::vector<double> grid = geometric(from, to, points);
  std::vector<Candidate> made(grid.size());
  parallel_for(grid.size(), [&](std::size_t i) { made[i] = make(grid[i]); });
  for (std::size_t i = 0; i < grid.size(); ++i) {
    if (accept(std::move(made[i]))) best_value = grid[i];
  }
  search_beside(best_value, std::pow(to / from, 0.5 / (points - 1)), rounds, from, to, make, accept);
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
Candidate search_coupling(const Fitter& fitter, std::size_t joint, std::string_view effect, const Scales& scales,
                          const StructureOptions& options) {
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
  if (best.judgement.rmse > (1 - options.worth_a_search * options.worth_keeping) * now) return best;
  const auto index = static_cast<std::size_t>(refined);
  const ShapeRange range = info.shape[index].values.fitted(motion_scales(scales));
  Candidate better = search(fitter, joint, best.design, range.from, range.to,
                            [index](JointFit& d, double value) { d.effects.back().shape[index] = value; });
  return better.judgement.rmse < best.judgement.rmse ? better : best;
}

/// Values of a shape to begin with: of the effects that are united, else a few over its range.
std::vector<double> starts(const JointFit& before, const EffectInfo& info, const ParameterInfo& shape,
                           const ShapeRange& range) {
  for (const std::string_view one : info.unites) {
    const EffectFit* fit = before.find(one);
    if (fit == nullptr) continue;
    const auto shapes = find_effect(one)->shape;
    for (std::size_t i = 0; i < shapes.size(); ++i) {
      if (shapes[i].name == shape.name) return {fit->shape[i]};
    }
  }
  const double from = std::max(range.from, 1e-3 * range.to), to = std::min(shape.upper, range.to);
  return geometric(from * std::pow(to / from, 0.1), from * std::pow(to / from, 0.9), 4);
}

/// One shape after the other, each by steps that become smaller.
template <class Attempt>
void walk(Candidate& best, const std::vector<ShapeRange>& ranges, Attempt&& attempt) {
  constexpr int sweeps = 3, rounds = 3;
  for (int sweep = 0; sweep < sweeps; ++sweep) {
    for (std::size_t i = 0; i < ranges.size(); ++i) {
      const std::vector<double> from = best.design.effects.back().shape;
      double best_value = from[i];
      const auto make = [&](double value) {
        std::vector<double> shape = from;
        shape[i] = value;
        return attempt(shape);
      };
      const auto accept = [&](Candidate tried) { return takes(best, std::move(tried)); };
      search_beside(best_value, sweep == 0 ? 1.5 : 1.2, rounds, ranges[i].from, ranges[i].to, make, accept);
    }
  }
}

/// Several shapes: from the best points of a coarse grid, since there are more valleys than one.
Candidate search_shapes(const Fitter& fitter, std::size_t joint, const JointFit& design, const EffectInfo& info,
                        const Scales& scales) {
  constexpr std::size_t most_walks = 5;
  std::vector<std::vector<double>> grid;
  std::vector<ShapeRange> ranges;
  for (const ParameterInfo& shape : info.shape) {
    const ShapeRange range = shape.values.fitted(motion_scales(scales));
    ranges.push_back({std::max(shape.lower, range.from), std::min(shape.upper, range.to)});
    grid.push_back(starts(fitter.design(joint), info, shape, ranges.back()));
  }
  const auto attempt = [&](const std::vector<double>& shape) {
    JointFit with = design;
    with.effects.back().shape = shape;
    const Judgement judgement = fitter.held_out_with(joint, with, {0.0})[0];
    return Candidate{std::move(with), judgement};
  };
  const std::vector<std::vector<double>> points = combinations(grid);
  std::vector<Candidate> all(points.size());
  parallel_for(points.size(), [&](std::size_t i) { all[i] = attempt(points[i]); });
  std::stable_sort(all.begin(), all.end(),
                   [](const Candidate& x, const Candidate& y) { return x.judgement.rmse < y.judgement.rmse; });
  Candidate best{design, {}};
  for (std::size_t i = 0; i < std::min(most_walks, all.size()); ++i) {
    walk(all[i], ranges, attempt);
    if (all[i].judgement.rmse < best.judgement.rmse) best = all[i];
  }
  return best;
}

}  // namespace

Candidate search_width(const Fitter& fitter, std::size_t joint, const Scales& scales) {
  return search(fitter, joint, fitter.design(joint), narrowest_sign * scales.velocity, widest_sign * scales.velocity,
                [](JointFit& design, double value) { design.sign_width = value; });
}

Candidate search_effect(const Fitter& fitter, std::size_t joint, std::string_view effect, const Scales& scales,
                        const StructureOptions& options) {
  JointFit design = fitter.design(joint);
  const EffectInfo& info = *find_effect(effect);
  if (info.needs_peers) return search_coupling(fitter, joint, effect, scales, options);
  std::erase_if(design.effects, [&](const EffectFit& one) {
    return std::find(info.unites.begin(), info.unites.end(), one.effect) != info.unites.end();
  });
  EffectFit fit;
  fit.effect = effect;
  fit.shape.resize(info.shape.size());
  design.effects.push_back(fit);
  if (info.shape.empty()) return {design, fitter.held_out_with(joint, design, {0.0})[0]};
  if (info.shape.size() > 1) return search_shapes(fitter, joint, design, info, scales);
  const ShapeRange range = info.shape[0].values.fitted(motion_scales(scales));
  const double to = std::min(info.shape[0].upper, range.to);
  return search(fitter, joint, design, range.from, to,
                [](JointFit& d, double value) { d.effects.back().shape[0] = value; });
}

}  // namespace fxdyn
