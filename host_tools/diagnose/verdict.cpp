#include "host_tools/diagnose/verdict.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "host_tools/diagnose/curve_sentence.hpp"
#include "host_tools/diagnose/explore.hpp"
#include "host_tools/diagnose/gap_errors.hpp"
#include "host_tools/diagnose/where.hpp"
#include "host_tools/diagnose/where_words.hpp"
#include "host_tools/effects/effect_roles.hpp"
#include "host_tools/effects/effects.hpp"
#include "host_tools/effects/evaluator.hpp"
#include "host_tools/effects/model_parts.hpp"
#include "host_tools/support/parallel.hpp"

namespace fxdyn::diagnosis {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// @param rated torque [N*m | N]
std::vector<NamedParameter> parameters_of(const EffectFit& fit, const Joint& joint, double rated) {
  std::vector<NamedParameter> out;
  const EffectInfo& info = *find_effect(fit.effect);
  const auto add = [&](const ParameterInfo& p, double value, const std::vector<double>& std, std::size_t i) {
    const bool turns = joint.type == JointType::revolute;
    NamedParameter one{std::string(p.name), std::string(turns ? p.unit : p.unit_prismatic), value, {}};
    // A torque that is less known than the joint's whole is shared with another effect, as a spring's offset.
    const bool known = i < std.size() && std[i] > 0 && !(p.unit == "N*m" && rated > 0 && std[i] > rated);
    if (known) one.std = std[i];
    out.push_back(std::move(one));
  };
  for (std::size_t i = 0; i < info.shape.size(); ++i) add(info.shape[i], fit.shape[i], fit.shape_std, i);
  for (std::size_t i = 0; i < info.linear.size(); ++i) add(info.linear[i], fit.linear[i], fit.linear_std, i);
  return out;
}

/// Makes the result of what was concluded.
class ReportWriter {
 public:
  explicit ReportWriter(const Conclusion& conclusion)
      : conclusion_(conclusion),
        options_(conclusion.outcome.models.options),
        report_(options_.report),
        errors_(conclusion) {}

  DiagnosisResult all() {
    DiagnosisResult out;
    for (std::size_t j = 0; j < joints_of(conclusion_.model).size(); ++j)
      out.joints.push_back(conclusion_.still[j] ? still(j) : moving(j));
    out.robot_effects = of_robot(out.undecided);
    // A joint whose gap a load closes is explained by it.
    for (JointDiagnosis& joint : out.joints) {
      const bool reached = std::any_of(out.robot_effects.begin(), out.robot_effects.end(), [&](const NamedEffect& e) {
        return e.established && std::find(e.joints->begin(), e.joints->end(), joint.index) != e.joints->end();
      });
      if (reached && joint.verdict == Verdict::nothing_missing) joint.verdict = Verdict::explained;
    }
    for (const std::string& effect : conclusion_.outcome.not_identifiable.back()) {
      // What of a load or a tilt is not part of the base parameters, the poses show.
      advise(fmt::format("{}: {}", effect,
                         conclusion_.outcome.models.has_baseline
                             ? "other poses and loads"
                             : "the same motions recorded without it (role = \"baseline\")"));
    }
    std::vector<Verdict> of_joints;
    for (const JointDiagnosis& joint : out.joints) of_joints.push_back(joint.verdict);
    const bool on_robot = std::any_of(out.robot_effects.begin(), out.robot_effects.end(),
                                      [](const NamedEffect& e) { return e.established; });
    if (on_robot || !out.undecided.empty()) of_joints.push_back(Verdict::explained);
    out.verdict = worst(of_joints);
    out.not_identifiable = conclusion_.outcome.not_identifiable.back();
    out.next_experiment = next_;
    out.gate = gate_of(conclusion_.now);
    out.figures_on = errors_.figures_on();
    out.baseline = conclusion_.outcome.models.has_baseline;
    out.notes = notes_;
    return out;
  }

 private:
  const Joint& joint_of(std::size_t j) const { return robot_of(conclusion_.model).joints[j]; }

  void advise(const std::string& text) {
    if (!text.empty() && next_.find(text) == std::string::npos) next_ += (next_.empty() ? "" : "; ") + text;
  }

  /// Share of the model's torque that an effect has.
  double model_share(std::size_t j, std::size_t e) const {
    ModelValue less = conclusion_.model;
    joints_of(less)[j].effects.erase(joints_of(less)[j].effects.begin() + static_cast<std::ptrdiff_t>(e));
    const MatrixXd& after = errors_.first_after();
    const MatrixXd without = predict(less, errors_.first_shown());
    const auto k = static_cast<Index>(j);
    return (after - without).col(k).norm() / std::max(after.col(k).norm(), 1e-300);
  }

  /// .. an effect on the robot, at the joint where it is largest.
  double body_share(std::size_t e) const {
    ModelValue less = conclusion_.model;
    body_of(less).erase(body_of(less).begin() + static_cast<std::ptrdiff_t>(e));
    const MatrixXd& after = errors_.first_after();
    const MatrixXd change = after - predict(less, errors_.first_shown());
    double most = 0;
    for (Index k = 0; k < change.cols(); ++k)
      most = std::max(most, change.col(k).norm() / std::max(after.col(k).norm(), 1e-300));
    return most;
  }

  /// A tilted base makes the masses about a first joint that stood upright felt, as a balancer there would be: with a
  /// tilt they are its own.
  bool part_of_tilt(std::size_t j, const EffectFit& fit) const {
    if (j != 0 || !find_effect(fit.effect)->as_masses_about_axis) return false;
    const Robot& robot = robot_of(conclusion_.model);
    const Eigen::Vector3d axis = robot.joints[0].origin.linear() * robot.joints[0].axis;
    const bool upright = axis.cross(robot.gravity).norm() < report_.upright * robot.gravity.norm();
    return upright && std::any_of(body_of(conclusion_.model).begin(), body_of(conclusion_.model).end(),
                                  [](const EffectFit& body) { return body.named && turns_gravity(body.effect); });
  }

  NamedEffect named(const EffectFit& fit, const Finding& finding) {
    const EffectId& id = finding.id;
    NamedEffect out;
    for (const Alternative& a : finding.alternatives) {
      const bool body = find_effect(a.candidate.effect)->acts_on == ActsOn::body;
      if (!id.body && !body && a.candidate.joint != id.joint) continue;
      if (std::find(out.alternatives.begin(), out.alternatives.end(), a.candidate.effect) != out.alternatives.end())
        continue;
      out.alternatives.push_back(a.candidate.effect);
      advise_between(fit.effect, id, a.candidate);
    }
    out.effect = fit.effect;
    out.parameters = parameters_of(fit, joint_of(id.joint), joints_of(conclusion_.model)[id.joint].rated_torque);
    out.score = finding.score;
    out.held_out_closure = finding.evidence.closure;
    out.established = finding.evidence.certainty == Certainty::established;
    out.odds_nothing = finding.evidence.against_nothing;
    out.odds_rival = finding.evidence.against_rival;
    if (finding.rival) out.rival = finding.rival->group.candidate.effect;
    return out;
  }

  void advise_between(const std::string& effect, const EffectId& id, const EffectCandidate& other) {
    const bool body = find_effect(other.effect)->acts_on == ActsOn::body;
    const std::size_t joint = id.body && !body ? other.joint : id.joint;
    const std::string place = id.body && body ? "" : fmt::format(" at joint {}", joint + 1);
    advise(fmt::format("{} or {}{}: {}", effect, other.effect, place, cure(effect, other.effect)));
  }

  /// An effect and its rival, of which one is there.
  std::vector<std::string> undecided(const EffectFit& fit, const Finding& finding) {
    const EffectCandidate& rival = finding.rival->group.candidate;
    advise_between(fit.effect, finding.id, rival);
    const bool on_body = find_effect(rival.effect)->acts_on == ActsOn::body;
    const bool elsewhere = !on_body && (finding.id.body || rival.joint != finding.id.joint);
    return {fit.effect, rival.effect + (elsewhere ? " of " + joint_of(rival.joint).name : "")};
  }

  const Finding* finding_of(const EffectId& id) const {
    for (const Finding& finding : conclusion_.outcome.found) {
      if (finding.id == id) return &finding;
    }
    return nullptr;
  }

  JointDiagnosis still(std::size_t j) {
    JointDiagnosis out{joint_of(j).name, joint_of(j).torque_unit(), j + 1, Verdict::not_excited};
    for (const std::string_view effect : joint_effect_names()) {
      if (!find_effect(effect)->curve) out.not_identifiable.emplace_back(effect);
    }
    advise(fmt::format("record a log in which joint {} moves", j + 1));
    return out;
  }

  /// Effects that were found at a joint. @param open those that are undecided
  std::vector<NamedEffect> effects_of(std::size_t j, std::vector<std::vector<std::string>>& open) {
    std::vector<NamedEffect> out;
    const auto& fits = joints_of(conclusion_.model)[j].effects;
    for (std::size_t e = 0; e < fits.size(); ++e) {
      const Finding* finding = finding_of({false, j, e});
      if (finding == nullptr) continue;  // nominal, or a link encoder's
      if (finding->evidence.undecided) open.push_back(undecided(fits[e], *finding));
      if (finding->evidence.certainty == Certainty::unlisted) continue;
      if (part_of_tilt(j, fits[e])) {
        notes_.push_back(fmt::format(
            "{}: the tilt makes masses about this axis felt, which no upright robot shows: the model carries them as "
            "{}",
            joint_of(j).name, fits[e].effect));
        continue;
      }
      out.push_back(named(fits[e], *finding));
      out.back().model_share = model_share(j, e);
    }
    for (const Likely& likely : conclusion_.likely) {
      if (!likely.finding.id.body && likely.finding.id.joint == j) out.push_back(named(likely.fit, likely.finding));
    }
    for (const DeflectionEffect& seen : conclusion_.deflections.found) {
      if (seen.joint == j) out.push_back(named(seen));
    }
    return out;
  }

  NamedEffect named(const DeflectionEffect& seen) const {
    const JointFit& joint = joints_of(conclusion_.model)[seen.joint];
    const auto place = std::find_if(joint.effects.begin(), joint.effects.end(),
                                    [&](const EffectFit& fit) { return fit.named && fit.effect == seen.fit.effect; });
    NamedEffect out;
    out.effect = seen.fit.effect;
    out.parameters = parameters_of(seen.fit, joint_of(seen.joint), joint.rated_torque);
    out.score = seen.score;
    // The score is twice the logarithm of a Bayes factor.
    out.odds_nothing = seen.score / (2 * std::numbers::ln10);
    out.established = out.odds_nothing >= options_.gate.established;
    if (seen.held_out) out.held_out_closure = seen.closure;
    out.signal = "q - qlink";
    out.model_share = model_share(seen.joint, static_cast<std::size_t>(place - joint.effects.begin()));
    return out;
  }

  void note_other_test_logs(std::size_t j, const GapFigures& figures) {
    if (conclusion_.test.empty() || figures.after <= report_.much_larger * figures.gate_after) return;
    notes_.push_back(fmt::format(
        "{}: the error is {:.3g} {} on the test logs and {:.3g} on the logs that judged: another load, tool "
        "or motion that these did not have?",
        joint_of(j).name, figures.after, joint_of(j).torque_unit(), figures.gate_after));
  }

  void note_error_of_law(std::size_t j) {
    notes_.push_back(fmt::format(
        "{}: something small beside its dry friction is left in its own motion; it is taken for the form of "
        "the friction's sign, tanh(dq / width)",
        joint_of(j).name));
  }
  void note_impacts(std::size_t j) {
    const std::optional<Impacts>& impacts = conclusion_.impacts[j];
    if (!impacts) return;
    notes_.push_back(fmt::format(
        "{}: {:.2g} impacts a second that are shorter than the torque's band shows, {:.2g} in the baseline; the "
        "largest, {:.2g} {}, at {:.3f} s of {}: a gap that closes, something that strikes, a loose connector?",
        joint_of(j).name, impacts->per_second, impacts->healthy, impacts->largest, joint_of(j).torque_unit(),
        impacts->t, impacts->log));
  }

  /// Whether the test logs bear out what the logs that judged said. None: there are no test logs.
  std::optional<bool> carries_over(const GapFigures& figures) const {
    if (conclusion_.test.empty()) return {};
    return figures.after <= report_.risen * figures.before;
  }

  void note_risen_error(std::size_t j, const GapFigures& figures) {
    notes_.push_back(fmt::format(
        "{0}: on the test logs the error rises from {1:.3g} to {2:.3g} {5}, on the logs that judged it goes from "
        "{3:.3g} to {4:.3g}: what was found does not carry over to their motion",
        joint_of(j).name, figures.before, figures.after, figures.gate_before, figures.gate_after,
        joint_of(j).torque_unit()));
  }

  void note_doubtful_direction(std::size_t j) {
    const double doubtful = conclusion_.doubtful[j];
    if (doubtful <= report_.much_doubt) return;
    const double step = conclusion_.now.front().filter.encoder_step[j];
    const bool lost = std::any_of(conclusion_.now.begin(), conclusion_.now.end(), [&](const ProcessedLog& log) {
      return log.lost_velocity.size() > 0 && log.lost_velocity.col(static_cast<Index>(j)).maxCoeff() > 0;
    });
    notes_.push_back(fmt::format(
        "{}: in {:.0f} % of the rows the {}encoder{} does not tell which way it moves; what is unexplained may be "
        "that: faster motion or a finer encoder would tell",
        joint_of(j).name, 100 * doubtful, lost ? "filtered " : "",
        step > 0 ? fmt::format(" (steps of {:.2g} {})", step, joint_of(j).position_unit()) : std::string()));
  }

  void advise_on_gap(std::size_t j, const std::vector<GapRegion>& regions) {
    std::vector<const ProcessedLog*> logs;
    for (const ProcessedLog& log : conclusion_.now) logs.push_back(&log);
    std::string which;
    // Nobody can record more of a time, or of a frequency.
    if (!regions.empty() && regions[0].signal != "t" && regions[0].signal != "frequency")
      which = ", " + words_of(regions[0], robot_of(conclusion_.nominal), j, logs);
    advise(fmt::format("record more of joint {}{}", j + 1, which));
  }

  static GapPlace place(const Impacts& impacts) {
    return {fmt::format("impacts, the largest at {:.2f} s of {}", impacts.t, impacts.log),
            {{"t", 0, impacts.t - 0.05, impacts.t + 0.05, {}, {}, impacts.log}}};
  }

  /// Whether the model has an effect that a joint feels and whose name is not established.
  /// @param listed such that are listed, or undecided, else such that are not
  bool is_there(std::size_t j, bool listed) const {
    const auto& found = conclusion_.outcome.found;
    return std::any_of(found.begin(), found.end(), [&](const Finding& f) {
      const Certainty certainty = f.evidence.certainty;
      return f.evidence.there && certainty != Certainty::established &&
             (f.evidence.undecided || certainty == Certainty::likely) == listed &&
             (f.id.body ? is_felt(f.id, j) : f.id.joint == j);
    });
  }
  /// In the gate; the number of what it judged: it has none.
  std::size_t place_at_gate(const EffectId& id) const {
    const std::vector<EffectId>& all = conclusion_.judged;
    return static_cast<std::size_t>(std::find(all.begin(), all.end(), id) - all.begin());
  }
  bool is_felt(const EffectId& on_robot, std::size_t j) const {
    const std::size_t i = place_at_gate(on_robot);
    return i < conclusion_.judged.size() &&
           conclusion_.gate.held.alone[i][static_cast<Index>(j)] > options_.gate.least_gain;
  }

  JointDiagnosis moving(std::size_t j) {
    const auto k = static_cast<Index>(j);
    const GapFigures of = errors_(j);
    JointDiagnosis out{joint_of(j).name, joint_of(j).torque_unit(), j + 1};
    out.effects = effects_of(j, out.undecided);
    std::sort(out.effects.begin(), out.effects.end(),
              [](const NamedEffect& a, const NamedEffect& b) { return a.score > b.score; });
    const auto any = [&](auto&& of_effect) { return std::any_of(out.effects.begin(), out.effects.end(), of_effect); };
    const std::optional<Impacts>& impacts = conclusion_.impacts[j];
    const std::vector<std::size_t>& bends = conclusion_.deflections.unexplained;
    JointState state;
    state.structured = conclusion_.outcome.structured(j) && !conclusion_.gate.of_law[j];
    state.remains = conclusion_.gate.remains[j];
    state.established = any([](const NamedEffect& e) { return e.established; });
    state.reached = robot_reaches(k);
    state.there = is_there(j, true);
    state.nameless = is_there(j, false);
    state.impacts = impacts.has_value();
    const std::optional<CurveResult>& curve = conclusion_.curves[j];
    state.wanders = curve && !curve->of_motion();
    state.curved = curve && curve->of_motion();
    state.bends = std::find(bends.begin(), bends.end(), j) != bends.end();
    out.verdict = verdict_of(state);

    note_other_test_logs(j, of);
    note_impacts(j);
    if (conclusion_.gate.of_law[j] && out.verdict == Verdict::nothing_missing) note_error_of_law(j);
    const bool changed = state.established || state.there || state.nameless || state.reached;
    // A finding elsewhere may reach this joint through the base parameters.
    if (changed || of.after != of.before) out.carries_over = carries_over(of);
    if (out.carries_over == false) note_risen_error(j, of);
    const bool left = out.verdict == Verdict::unexplained || out.verdict == Verdict::partly_explained;
    // What only bends leaves no gap in the torque, and noise alone has nothing to close.
    const bool of_torque = state.there || state.nameless || state.reached ||
                           (left && (state.structured || state.remains || state.wanders || state.curved)) ||
                           any([](const NamedEffect& e) { return e.established && e.signal.empty(); });
    const bool only_impacts = state.impacts && !changed && !state.structured && !state.wanders && !state.curved;
    if (only_impacts) {
      out.where = place(*impacts);
      advise(fmt::format("look at the raw torque of joint {} there; an encoder on its link would show a gap", j + 1));
    } else if (of_torque) {
      out.where = place_of_gap(j, std::min(of.floor, of.before), left ? curve : std::nullopt);
    }
    if (left && of_torque) note_doubtful_direction(j);
    if (state.wanders) {
      advise(fmt::format("joint {}: note what switches on and off nearby, and record the same motion at another time",
                         j + 1));
    } else if (left && !only_impacts) {
      advise_on_gap(j, out.where.regions);
    }
    if (state.bends) {
      notes_.push_back(
          fmt::format("{}: the deflection that the link encoder shows is none that has a name", joint_of(j).name));
    }
    out.gap_before = of.before;
    out.gap_after = of.after;
    out.gate_before = of.gate_before;
    out.gate_after = of.gate_after;
    // On other logs than those that judged, either model may show that there is less noise.
    out.noise_floor = std::min({of.floor, of.before, of.after});
    // What wanders was taken off before anything was judged, and is no noise.
    if (state.wanders) *out.noise_floor *= std::sqrt(1 - curve->closes);
    if (of_torque) {
      out.closure = conclusion_.gate.closure[k];
      const Share share = diagnosis::left_of(conclusion_.gate.held, conclusion_.gate.gap[k], k);
      out.left = GapLeft{share.share, share.low, share.high};
      if (state.wanders || state.curved) out.left = more_of(*out.left, left_of(*curve, of));
    }
    if (left) out.curve = curve;
    out.not_identifiable = conclusion_.outcome.not_identifiable[j];
    out.state_p = conclusion_.outcome.lack[j].state_p;
    out.time_p = conclusion_.outcome.lack[j].time_p;
    return out;
  }

  static GapLeft more_of(const GapLeft& a, const GapLeft& b) {
    return {std::max(a.share, b.share), std::max(a.low, b.low), std::max(a.high, b.high)};
  }
  /// .. of what wanders.
  static GapLeft left_of(const CurveResult& curve, const GapFigures& of) {
    const double after = of.gate_after * of.gate_after, closed = std::max(of.gate_before * of.gate_before - after, 0.0);
    const auto share = [&](double closes) {
      const double left = std::clamp(closes, 0.0, 1.0) * after;
      return left > 0 ? left / (left + closed) : 0;
    };
    constexpr double deviations_of_95 = 1.96;
    const double reach = deviations_of_95 * curve.closes_std;
    return {share(curve.closes), share(curve.closes - reach), share(curve.closes + reach)};
  }

  /// Where the gap of the model before sits, on the logs that fit and those that judge.
  GapPlace place_of_gap(std::size_t j, double noise, const std::optional<CurveResult>& curve) const {
    std::vector<const ProcessedLog*> logs;
    std::vector<VectorXd> loads, errors;
    ModelValue rigid = conclusion_.nominal;
    for (JointFit& fit : joints_of(rigid)) {
      fit.effects.clear();
      fit.bls.reset();
    }
    for (const ProcessedLog& log : conclusion_.now) {
      logs.push_back(&log);
      loads.push_back(predict_joint(rigid, log, j));
      errors.push_back(error_of(log, predict_joint(conclusion_.nominal, log, j), j));
    }
    std::optional<GapRegion> of_curve;
    if (curve) of_curve = place_of(*curve);
    return where(robot_of(conclusion_.nominal), j, logs, loads, errors, noise, report_, of_curve);
  }

  /// Whether a named effect on the robot is felt at a joint.
  bool robot_reaches(Index joint) const {
    for (std::size_t i = 0; i < conclusion_.judged.size(); ++i) {
      const EffectId& id = conclusion_.judged[i];
      if (id.body && body_of(conclusion_.model)[id.effect].named &&
          conclusion_.gate.held.alone[i][joint] > options_.gate.least_gain)
        return true;
    }
    return false;
  }

  std::vector<NamedEffect> of_robot(std::vector<std::vector<std::string>>& open) {
    std::vector<NamedEffect> robot;
    for (std::size_t e = 0; e < body_of(conclusion_.model).size(); ++e) {
      const EffectId id{true, 0, e};
      const Finding* finding = finding_of(id);
      if (finding == nullptr) continue;
      if (finding->evidence.undecided) open.push_back(undecided(body_of(conclusion_.model)[e], *finding));
      if (finding->evidence.certainty == Certainty::unlisted) continue;
      NamedEffect one = named(body_of(conclusion_.model)[e], *finding);
      one.joints.emplace();
      for (std::size_t j = 0; j < joints_of(conclusion_.model).size(); ++j) {
        if (is_felt(id, j)) one.joints->push_back(j + 1);
      }
      one.model_share = body_share(e);
      robot.push_back(std::move(one));
    }
    for (const Likely& likely : conclusion_.likely) {
      if (!likely.finding.id.body) continue;
      NamedEffect one = named(likely.fit, likely.finding);
      one.joints.emplace();
      for (const std::size_t j : likely.joints) one.joints->push_back(j + 1);
      robot.push_back(std::move(one));
    }
    return robot;
  }

  const Conclusion& conclusion_;
  const Options& options_;
  const ReportOptions& report_;
  const GapErrors errors_;
  std::string next_;
  std::vector<std::string> notes_;
};

}  // namespace

std::vector<EffectId> judged_by(const Gate& gate, const Linearised& problem) {
  std::vector<EffectId> out;
  for (const std::size_t g : gate.groups) out.push_back(problem.groups()[g].id);
  return out;
}

std::vector<double> doubtful_shares(const Linearised& problem) {
  std::vector<double> out;
  for (std::size_t j = 0; j < problem.joints(); ++j) out.push_back(problem.noise().doubtful_share(j));
  return out;
}

std::string gate_of(const std::vector<ProcessedLog>& now) {
  if (std::any_of(now.begin(), now.end(), [](const ProcessedLog& log) { return log.role == Role::validate; }))
    return "validate logs";
  return fmt::format("{}, each judged by coefficients fitted to the others",
                     now.size() == 1 ? "blocks of the train log" : "train logs, whole or in parts");
}

DiagnosisResult verdicts(const Conclusion& conclusion) { return ReportWriter(conclusion).all(); }

}  // namespace fxdyn::diagnosis
