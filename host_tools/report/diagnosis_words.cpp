#include "host_tools/report/diagnosis_words.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <string_view>

namespace fxdyn::diagnosis_words {
namespace {

bool is_known(const std::optional<double>& value) { return value && std::isfinite(*value); }

const char* certainty_name(const NamedEffect& effect) { return effect.established ? "established" : "likely"; }

}  // namespace

std::string verdict(Verdict of) {
  std::string words(to_string(of));
  std::replace(words.begin(), words.end(), '_', ' ');
  return words;
}

std::string figure(std::optional<double> value) { return is_known(value) ? fmt::format("{:.3g}", *value) : "-"; }

std::string share(std::optional<double> value) { return is_known(value) ? fmt::format("{:.0f} %", 100 * *value) : "-"; }

std::string left(const std::optional<GapLeft>& of) {
  if (!of || !is_known(of->share)) return "-";
  return fmt::format("{} ({:.0f} .. {:.0f})", share(of->share), 100 * of->low, 100 * of->high);
}

std::string certainty(const NamedEffect& effect) {
  const bool closer = is_known(effect.odds_rival) && *effect.odds_rival < effect.odds_nothing;
  const double odds = closer ? *effect.odds_rival : effect.odds_nothing;
  if (!is_known(odds)) return certainty_name(effect);
  return fmt::format("{}: 10^{:.0f} to 1 against {}", certainty_name(effect), odds, closer ? effect.rival : "nothing");
}

std::string curve(const CurveResult& of) {
  constexpr double told_apart = 3;  // log10 odds, as for names
  const bool open = is_known(of.odds_rival) && *of.odds_rival < told_apart;
  const std::string which = open ? fmt::format("{} or {}", of.effect, of.rival) : of.effect;
  return fmt::format("{} ({}, 10^{:.0f} to 1 against nothing): closes {} of the error{}", of.sentence, which,
                     of.odds_nothing, share(of.closes), of.in_model ? ", in the model" : "");
}

std::string either(const std::vector<std::string>& names) { return fmt::format("{}", fmt::join(names, " or ")); }

std::string parameters(const NamedEffect& of, const char* plus_minus) {
  std::string out;
  for (const NamedParameter& p : of.parameters) {
    const bool known = is_known(p.std) && *p.std > 0;
    out += fmt::format("{}{} {}{}{}", out.empty() ? "" : ", ", p.name, figure(p.value),
                       known ? fmt::format("{}{:.2g}", plus_minus, *p.std) : "",
                       p.unit.empty() || p.unit == "-" || p.unit == "1" ? "" : " " + p.unit);
  }
  return out;
}

std::string effect(const NamedEffect& of, const char* plus_minus) {
  const std::string values = parameters(of, plus_minus), likely = of.established ? "" : "likely ";
  return likely + of.effect + (values.empty() ? "" : " " + values);
}

std::vector<std::string> experiments(const std::string& all) {
  constexpr std::string_view between = "; ";
  std::vector<std::string> parts;
  for (std::size_t from = 0; from < all.size();) {
    const std::size_t end = std::min(all.find(between, from), all.size());
    parts.push_back(all.substr(from, end - from));
    from = end + between.size();
  }
  return parts;
}

std::string list(const std::vector<std::string>& names) { return fmt::format("{}", fmt::join(names, ", ")); }

std::string list(const std::optional<std::vector<std::size_t>>& joints) {
  return joints ? fmt::format("{}", fmt::join(*joints, ", ")) : "";
}

std::string not_borne_out(const DiagnosisResult& diagnosis) {
  std::string out;
  for (const JointDiagnosis& joint : diagnosis.joints) {
    if (joint.carries_over.value_or(true)) continue;
    out += fmt::format("{}{} ({} -> {} {}; {} -> {} on the gate data)", out.empty() ? "" : ", ", joint.joint,
                       figure(joint.gap_before), figure(joint.gap_after), joint.unit, figure(joint.gate_before),
                       figure(joint.gate_after));
  }
  return out;
}

std::string figures_on(const DiagnosisResult& diagnosis) {
  std::string out = diagnosis.figures_on;
  if (!out.empty() && !diagnosis.gate.empty() && diagnosis.gate != out) out += "; closed: on " + diagnosis.gate;
  if (diagnosis.baseline) out += out.empty() ? "change since the baseline" : "; change since the baseline";
  return out;
}

}  // namespace fxdyn::diagnosis_words
