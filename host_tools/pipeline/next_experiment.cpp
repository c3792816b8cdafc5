#include "host_tools/pipeline/next_experiment.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <set>

#include "host_tools/diagnose/options.hpp"
#include "host_tools/effects/effects.hpp"
#include "host_tools/effects/identified_model.hpp"
#include "host_tools/excite/excite.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/files.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::VectorXd;
using nlohmann::json;
namespace fs = std::filesystem;

/// What can't be told from these logs is asked for at this size, share of the rated torque.
constexpr double asked_share = 0.01;

/// Values of an effect's parameters by name, 0 where one is missing.
template <class Infos>
std::vector<double> values_of(const Infos& infos, const std::vector<NamedParameter>& named) {
  std::vector<double> out;
  for (const ParameterInfo& info : infos) {
    const auto found =
        std::find_if(named.begin(), named.end(), [&](const NamedParameter& p) { return p.name == info.name; });
    out.push_back(found == named.end() ? 0 : found->value);
  }
  return out;
}

class Questions {
 public:
  explicit Questions(IdentifiedModel& model) : model_(model) {}

  void likely(const NamedEffect& named, std::size_t joint) {
    const EffectInfo* info = find_effect(named.effect);
    if (named.established || info == nullptr) return;
    // What else is left at the joint keeps this name from being sure: no motion changes that.
    const double sure = diagnosis::GateOptions{}.established;
    if (named.odds_nothing >= sure && named.odds_rival.value_or(sure) >= sure) return;
    EffectQuestion question{
        {named.effect, joint, values_of(info->shape, named.parameters)}, {}, asked_share, "", joint, {}, "likely"};
    // The columns of a load are mass and first moments, not its parameters.
    if (info->acts_on != ActsOn::body) question.coefficients = vector_of(values_of(info->linear, named.parameters));
    if (!question.coefficients.allFinite() || question.coefficients.isZero()) question.coefficients.resize(0);
    set_rival(question, named.rival);
    question.odds_so_far = question.rival.empty() ? named.odds_nothing : named.odds_rival;
    add(std::move(question));
  }

  void undecided(const std::vector<std::string>& set, std::size_t joint) {
    const EffectInfo* info = find_effect(set.front());
    if (info == nullptr) return;
    EffectQuestion question{{set.front(), joint, {}}, {}, asked_share, "", joint, {}, "undecided"};
    std::vector<EffectFit>& fits = info->acts_on == ActsOn::body ? model_.body : model_.joints[joint].effects;
    const auto fit = std::find_if(fits.begin(), fits.end(), [&](const EffectFit& f) {
      return f.effect == set.front() && !f.named;  // with a baseline the healthy one is there as well
    });
    if (fit != fits.end()) {
      question.effect.shape = fit->shape;
      if (info->acts_on != ActsOn::body) question.coefficients = vector_of(fit->linear);
      fits.erase(fit);  // the model must not answer the question
    }
    for (std::size_t i = 1; i < set.size(); ++i) {
      if (set_rival(question, set[i])) add(question);
    }
  }

  void not_identifiable(const std::vector<std::string>& names, std::size_t joint) {
    for (const std::string& name : names) {
      const EffectInfo* info = find_effect(name);
      if (info == nullptr || info->nominal || info->unites_others()) continue;
      add({{name, joint, {}}, {}, asked_share, "", joint, {}, "not_identifiable"});
    }
  }

  void unexplained(const JointDiagnosis& joint) {
    static const std::set<std::string_view> planned{"q", "dq", "speed", "ddq", "direction"};
    for (const GapRegion& region : joint.where.regions) {
      if (!planned.contains(region.signal) || !(region.to > region.from)) continue;
      const std::size_t of = region.joint > 0 ? region.joint - 1 : joint.index - 1;
      open_.places.push_back({joint.index - 1, of, region.signal, region.from, region.to});
      return;  // the clearest
    }
    open_.unplanned.push_back(fmt::format("joint {} is unexplained{}", joint.index,
                                          joint.where.sentence.empty() ? "" : ": " + joint.where.sentence));
  }

  void still(const JointDiagnosis& joint) {
    open_.unplanned.push_back(
        fmt::format("joint {} hardly moved: `fxdyn excite` without --after plans for it", joint.index));
  }

  OpenQuestions all() { return std::move(open_); }

 private:
  static VectorXd vector_of(const std::vector<double>& values) {
    return Eigen::Map<const VectorXd>(values.data(), static_cast<Index>(values.size()));
  }
  /// "spring", or "spring of elbow" where it is at another joint. @return whether there is such an effect
  bool set_rival(EffectQuestion& question, const std::string& text) const {
    const std::size_t at = text.find(" of ");
    question.rival = text.substr(0, at);
    question.rival_joint = question.effect.joint;
    if (find_effect(question.rival) == nullptr) {
      question.rival.clear();
      return false;
    }
    if (at == std::string::npos) return true;
    for (std::size_t j = 0; j < model_.robot.size(); ++j) {
      if (model_.robot.joints[j].name == text.substr(at + 4)) question.rival_joint = j;
    }
    return true;
  }
  /// A question is asked once.
  void add(EffectQuestion question) {
    const bool known = std::any_of(open_.effects.begin(), open_.effects.end(), [&](const EffectQuestion& q) {
      return q.effect.effect == question.effect.effect && q.effect.joint == question.effect.joint &&
             q.rival == question.rival && q.rival_joint == question.rival_joint;
    });
    if (!known) open_.effects.push_back(std::move(question));
  }

  IdentifiedModel& model_;
  OpenQuestions open_;
};

/// RMS below the cut-off that a joint's torque has without structure; where it is not told, 1 % of its rated torque.
VectorXd noise_of(const DiagnosisResult& diagnosis, const IdentifiedModel& model) {
  VectorXd out(static_cast<Index>(model.joints.size()));
  for (std::size_t j = 0; j < model.joints.size(); ++j) {
    const auto& floor = diagnosis.joints[j].noise_floor;
    const double rated = model.joints[j].rated_torque > 0 ? model.joints[j].rated_torque : 1;
    out[static_cast<Index>(j)] = floor && *floor > 0 ? *floor : 0.01 * rated;
  }
  return out;
}

/// Joints of the same names, kinds and places: a URDF that was changed since is another robot.
bool is_same(const Robot& a, const Robot& b) {
  for (std::size_t j = 0; j < a.size(); ++j) {
    const Joint &one = a.joints[j], &other = b.joints[j];
    if (one.name != other.name || one.type != other.type || !one.axis.isApprox(other.axis, 1e-6) ||
        !one.origin.isApprox(other.origin, 1e-6))
      return false;
  }
  return true;
}

bool is_on_robot(const EffectQuestion& question) {
  return find_effect(question.effect.effect)->acts_on == ActsOn::body;
}

std::string asked(const EffectQuestion& q) {
  const std::string at = is_on_robot(q) ? "robot" : fmt::format("joint {}", q.effect.joint + 1);
  const std::string elsewhere =
      q.rival_joint != q.effect.joint && !is_on_robot(q) ? fmt::format(" of joint {}", q.rival_joint + 1) : "";
  return fmt::format("{}: {} or {}{}", at, q.effect.effect, q.rival.empty() ? "nothing" : q.rival,
                     q.rival.empty() ? "" : elsewhere);
}

/// "joint 2: unexplained between 0.2 and 0.4 rad"
std::string words_of(const PlaceQuestion& place, const Robot& robot) {
  const std::string begin = fmt::format("joint {}: unexplained ", place.joint + 1);
  if (place.signal == "direction") return begin + (place.from < 0 ? "in negative direction" : "in positive direction");
  const std::string per = place.signal == "q" ? "" : place.signal == "ddq" ? "/s^2" : "/s";
  const std::string of = place.of_joint == place.joint ? "" : fmt::format("while joint {} is ", place.of_joint + 1);
  return begin + fmt::format("{}between {:.3g} and {:.3g} {}{}", of, place.from, place.to,
                             robot.joints[place.of_joint].position_unit(), per);
}

/// What motion alone does not decide, and what would: "robot: payload or nothing (the same motions ..); ..".
std::string cures(const NextMotions& next, const OpenQuestions& open, const Robot& robot) {
  std::string out;
  const auto add = [&](const std::string& text) { out += (out.empty() ? "" : "; ") + text; };
  for (std::size_t i = 0; i < open.effects.size(); ++i) {
    const EffectQuestion& q = open.effects[i];
    if (!next.hopeless[i]) continue;
    const std::string_view rival = q.rival.empty() ? base_parameters_name : std::string_view(q.rival);
    add(fmt::format("{} ({})", asked(q), cure(q.effect.effect, rival)));
  }
  for (std::size_t i = 0; i < open.places.size(); ++i) {
    if (next.hopeless_places[i]) add(words_of(open.places[i], robot) + " (out of reach of the limits)");
  }
  for (const std::string& text : open.unplanned) add(text);
  return out;
}

json to_json(const NextMotions& next, const OpenQuestions& open, const Project& project, const fs::path& after) {
  json questions = json::array(), places = json::array(), trajectories = json::array();
  for (std::size_t i = 0; i < open.effects.size(); ++i) {
    const EffectQuestion& q = open.effects[i];
    const auto at = static_cast<Index>(i);
    json one{{"effect", q.effect.effect},
             {"rival", q.rival.empty() ? json(nullptr) : json(q.rival)},
             {"why", q.why},
             {"log10_odds_so_far", q.odds_so_far ? json(*q.odds_so_far) : json(nullptr)},
             {"log10_odds_expected", next.odds[at]},
             {"log10_odds_usual", next.usual[at]}};
    one["decided_by_motion"] = !next.hopeless[i];
    one["joint"] = is_on_robot(q) ? json(nullptr) : json(q.effect.joint + 1);
    questions.push_back(std::move(one));
  }
  for (std::size_t i = 0; i < open.places.size(); ++i) {
    const PlaceQuestion& place = open.places[i];
    places.push_back({{"joint", place.joint + 1},
                      {"of_joint", place.of_joint + 1},
                      {"signal", place.signal},
                      {"from", place.from},
                      {"to", place.to},
                      {"seconds", next.seconds[static_cast<Index>(i)]}});
  }
  for (const PlannedTrajectory& one : next.trajectories) trajectories.push_back(trajectory_json(one, project.robot));
  return {{"schema", "fxdyn.excite/1"},
          {"project", project.file.filename().string()},
          {"robot", project.robot.name},
          {"seed", project.excite.seed},
          {"trajectories", trajectories},
          {"notes", next.notes},
          {"next",
           {{"after", after.string()}, {"questions", questions}, {"places", places}, {"unplanned", open.unplanned}}}};
}

std::string table(const NextMotions& next, const OpenQuestions& open, const Robot& robot) {
  std::string out = fmt::format("\n{:<52}{:>10}{:>10}{:>10}\n", "question (log10 of the odds that decide it)", "so far",
                                "planned", "usual");
  for (std::size_t i = 0; i < open.effects.size(); ++i) {
    const EffectQuestion& q = open.effects[i];
    if (next.hopeless[i]) continue;
    out += fmt::format("{:<52}{:>10}{:>10.1f}{:>10.1f}\n", asked(q),
                       q.odds_so_far ? fmt::format("{:.1f}", *q.odds_so_far) : "-", next.odds[static_cast<Index>(i)],
                       next.usual[static_cast<Index>(i)]);
  }
  for (std::size_t i = 0; i < open.places.size(); ++i) {
    if (!next.hopeless_places[i])
      out += fmt::format("{}: {:.1f} s there\n", words_of(open.places[i], robot), next.seconds[static_cast<Index>(i)]);
  }
  if (const std::string others = cures(next, open, robot); !others.empty()) out += "not planned for: " + others + "\n";
  out += "usual: the middle one of random fast motions, as long\n";
  for (const PlannedTrajectory& one : next.trajectories)
    out += fmt::format("{:<20}{:>8.1f} s\n", one.name, one.t[one.t.size() - 1]);
  for (const std::string& note : next.notes) out += fmt::format("note: {}\n", note);
  return out + "note: collisions of the robot with itself are not checked; play the motions slowly first\n";
}

}  // namespace

OpenQuestions open_questions(const DiagnosisResult& diagnosis, IdentifiedModel& model) {
  Questions questions(model);
  for (const NamedEffect& effect : diagnosis.robot_effects) questions.likely(effect, 0);
  for (const auto& set : diagnosis.undecided) questions.undecided(set, 0);
  questions.not_identifiable(diagnosis.not_identifiable, 0);
  for (const JointDiagnosis& joint : diagnosis.joints) {
    if (joint.verdict == Verdict::not_excited) {
      questions.still(joint);
      continue;
    }
    for (const NamedEffect& effect : joint.effects) questions.likely(effect, joint.index - 1);
    for (const auto& set : joint.undecided) questions.undecided(set, joint.index - 1);
    questions.not_identifiable(joint.not_identifiable, joint.index - 1);
    if (joint.verdict == Verdict::unexplained || joint.verdict == Verdict::partly_explained)
      questions.unexplained(joint);
  }
  OpenQuestions open = questions.all();
  open.known_base = diagnosis.baseline;
  return open;
}

std::string excite_after(const Project& project, const fs::path& after, const fs::path& directory, Progress& progress) {
  const fs::path file = after / "diagnosis.json", model_file = after / "model.json";
  for (const fs::path& needed : {file, model_file}) {
    if (!fs::exists(needed))
      throw InputError(fmt::format("{}: missing; --after takes the --out of `fxdyn diagnose`", needed.string()));
  }
  DiagnosisResult diagnosis;
  try {
    diagnosis = diagnosis_of(json::parse(read_file(file)));
  } catch (const std::exception& error) {  // of the JSON, or of its schema
    throw InputError(fmt::format("{}: {}; run `fxdyn diagnose` again", file.string(), error.what()));
  }
  IdentifiedModel model = read_model(model_file);
  if (model.project != project.file.filename().string() || model.robot.size() != project.robot.size() ||
      diagnosis.joints.size() != project.robot.size() || !is_same(model.robot, project.robot))
    throw InputError(fmt::format(
        "{}: is of the project '{}', or of another robot, not of '{}'; give the --out of a diagnosis of this one",
        model_file.string(), model.project, project.file.filename().string()));
  const OpenQuestions open = open_questions(diagnosis, model);
  if (open.empty())
    throw DataError(
        fmt::format("{}: nothing is open; `fxdyn excite PROJECT --out DIR` plans without a diagnosis", file.string()));
  std::error_code failed;
  fs::create_directories(directory, failed);  // fails now rather than after the work
  if (failed) throw InputError(fmt::format("{}: can't be made: {}", directory.string(), failed.message()));
  for (JointFit& joint : model.joints) joint.bls.reset();  // trained on what is asked here
  const NextMotions next = plan_next(project, model, open, noise_of(diagnosis, model), after, progress);
  if (next.trajectories.empty())
    throw DataError(fmt::format("{}: no motion that could be planned decides what is open: {}", file.string(),
                                cures(next, open, project.robot)));
  for (const PlannedTrajectory& one : next.trajectories) write_motion(directory, one, project.robot);
  write_file(directory / "excite.json", to_json(next, open, project, after).dump(1) + "\n");
  return table(next, open, project.robot) + fmt::format("plan: {}\n", (directory / "excite.json").string());
}

}  // namespace fxdyn
