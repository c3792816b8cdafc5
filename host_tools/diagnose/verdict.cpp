#include "host_tools/diagnose/verdict.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "host_tools/diagnose/where.hpp"
#include "host_tools/effects/effect_roles.hpp"
#include "host_tools/effects/effects.hpp"
#include "host_tools/effects/evaluator.hpp"
#include "host_tools/effects/identified_model.hpp"
#include "host_tools/support/parallel.hpp"

namespace fxdyn::diagnosis {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
bool is_validate(const ProcessedLog& log) { return log.role == Role::validate; }

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

/// Filtered error of a joint over a log, full rate.
VectorXd error_of(const ProcessedLog& log, const MatrixXd& torque, std::size_t joint) {
  const auto j = static_cast<Index>(joint);
  return log.filter_columns(log.tau.col(j) - torque.col(j)).col(0);
}

/// Makes the result of what was concluded.
class ReportWriter {
 public:
  explicit ReportWriter(const Conclusion& conclusion)
      : conclusion_(conclusion),
        problem_(*conclusion.outcome.problem),
        report_(conclusion.outcome.models.options.report) {
    // Figures are on logs that decided nothing, where there are any.
    for (const ProcessedLog& log : conclusion_.test) shown_.push_back(&log);
    figures_on_ = "test logs";
    if (shown_.empty()) {
      figures_on_ = "validate logs, which also decided which names stay";
      for (const ProcessedLog& log : conclusion_.now) {
        if (is_validate(log)) shown_.push_back(&log);
      }
    }
    blocks_only_ = shown_.empty();
    if (blocks_only_) {
      figures_on_ = gate_of(conclusion_.now);
      for (const ProcessedLog& log : conclusion_.now) shown_.push_back(&log);
    }
    const bool judged_alone = std::any_of(conclusion_.now.begin(), conclusion_.now.end(), is_validate);
    for (const ProcessedLog& log : conclusion_.now) {
      if (!judged_alone || is_validate(log)) judges_.push_back(&log);
    }
    before_.resize(shown_.size());
    after_.resize(shown_.size());
    judged_.resize(judges_.size());
    parallel_for(shown_.size() + judges_.size(), [&](std::size_t l) {
      if (l >= shown_.size()) {
        const std::size_t k = l - shown_.size();
        judged_[k] = predict(conclusion_.model, *judges_[k]);
        return;
      }
      before_[l] = predict(conclusion_.nominal, *shown_[l]);
      after_[l] = predict(conclusion_.model, *shown_[l]);
    });
  }

  DiagnosisResult all() {
    DiagnosisResult out;
    for (std::size_t j = 0; j < conclusion_.model.joints.size(); ++j)
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
                         problem_.has_baseline() ? "other poses and loads"
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
    out.figures_on = figures_on_;
    out.baseline = problem_.has_baseline();
    out.notes = notes_;
    return out;
  }

 private:
  /// Errors of what was fitted come out too small by the square root of this.
  double judged_over_fitted(Index joint) const {
    const HeldOut& held = conclusion_.gate.held;
    return held.fitted_rows[joint] / std::max(held.rows[joint], 1.0) * held.after[joint] /
           std::max(held.fitted_after[joint], 1e-300);
  }

  /// RMS error of a joint on the logs that judged the names.
  double gate_error(std::size_t j) const {
    double square = 0, count = 0;
    for (std::size_t l = 0; l < judges_.size(); ++l) {
      const ProcessedLog& log = *judges_[l];
      const Index samples = log.last - log.first;
      square += error_of(log, judged_[l], j).segment(log.first, samples).squaredNorm();
      count += static_cast<double>(samples);
    }
    if (!is_validate(*judges_.front())) square *= judged_over_fitted(static_cast<Index>(j));
    return std::sqrt(square / std::max(count, 1.0));
  }

  const Joint& joint_of(std::size_t j) const { return conclusion_.model.robot.joints[j]; }

  void advise(const std::string& text) {
    if (!text.empty() && next_.find(text) == std::string::npos) next_ += (next_.empty() ? "" : "; ") + text;
  }

  /// Share of the model's torque that an effect has.
  double model_share(std::size_t j, std::size_t e) const {
    IdentifiedModel less = conclusion_.model;
    less.joints[j].effects.erase(less.joints[j].effects.begin() + static_cast<std::ptrdiff_t>(e));
    const MatrixXd without = predict(less, *shown_.front());
    const auto k = static_cast<Index>(j);
    return (after_.front() - without).col(k).norm() / std::max(after_.front().col(k).norm(), 1e-300);
  }

  /// .. an effect on the robot, at the joint where it is largest.
  double body_share(std::size_t e) const {
    IdentifiedModel less = conclusion_.model;
    less.body.erase(less.body.begin() + static_cast<std::ptrdiff_t>(e));
    const MatrixXd change = after_.front() - predict(less, *shown_.front());
    double most = 0;
    for (Index k = 0; k < change.cols(); ++k)
      most = std::max(most, change.col(k).norm() / std::max(after_.front().col(k).norm(), 1e-300));
    return most;
  }

  /// A tilted base makes the masses about a first joint that stood upright felt, as a balancer there would be: with a
  /// tilt they are its own.
  bool part_of_tilt(std::size_t j, const EffectFit& fit) const {
    if (j != 0 || !find_effect(fit.effect)->as_masses_about_axis) return false;
    const Robot& robot = conclusion_.model.robot;
    const Eigen::Vector3d axis = robot.joints[0].origin.linear() * robot.joints[0].axis;
    const bool upright = axis.cross(robot.gravity).norm() < report_.upright * robot.gravity.norm();
    return upright && std::any_of(conclusion_.model.body.begin(), conclusion_.model.body.end(),
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
    out.parameters = parameters_of(fit, joint_of(id.joint), conclusion_.model.joints[id.joint].rated_torque);
    out.score = finding.score;
    out.held_out_closure = finding.evidence.closure;
    out.established = finding.evidence.certainty == Certainty::established;
    out.odds_nothing = finding.evidence.against_nothing;
    out.odds_rival = finding.evidence.against_rival;
    if (finding.rival) out.rival = finding.rival->candidate.effect;
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
    const EffectCandidate& rival = finding.rival->candidate;
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
    for (const std::string_view effect : joint_effect_names()) out.not_identifiable.emplace_back(effect);
    advise(fmt::format("record a log in which joint {} moves", j + 1));
    return out;
  }

  /// RMS errors of a joint on the logs that are shown [N*m | N].
  struct Figures {
    double before = 0, after = 0;
    double gate = 0;   ///< on the logs that judged
    double floor = 0;  ///< of the noise
  };

  Figures figures(std::size_t j) const {
    const auto k = static_cast<Index>(j);
    const HeldOut& held = conclusion_.gate.held;
    Figures out;
    double before = 0, after = 0, count = 0;
    for (std::size_t l = 0; l < shown_.size(); ++l) {
      const ProcessedLog& log = *shown_[l];
      const Index samples = log.last - log.first;
      before += error_of(log, before_[l], j).segment(log.first, samples).squaredNorm();
      after += error_of(log, after_[l], j).segment(log.first, samples).squaredNorm();
      count += static_cast<double>(samples);
    }
    if (blocks_only_) {
      // Errors of what was fitted, by the ratio of judged to fitted ones.
      const double rows = held.fitted_rows[k] / std::max(held.rows[k], 1.0);
      before *= rows * held.before[k] / std::max(held.fitted_before[k], 1e-300);
      after *= judged_over_fitted(k);
    }
    out.before = std::sqrt(before / std::max(count, 1.0));
    out.after = std::sqrt(after / std::max(count, 1.0));
    // Of the logs that judged: what another motion shows on top is no noise.
    out.gate = blocks_only_ ? out.after : gate_error(j);
    out.floor = out.gate * std::sqrt(std::max(0.0, 1 - held.leftover[k] / std::max(held.after[k], 1e-300)));
    return out;
  }

  /// Effects that were found at a joint. @param open those that are undecided
  std::vector<NamedEffect> effects_of(std::size_t j, std::vector<std::vector<std::string>>& open) {
    std::vector<NamedEffect> out;
    const auto& fits = conclusion_.model.joints[j].effects;
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
    const JointFit& joint = conclusion_.model.joints[seen.joint];
    const auto place = std::find_if(joint.effects.begin(), joint.effects.end(),
                                    [&](const EffectFit& fit) { return fit.named && fit.effect == seen.fit.effect; });
    NamedEffect out;
    out.effect = seen.fit.effect;
    out.parameters = parameters_of(seen.fit, joint_of(seen.joint), joint.rated_torque);
    out.score = seen.score;
    // The score is twice the logarithm of a Bayes factor.
    out.odds_nothing = seen.score / (2 * std::numbers::ln10);
    out.established = out.odds_nothing >= problem_.models().options.gate.established;
    if (seen.held_out) out.held_out_closure = seen.closure;
    out.signal = "q - qlink";
    out.model_share = model_share(seen.joint, static_cast<std::size_t>(place - joint.effects.begin()));
    return out;
  }

  void note_other_test_logs(std::size_t j, const Figures& figures) {
    if (conclusion_.test.empty() || figures.after <= report_.much_larger * figures.gate) return;
    notes_.push_back(fmt::format(
        "{}: the error is {:.3g} {} on the test logs and {:.3g} on the logs that judged: another load, tool "
        "or motion that these did not have?",
        joint_of(j).name, figures.after, joint_of(j).torque_unit(), figures.gate));
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

  void note_risen_error(std::size_t j, const Figures& figures) {
    if (conclusion_.test.empty() || figures.after <= report_.risen * figures.before) return;
    notes_.push_back(
        fmt::format("{}: on the test logs the error rises from {:.3g} to {:.3g} {}: what was found does not carry "
                    "over to their motion",
                    joint_of(j).name, figures.before, figures.after, joint_of(j).torque_unit()));
  }

  void note_doubtful_direction(std::size_t j) {
    const double doubtful = problem_.noise().doubtful_share(j);
    if (doubtful <= report_.much_doubt) return;
    const double step = conclusion_.now.front().filter.encoder_step[j];
    notes_.push_back(fmt::format(
        "{}: in {:.0f} % of the rows the encoder{} does not tell which way it moves; what is unexplained may be "
        "that: faster "
        "motion or a finer encoder would tell",
        joint_of(j).name, 100 * doubtful,
        step > 0 ? fmt::format(" (steps of {:.2g} {})", step, joint_of(j).position_unit()) : std::string()));
  }

  void advise_on_gap(std::size_t j, const std::vector<GapRegion>& regions) {
    std::string which;
    if (!regions.empty())
      which = fmt::format(" where the gap sits ({} from {:.3g} to {:.3g})", regions[0].signal, regions[0].from,
                          regions[0].to);
    advise(fmt::format("record more of joint {}{}", j + 1, which));
  }

  static GapPlace place(const Impacts& impacts) {
    return {fmt::format("impacts, the largest at {:.2f} s of {}", impacts.t, impacts.log),
            {{"t", impacts.t - 0.05, impacts.t + 0.05, {}, {}, impacts.log}}};
  }

  /// Whether the model has an effect at a joint whose name is not established.
  bool is_there(std::size_t j) const {
    const auto& found = conclusion_.outcome.found;
    return std::any_of(found.begin(), found.end(), [&](const Finding& f) {
      return !f.id.body && f.id.joint == j && f.evidence.there && f.evidence.certainty != Certainty::established;
    });
  }

  JointDiagnosis moving(std::size_t j) {
    const auto k = static_cast<Index>(j);
    const Figures of = figures(j);
    JointDiagnosis out{joint_of(j).name, joint_of(j).torque_unit(), j + 1};
    out.effects = effects_of(j, out.undecided);
    std::sort(out.effects.begin(), out.effects.end(),
              [](const NamedEffect& a, const NamedEffect& b) { return a.score > b.score; });
    const auto any = [&](auto&& of_effect) { return std::any_of(out.effects.begin(), out.effects.end(), of_effect); };
    const std::optional<Impacts>& impacts = conclusion_.impacts[j];
    const std::vector<std::size_t>& bends = conclusion_.deflections.unexplained;
    JointState state;
    state.structured = conclusion_.outcome.structured(j);
    state.remains = conclusion_.gate.remains[j];
    state.established = any([](const NamedEffect& e) { return e.established; });
    state.reached = robot_reaches(k);
    state.there = is_there(j);
    state.likely = any([](const NamedEffect& e) { return !e.established; });
    state.impacts = impacts.has_value();
    state.bends = std::find(bends.begin(), bends.end(), j) != bends.end();
    out.verdict = verdict_of(state);

    note_other_test_logs(j, of);
    note_impacts(j);
    const bool changed = state.established || state.there || state.reached;
    if (changed) note_risen_error(j, of);
    const bool left = out.verdict == Verdict::unexplained || out.verdict == Verdict::partly_explained;
    // What only bends leaves no gap in the torque, and noise alone has nothing to close.
    const bool of_torque = state.there || state.reached || (left && (state.structured || state.likely)) ||
                           any([](const NamedEffect& e) { return e.signal.empty(); });
    const bool only_impacts = state.impacts && !changed && !state.structured;
    if (only_impacts) {
      out.where = place(*impacts);
      advise(fmt::format("look at the raw torque of joint {} there; an encoder on its link would show a gap", j + 1));
    } else if (of_torque) {
      out.where = place_of_gap(j, std::min(of.floor, of.before));
    }
    if (left && of_torque) note_doubtful_direction(j);
    if (left && !only_impacts) advise_on_gap(j, out.where.regions);
    if (state.bends) {
      notes_.push_back(
          fmt::format("{}: the deflection that the link encoder shows is none that has a name", joint_of(j).name));
    }
    out.gap_before = of.before;
    out.gap_after = of.after;
    out.noise_floor = std::min(of.floor, of.after);
    if (of_torque) {
      out.closure = conclusion_.gate.closure[k];
      const Share share = left_of(conclusion_.gate.held, conclusion_.gate.gap[k], k);
      out.left = GapLeft{share.share, share.low, share.high};
    }
    out.not_identifiable = conclusion_.outcome.not_identifiable[j];
    out.state_p = conclusion_.outcome.lack[j].state_p;
    out.time_p = conclusion_.outcome.lack[j].time_p;
    return out;
  }

  /// Where the gap of the model before sits, on the logs that fit and those that judge.
  GapPlace place_of_gap(std::size_t j, double noise) const {
    std::vector<const ProcessedLog*> logs;
    std::vector<VectorXd> errors;
    for (const ProcessedLog& log : conclusion_.now) {
      logs.push_back(&log);
      errors.push_back(error_of(log, predict(conclusion_.nominal, log), j));
    }
    return where(conclusion_.nominal, logs, j, errors, noise, report_);
  }

  /// Whether a named effect on the robot is felt at a joint.
  bool robot_reaches(Index joint) const {
    for (std::size_t i = 0; i < conclusion_.gate.groups.size(); ++i) {
      const Group& group = problem_.groups()[conclusion_.gate.groups[i]];
      if (group.on_body && conclusion_.model.body[group.id.effect].named &&
          conclusion_.gate.held.alone[i][joint] > problem_.models().options.gate.least_felt)
        return true;
    }
    return false;
  }

  std::vector<NamedEffect> of_robot(std::vector<std::vector<std::string>>& open) {
    std::vector<NamedEffect> robot;
    const Gate& gate = conclusion_.gate;
    for (std::size_t e = 0; e < conclusion_.model.body.size(); ++e) {
      const EffectId id{true, 0, e};
      const Finding* finding = finding_of(id);
      if (finding == nullptr) continue;
      if (finding->evidence.undecided) open.push_back(undecided(conclusion_.model.body[e], *finding));
      if (finding->evidence.certainty == Certainty::unlisted) continue;
      NamedEffect one = named(conclusion_.model.body[e], *finding);
      const std::size_t i = gate.place(problem_, id);
      one.joints.emplace();
      for (std::size_t j = 0; j < conclusion_.model.joints.size(); ++j) {
        if (gate.held.alone[i][static_cast<Index>(j)] > problem_.models().options.gate.least_felt)
          one.joints->push_back(j + 1);
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
  const Linearised& problem_;
  const ReportOptions& report_;
  std::vector<const ProcessedLog*> shown_;
  std::string figures_on_, next_;
  std::vector<std::string> notes_;
  bool blocks_only_ = false;
  std::vector<MatrixXd> before_, after_;
  std::vector<const ProcessedLog*> judges_;  ///< what accepted the names: validate logs, or the train logs
  std::vector<MatrixXd> judged_;             ///< .. and the model's torque on them
};

}  // namespace

std::string gate_of(const std::vector<ProcessedLog>& now) {
  if (std::any_of(now.begin(), now.end(), is_validate)) return "validate logs";
  return fmt::format("{}, each judged by coefficients fitted to the others",
                     now.size() == 1 ? "blocks of the train log" : "train logs, whole or in parts");
}

DiagnosisResult verdicts(const Conclusion& conclusion) { return ReportWriter(conclusion).all(); }

}  // namespace fxdyn::diagnosis
