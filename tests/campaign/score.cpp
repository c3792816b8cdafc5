#include "tests/campaign/score.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>

namespace fxdyn::campaign {
namespace {

using nlohmann::json;

std::size_t true_joint(const json& effect) { return effect.value("joint", std::size_t{0}); }

/// @param certainty established or likely
std::vector<Named> of(const json& list, std::size_t joint, const std::string& certainty) {
  std::vector<Named> named;
  for (const json& entry : list) {
    if (entry.at("certainty") != certainty) continue;
    Named one;
    one.effect = entry.at("effect");
    one.joint = joint;
    if (entry.contains("score") && entry.at("score").is_number()) one.score = entry.at("score");
    if (entry.contains("alternatives")) {
      for (const json& alternative : entry.at("alternatives")) {
        // a name, or an object with one
        one.alternatives.push_back(alternative.is_string() ? alternative.get<std::string>()
                                                           : alternative.value("effect", std::string()));
      }
    }
    named.push_back(one);
  }
  return named;
}

/// A truth whose form deviates from the catalogue's is right under the names of its class.
bool is_right(const Named& named, const json& effect) {
  if (named.joint != true_joint(effect)) return false;
  if (!effect.contains("names")) return named.effect == effect.at("effect").get<std::string>();
  const auto names = effect.at("names").get<std::vector<std::string>>();
  return std::find(names.begin(), names.end(), named.effect) != names.end();
}

/// Among the name and its first two alternatives, at the right joint. An alternative on the body counts whatever the
/// joint that it is stated at, since it has none of its own.
bool is_among(const Named& named, const json& effect) {
  if (is_right(named, effect)) return true;
  const std::size_t joint = true_joint(effect);
  if (joint != 0 && named.joint != joint) return false;
  const auto end =
      named.alternatives.begin() + static_cast<std::ptrdiff_t>(std::min<std::size_t>(2, named.alternatives.size()));
  return std::find(named.alternatives.begin(), end, effect.at("effect").get<std::string>()) != end;
}

json as_json(const std::vector<Named>& named) {
  json list = json::array();
  for (const Named& one : named) {
    list.push_back({{"effect", one.effect}, {"joint", one.joint}, {"alternatives", one.alternatives}});
  }
  return list;
}

}  // namespace

/// Structure is left at a joint, whatever was found there.
bool is_left(const json& joint) {
  return joint.at("verdict") == "unexplained" || joint.at("verdict") == "partly_explained";
}

std::vector<Named> named_effects(const json& diagnosis, const std::string& certainty) {
  std::vector<Named> named;
  std::size_t joint = 0;
  for (const json& entry : diagnosis.at("joints")) {
    ++joint;
    for (Named& one : of(entry.at("effects"), entry.value("index", joint), certainty)) named.push_back(std::move(one));
  }
  for (Named& one : of(diagnosis.at("robot_effects"), 0, certainty)) named.push_back(std::move(one));
  std::stable_sort(named.begin(), named.end(), [](const Named& a, const Named& b) { return a.score > b.score; });
  return named;
}

/// Whether the clearest region of a joint's gap is where the torque sits: in its signal, and they overlap. A tight spot
/// of friction changes sign with the direction, so that the region may be of the position alone.
bool is_placed(const json& joint, const json& place) {
  const json& regions = joint.at("where").at("regions");
  if (regions.empty()) return false;
  const json& first = regions.front();
  return first.at("signal") == place.at("signal") && first.value("joint", 0) == 0 &&
         first.at("from").get<double>() <= place.at("to").get<double>() &&
         first.at("to").get<double>() >= place.at("from").get<double>();
}

/// The free curve that a joint has, "cross_position 4" where it is over the position of joint 4; "": none.
std::string curve_at(const json& joint) {
  const json curve = joint.value("curve", json());
  if (!curve.is_object()) return {};
  const json other = curve.value("joint", json());
  return curve.at("effect").get<std::string>() + (other.is_number() ? fmt::format(" {}", other.get<int>()) : "");
}

/// Joints with a free curve.
std::size_t count_curves(const json& diagnosis) {
  std::size_t count = 0;
  for (const json& joint : diagnosis.at("joints")) count += static_cast<std::size_t>(!curve_at(joint).empty());
  return count;
}

/// Points of a curve whose band of 95 % holds the truth's, and all of them. The mean is taken off both: what is nominal
/// has it. Points where the truth was not swept don't count, nor does a friction beside a torque.
void count_band(const json& curve, const json& truth, double clock_s, json& out) {
  if (!curve.contains("x") || curve.at("friction") != truth.at("friction")) return;
  const auto x = curve.at("x").get<std::vector<double>>(), y = curve.at("y").get<std::vector<double>>(),
             std = curve.at("std").get<std::vector<double>>();
  const auto true_x = truth.at("x").get<std::vector<double>>(), true_y = truth.at("y").get<std::vector<double>>();
  const double start = curve.at("signal") == "t" ? clock_s : 0, step = true_x[1] - true_x[0];
  std::vector<double> off, deviation;
  double mean = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    const double place = (x[i] - start - true_x.front()) / step;
    const auto left = static_cast<std::size_t>(std::max(place, 0.0));
    if (place < 0 || left + 1 >= true_x.size()) continue;
    off.push_back(y[i] - std::lerp(true_y[left], true_y[left + 1], place - static_cast<double>(left)));
    deviation.push_back(std[i]);
    mean += off.back();
  }
  std::size_t held = 0;
  for (std::size_t i = 0; i < off.size(); ++i)
    held += static_cast<std::size_t>(std::fabs(off[i] - mean / static_cast<double>(off.size())) <= 1.96 * deviation[i]);
  out["band_held"] = held;
  out["band_points"] = off.size();
}

/// Joints, and those of them that have a sentence with a place. `found`: joints with a healthy robot's own friction
/// under its name. The sentence is rightly about that, and they don't count.
void count_places(const json& diagnosis, const std::set<std::size_t>& found, json& out) {
  std::size_t joints = 0, placed = 0, index = 0;
  for (const json& entry : diagnosis.at("joints")) {
    ++index;
    if (found.contains(entry.value("index", index))) continue;
    ++joints;
    placed += static_cast<std::size_t>(!entry.at("where").at("regions").empty());
  }
  out["joints"] = joints;
  out["joints_placed"] = placed;
}

/// A truth that the catalogue has no name for: noticed, placed, and given a curve.
void score_outside(const json& truth, const json& diagnosis, const std::set<std::size_t>& unexplained,
                   const std::vector<Named>& named, json& out) {
  const json& first = truth.at("effects").front();
  const std::size_t joint = true_joint(first);
  const bool flagged = unexplained.contains(joint);
  if (first.contains("place") && joint > 0)
    out["placed"] = is_placed(diagnosis.at("joints").at(joint - 1), first.at("place"));
  if (first.contains("curve") && joint > 0) {
    // Right is the form's variable at the joint and no curve elsewhere; none where no curve has the form.
    const std::string curve = curve_at(diagnosis.at("joints").at(joint - 1));
    out["curve"] = curve;
    out["curve_right"] = curve == first.at("curve").get<std::string>() && count_curves(diagnosis) <= !curve.empty();
    const json& drawn = diagnosis.at("joints").at(joint - 1).value("curve", json());
    out["curve_in_model"] = !curve.empty() && drawn.value("in_model", false);
    if (out["curve_right"] && first.contains("swept") && !curve.empty())
      count_band(drawn, first.at("swept"), truth.value("clock_s", 0.0), out);
  }
  const bool taken = any_of(named.begin(), named.end(), [&](const Named& one) { return one.joint == joint; });
  out["flagged"] = flagged;
  out["accepted"] = std::any_of(named.begin(), named.end(),
                                [&](const Named& one) { return !flagged || !unexplained.contains(one.joint); });
  out["named_beside"] = taken && flagged;
  out["taken"] = taken;
  out["right_joint"] = flagged || taken;
  out["passed"] = flagged;
}

json score(const json& truth, const json& diagnosis, std::optional<double> closure) {
  const std::string verdict = diagnosis.at("verdict");
  std::vector<Named> named = named_effects(diagnosis, "established"), likely = named_effects(diagnosis, "likely");
  json out{{"verdict", verdict}, {"named", as_json(named)}, {"likely", as_json(likely)}};
  std::set<std::size_t> unexplained;
  std::size_t index = 0;
  for (const json& entry : diagnosis.at("joints")) {
    ++index;
    if (is_left(entry)) unexplained.insert(entry.value("index", index));
  }
  out["unexplained_joints"] = unexplained;
  if (closure) out["closure"] = *closure;
  out["curves"] = count_curves(diagnosis);

  const json& effects = truth.at("effects");
  // What a healthy robot has anyway may be named: it is there. Unless there is more of it.
  const auto is_of = [](const Named& one, const json& list) {
    return std::any_of(list.begin(), list.end(), [&](const json& effect) { return is_right(one, effect); });
  };
  const auto is_healthy = [&](const Named& one) { return is_of(one, truth.at("background")) && !is_of(one, effects); };
  std::set<std::size_t> with_healthy;
  for (const Named& one : named) {
    if (is_healthy(one)) with_healthy.insert(one.joint);
  }
  std::erase_if(named, is_healthy);
  std::erase_if(likely, is_healthy);
  const auto right_of = [&](const std::vector<Named>& list) {
    return std::count_if(list.begin(), list.end(), [&](const Named& one) { return is_of(one, effects); });
  };
  out["established_right"] = right_of(named);
  out["established_all"] = named.size();
  out["likely_right"] = right_of(likely);
  out["likely_all"] = likely.size();
  if (effects.empty()) {
    out["false_alarm"] =
        !named.empty() || verdict == "unexplained" || verdict == "partly_explained" || verdict == "not_excited";
    out["passed"] = !out["false_alarm"];
    count_places(diagnosis, with_healthy, out);
    return out;
  }

  std::size_t found = 0, found_among = 0, joints = 0;
  for (const json& effect : effects) {
    const std::size_t joint = true_joint(effect);
    const auto any = [&](auto&& test) { return std::any_of(named.begin(), named.end(), test); };
    found += static_cast<std::size_t>(any([&](const Named& one) { return is_right(one, effect); }));
    found_among += static_cast<std::size_t>(any([&](const Named& one) { return is_among(one, effect); }));
    joints += static_cast<std::size_t>(any([&](const Named& one) { return one.joint == joint; }) ||
                                       unexplained.contains(joint));
  }
  std::size_t spurious = 0;
  for (const Named& one : named) spurious += static_cast<std::size_t>(!is_of(one, effects));
  out["spurious"] = spurious;
  out["too_many"] = spurious > 0;
  // A flag at a joint that nothing was added to and that feels nothing of it
  std::set<std::size_t> felt;
  for (const json& effect : effects) {
    felt.insert(true_joint(effect));
    if (effect.contains("feels")) felt.insert(effect.at("feels").get<std::size_t>());
  }
  const bool on_body = felt.contains(0);
  out["flagged_elsewhere"] =
      !on_body && !std::includes(felt.begin(), felt.end(), unexplained.begin(), unexplained.end());
  out["detected"] = verdict != "nothing_missing" && verdict != "not_excited";

  const json& first = effects.front();
  if (first.value("outside", false)) {
    score_outside(truth, diagnosis, unexplained, named, out);
    return out;
  }
  if (effects.size() > 1) {
    out["both"] = found == effects.size();
    out["passed"] = found == effects.size();
    out["right_joint"] = joints == effects.size();
    return out;
  }
  // The strongest finding alone counts: a name that stands second beside a wrong one is no answer.
  out["top1"] = !named.empty() && is_right(named.front(), first);
  out["top3"] = !named.empty() && is_among(named.front(), first);
  out["found"] = found == 1;
  out["found_among"] = found_among == 1;
  out["named_as"] = named.empty() ? verdict : named.front().effect;
  const std::size_t joint = true_joint(first);
  out["right_joint"] = named.empty() ? unexplained.contains(joint) : named.front().joint == joint;
  out["wrong_name"] = !named.empty() && !is_among(named.front(), first);
  out["passed"] = out["top1"];
  return out;
}

}  // namespace fxdyn::campaign
