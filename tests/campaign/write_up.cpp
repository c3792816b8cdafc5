#include "tests/campaign/write_up.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <functional>
#include <limits>
#include <map>

#include "model/version.hpp"

namespace fxdyn::campaign {
namespace {

using nlohmann::json;
using Filter = std::function<bool(const json&)>;

bool done(const json& r) { return r.at("status") == "done"; }
bool ran(const json& r) { return r.at("status") != "not_generated"; }
bool in(const json& r, const char* group) { return r.at("group") == group; }

const json* first_effect(const json& r) {
  if (!r.contains("truth") || r.at("truth").at("effects").empty()) return nullptr;
  return &r.at("truth").at("effects").front();
}
/// Beforehand, from motion and noise alone: visible, ambiguous, hidden.
std::string expected(const json& r) {
  const json* effect = first_effect(r);
  return effect == nullptr ? "" : effect->at("expected").at("verdict").get<std::string>();
}
std::string plant_of(const json& r) {
  return r.contains("truth") ? r.at("truth").value("plant", std::string()) : std::string();
}
double share(const json& r) {
  const json* effect = first_effect(r);
  return effect == nullptr ? 0 : effect->value("wanted_share", 0.0);
}
bool has(const json& r, const char* key) { return r.contains("score") && r.at("score").value(key, false); }

/// Adds a case's effects of that certainty: right ones, of all.
void add(Rate& rate, const json& r, const std::string& certainty) {
  rate.hit += r.at("score").at(certainty + "_right").get<std::size_t>();
  rate.of += r.at("score").at(certainty + "_all").get<std::size_t>();
}

std::vector<const json*> where(const std::vector<json>& results, const Filter& filter) {
  std::vector<const json*> list;
  for (const json& r : results) {
    if (ran(r) && filter(r)) list.push_back(&r);
  }
  return list;
}

/// A diagnosis that failed counts as a miss.
Rate rate(const std::vector<json>& results, const Filter& filter, const char* key) {
  Rate rate;
  for (const json* r : where(results, filter)) {
    ++rate.of;
    rate.hit += static_cast<std::size_t>(has(*r, key));
  }
  return rate;
}

double median(std::vector<double> values) {
  if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
  std::sort(values.begin(), values.end());
  const std::size_t half = values.size() / 2;
  return values.size() % 2 == 1 ? values[half] : 0.5 * (values[half - 1] + values[half]);
}
std::vector<double> values_of(const std::vector<json>& results, const Filter& filter, const char* key) {
  std::vector<double> values;
  for (const json* r : where(results, filter)) {
    if (r->contains("score") && r->at("score").contains(key)) values.push_back(r->at("score").at(key));
    if (r->contains(key)) values.push_back(r->at(key));
  }
  return values;
}

/// A figure without a goal of its own.
Figure plain(const std::string& what, Rate rate) { return {what, "", rate.value(), rate.of, true}; }
Figure at_least(const std::string& what, Rate rate, double goal) {
  return {what, fmt::format(">= {:.2f}", goal), rate.value(), rate.of, rate.of > 0 && rate.value() >= goal};
}
Figure at_most(const std::string& what, Rate rate, double goal) {
  return {what, fmt::format("<= {:.2f}", goal), rate.value(), rate.of, rate.of > 0 && rate.value() <= goal};
}

bool single(const json& r, double size) { return in(r, "single") && share(r) == size; }

std::string named_text(const json& r) {
  if (!r.contains("score")) return r.value("message", "");
  std::vector<std::string> names;
  for (const json& one : r.at("score").at("named")) {
    std::string text = fmt::format("{} @{}", one.at("effect").get<std::string>(), one.at("joint").get<int>());
    if (!one.at("alternatives").empty())
      text += fmt::format(" (or {})", fmt::join(one.at("alternatives").get<std::vector<std::string>>(), ", "));
    names.push_back(text);
  }
  std::string text = r.at("score").at("verdict").get<std::string>();
  if (!names.empty()) text += fmt::format(": {}", fmt::join(names, "; "));
  const auto unexplained = r.at("score").at("unexplained_joints").get<std::vector<int>>();
  if (!unexplained.empty()) text += fmt::format(" [unexplained: joint {}]", fmt::join(unexplained, ", "));
  return text;
}

std::string truth_text(const json& r) {
  std::vector<std::string> parts;
  if (!r.contains("truth")) return "";
  for (const json& effect : r.at("truth").at("effects")) {
    const std::size_t joint = effect.value("joint", std::size_t{0});
    const json& expected = effect.at("expected");
    parts.push_back(fmt::format(
        "{} @{} {:.2g} % ({}{})", effect.at("effect").get<std::string>(), joint, 100 * effect.at("share").get<double>(),
        expected.at("verdict").get<std::string>(),
        expected.at("verdict") == "ambiguous" ? " with " + expected.at("rival").get<std::string>() : std::string()));
  }
  return parts.empty() ? "nothing" : fmt::format("{}", fmt::join(parts, "; "));
}

/// Rows: what it is; columns: what came first in the diagnosis.
std::string confusion(const std::vector<json>& results, const Filter& filter) {
  std::map<std::string, std::map<std::string, int>> table;
  std::map<std::string, int> total;
  std::map<std::string, int> right, visible, visible_right;
  for (const json* r : where(results, filter)) {
    if (first_effect(*r) == nullptr) continue;
    const std::string name = first_effect(*r)->at("effect");
    ++total[name];
    const bool top1 = has(*r, "top1");
    right[name] += top1;
    if (expected(*r) == "visible") {
      ++visible[name];
      visible_right[name] += top1;
    }
    if (top1) continue;
    std::string as = done(*r) ? r->at("score").value("named_as", "") : "failed";
    if (as == name) as += " at another joint";
    ++table[name][as];
  }
  std::string text = "| effect | cases | right | visible: right | else named as |\n|---|---|---|---|---|\n";
  for (const auto& [name, count] : total) {
    std::vector<std::string> others;
    for (const auto& [as, times] : table[name]) others.push_back(fmt::format("{} x{}", as, times));
    text += fmt::format("| {} | {} | {} | {} of {} | {} |\n", name, count, right[name], visible_right[name],
                        visible[name], fmt::join(others, ", "));
  }
  return text;
}

std::string summary_line(const std::vector<json>& results, const Filter& filter) {
  const std::size_t cases = where(results, filter).size();
  if (cases == 0) return "no case\n";
  const auto part = [&](const char* key) { return rate(results, filter, key).value(); };
  return fmt::format("{} cases: top-1 {:.2f}, among the stated {:.2f}, joint {:.2f}, gap closed (median) {:.2f}\n",
                     cases, part("top1"), part("top3"), part("right_joint"),
                     median(values_of(results, filter, "closure")));
}

std::string table_of(const std::vector<json>& results, const Filter& filter) {
  std::string text = "| case | what it is | what was said |\n|---|---|---|\n";
  for (const json& r : results) {
    if (ran(r) && filter(r))
      text += fmt::format("| `{}` | {} | {} |\n", r.at("name").get<std::string>(), truth_text(r), named_text(r));
  }
  return text;
}

std::string ambiguous_cases(const std::vector<json>& results) {
  std::map<std::string, std::map<std::string, int>> rivals;
  std::map<std::string, int> hidden;
  for (const json* r : where(results, [](const json& x) { return first_effect(x) != nullptr; })) {
    const json& effect = *first_effect(*r);
    const json& one = effect.at("expected");
    const std::string name = effect.at("effect");
    if (one.at("verdict") == "ambiguous") ++rivals[name][one.at("rival")];
    if (one.at("verdict") == "hidden") ++hidden[name];
  }
  std::string text;
  for (const auto& [name, others] : rivals) {
    std::vector<std::string> list;
    for (const auto& [rival, times] : others) list.push_back(fmt::format("{} x{}", rival, times));
    text += fmt::format("- {}: looks like {}\n", name, fmt::join(list, ", "));
  }
  for (const auto& [name, times] : hidden) text += fmt::format("- {}: hidden x{}\n", name, times);
  return text.empty() ? "none\n" : text;
}

}  // namespace

/// Where what has no name sits, and clean joints of which no place is told.
std::vector<Figure> place_figures(const std::vector<json>& results, const Filter& outside) {
  const Filter known = [=](const json& r) { return outside(r) && first_effect(r)->contains("place"); };
  const Filter curved = [=](const json& r) { return outside(r) && first_effect(r)->contains("curve"); };
  Rate quiet;
  for (const json& r : results) {
    if (!done(r) || !r.at("score").contains("joints_placed")) continue;
    const auto joints = r.at("score").at("joints").get<std::size_t>();
    quiet.of += joints;
    quiet.hit += joints - r.at("score").at("joints_placed").get<std::size_t>();
  }
  Rate band;
  for (const json* r : where(results, curved)) {
    if (!done(*r) || !r->at("score").contains("band_points")) continue;
    band.hit += r->at("score").at("band_held").get<std::size_t>();
    band.of += r->at("score").at("band_points").get<std::size_t>();
  }
  const auto closures = values_of(
      results, [=](const json& r) { return curved(r) && has(r, "curve_right") && has(r, "curve_in_model"); },
      "closure");
  const double closed = median(closures);
  return {at_least("outside the catalogue: where it sits, variable and interval", rate(results, known, "placed"), 0.9),
          at_least("outside the catalogue: curve of the right variable and joint; none where none has the form",
                   rate(results, curved, "curve_right"), 0.9),
          {"outside the catalogue: closed in truth by a right curve in the model, median", ">= 0.90", closed,
           closures.size(), closed >= 0.9},
          at_least("outside the catalogue: points whose band of 95 % holds the truth, right curves", band, 0.9),
          at_least("clean robots: joints without a place", quiet, 0.95)};
}

/// Of the second campaign. An effect is told apart by the data from 20 and, of its best rival, 5 deviations on.
std::vector<Figure> drawn_figures(const std::vector<json>& results) {
  const auto is_outside = [](const json& r) {
    return first_effect(r) != nullptr && first_effect(r)->value("outside", false);
  };
  const auto chi = [](const json& r, const char* key) { return first_effect(r)->at("expected").at(key).get<double>(); };
  const Filter told = [=](const json& r) {
    return in(r, "drawn") && first_effect(r) != nullptr && !is_outside(r) &&
           (first_effect(r)->contains("wanted_deflection") || (chi(r, "chi") >= 20 && chi(r, "rival_chi") >= 5));
  };
  const auto of = [](const Filter& one, const Filter& other) {
    return [=](const json& r) { return one(r) && other(r); };
  };
  const Filter baseline = [](const json& r) { return r.at("truth").at("baseline").get<bool>(); };
  const Filter memory = [](const json& r) {
    const std::string friction = r.at("truth").at("friction");
    return friction == "lugre" || friction == "maxwell";
  };
  const Filter linked = [](const json& r) { return first_effect(r)->contains("wanted_deflection"); };
  const Filter position_or_load = [](const json& r) {
    const std::string effect = first_effect(r)->at("effect");
    return effect == "payload" || effect == "gravity_tilt" || effect == "torque_gain" || effect == "spring" ||
           effect == "gravity_compensator";
  };
  const Filter outside = [=](const json& r) { return in(r, "drawn") && is_outside(r) && chi(r, "chi") >= 20; };
  Rate alarms, refused, established, likely;
  for (const json* r : where(results, [](const json& r) { return in(r, "drawn"); })) {
    ++refused.of;
    refused.hit += static_cast<std::size_t>(!done(*r));
    if (done(*r)) {
      add(established, *r, "established");
      add(likely, *r, "likely");
    }
    if (!r->contains("truth") || first_effect(*r) != nullptr) continue;
    ++alarms.of;
    alarms.hit += static_cast<std::size_t>(!done(*r) || has(*r, "false_alarm"));
  }
  Rate curve_instead;
  for (const json* r : where(results, told)) {
    ++curve_instead.of;
    curve_instead.hit +=
        static_cast<std::size_t>(done(*r) && !has(*r, "found") && r->at("score").value("curves", 0) > 0);
  }
  std::vector<Figure> list{at_least("drawn, told apart: named right", rate(results, told, "found"), 0.95),
                           at_least("drawn, told apart: right joint", rate(results, told, "right_joint"), 0.98),
                           at_least("drawn, friction with memory and a baseline",
                                    rate(results, of(told, of(baseline, memory)), "found"), 0.9),
                           at_least("drawn, payload, tilt, gain, spring, compensator, with a baseline",
                                    rate(results, of(told, of(baseline, position_or_load)), "found"), 0.9),
                           at_least("drawn, link encoders", rate(results, of(told, linked), "found"), 0.95),
                           at_most("drawn, a name too many", rate(results, told, "too_many"), 0.03),
                           at_most("drawn, told apart: a curve in place of the name", curve_instead, 0.05),
                           at_least("drawn, outside the catalogue: flagged", rate(results, outside, "flagged"), 0.95),
                           at_least("drawn, of what is established: right", established, 0.98),
                           at_least("drawn, of what is likely: right", likely, 0.8),
                           at_most("drawn, outside the catalogue: a name", rate(results, outside, "taken"), 0.03),
                           at_most("drawn, clean robots: false alarms", alarms, 0.01),
                           at_most("drawn, no answer", refused, 0)};
  for (Figure& figure : place_figures(results, outside)) list.push_back(std::move(figure));
  return list;
}

std::vector<Figure> figures(const std::vector<json>& results) {
  if (std::any_of(results.begin(), results.end(), [](const json& r) { return in(r, "drawn"); }))
    return drawn_figures(results);
  const auto visible = [](double size) {
    return [size](const json& r) { return single(r, size) && expected(r) == "visible"; };
  };
  const auto any_single = [](const json& r) { return in(r, "single"); };
  const Filter healthy = [](const json& r) {
    return in(r, "clean") || in(r, "changed_friction") || (in(r, "background") && first_effect(r) == nullptr);
  };
  const Filter outside = [](const json& r) { return in(r, "outside") && share(r) >= 0.006; };
  std::vector<Figure> list{
      at_least("top-1 name, visible effects, 0.6 %", rate(results, visible(0.006), "top1"), 0.95),
      at_least("top-1 name, visible effects, 0.2 %", rate(results, visible(0.002), "top1"), 0.85),
      at_least("top-3, visible effects, 0.6 %", rate(results, visible(0.006), "top3"), 0.99),
      plain("top-1 name, all effects, hidden and ambiguous too, 0.6 %",
            rate(
                results, [](const json& r) { return single(r, 0.006); }, "top1")),
      plain("top-1 name, all effects, hidden and ambiguous too, 0.2 %",
            rate(
                results, [](const json& r) { return single(r, 0.002); }, "top1")),
      at_least("right joint, visible effects",
               rate(
                   results, [&](const json& r) { return any_single(r) && expected(r) == "visible"; }, "right_joint"),
               0.98)};
  Rate alarms;
  for (const json* r : where(results, healthy)) {
    ++alarms.of;
    alarms.hit += static_cast<std::size_t>(!done(*r) || has(*r, "false_alarm"));
  }
  list.push_back(at_most("false alarms (clean, friction changed, quiet background)", alarms, 0.01));
  list.push_back(at_least("outside the catalogue, >= 0.6 %: flagged", rate(results, outside, "flagged"), 0.95));
  list.push_back(at_most("outside the catalogue, >= 0.6 %: accepted under a wrong name",
                         rate(results, outside, "accepted"), 0.03));
  list.push_back(at_most("outside the catalogue, >= 0.6 %: a name at that joint beside the flag",
                         rate(results, outside, "named_beside"), 0.03));
  for (Figure& figure : place_figures(results, outside)) list.push_back(std::move(figure));
  for (const auto& [size, goal] : {std::pair{0.006, 0.90}, std::pair{0.02, 0.95}}) {
    auto closures = values_of(results, visible(size), "closure");
    const double value = median(closures);
    list.push_back({fmt::format("gap closed in truth, visible effects, {:g} %, median", 100 * size),
                    fmt::format(">= {:.2f}", goal), value, closures.size(), value >= goal});
  }
  for (const auto& [size, goal] : {std::pair{0.006, 0.75}, std::pair{0.02, 0.90}}) {
    list.push_back(
        at_least(fmt::format("pairs, both named, {:g} %", 100 * size),
                 rate(
                     results, [size = size](const json& r) { return in(r, "pair") && share(r) == size; }, "both"),
                 goal));
  }
  list.push_back(
      at_least("no baseline, detectable: top-1",
               rate(
                   results, [](const json& r) { return in(r, "no_baseline") && expected(r) == "visible"; }, "top1"),
               0.80));
  list.push_back(at_most(
      "no baseline, unidentifiable: wrong name",
      rate(
          results, [](const json& r) { return in(r, "no_baseline") && expected(r) != "visible"; }, "wrong_name"),
      0));
  for (const char* effect : {"elasticity", "eccentricity", "backlash"}) {
    list.push_back(at_least(fmt::format("link encoder: {}", effect),
                            rate(
                                results,
                                [&](const json& r) {
                                  return in(r, "dual_encoder") && first_effect(r) != nullptr &&
                                         first_effect(r)->at("effect") == effect;
                                },
                                "top1"),
                            0.95));
  }
  const auto has_name = [](const char* plant) {
    return [=](const json& r) { return first_effect(r) != nullptr && !in(r, "outside") && plant_of(r) == plant; };
  };
  list.push_back(plain("a name too many, one or two effects", rate(results, has_name("internal"), "too_many")));
  list.push_back(plain("a joint without an effect flagged", rate(results, has_name("internal"), "flagged_elsewhere")));
  list.push_back(plain("MuJoCo's plant: a name too many", rate(results, has_name("mujoco"), "too_many")));
  list.push_back(plain("MuJoCo's plant: a joint without an effect flagged",
                       rate(results, has_name("mujoco"), "flagged_elsewhere")));
  const auto one_of = [](const char* group, bool closed_loop) {
    return [=](const json& r) {
      return in(r, group) && expected(r) == "visible" && r.at("truth").at("closed_loop").get<bool>() == closed_loop;
    };
  };
  list.push_back(at_least("moved by a controller, visible, 0.6 %: top-1",
                          rate(results, one_of("controlled", true), "top1"), 0.95));
  list.push_back(at_least("MuJoCo's plant, prescribed motion, visible: top-1",
                          rate(results, one_of("mujoco", false), "top1"), 0.95));
  list.push_back(at_least("MuJoCo's plant, moved by a controller, visible: top-1",
                          rate(results, one_of("mujoco", true), "top1"), 0.95));
  return list;
}

std::string write_up(const std::vector<json>& results, const std::string& command, const std::string& commit) {
  std::string text = "# Diagnosis campaign\n\n";
  text += fmt::format("Version {}{}. `{}`\n\n", version, commit.empty() ? "" : ", commit " + commit, command);
  const Filter all = [](const json&) { return true; };
  const auto times = values_of(results, all, "diagnosis_s"), generation = values_of(results, all, "generation_s");
  std::size_t missing = 0, failed = 0;
  for (const json& r : results) {
    missing += static_cast<std::size_t>(!ran(r));
    failed += static_cast<std::size_t>(r.at("status") == "failed");
  }
  text += fmt::format(
      "{} cases. {} of them could not be had, since no joint reaches the size. {} ended without a diagnosis. Time of "
      "one diagnosis on one thread: median {:.1f} s, longest {:.1f} s. Generating a case takes {:.1f} s in the "
      "median.\n\n",
      results.size(), missing, failed, median(times),
      times.empty() ? 0.0 : *std::max_element(times.begin(), times.end()), median(generation));
  text +=
      "**Recording.** Each role has 40 s: 10 s fast, 10 s up to 3.5 Hz, 10 s slow, 10 s of reversals. The roles are "
      "baseline, train, validate and test, all of different trajectories. The logs have 500 Hz, 17-bit encoders, 1 % "
      "white and 0.3 % coloured torque noise.\n\n"
      "**Sizes.** A size is the RMS of the noise-free torque change over the train logs. It is taken at the joint that "
      "feels it most, as a share of rated torque.\n\n"
      "**Visible effects.** *Visible* is told beforehand, from motion and noise alone. First nominal friction takes "
      "its "
      "part; without a baseline the whole nominal model does. What is left of the effect stands out by 8 standard "
      "deviations. It also stands out by 5 from the best other effect of the catalogue.\n\n## Figures\n\n| what | goal "
      "| reached | cases |\n|---|---|---|---|\n";
  for (const Figure& figure : figures(results)) {
    if (figure.cases == 0) continue;
    text += fmt::format("| {} | {} | {}{:.3f}{} | {} |\n", figure.what, figure.goal, figure.met ? "" : "**",
                        figure.value, figure.met ? "" : "**", figure.cases);
  }
  text += "\n## Which effect is named as what\n";
  for (const double size : {0.002, 0.006, 0.02}) {
    const Filter of_size = [size](const json& r) { return single(r, size); };
    if (where(results, of_size).empty()) continue;
    text += fmt::format("\n### {:g} % of rated torque\n\n{}\n{}", 100 * size, summary_line(results, of_size),
                        confusion(results, of_size));
  }
  const std::vector<std::pair<const char*, const char*>> groups{{"mujoco", "The MuJoCo plant"},
                                                                {"no_baseline", "Without a baseline"},
                                                                {"background", "With a background"},
                                                                {"controlled", "Moved by a controller"},
                                                                {"dual_encoder", "Link encoders"}};
  for (const auto& [group, title] : groups) {
    const Filter of_group = [&, group = group](const json& r) { return in(r, group); };
    if (where(results, of_group).empty()) continue;
    const Filter with_effect = [&, group = group](const json& r) { return in(r, group) && first_effect(r) != nullptr; };
    text += fmt::format("\n## {}\n\n{}\n{}", title, summary_line(results, with_effect), confusion(results, of_group));
  }
  text +=
      "\nSizes on the MuJoCo plant are those of the internal one. Its gears and friction differ a little, so the gap "
      "before holds more than the effect.\n";
  text += "\n## What this recording can't tell apart in principle\n\n" + ambiguous_cases(results);
  text +=
      "\n## Every case that failed\n\n" + table_of(results, [](const json& r) { return !r.at("passed").get<bool>(); });
  text +=
      "\n## Passed, with a name too many or a flag at another joint\n\n" + table_of(results, [](const json& r) {
        return r.at("passed").get<bool>() && !in(r, "outside") && (has(r, "too_many") || has(r, "flagged_elsewhere"));
      });
  std::vector<std::string> missing_names;
  for (const json& r : results) {
    if (!ran(r)) missing_names.push_back(fmt::format("`{}`", r.at("name").get<std::string>()));
  }
  if (!missing_names.empty())
    text += fmt::format("\n## Not possible on these robots\n\n{}\n", fmt::join(missing_names, ", "));
  return text;
}

}  // namespace fxdyn::campaign
