#include "host_tools/diagnose/verdict.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <set>

#include "host_tools/diagnose/where.hpp"
#include "host_tools/effects/effects.hpp"
#include "host_tools/effects/evaluator.hpp"
#include "host_tools/effects/identified_model.hpp"
#include "host_tools/excite/sight.hpp"
#include "host_tools/support/parallel.hpp"
#include "model/effects/gravity_compensator.hpp"
#include "model/effects/gravity_tilt.hpp"

namespace fxdyn::diagnosis {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using nlohmann::json;

/// Times the error before: what test logs say against a name.
constexpr double risen = 1.05;
/// Times the error of the logs that judged: the test logs hold something else.
constexpr double much_larger = 2;
/// Share of rows.
constexpr double much_doubt = 0.1;

bool is_validate(const ProcessedLog& log) { return log.role == Role::validate; }

/// @param rated torque [N*m | N]
json parameters_json(const EffectFit& fit, const Joint& joint, double rated) {
  json out = json::array();
  const EffectInfo& info = *find_effect(fit.effect);
  const auto add = [&](const ParameterInfo& p, double value, const std::vector<double>& std, std::size_t i) {
    const bool turns = joint.type == JointType::revolute;
    json one = {{"name", p.name}, {"value", value}, {"unit", turns ? p.unit : p.unit_prismatic}};
    // A torque that is less known than the joint's whole is shared with another effect, as a spring's offset.
    const bool known = i < std.size() && std[i] > 0 && !(p.unit == "N*m" && rated > 0 && std[i] > rated);
    one["std"] = known ? json(std[i]) : json(nullptr);
    out.push_back(one);
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

class Teller {
 public:
  explicit Teller(const Conclusion& told) : t_(told), at_(*told.outcome.at) {
    // Figures are on logs that decided nothing, where there are any.
    for (const ProcessedLog& log : t_.test) shown_.push_back(&log);
    figures_on_ = "test logs";
    if (shown_.empty()) {
      figures_on_ = "validate logs, which also decided which names stay";
      for (const ProcessedLog& log : t_.now) {
        if (is_validate(log)) shown_.push_back(&log);
      }
    }
    blocks_only_ = shown_.empty();
    if (blocks_only_) {
      figures_on_ = gate_of(t_.now);
      for (const ProcessedLog& log : t_.now) shown_.push_back(&log);
    }
    const bool judged_alone = std::any_of(t_.now.begin(), t_.now.end(), is_validate);
    for (const ProcessedLog& log : t_.now) {
      if (!judged_alone || is_validate(log)) judges_.push_back(&log);
    }
    before_.resize(shown_.size());
    after_.resize(shown_.size());
    judged_.resize(judges_.size());
    parallel_for(shown_.size() + judges_.size(), [&](std::size_t l) {
      if (l >= shown_.size()) {
        judged_[l - shown_.size()] = predict(t_.model, *judges_[l - shown_.size()]);
        return;
      }
      before_[l] = predict(t_.nominal, *shown_[l]);
      after_[l] = predict(t_.model, *shown_[l]);
    });
  }

  json all() {
    json joints = json::array();
    for (std::size_t j = 0; j < t_.model.joints.size(); ++j) joints.push_back(t_.still[j] ? still(j) : moving(j));
    json resembles = json::array();
    const json robot = of_robot(resembles);
    // A joint whose gap a load closes is explained by it.
    for (json& joint : joints) {
      const bool reached = std::any_of(robot.begin(), robot.end(), [&](const json& r) {
        return std::find(r["joints"].begin(), r["joints"].end(), joint["index"]) != r["joints"].end();
      });
      if (reached && joint["verdict"] == "nothing_missing") joint["verdict"] = "effects_found";
    }
    for (const std::string& effect : t_.outcome.not_identifiable.back()) {
      // What of a load or a tilt is not part of the base parameters, the poses show.
      advise(fmt::format("{}: {}", effect,
                         at_.models().has_baseline ? "other poses and loads"
                                                   : "the same motions recorded without it (role = \"baseline\")"));
    }
    const auto any = [&](const char* verdict) {
      return std::any_of(joints.begin(), joints.end(), [&](const json& joint) { return joint["verdict"] == verdict; });
    };
    const char* verdict = any("unexplained") || !resembles.empty()                ? "unexplained"
                          : any("effects_found") || any_effect_ || !robot.empty() ? "effects_found"
                          : any("not_excited")                                    ? "not_excited"
                                                                                  : "nothing_missing";
    return {{"schema", "fxdyn.diagnosis/1"},
            {"verdict", verdict},
            {"joints", joints},
            {"robot_effects", robot},
            {"resembles", resembles},
            {"not_identifiable", t_.outcome.not_identifiable.back()},
            {"next_experiment", next_},
            {"gate", gate_of(t_.now)},
            {"figures_on", figures_on_},
            {"baseline", at_.models().has_baseline},
            {"notes", notes_}};
  }

 private:
  /// Errors of what was fitted come out too small by the square root of this.
  double judged_over_fitted(Index joint) const {
    const HeldOut& held = t_.gate.held;
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

  const Joint& joint_of(std::size_t j) const { return t_.model.robot.joints[j]; }

  void advise(const std::string& text) {
    if (!text.empty() && next_.find(text) == std::string::npos) next_ += (next_.empty() ? "" : "; ") + text;
  }

  /// Share of the model's torque that an effect has.
  double model_share(std::size_t j, std::size_t e) const {
    IdentifiedModel less = t_.model;
    less.joints[j].effects.erase(less.joints[j].effects.begin() + static_cast<std::ptrdiff_t>(e));
    const MatrixXd without = predict(less, *shown_.front());
    const auto k = static_cast<Index>(j);
    return (after_.front() - without).col(k).norm() / std::max(after_.front().col(k).norm(), 1e-300);
  }

  /// .. an effect on the robot, at the joint where it is largest.
  double body_share(std::size_t e) const {
    IdentifiedModel less = t_.model;
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
    if (j != 0 || fit.effect != GravityCompensator::name) return false;
    const Robot& robot = t_.model.robot;
    const Eigen::Vector3d axis = robot.joints[0].origin.linear() * robot.joints[0].axis;
    const bool upright = axis.cross(robot.gravity).norm() < 1e-3 * robot.gravity.norm();
    return upright && std::any_of(t_.model.body.begin(), t_.model.body.end(),
                                  [](const EffectFit& body) { return body.named && body.effect == GravityTilt::name; });
  }

  json effect_json(const EffectFit& fit, const EffectId& id, double closed) {
    json alternatives = json::array();
    const auto found =
        std::find_if(t_.outcome.found.begin(), t_.outcome.found.end(), [&](const Finding& f) { return f.id == id; });
    const bool known = found != t_.outcome.found.end();
    for (const Alternative& a : known ? found->alternatives : std::vector<Alternative>{}) {
      const bool body = find_effect(a.candidate.effect)->acts_on == ActsOn::body;
      if (!id.body && !body && a.candidate.joint != id.joint) continue;
      if (std::find(alternatives.begin(), alternatives.end(), a.candidate.effect) != alternatives.end()) continue;
      alternatives.push_back(a.candidate.effect);
      const std::size_t joint = id.body && !body ? a.candidate.joint : id.joint;
      const std::string place = id.body && body ? "" : fmt::format(" at joint {}", joint + 1);
      advise(
          fmt::format("{} or {}{}: {}", fit.effect, a.candidate.effect, place, cure(fit.effect, a.candidate.effect)));
    }
    return {{"effect", fit.effect},
            {"parameters", parameters_json(fit, joint_of(id.joint), t_.model.joints[id.joint].rated_torque)},
            {"score", known ? found->score : 0.0},
            {"held_out_closure", closed},
            {"alternatives", alternatives}};
  }

  json still(std::size_t j) {
    json unseen = json::array();
    for (const std::string_view effect : joint_effect_names()) unseen.push_back(effect);
    advise(fmt::format("record a log in which joint {} moves", j + 1));
    return {{"joint", joint_of(j).name},
            {"index", j + 1},
            {"unit", joint_of(j).torque_unit()},
            {"verdict", "not_excited"},
            {"gap_before", nullptr},
            {"gap_after", nullptr},
            {"noise_floor", nullptr},
            {"closure", nullptr},
            {"where", json::array()},
            {"effects", json::array()},
            {"resembles", json::array()},
            {"not_identifiable", unseen},
            {"lack_of_fit", {{"state_p", nullptr}, {"time_p", nullptr}}}};
  }

  json moving(std::size_t j) {
    const auto k = static_cast<Index>(j);
    const HeldOut& held = t_.gate.held;
    double before = 0, after = 0, count = 0;
    std::vector<VectorXd> errors;
    for (std::size_t l = 0; l < shown_.size(); ++l) {
      const ProcessedLog& log = *shown_[l];
      const Index samples = log.last - log.first;
      errors.push_back(error_of(log, before_[l], j));
      before += errors.back().segment(log.first, samples).squaredNorm();
      after += error_of(log, after_[l], j).segment(log.first, samples).squaredNorm();
      count += static_cast<double>(samples);
    }
    if (blocks_only_) {
      // Errors of what was fitted, by the ratio of judged to fitted ones.
      const double rows = held.fitted_rows[k] / std::max(held.rows[k], 1.0);
      before *= rows * held.before[k] / std::max(held.fitted_before[k], 1e-300);
      after *= judged_over_fitted(k);
    }
    const double rms_before = std::sqrt(before / std::max(count, 1.0)),
                 rms_after = std::sqrt(after / std::max(count, 1.0));
    // Of the logs that judged: what another motion shows on top is no noise.
    const double rms_gate = blocks_only_ ? rms_after : gate_error(j),
                 floor = rms_gate * std::sqrt(std::max(0.0, 1 - held.leftover[k] / std::max(held.after[k], 1e-300)));
    json effects = json::array(), resembles = json::array();
    const auto& fits = t_.model.joints[j].effects;
    for (std::size_t e = 0; e < fits.size(); ++e) {
      const EffectId id{false, j, e};
      const std::size_t i = t_.gate.place(at_, id);
      if (i == t_.gate.groups.size()) continue;  // nominal, or a link encoder's
      if (!fits[e].named) {
        resembles.push_back(fits[e].effect);
        continue;
      }
      if (part_of_tilt(j, fits[e])) {
        notes_.push_back(fmt::format(
            "{}: the tilt makes masses about this axis felt, which no upright robot shows: the model carries them as "
            "gravity_compensator",
            joint_of(j).name));
        continue;
      }
      json one = effect_json(fits[e], id, t_.gate.gap[k] > 0 ? held.alone[i][k] / t_.gate.gap[k] : 0);
      one["model_share"] = model_share(j, e);
      effects.push_back(std::move(one));
    }
    for (const DeflectionEffect& seen : t_.deflections.found) {
      if (seen.joint != j) continue;
      const auto at = std::find_if(fits.begin(), fits.end(),
                                   [&](const EffectFit& fit) { return fit.named && fit.effect == seen.fit.effect; });
      effects.push_back({{"effect", seen.fit.effect},
                         {"parameters", parameters_json(seen.fit, joint_of(j), t_.model.joints[j].rated_torque)},
                         {"score", seen.score},
                         {"held_out_closure", seen.held_out ? json(seen.closure) : json(nullptr)},
                         {"signal", "q - qlink"},
                         {"alternatives", json::array()},
                         {"model_share", model_share(j, static_cast<std::size_t>(at - fits.begin()))}});
    }
    const LackOfFit& lack = t_.outcome.lack[j];
    if (!t_.test.empty() && rms_after > much_larger * rms_gate) {
      notes_.push_back(fmt::format(
          "{}: the error is {:.3g} {} on the test logs and {:.3g} on the logs that judged: another load, tool "
          "or motion that these did not have?",
          joint_of(j).name, rms_after, joint_of(j).torque_unit(), rms_gate));
    }
    const bool nothing_found = effects.empty() && !robot_reaches(k);
    const std::optional<Jolts>& jolts = t_.jolts[j];
    if (jolts) {
      notes_.push_back(
          fmt::format("{}: {:.2g} blows a second that are shorter than the torque's band shows, {:.2g} in the "
                      "baseline; the largest, "
                      "{:.2g} {}, at {:.3f} s of {}: a gap that closes, something that strikes, a loose connector?",
                      joint_of(j).name, jolts->per_second, jolts->healthy, jolts->largest, joint_of(j).torque_unit(),
                      jolts->t, jolts->log));
    }
    const bool unexplained =
        (lack.structured() && (nothing_found || t_.gate.remains[j])) || !resembles.empty() || (nothing_found && jolts);
    const std::string verdict = unexplained ? "unexplained" : !effects.empty() ? "effects_found" : "nothing_missing";
    any_effect_ |= !effects.empty();
    // What only bends leaves no gap in the torque, and noise alone has nothing to close.
    const bool of_torque =
        !resembles.empty() || robot_reaches(k) || unexplained ||
        std::any_of(effects.begin(), effects.end(), [](const json& e) { return !e.contains("signal"); });
    const bool of_torque_found = verdict != "nothing_missing" && of_torque;
    const json closure = of_torque ? json(t_.gate.closure[k]) : json(nullptr);
    const bool anything = !effects.empty() || !resembles.empty() || robot_reaches(k);
    if (anything && !t_.test.empty() && rms_after > risen * rms_before) {
      notes_.push_back(
          fmt::format("{}: on the test logs the error rises from {:.3g} to {:.3g} {}: what was found does not carry "
                      "over to their motion",
                      joint_of(j).name, rms_before, rms_after, joint_of(j).torque_unit()));
    }
    std::sort(effects.begin(), effects.end(), [](const json& a, const json& b) { return a["score"] > b["score"]; });
    json regions = json::array();
    const bool only_jolts = jolts && nothing_found && resembles.empty() && !lack.structured();
    if (only_jolts) {
      regions.push_back({{"signal", "t"},
                         {"from", jolts->t - 0.05},
                         {"to", jolts->t + 0.05},
                         {"share_of_gap", nullptr},
                         {"log", jolts->log}});
    } else if (unexplained || of_torque_found || rms_before >= much_larger * floor) {
      regions = where(t_.nominal, shown_, j, errors, std::min(floor, rms_before));
    }
    const double doubtful = at_.doubtful(j);
    if (unexplained && doubtful > much_doubt) {
      const double step = t_.now.front().filter.encoder_step[j];
      notes_.push_back(fmt::format(
          "{}: in {:.0f} % of the rows the encoder{} does not tell which way it moves; what is unexplained may be "
          "that: faster "
          "motion or a finer encoder would tell",
          joint_of(j).name, 100 * doubtful,
          step > 0 ? fmt::format(" (steps of {:.2g} {})", step, joint_of(j).position_unit()) : std::string()));
    }
    if (only_jolts) {
      advise(fmt::format("look at the raw torque of joint {} there; an encoder on its link would show a gap", j + 1));
    } else if (unexplained) {
      std::string which;
      if (!regions.empty())
        which = fmt::format(" where the gap sits ({} from {:.3g} to {:.3g})", regions[0]["signal"].get<std::string>(),
                            regions[0]["from"].get<double>(), regions[0]["to"].get<double>());
      advise(fmt::format("record more of joint {}{}", j + 1, which));
    }
    return {{"joint", joint_of(j).name},
            {"index", j + 1},
            {"unit", joint_of(j).torque_unit()},
            {"verdict", verdict},
            {"gap_before", rms_before},
            {"gap_after", rms_after},
            {"noise_floor", std::min(floor, rms_after)},
            {"closure", closure},
            {"where", regions},
            {"effects", effects},
            {"resembles", resembles},
            {"not_identifiable", t_.outcome.not_identifiable[j]},
            {"lack_of_fit", {{"state_p", lack.state_p}, {"time_p", lack.time_p}}}};
  }

  /// Whether a named effect on the robot is felt at a joint.
  bool robot_reaches(Index joint) const {
    for (std::size_t i = 0; i < t_.gate.groups.size(); ++i) {
      const Group& group = at_.groups()[t_.gate.groups[i]];
      if (group.on_body && t_.model.body[group.id.effect].named && t_.gate.held.alone[i][joint] > least_felt)
        return true;
    }
    return false;
  }

  json of_robot(json& resembles) {
    json robot = json::array();
    for (std::size_t e = 0; e < t_.model.body.size(); ++e) {
      const EffectId id{true, 0, e};
      const std::size_t i = t_.gate.place(at_, id);
      if (i == t_.gate.groups.size()) continue;
      if (!t_.model.body[e].named) {
        resembles.push_back(t_.model.body[e].effect);
        advise(fmt::format("{} explains too little of what it resembles: other loads and postures would tell",
                           t_.model.body[e].effect));
        continue;
      }
      json one = effect_json(t_.model.body[e], id, t_.gate.robot_closure[i]);
      json which = json::array();
      for (std::size_t j = 0; j < t_.model.joints.size(); ++j) {
        if (t_.gate.held.alone[i][static_cast<Index>(j)] > least_felt) which.push_back(j + 1);
      }
      one["joints"] = which;
      one["model_share"] = body_share(e);
      robot.push_back(std::move(one));
    }
    return robot;
  }

  const Conclusion& t_;
  const Linearised& at_;
  std::vector<const ProcessedLog*> shown_;
  std::string figures_on_, next_;
  std::vector<std::string> notes_;
  bool blocks_only_ = false, any_effect_ = false;
  std::vector<MatrixXd> before_, after_;
  std::vector<const ProcessedLog*> judges_;  ///< what accepted the names: validate logs, or the train logs
  std::vector<MatrixXd> judged_;             ///< .. and the model's torque on them
};

}  // namespace

std::string gate_of(const std::vector<ProcessedLog>& now) {
  if (std::any_of(now.begin(), now.end(), is_validate)) return "validate logs";
  return now.size() == 1 ? "blocks of the train log, each judged by coefficients fitted to the others"
                         : "train logs, each judged by coefficients fitted to the others";
}

namespace {

bool is_changed(const Unknown& u) {
  constexpr double beyond = 2;  // times what sessions differ by
  return u.change && u.kind == Unknown::Kind::linear && std::fabs(u.value) >= beyond * u.prior_std;
}

}  // namespace

std::vector<EffectCandidate> changed_effects(const Linearised& at) {
  std::vector<EffectCandidate> out;
  for (const Unknown& u : at.unknowns()) {
    if (!is_changed(u)) continue;
    const EffectFit& fit = at.models().current.joints[u.joint].effects[u.effect];
    // Of these, one that comes on top is the change: torques that add up, with shapes of their own.
    if (find_effect(fit.effect)->changes_by_one_more) out.push_back({fit.effect, u.joint, fit.shape});
  }
  return out;
}

std::vector<std::string> changed_parameters(const Linearised& at) {
  std::vector<std::string> out;
  const Models& models = at.models();
  std::set<std::size_t> joints;
  for (const Unknown& u : at.unknowns()) {
    if (!is_changed(u)) continue;
    joints.insert(u.joint);
    const EffectFit& now = models.current.joints[u.joint].effects[u.effect];
    const Joint& joint = models.current.robot.joints[u.joint];
    const ParameterInfo& p = find_effect(now.effect)->linear[u.index];
    const double today = now.linear[u.index];
    const std::string_view unit = joint.type == JointType::revolute ? p.unit : p.unit_prismatic;
    out.push_back(fmt::format(
        "{}: {} ({}) is {:.4g}{}, {:.4g} in the baseline: more than {} differs from session to session, and part of "
        "the nominal model",
        joint.name, now.effect, p.name, today, unit == "-" ? "" : " " + std::string(unit), today - u.value,
        find_effect(now.effect)->friction ? "friction" : "a healthy robot"));
  }
  const auto& body = models.current.body;
  const bool load = std::any_of(body.begin(), body.end(), [](const EffectFit& fit) { return fit.named; });
  if (load && 2 * joints.size() >= at.joints()) {
    out.push_back(
        fmt::format("friction at {} of {} joints and the load or tilt changed at once: is the baseline of this robot?",
                    joints.size(), at.joints()));
  }
  return out;
}

json verdicts(const Conclusion& told) { return Teller(told).all(); }

}  // namespace fxdyn::diagnosis
