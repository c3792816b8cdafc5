#include "tests/campaign/thresholds.hpp"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "tests/campaign/score.hpp"

namespace fxdyn::campaign {
namespace {

using diagnosis::Options;
using Reads = Threshold::Reads;

/// A member of one of the options' parts.
template <auto part, auto member>
double& place(Options& options) {
  return options.*part.*member;
}

constexpr auto noise = &Options::noise;
constexpr auto prior = &Options::prior;
constexpr auto session = &Options::session;
constexpr auto search = &Options::search;
constexpr auto lack = &Options::lack_of_fit;
constexpr auto gate = &Options::gate;
constexpr auto impact = &Options::impact;
constexpr auto deflection = &Options::deflection;
constexpr auto recording = &Options::recording;

std::vector<Threshold> before_the_search() {
  using namespace diagnosis;
  return {
      {"noise.doubtful", "noise variances", place<noise, &NoiseOptions::doubtful>},
      {"noise.background_prior", "noise variances", place<noise, &NoiseOptions::background_prior>,
       Reads::with_baseline},
      {"noise.mostly_gap", "times the noise", place<noise, &NoiseOptions::mostly_gap>, Reads::without_baseline},
      {"prior.friction_change", "share", place<prior, &PriorOptions::friction_change>, Reads::with_baseline},
      {"prior.dry_friction_change", "share", place<prior, &PriorOptions::dry_friction_change>, Reads::with_baseline},
      {"prior.offset_change", "share", place<prior, &PriorOptions::offset_change>, Reads::with_baseline},
      {"prior.rotor", "share", place<prior, &PriorOptions::rotor>},
      {"prior.link_rotor", "share", place<prior, &PriorOptions::link_rotor>, Reads::with_link_encoders},
      {"session.still", "times the noise", place<session, &SessionOptions::still>},
  };
}

std::vector<Threshold> of_the_search() {
  using namespace diagnosis;
  return {
      {"search.least_score", "score", place<search, &SearchOptions::least_score>},
      {"search.most_score", "score", place<search, &SearchOptions::most_score>},
      {"search.false_alarm", "chance", place<search, &SearchOptions::false_alarm>},
      {"search.least_share", "-", place<search, &SearchOptions::least_share>},
      {"search.most_share", "-", place<search, &SearchOptions::most_share>},
      {"search.beyond_bound", "deviations", place<search, &SearchOptions::beyond_bound>},
      {"lack_of_fit.state", "chance", place<lack, &LackOfFitOptions::state>},
      {"lack_of_fit.time", "chance", place<lack, &LackOfFitOptions::time>},
  };
}

std::vector<Threshold> of_the_judges() {
  using namespace diagnosis;
  return {
      {"gate.least_gain", "noise variances", place<gate, &GateOptions::least_gain>},
      {"gate.sure_gain", "noise variances", place<gate, &GateOptions::sure_gain>},
      {"gate.least_share_in_structure", "share", place<gate, &GateOptions::least_share_in_structure>},
      {"gate.worse", "-", place<gate, &GateOptions::worse>},
      {"gate.worse_fitted", "-", place<gate, &GateOptions::worse_fitted>},
      {"gate.beyond_noise", "share", place<gate, &GateOptions::beyond_noise>},
      {"gate.several_closure", "share", place<gate, &GateOptions::several_closure>},
      {"gate.least_closure", "share", place<gate, &GateOptions::least_closure>},
      {"gate.sure_closure", "share", place<gate, &GateOptions::sure_closure>},
      {"gate.sure_deviations", "deviations", place<gate, &GateOptions::sure_deviations>},
      {"gate.established", "log10 odds", place<gate, &GateOptions::established>},
      {"gate.established_deviations", "deviations", place<gate, &GateOptions::established_deviations>},
      {"gate.likely", "log10 odds", place<gate, &GateOptions::likely>},
      {"impact.beyond", "deviations", place<impact, &ImpactOptions::beyond>, Reads::with_baseline},
      {"impact.times", "-", place<impact, &ImpactOptions::times>, Reads::with_baseline},
      {"impact.added", "impacts", place<impact, &ImpactOptions::added>, Reads::with_baseline},
      {"deflection.least_score", "score", place<deflection, &DeflectionOptions::least_score>,
       Reads::with_link_encoders},
      {"deflection.least_closure", "share", place<deflection, &DeflectionOptions::least_closure>,
       Reads::with_link_encoders},
      {"deflection.least_part", "share", place<deflection, &DeflectionOptions::least_part>, Reads::with_link_encoders},
      {"deflection.same", "share", place<deflection, &DeflectionOptions::same>, Reads::with_link_encoders},
      {"deflection.noted", "times the noise", place<deflection, &DeflectionOptions::noted>, Reads::with_link_encoders},
      {"recording.least_score", "score", place<recording, &RecordingOptions::least_score>},
      {"recording.least_closure", "share", place<recording, &RecordingOptions::least_closure>},
  };
}

/// The cases as they are added; their order gives the seeds.
class List {
 public:
  Case& add(Group group, std::vector<Wanted> wanted, const std::string& name) {
    Case one;
    one.group = group;
    one.robot = small_arm;
    one.effects = std::move(wanted);
    one.seed = 7001 + cases_.size();
    one.recording = {.log_s = 5, .sample_s = 0.004, .encoder_bits = 17};
    one.name = fmt::format("{:02}_{}{}{}", cases_.size() + 1, to_string(group), name.empty() ? "" : "_", name);
    cases_.push_back(one);
    return cases_.back();
  }
  std::vector<Case> take() { return std::move(cases_); }

 private:
  std::vector<Case> cases_;
};

void add_healthy(List& list) {
  list.add(Group::clean, {}, "");
  list.add(Group::clean, {}, "15_bits").recording.encoder_bits = 15;
  list.add(Group::clean, {}, "no_baseline").baseline = false;
  list.add(Group::clean, {}, "controlled").closed_loop = true;
  list.add(Group::changed_friction, {}, "").friction_change = 0.05;
}

/// One of each family (friction at low and at high speed, of the load, position, time, other joint, torque's path,
/// body), small and large.
void add_families(List& list) {
  for (const char* effect : {"stribeck", "presliding", "viscous_quadratic", "load_friction", "ripple", "spring",
                             "friction_drift", "joint_coupling", "delay", "payload"}) {
    for (const double share : {0.006, 0.02})
      list.add(Group::single, {{effect, share}}, fmt::format("{}_{:g}", effect, 100 * share));
  }
}

void add_others(List& list) {
  for (const char* effect : {"square_wave", "other_position", "wandering_friction"})
    list.add(Group::outside, {{effect, 0.02}}, effect);
  list.add(Group::outside, {{"product_of_velocities", 0.006}}, "product_of_velocities");
  list.add(Group::pair, {{"stribeck", 0.02}, {"ripple", 0.02}}, "stribeck_ripple");
  list.add(Group::pair, {{"payload", 0.02}, {"spring", 0.02}}, "payload_spring");
  for (const char* effect : {"ripple", "stribeck", "viscous_cubic"})
    list.add(Group::no_baseline, {{effect, 0.02}}, effect).baseline = false;
  for (const auto& [effect, size] :
       {std::pair{"elasticity", 5e-4}, std::pair{"eccentricity", 2e-4}, std::pair{"backlash", 5e-4}})
    list.add(Group::dual_encoder, {{effect, 0, {}, false, size}}, effect).link_encoders = true;
  list.add(Group::background, {}, "quiet").background = {{"ripple", 0.006}, {"stribeck", 0.01}};
  list.add(Group::background, {{"spring", 0.01}}, "spring").background = {{"ripple", 0.006}, {"stribeck", 0.01}};
  list.add(Group::single, {{"stribeck", 0.02}}, "stribeck_15_bits").recording.encoder_bits = 15;
}

std::string counts(const ThresholdRow::Changed& changed) {
  return fmt::format("{} / {} / {}", changed.verdict, changed.effects, changed.joints);
}

void count(ThresholdRow::Changed& changed, const Answer& normal, const Answer& other) {
  changed.verdict += static_cast<std::size_t>(normal.verdict != other.verdict);
  changed.effects += static_cast<std::size_t>(normal.effects != other.effects);
  changed.joints += static_cast<std::size_t>(normal.joints != other.joints);
  changed.right += static_cast<std::size_t>(other.right);
}

}  // namespace

bool Threshold::is_read(const Case& one) const {
  switch (reads) {
    case Reads::with_baseline:
      return one.baseline;
    case Reads::without_baseline:
      return !one.baseline;
    case Reads::with_link_encoders:
      return one.link_encoders;
    case Reads::always:
      return true;
  }
  return true;
}

const std::vector<Threshold>& deciding_thresholds() {
  static const std::vector<Threshold> all = [] {
    std::vector<Threshold> out = before_the_search();
    for (const auto& part : {of_the_search(), of_the_judges()}) out.insert(out.end(), part.begin(), part.end());
    return out;
  }();
  return all;
}

std::vector<Case> threshold_cases() {
  List list;
  add_healthy(list);
  add_families(list);
  add_others(list);
  return list.take();
}

Answer answer_of(const nlohmann::json& truth, const nlohmann::json& report) {
  Answer out;
  out.verdict = report.at("verdict");
  for (const Named& one : named_effects(report)) {
    out.effects.insert(one.effect);
    out.joints.insert(one.joint);
  }
  for (const nlohmann::json& joint : report.at("joints")) {
    if (joint.at("verdict") == "unexplained" || joint.at("verdict") == "partly_explained")
      out.joints.insert(joint.at("index").get<std::size_t>());
  }
  out.right = score(truth, report, {}).at("passed");
  return out;
}

nlohmann::json to_json(const CaseAnswers& answers) {
  const auto one = [](const Answer& a) -> nlohmann::json {
    return {{"verdict", a.verdict}, {"effects", a.effects}, {"joints", a.joints}, {"right", a.right}};
  };
  nlohmann::json out = {{"normal", one(answers.normal)}, {"halved", nlohmann::json::array()}};
  out["doubled"] = out["halved"];
  for (const Answer& answer : answers.halved) out["halved"].push_back(one(answer));
  for (const Answer& answer : answers.doubled) out["doubled"].push_back(one(answer));
  return out;
}

CaseAnswers case_answers(const nlohmann::json& json) {
  const auto one = [](const nlohmann::json& a) -> Answer {
    return {a.at("verdict"), a.at("effects"), a.at("joints"), a.at("right")};
  };
  CaseAnswers out{one(json.at("normal")), {}, {}};
  for (const nlohmann::json& answer : json.at("halved")) out.halved.push_back(one(answer));
  for (const nlohmann::json& answer : json.at("doubled")) out.doubled.push_back(one(answer));
  return out;
}

bool ThresholdRow::without_effect() const {
  const auto none = [](const Changed& c) { return c.verdict + c.effects + c.joints == 0; };
  return none(halved) && none(doubled);
}

std::vector<ThresholdRow> rows_of(const std::vector<Threshold>& thresholds, const std::vector<CaseAnswers>& answers) {
  std::vector<ThresholdRow> rows;
  for (std::size_t t = 0; t < thresholds.size(); ++t) {
    Options defaults;
    ThresholdRow row;
    row.name = thresholds[t].name;
    row.unit = thresholds[t].unit;
    row.value = thresholds[t].of(defaults);
    for (const CaseAnswers& one : answers) {
      ++row.cases;
      row.right += static_cast<std::size_t>(one.normal.right);
      count(row.halved, one.normal, one.halved[t]);
      count(row.doubled, one.normal, one.doubled[t]);
    }
    rows.push_back(std::move(row));
  }
  return rows;
}

std::string to_markdown(const std::vector<ThresholdRow>& rows) {
  std::string out =
      "| threshold | default | unit | halved: verdict / effect / joint changes | doubled: likewise | right: halved, "
      "default, doubled |\n|---|---|---|---|---|---|\n";
  for (const ThresholdRow& row : rows) {
    out +=
        fmt::format("| {} | {:g} | {} | {} | {} | {}, {}, {} of {} |\n", row.name, row.value, row.unit,
                    counts(row.halved), counts(row.doubled), row.halved.right, row.right, row.doubled.right, row.cases);
  }
  return out;
}

}  // namespace fxdyn::campaign
