#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>

#include "host_tools/effects/effects.hpp"
#include "host_tools/excite/sight.hpp"

namespace fxdyn {
namespace {

using nlohmann::json;

json number(double value) { return std::isfinite(value) ? json(value) : json(nullptr); }

std::string_view unit_of(const ParameterInfo& parameter, JointType type) {
  return type == JointType::revolute ? parameter.unit : parameter.unit_prismatic;
}

json to_json(const Visibility& v, const EffectSight& effect, JointType type) {
  const EffectInfo& info = *find_effect(effect.effect);
  json shape = json::array(), parameters = json::array();
  for (std::size_t i = 0; i < v.shape.size(); ++i) {
    shape.push_back({{"name", info.shape[i].name}, {"value", v.shape[i]}, {"unit", unit_of(info.shape[i], type)}});
  }
  const auto names = column_names(effect.effect, type);
  for (std::size_t i = 0; i < v.parameters.size(); ++i) {
    parameters.push_back({{"name", names[i].name}, {"smallest", number(v.parameters[i])}, {"unit", names[i].unit}});
  }
  return {{"rho", v.rho}, {"smallest_percent", number(100 * v.smallest)}, {"shape", shape}, {"parameters", parameters}};
}

/// "0.31" of percent, in four characters or so.
std::string percent(double share) {
  if (!std::isfinite(share)) return "-";
  const double p = 100 * share;
  return p < 0.995 ? fmt::format("{:.2f}", p) : p < 99.5 ? fmt::format("{:.1f}", p) : fmt::format("{:.0f}", p);
}

std::string cell(const EffectSight& effect, const Visibility& v) {
  const std::string joint = effect.joint ? fmt::format("J{}", *effect.joint + 1) : "all";
  return fmt::format("{:<4}{:>5} {:>5.2f}", joint, percent(v.smallest), v.rho);
}

/// Text broken into lines of at most 100 characters: `first` spaces before the first, `later` before the others.
std::string wrapped(const std::string& text, std::size_t first, std::size_t later) {
  std::string out, line(first, ' ');
  bool empty = true;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = std::min(text.find(' ', at), text.size());
    const std::string word = text.substr(at, end - at);
    if (!empty && line.size() + 1 + word.size() > 100) {
      out += line + "\n";
      line = std::string(later, ' ');
      empty = true;
    }
    line += (empty ? "" : " ") + word;
    empty = false;
    at = end + 1;
  }
  return out + line + "\n";
}

}  // namespace

json sight_json(const Sight& sight, const std::vector<std::string>& assumptions) {
  json effects = json::array();
  for (const EffectSight& effect : sight.effects) {
    const Joint& joint = sight.robot.joints[effect.joint.value_or(0)];
    json entry{{"effect", effect.effect}, {"verdict", to_string(effect.verdict)}};
    if (effect.joint) {
      entry["joint"] = joint.name;
      entry["index"] = *effect.joint + 1;
    } else {
      entry["joints"] = json::array();
      for (std::size_t j = 0; j < sight.robot.size(); ++j) entry["joints"].push_back(j + 1);
    }
    entry.update(to_json(effect.typical, effect, joint.type));
    entry["worst"] = to_json(effect.worst, effect, joint.type);
    if (effect.healthy) entry["with_baseline"] = to_json(*effect.healthy, effect, joint.type);
    entry["confused_with"] = json::array();
    for (const Confusion& c : effect.confused) {
      entry["confused_with"].push_back({{"effect", c.effect}, {"correlation", c.correlation}, {"cure", c.cure}});
    }
    effects.push_back(std::move(entry));
  }
  json noise = json::array();
  for (const double share : sight.noise) noise.push_back(100 * share);
  return {{"threshold", sight.threshold},
          {"torque_cutoff_hz", sight.torque_cutoff_hz},
          {"noise_percent", noise},
          {"seconds", sight.seconds},
          {"independent_samples", sight.independent_samples},
          {"assumptions", assumptions},
          {"effects", effects}};
}

std::string sight_table(const Sight& sight, const std::vector<std::string>& assumptions) {
  std::string out = wrapped(
      fmt::format(
          "What this experiment will see: the smallest RMS torque [% of rated] that shows at {:.0f} standard "
          "deviations; rho: the share of the effect that the nominal model does not absorb. {:.0f} s of motion, "
          "{:.0f} independent samples, noise {} % of rated below {:.1f} Hz.",
          sight.threshold, sight.seconds, sight.independent_samples, percent(sight.noise.mean()),
          sight.torque_cutoff_hz),
      0, 2);
  for (const std::string& assumption : assumptions) out += wrapped("Assumed: " + assumption + ".", 0, 2);
  out += fmt::format("\n{:<20} {:<16} {:<16} {:<14} {:<8} {}\n", "effect", "best   %   rho", "worst  %   rho",
                     "seen/weak/no", "baseline", "mixed up with");
  struct Pair {
    std::string a, b, cure;
    std::vector<std::size_t> joints;
    double correlation = 0;
  };
  std::vector<Pair> pairs;
  for (std::size_t first = 0; first < sight.effects.size();) {
    std::size_t last = first;
    std::array<int, 3> verdicts{};
    const EffectSight *best = &sight.effects[first], *worst = best;
    double baseline = best->healthy ? best->healthy->smallest : std::numeric_limits<double>::infinity();
    std::map<std::string, int> mixed;
    for (; last < sight.effects.size() && sight.effects[last].effect == best->effect; ++last) {
      const EffectSight& effect = sight.effects[last];
      ++verdicts[static_cast<std::size_t>(effect.verdict)];
      if (effect.typical.smallest < best->typical.smallest) best = &effect;
      if (effect.worst.smallest > worst->worst.smallest) worst = &effect;
      if (effect.healthy) baseline = std::min(baseline, effect.healthy->smallest);
      for (const Confusion& c : effect.confused) {
        ++mixed[c.effect];
        const auto& a = std::min(effect.effect, c.effect);
        const auto& b = std::max(effect.effect, c.effect);
        auto pair = std::find_if(pairs.begin(), pairs.end(), [&](const Pair& p) { return p.a == a && p.b == b; });
        if (pair == pairs.end()) pair = pairs.insert(pairs.end(), {a, b, c.cure, {}, 0});
        pair->correlation = std::max(pair->correlation, c.correlation);
        if (effect.joint) pair->joints.push_back(*effect.joint + 1);
      }
    }
    std::string names;
    for (const auto& [name, count] : mixed) {
      const std::string more = (names.empty() ? "" : ", ") + name;
      if (names.size() + more.size() > 17) {
        names += names.empty() ? "see below" : " ...";
        break;
      }
      names += more;
    }
    out += fmt::format("{:<20} {:<16} {:<16} {:<14} {:<8} {}\n", best->effect, cell(*best, best->typical),
                       cell(*worst, worst->worst), fmt::format("{}/{}/{}", verdicts[0], verdicts[1], verdicts[2]),
                       percent(baseline), names);
    first = last;
  }
  out += wrapped(
      "best: joint, with a typical shape of the effect; worst: joint and shape; seen: from 0.5 % of rated or less; "
      "baseline: best, with the same motions recorded once more without the effect",
      0, 2);
  if (!pairs.empty()) out += "\nCan't be told apart, and what would help:\n";
  std::vector<std::string> cures;
  std::map<std::string, std::string> of_cure;
  for (Pair& pair : pairs) {
    std::sort(pair.joints.begin(), pair.joints.end());
    pair.joints.erase(std::unique(pair.joints.begin(), pair.joints.end()), pair.joints.end());
    std::string text = pair.a + " / " + pair.b;
    for (const std::size_t joint : pair.joints) text += fmt::format(" J{}", joint);
    text += fmt::format(" ({:.2f})", pair.correlation);
    std::string& line = of_cure[pair.cure];
    if (line.empty()) cures.push_back(pair.cure);
    line += (line.empty() ? "" : ", ") + text;
  }
  for (const std::string& cure : cures) {
    out += wrapped(of_cure[cure], 2, 4) + wrapped("-> " + cure, 6, 9);
  }
  return out;
}

}  // namespace fxdyn
