#include "host_tools/diagnose/diagnose.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <set>

#include "host_tools/diagnose/deflection.hpp"
#include "host_tools/diagnose/lack_of_fit.hpp"
#include "host_tools/diagnose/linearised.hpp"
#include "host_tools/diagnose/refit.hpp"
#include "host_tools/diagnose/search.hpp"
#include "host_tools/diagnose/where.hpp"
#include "host_tools/error.hpp"
#include "host_tools/excite/sight.hpp"
#include "host_tools/identify/solver.hpp"
#include "host_tools/model/effects.hpp"
#include "host_tools/parallel.hpp"
#include "host_tools/random.hpp"
#include "host_tools/report/metrics.hpp"

namespace fxdyn {
namespace {

using namespace diagnosis;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using nlohmann::json;

/// A name closes at least this share of the gap above the noise on data that did not fit it.
constexpr double least_closure = 0.5;
/// Where structure remains, a name is believed only if it closes this much: another effect may only resemble it.
constexpr double sure_closure = 0.8;
/// Rows a period of the torque cut-off: two would be Nyquist's.
constexpr double rows_per_period = 2.5;
/// Faster than this there is nothing that these rules could name, and many rows.
constexpr double highest_cutoff_hz = 40;
/// Squared share of a column that is left: less can't be told from the nominal model.
constexpr double nothing_left = 1e-5;
constexpr int most_passes = 2;
/// A residual of that many times the noise is mostly gap.
constexpr double much_more = 3;
/// Into which a single log is cut, as the search does.
constexpr int blocks_of_one_log = 5;

/// The logs with their ages, and the session that all of them but the healthy ones belong to: one where no two windows
/// overlap in time; else every log starts its own.
std::vector<SessionLog> sessions(const std::vector<ProcessedLog>& now, const std::vector<ProcessedLog>& before,
                                 const std::vector<ProcessedLog>& test, std::optional<Session>& session) {
  std::vector<std::array<double, 2>> windows;
  for (const auto* logs : {&now, &test}) {
    for (const ProcessedLog& log : *logs) windows.push_back({log.t[0], log.t[log.t.size() - 1]});
  }
  std::sort(windows.begin(), windows.end());
  bool one = true;
  for (std::size_t i = 1; i < windows.size(); ++i) one &= windows[i][0] > windows[i - 1][1] - 1e-9;
  if (one) session = {windows.front()[0], windows.back()[1]};
  std::vector<SessionLog> out;
  const auto add = [&](const ProcessedLog& log, bool healthy, double start) {
    SessionLog entry{log, healthy, healthy || log.role == Role::train, std::max(0.0, log.t[0] - start)};
    double& cutoff = entry.log.filter.torque_cutoff_hz;
    cutoff = std::min(cutoff, highest_cutoff_hz);
    entry.log.decimation = std::max<Index>(log.decimation > 8 ? log.decimation / 8 : 1,
                                           static_cast<Index>(1 / (log.step_s * rows_per_period * cutoff)));
    out.push_back(std::move(entry));
  };
  for (const ProcessedLog& log : now) add(log, false, one ? windows.front()[0] : log.t[0]);
  for (const ProcessedLog& log : before) add(log, true, log.t[0]);
  return out;
}

/// Without a log that judges and with one trajectory only, its blocks have to.
void check_splits(const std::vector<ProcessedLog>& logs) {
  constexpr double shortest_s = 1;
  if (logs.size() > 1) return;
  const ProcessedLog& log = logs.front();
  const double seconds = static_cast<double>(log.last - log.first) * log.step_s;
  if (seconds >= blocks_of_one_log * shortest_s) return;
  throw DataError(
      fmt::format("{}: {:.1f} s (after filtering) are too short to split into {} blocks that judge one another: record "
                  "{:.0f} s or more, or add a log with role = \"validate\"",
                  log.name, seconds, blocks_of_one_log, 4 * blocks_of_one_log * shortest_s));
}

/// Joints that this motion tells nothing of: they stand still, or as good as, beside what the encoder's noise looks
/// like.
std::vector<bool> still_joints(const GateData& data, const std::vector<ProcessedLog>& baseline) {
  constexpr double times_noise = 6;
  std::vector<bool> out = moving_joints(data.logs);
  const std::vector<bool> before = baseline.empty() ? out : moving_joints(baseline);
  const ProcessedLog& log = data.logs.front();
  for (std::size_t j = 0; j < out.size(); ++j) {
    const FilterFit& filter = data.filter;
    const double noise = std::max(filter.position_noise[j], filter.encoder_step[j] / std::sqrt(12.0));
    const double cutoff = std::min(filter.position_cutoff_hz, 0.5 / log.step_s);
    const double noise_dq = 2 * std::numbers::pi * noise * std::sqrt(2 * log.step_s * cutoff * cutoff * cutoff / 3);
    out[j] = !out[j] || !before[j] || !(data.dq[static_cast<Index>(j)] > times_noise * noise_dq);
  }
  return out;
}

bool any(const std::vector<bool>& joints) { return std::find(joints.begin(), joints.end(), true) != joints.end(); }

/// Keeps the joints out of the fit. Where one stands still its encoder's noise is no motion.
void leave_out(std::vector<ProcessedLog>& logs, const std::vector<bool>& joints) {
  if (!any(joints)) return;
  for (ProcessedLog& log : logs) {
    log.left_out = joints;
    ProcessedLog alone = log;
    alone.role = Role::train;
    const std::vector<bool> moving = moving_joints({alone});
    for (std::size_t j = 0; j < joints.size(); ++j) {
      if (!joints[j] || moving[j]) continue;
      const auto k = static_cast<Index>(j);
      log.q.col(k).setConstant(log.q.col(k).mean());
      if (log.measured_dq.size() > 0) log.measured_dq.col(k).setZero();
      if (log.measured_ddq.size() > 0) log.measured_ddq.col(k).setZero();
    }
  }
}

/// A joint that stands still holds any torque up to its stiction: what was measured says nothing. The model's own
/// torque takes its place, under so much white noise that the joint counts next to nothing in what all joints share.
void mute(std::vector<SessionLog>& logs, const IdentifiedModel& model, const std::vector<bool>& joints) {
  constexpr double noise = 0.1;  // of rated torque
  if (!any(joints)) return;
  for (std::size_t l = 0; l < logs.size(); ++l) {
    ProcessedLog& log = logs[l].log;
    const MatrixXd torque = predict(model, log);
    Random random(l + 1);
    for (std::size_t j = 0; j < joints.size(); ++j) {
      if (!joints[j]) continue;
      const auto k = static_cast<Index>(j);
      for (Index i = 0; i < log.samples(); ++i)
        log.tau(i, k) = torque(i, k) + noise * model.joints[j].rated_torque * random.normal();
    }
  }
}

IdentifiedModel nominal_model(Project project, GateData& data, bool healthy, Progress& progress) {
  if (!project.identify.effects) project.identify.effects = {"viscous", "coulomb", "offset", "rotor_inertia"};
  project.identify.physical = false;
  project.identify.essential = false;
  if (project.identify.method == "rls") project.identify.method = "wls";
  const auto fitter = identify(project, data, progress);
  if (fitter->torque_lead_s() < 0 && !project.signals.torque_lead_s && !healthy) {
    // Torque that comes late is an effect with a name; but for a healthy robot it is how its signals are sampled.
    fitter->set_torque_lead(0);
    weigh(*fitter, project.identify);
    std::erase_if(data.notes, [](const std::string& note) { return note.starts_with("the torque column is"); });
  }
  IdentifiedModel model = finish_model(*fitter, project, data).model;
  for (JointFit& joint : model.joints)
    std::erase_if(joint.effects, [](const EffectFit& fit) { return fit.effect == Elasticity::name; });
  return model;
}

/// What a search came to.
struct Outcome {
  Models models;
  std::unique_ptr<Linearised> at;  ///< around the models, without candidates
  std::vector<Found> found;        ///< of the last search; groups are those of `at`
  std::vector<MatrixXd> features;
  std::vector<LackOfFit> lack;
  std::vector<std::vector<std::string>> not_identifiable;  ///< per joint, and of the robot
  std::vector<VectorXd> whitening;
};

std::vector<std::size_t> in_model(const Linearised& at) {
  std::vector<std::size_t> groups;
  for (std::size_t g = 0; g < at.groups().size(); ++g) {
    if (at.groups()[g].in_model) groups.push_back(g);
  }
  return groups;
}

std::vector<Index> columns_of(const Linearised& at, const std::vector<std::size_t>& groups) {
  std::vector<Index> out = at.nuisance();
  for (const std::size_t g : groups) {
    for (Index i = 0; i < at.groups()[g].count; ++i) out.push_back(at.groups()[g].first + i);
  }
  return out;
}

bool same(const EffectCandidate& a, bool a_body, const EffectCandidate& b, bool b_body) {
  return a.effect == b.effect && a_body == b_body && (a_body || a.joint == b.joint);
}

void drop(Models& models, const Group& group) {
  auto& effects = group.on_body ? models.current.body : models.current.joints[group.candidate.joint].effects;
  const auto it = std::find_if(effects.begin(), effects.end(), [&](const EffectFit& fit) {
    return fit.named && fit.effect == group.candidate.effect && fit.shape == group.candidate.shape;
  });
  if (it != effects.end()) effects.erase(it);
}

void look_for_lack(Outcome& out) {
  const std::size_t n = out.at->joints();
  out.features.resize(n);
  out.lack.resize(n);
  const LinearFit fit = out.at->solve(columns_of(*out.at, in_model(*out.at)));
  parallel_for(n, [&](std::size_t j) {
    out.features[j] = features(*out.at, j);
    out.lack[j] = lack_of_fit(*out.at, j, fit, out.features[j]);
  });
}

/// What can't be seen whatever its size: by joint, the robot's last.
std::vector<std::vector<std::string>> blind_spots(const Linearised& at, const Search& search) {
  std::vector<std::vector<std::string>> out(at.joints() + 1);
  for (const EffectInfo& info : effect_infos()) {
    for (std::size_t j = 0; j < at.joints() + 1; ++j) {
      bool any = false, seen = false;
      for (std::size_t g = 0; g < search.not_absorbed().size() && g < at.groups().size(); ++g) {
        const Group& group = at.groups()[g];
        if (group.in_model || group.candidate.effect != info.name) continue;
        if (group.on_body != (j == at.joints()) || (!group.on_body && group.candidate.joint != j)) continue;
        any = true;
        seen |= search.not_absorbed()[g] >= nothing_left;
      }
      if (any && !seen) out[j].emplace_back(info.name);
    }
  }
  return out;
}

/// Without a healthy session the noise's colour comes from a residual that holds the gap too: taken as noise, a slow
/// gap would be whitened away. So only where the residual is not much more than the noise above the torque's band.
std::vector<VectorXd> colours(const Models& models, const std::vector<SessionLog>& logs) {
  if (models.has_baseline) return {};
  const std::size_t n = models.current.joints.size();
  const std::vector<VectorXd> white(n, VectorXd::Zero(1));
  const Linearised in_band(models, logs, white), coloured(models, logs);
  std::vector<VectorXd> out = coloured.whitening();
  for (std::size_t j = 0; j < n; ++j) {
    double noise = 0;
    for (const SessionLog& entry : logs) noise = std::max(noise, entry.log.torque_noise[static_cast<Index>(j)]);
    if (1 / std::sqrt(in_band.weights()[static_cast<Index>(j)]) > much_more * noise) out[j] = white[j];
  }
  return out;
}

/// Search, name, fit again around what was named; until nothing changes.
Outcome explore(Models models, const std::vector<SessionLog>& logs, const SearchSettings& settings,
                const std::vector<EffectCandidate>& never, Progress& progress) {
  Outcome out;
  std::vector<VectorXd> whitening = colours(models, logs);
  for (int pass = 0; pass < most_passes; ++pass) {
    progress.stage(pass == 0 ? "looking for what is missing" : "looking again, around what was found", 8);
    Linearised at(models, logs, whitening);
    std::vector<EffectCandidate> skip = never;
    for (const std::size_t g : in_model(at)) skip.push_back(at.groups()[g].candidate);
    std::erase_if(skip, [](const EffectCandidate& c) { return c.effect == JointCoupling::name; });
    at.add_all(dictionary(at, skip));
    progress.step();
    Search search(at, settings);
    const std::vector<std::size_t> start = in_model(at);
    const Choice choice = search.run(start, progress);
    if (pass == 0) out.not_identifiable = blind_spots(at, search);
    out.found = search.explain(choice);
    out.whitening = at.whitening();
    bool changed = false;
    for (const std::size_t g : start) {
      if (std::find(choice.groups.begin(), choice.groups.end(), g) != choice.groups.end()) continue;
      drop(models, at.groups()[g]);
      changed = true;
    }
    Index column = static_cast<Index>(at.nuisance().size());
    std::vector<Group> groups;
    for (const std::size_t g : choice.groups) {
      const Group& group = at.groups()[g];
      groups.push_back(group);
      if (!group.in_model) {
        name(models, group, choice.fit.x.segment(column, group.count));
        changed = true;
      }
      column += group.count;
    }
    if (changed) refit(models, logs, at.whitening(), 4);
    out.models = models;
    // Without a baseline the gap was part of what looked like noise.
    const bool better = changed && !models.has_baseline;
    whitening = better ? colours(models, logs) : at.whitening();
    out.whitening = whitening.empty() ? at.whitening() : whitening;
    out.at = std::make_unique<Linearised>(models, logs, whitening);
    // What the search found, by its group in the new linearisation.
    std::vector<Found> found;
    std::set<std::size_t> taken;
    for (std::size_t i = 0; i < groups.size(); ++i) {
      for (const std::size_t g : in_model(*out.at)) {
        if (taken.contains(g)) continue;
        if (!same(groups[i].candidate, groups[i].on_body, out.at->groups()[g].candidate, out.at->groups()[g].on_body))
          continue;
        taken.insert(g);
        Found f = out.found[i];
        f.group = g;
        found.push_back(f);
        break;
      }
    }
    out.found = std::move(found);
    look_for_lack(out);
    const bool structured =
        std::any_of(out.lack.begin(), out.lack.end(), [](const LackOfFit& l) { return l.structured(); });
    if (!changed || (!structured && out.found.size() < 2)) break;
  }
  return out;
}

/// Squares of judged residuals, whitened and weighted to unit variance.
struct HeldOut {
  VectorXd before, after, leftover;
  std::vector<double> alone;  ///< by found effect: what comes back over all joints when it alone is removed
  std::vector<VectorXd> alone_by_joint;
  VectorXd rows;
};

HeldOut hold_out(const Linearised& at, const std::vector<MatrixXd>& features, const std::vector<std::size_t>& groups) {
  const auto n = static_cast<Index>(at.joints());
  HeldOut out{VectorXd::Zero(n),
              VectorXd::Zero(n),
              VectorXd::Zero(n),
              std::vector<double>(groups.size(), 0.0),
              std::vector<VectorXd>(groups.size(), VectorXd::Zero(n)),
              VectorXd::Zero(n)};
  const VectorXd& w = at.weights();
  for (const Fold& fold : at.folds()) {
    out.rows += at.row_count(fold.judge);
    const LinearFit all = at.solve(columns_of(at, groups), fold.fit);
    const VectorXd after = at.square(all, fold.judge).cwiseProduct(w);
    out.after += after;
    for (Index j = 0; j < n; ++j) {
      out.leftover[j] += after[j] * structured_share(at, static_cast<std::size_t>(j), all,
                                                     features[static_cast<std::size_t>(j)], fold.judge);
    }
    out.before += at.square(at.solve(at.nuisance(), fold.fit), fold.judge).cwiseProduct(w);
    for (std::size_t i = 0; i < groups.size(); ++i) {
      std::vector<std::size_t> others = groups;
      others.erase(others.begin() + static_cast<std::ptrdiff_t>(i));
      const VectorXd without = at.square(at.solve(columns_of(at, others), fold.fit), fold.judge).cwiseProduct(w);
      out.alone_by_joint[i] += without - after;
      out.alone[i] += (without - after).sum();
    }
  }
  return out;
}

json parameters_json(const EffectFit& fit, const Joint& joint) {
  json out = json::array();
  const EffectInfo& info = *find_effect(fit.effect);
  const auto add = [&](const ParameterInfo& p, double value, const std::vector<double>& std, std::size_t i) {
    const bool turns = joint.type == JointType::revolute;
    json one = {{"name", p.name}, {"value", value}, {"unit", turns ? p.unit : p.unit_prismatic}};
    one["std"] = i < std.size() && std[i] > 0 ? json(std[i]) : json(nullptr);
    out.push_back(one);
  };
  for (std::size_t i = 0; i < info.shape.size(); ++i) add(info.shape[i], fit.shape[i], fit.shape_std, i);
  for (std::size_t i = 0; i < info.linear.size(); ++i) add(info.linear[i], fit.linear[i], fit.linear_std, i);
  return out;
}

/// Standard deviations from the whitened information.
void add_deviations(Models& models, const Linearised& at) {
  std::vector<Index> columns;
  for (Index c = 0; c < static_cast<Index>(at.unknowns().size()); ++c) columns.push_back(c);
  for (const Index c : at.nuisance()) {
    if (c >= static_cast<Index>(at.unknowns().size())) columns.push_back(c);  // background
  }
  const LinearFit fit = at.solve(columns);
  const MatrixXd covariance = SymmetricSolver(fit.information).inverse();
  IdentifiedModel& model = models.current;
  for (JointFit& joint : model.joints) {
    for (EffectFit& effect : joint.effects) {
      if (find_effect(effect.effect)->acts_on == ActsOn::position && !effect.linear_std.empty())
        continue;  // from a link encoder
      effect.linear_std.assign(effect.linear.size(), 0.0);
      effect.shape_std.assign(effect.shape.size(), 0.0);
    }
  }
  for (EffectFit& effect : model.body) effect.linear_std.assign(effect.linear.size(), 0.0);
  for (std::size_t c = 0; c < at.unknowns().size(); ++c) {
    const Unknown& u = at.unknowns()[c];
    const double variance = covariance(static_cast<Index>(c), static_cast<Index>(c));
    const double std = std::sqrt(std::max(variance, 0.0));
    if (u.kind == Unknown::Kind::base) {
      model.base[u.index].std = std;
    } else if (u.kind == Unknown::Kind::width) {
      model.joints[u.joint].sign_width_std = std * model.joints[u.joint].sign_width;
    } else {
      EffectFit& effect = u.body ? model.body[u.effect] : model.joints[u.joint].effects[u.effect];
      if (u.kind == Unknown::Kind::shape) {
        effect.shape_std[u.index] = std * effect.shape[u.index];
      } else {
        double& place = effect.linear_std[u.index];
        place = std::hypot(place, std);  // common part and change
        if (effect.effect == Payload::name && u.index > 0) place = std / std::max(effect.linear[0], 1e-9);
      }
    }
  }
}

/// Filtered error of a joint over a log, full rate.
VectorXd error_of(const ProcessedLog& log, const MatrixXd& torque, std::size_t joint) {
  const auto j = static_cast<Index>(joint);
  return log.filter_columns(log.tau.col(j) - torque.col(j)).col(0);
}

/// Base parameters of the baseline with friction, load and tilt of their own against what both sessions measured.
void check_same_robot(Models models, const std::vector<SessionLog>& logs, const std::vector<bool>& still) {
  constexpr double most = 0.2;  // of the torque's power that no fit explains
  models.background.clear();    // explains anything
  Linearised at(models, logs, std::vector<VectorXd>(models.current.joints.size(), VectorXd::Zero(1)));
  const auto first = static_cast<Index>(at.nuisance().size());
  for (const EffectInfo& info : effect_infos()) {
    if (info.acts_on != ActsOn::body) continue;
    Group group;
    group.candidate = {std::string(info.name), 0, {}};
    group.on_body = true;
    at.add(group, at.make(group.candidate));
  }
  std::vector<Index> columns = at.nuisance();
  for (Index c = first; c < at.columns(); ++c) columns.push_back(c);
  const LinearFit fit = at.solve(columns);
  std::size_t strange = 0, judged = 0;
  for (std::size_t j = 0; j < at.joints(); ++j) {
    if (still[j]) continue;
    ++judged;
    bool explained = true;
    for (const bool healthy : {false, true}) {
      std::vector<std::size_t> blocks;
      double whole = 0;
      for (const std::size_t b : at.fit_blocks()) {
        if (at.blocks()[b].healthy == healthy) blocks.push_back(b);
      }
      for (const SessionLog& entry : logs) {
        if (entry.healthy != healthy || !entry.fits) continue;
        whole += entry.log.decimate(entry.log.filter_columns(entry.log.tau.col(static_cast<Index>(j)))).squaredNorm();
      }
      explained &= at.square(fit, blocks)[static_cast<Index>(j)] <= most * whole;
    }
    strange += !explained;
  }
  if (2 * strange > judged) {
    throw DataError(fmt::format(
        "the baseline and these logs can't be of one robot: nothing explains both at {} of {} joints; other "
        "units, columns or gains? Correct the baseline or remove it (role = \"baseline\")",
        strange, judged));
  }
}

}  // namespace

Diagnosis diagnose(const Project& project, GateData& given, const std::vector<ProcessedLog>& given_baseline,
                   const std::vector<ProcessedLog>& test, Progress& progress) {
  const std::size_t n = project.robot.size();
  const std::vector<bool> still = still_joints(given, given_baseline);
  if (std::find(still.begin(), still.end(), false) == still.end()) {
    throw DataError(
        "not_excited: no joint moves in the train logs (and in the baseline) by more than its encoder's noise; record "
        "logs in which they do");
  }
  std::optional<GateData> frozen;
  std::vector<ProcessedLog> frozen_baseline;
  if (any(still)) {
    frozen = given;
    frozen_baseline = given_baseline;
    leave_out(frozen->logs, still);
    leave_out(frozen_baseline, still);
  }
  GateData& data = frozen ? *frozen : given;
  const std::vector<ProcessedLog>& baseline = frozen ? frozen_baseline : given_baseline;
  Models models;
  models.has_baseline = !baseline.empty();
  SearchSettings settings;
  settings.max_effects = static_cast<std::size_t>(project.diagnose.max_effects);
  // Few things change at once; a robot of which nothing is known may lack more.
  settings.most = models.has_baseline ? 4 + n : 2 + 2 * n;
  SearchSettings modest = settings;  // a background need not be named, only taken out
  modest.max_effects = std::min<std::size_t>(2, settings.max_effects);
  modest.most = std::max<std::size_t>(2, n);
  std::optional<Session> session;
  std::vector<SessionLog> logs = sessions(data.logs, baseline, test, session);
  std::vector<std::string> notes;
  // A link encoder shows what bends before any torque is looked at.
  std::vector<EffectCandidate> never;
  Deflections deflections;
  std::vector<DeflectionEffect> bent_already;
  const auto look_at_links = [&](const IdentifiedModel& model) {
    deflections = find_deflections(model, data.logs, baseline, bent_already);
    notes.insert(notes.end(), deflections.notes.begin(), deflections.notes.end());
    for (const DeflectionEffect& effect : bent_already) {
      notes.push_back(
          fmt::format("{}: the baseline has {} already", project.robot.joints[effect.joint].name, effect.fit.effect));
      models.fixed.push_back({effect.fit.effect, effect.joint, effect.fit.shape});
    }
    for (const DeflectionEffect& effect : deflections.found)
      models.fixed.push_back({effect.fit.effect, effect.joint, effect.fit.shape});
    for (std::size_t j = 0; j < n; ++j) {
      const bool encoded = std::all_of(data.logs.begin(), data.logs.end(), [&](const ProcessedLog& log) {
        return log.qlink.size() > 0 && log.has_link[j];
      });
      if (!encoded) continue;
      for (const std::string_view effect : {Elasticity::name, Backlash::name, Eccentricity::name})
        never.push_back({std::string(effect), j, {}});
    }
  };
  const auto bend_already = [&](IdentifiedModel& model) {
    for (const DeflectionEffect& effect : bent_already) {
      model.joints[effect.joint].effects.push_back(effect.fit);
      model.joints[effect.joint].effects.back().named = false;
    }
  };
  for (std::size_t j = 0; j < n; ++j) {
    if (!still[j]) continue;
    for (const std::string_view effect : joint_effect_names()) never.push_back({std::string(effect), j, {}});
  }
  if (models.has_baseline) {
    GateData healthy = data;
    healthy.logs = baseline;
    healthy.notes.clear();
    try {
      models.healthy = nominal_model(project, healthy, true, progress);
    } catch (const DataError& error) {
      throw DataError(fmt::format("role = \"baseline\": {}", error.what()));
    }
    mute(logs, models.healthy, still);
    models.healthy.logs = data.references;
    look_at_links(models.healthy);
    bend_already(models.healthy);
    // What the healthy session has that is not nominal is its background: learned, not reported.
    Models alone;
    alone.current = models.healthy;
    alone.fixed = models.fixed;
    std::vector<SessionLog> before;
    for (const SessionLog& log : logs) {
      if (!log.healthy) continue;
      before.push_back(log);
      before.back().healthy = false;
    }
    for (int round = 0; round < 2; ++round) refit(alone, before, {}, 4);
    Outcome background;
    background.at = std::make_unique<Linearised>(alone, before);
    look_for_lack(background);
    bool structured =
        std::any_of(background.lack.begin(), background.lack.end(), [](const LackOfFit& l) { return l.structured(); });
    if (!structured) {
      // Ripple is finer than the functions that the test knows.
      Linearised at(alone, before);
      Search ripples_only(at, modest);
      structured = !ripples_only.run({}, progress).groups.empty();
    }
    if (structured) {
      background = explore(alone, before, modest, never, progress);
      alone = background.models;
      for (std::size_t j = 0; j < n; ++j) {
        for (EffectFit& fit : alone.current.joints[j].effects) {
          if (fit.named)
            notes.push_back(fmt::format("{}: the baseline has {} already", project.robot.joints[j].name, fit.effect));
          fit.named = false;
        }
        if (background.lack[j].structured()) models.background.push_back(j);
        if (background.lack[j].structured())
          notes.push_back(
              fmt::format("{}: the baseline has structure that no effect explains", project.robot.joints[j].name));
      }
      for (EffectFit& fit : alone.current.body) fit.named = false;
    }
    models.healthy = models.current = alone.current;
    check_same_robot(models, logs, still);
    data.notes.insert(data.notes.end(), healthy.notes.begin(), healthy.notes.end());
  } else {
    models.current = nominal_model(project, data, false, progress);
    mute(logs, models.current, still);
    look_at_links(models.current);
  }
  check_splits(data.logs);
  models.current.session = session;
  for (const DeflectionEffect& effect : deflections.found)
    models.current.joints[effect.joint].effects.push_back(effect.fit);
  const std::vector<VectorXd> plain(n, VectorXd::Zero(1));
  refit(models, logs, plain, 8);
  Diagnosis result;
  {
    const Linearised at(models, logs);
    Models with = models;
    add_deviations(with, at);
    result.nominal = with.current;
    for (JointFit& joint : result.nominal.joints)
      std::erase_if(joint.effects, [](const EffectFit& fit) { return fit.named; });
  }

  Outcome outcome = explore(models, logs, settings, never, progress);
  // Names that do not hold on data that did not fit them go first. Where structure remains, what counts is the error in
  // the whole band: whitening would weigh it by how fast it is.
  const auto judge = [&] {
    const std::vector<std::size_t> groups = in_model(*outcome.at);
    HeldOut held = hold_out(*outcome.at, outcome.features, groups);
    if (std::none_of(outcome.lack.begin(), outcome.lack.end(), [](const LackOfFit& l) { return l.structured(); }))
      return held;
    const Linearised at(outcome.models, logs, plain);
    std::vector<MatrixXd> in_band(n);
    parallel_for(n, [&](std::size_t j) { in_band[j] = features(at, j); });
    const HeldOut band = hold_out(at, in_band, groups);
    for (std::size_t j = 0; j < n; ++j) {
      if (!outcome.lack[j].structured()) continue;
      const auto k = static_cast<Index>(j);
      held.before[k] = band.before[k];
      held.after[k] = band.after[k];
      held.leftover[k] = band.leftover[k];
      for (std::size_t i = 0; i < groups.size(); ++i) held.alone_by_joint[i][k] = band.alone_by_joint[i][k];
    }
    for (std::size_t i = 0; i < groups.size(); ++i) held.alone[i] = held.alone_by_joint[i].sum();
    return held;
  };
  // How fast drift comes to its end shows on the data that follow.
  bool drifted = false;
  for (std::size_t j = 0; j < n; ++j) {
    for (std::size_t e = 0; e < outcome.models.current.joints[j].effects.size(); ++e) {
      if (outcome.models.current.joints[j].effects[e].effect != FrictionDrift::name ||
          !outcome.models.current.joints[j].effects[e].named)
        continue;
      const double found = outcome.models.current.joints[j].effects[e].shape[0];
      double best = found, least = 1e300;
      for (const double factor : {1.0, 0.5, 0.25, 0.125, 0.0625, 0.03125, 2.0}) {
        Models other = outcome.models;
        other.current.joints[j].effects[e].shape[0] = std::clamp(found * factor, 0.1, 1e4);
        const Linearised at(other, logs, outcome.whitening);
        double sum = 0;
        for (const Fold& fold : at.folds())
          sum += at.square(at.solve(columns_of(at, in_model(at)), fold.fit), fold.judge)[static_cast<Index>(j)];
        if (sum >= least) continue;
        least = sum;
        best = other.current.joints[j].effects[e].shape[0];
      }
      outcome.models.current.joints[j].effects[e].shape[0] = best;
      drifted = true;
    }
  }
  if (drifted) {
    refit(outcome.models, logs, outcome.whitening, 4);
    outcome.at = std::make_unique<Linearised>(outcome.models, logs, outcome.whitening);
    look_for_lack(outcome);
  }
  std::vector<std::size_t> groups = in_model(*outcome.at);
  HeldOut held = judge();
  for (bool again = true; again && !groups.empty();) {
    again = false;
    std::size_t worst = 0;
    for (std::size_t i = 1; i < groups.size(); ++i) {
      if (held.alone[i] < held.alone[worst]) worst = i;
    }
    if (held.alone[worst] > 4) break;
    drop(outcome.models, outcome.at->groups()[groups[worst]]);
    refit(outcome.models, logs, outcome.whitening, 3);
    std::vector<Found> before = outcome.found;
    std::vector<Group> old = outcome.at->groups();
    outcome.at = std::make_unique<Linearised>(outcome.models, logs, outcome.whitening);
    groups = in_model(*outcome.at);
    outcome.found.clear();
    for (const std::size_t g : groups) {
      for (Found f : before) {
        if (!same(old[f.group].candidate, old[f.group].on_body, outcome.at->groups()[g].candidate,
                  outcome.at->groups()[g].on_body))
          continue;
        f.group = g;
        outcome.found.push_back(f);
        break;
      }
    }
    look_for_lack(outcome);
    held = judge();
    again = true;
  }

  const Linearised& at = *outcome.at;
  Models& found = outcome.models;
  const bool remainder =
      std::any_of(outcome.lack.begin(), outcome.lack.end(), [](const LackOfFit& l) { return l.structured(); });
  if (groups.empty() && deflections.found.empty()) {
    found.current = models.current;
  } else if (remainder) {
    refit(found, logs, plain, 4);
  }
  add_deviations(found, at);
  const VectorXd gap = (held.before - held.after).cwiseMax(0.0) + held.leftover;
  VectorXd closure(static_cast<Index>(n));
  for (Index j = 0; j < closure.size(); ++j) closure[j] = gap[j] > 0 ? (held.before[j] - held.after[j]) / gap[j] : 0;
  // An effect on the robot: what comes back without it against what it leaves on the joints that it reaches.
  std::vector<double> robot_closure(groups.size(), 0.0);
  for (std::size_t i = 0; i < groups.size(); ++i) {
    if (!at.groups()[groups[i]].on_body) continue;
    double left = 0;
    for (Index j = 0; j < gap.size(); ++j) {
      if (held.alone_by_joint[i][j] > 6) left += held.leftover[j];
    }
    robot_closure[i] = held.alone[i] / std::max(held.alone[i] + left, 1e-300);
  }
  std::vector<bool> accepted(n), remains(n);
  for (std::size_t j = 0; j < n; ++j) {
    const auto k = static_cast<Index>(j);
    remains[j] = !still[j] && outcome.lack[j].structured() && held.leftover[k] > (1 - sure_closure) * gap[k];
    accepted[j] = closure[k] >= (remains[j] ? sure_closure : least_closure);
  }

  // Models: what is not named stays as an unnamed column, since the gate data says it helps.
  for (std::size_t j = 0; j < n; ++j) {
    auto& effects = found.current.joints[j].effects;
    for (EffectFit& fit : effects) {
      const bool fixed = std::any_of(models.fixed.begin(), models.fixed.end(),
                                     [&](const EffectCandidate& c) { return c.joint == j && c.effect == fit.effect; });
      if (!fixed) fit.named &= accepted[j];
    }
    if (still[j]) effects.clear();
  }
  for (std::size_t i = 0; i < groups.size(); ++i) {
    if (!at.groups()[groups[i]].on_body || robot_closure[i] >= least_closure) continue;
    for (EffectFit& fit : found.current.body) fit.named &= fit.effect != at.groups()[groups[i]].candidate.effect;
  }
  result.model = found.current;

  // Figures on logs that decided nothing, where there are any.
  std::vector<const ProcessedLog*> shown;
  std::string kind = "test logs";
  for (const ProcessedLog& log : test) shown.push_back(&log);
  if (shown.empty()) {
    kind = "validate logs";
    for (const ProcessedLog& log : data.logs) {
      if (log.role == Role::validate) shown.push_back(&log);
    }
  }
  const bool blocks_only = shown.empty();
  if (blocks_only) {
    kind = "blocks of the train logs, each judged by a fit of the others";
    for (const ProcessedLog& log : data.logs) shown.push_back(&log);
  }
  std::vector<MatrixXd> torque_before(shown.size()), torque_after(shown.size());
  parallel_for(shown.size(), [&](std::size_t l) {
    torque_before[l] = predict(result.nominal, *shown[l]);
    torque_after[l] = predict(result.model, *shown[l]);
  });
  json joints = json::array();
  bool any_effect = false, any_unexplained = false, any_still = false;
  std::string next;
  const auto advise = [&](const std::string& text) {
    if (!text.empty() && next.find(text) == std::string::npos) next += (next.empty() ? "" : "; ") + text;
  };
  const auto share_of_model = [&](const EffectFit& fit, std::size_t j) {
    IdentifiedModel less = result.model;
    std::erase_if(less.joints[j].effects,
                  [&](const EffectFit& f) { return f.effect == fit.effect && f.shape == fit.shape; });
    const MatrixXd without = predict(less, *shown.front());
    const auto k = static_cast<Index>(j);
    return (torque_after.front() - without).col(k).norm() / std::max(torque_after.front().col(k).norm(), 1e-300);
  };
  const auto effect_json = [&](const EffectFit& fit, std::size_t j, const Found* f, double closed) {
    json alternatives = json::array();
    if (f != nullptr) {
      for (const Alternative& a : f->alternatives) {
        const bool body = find_effect(a.candidate.effect)->acts_on == ActsOn::body;
        if (!body && a.candidate.joint != j) continue;
        if (std::find(alternatives.begin(), alternatives.end(), a.candidate.effect) != alternatives.end()) continue;
        alternatives.push_back(a.candidate.effect);
        advise(fmt::format("{} or {} at joint {}: {}", fit.effect, a.candidate.effect, j + 1,
                           cure(fit.effect, a.candidate.effect)));
      }
    }
    return json{{"effect", fit.effect},
                {"parameters", parameters_json(fit, project.robot.joints[j])},
                {"score", f != nullptr ? f->score : 0.0},
                {"held_out_closure", closed},
                {"alternatives", alternatives}};
  };
  const auto found_of = [&](const EffectFit& fit, std::size_t j, bool body) -> std::pair<const Found*, std::size_t> {
    for (std::size_t i = 0; i < groups.size(); ++i) {
      const Group& group = at.groups()[groups[i]];
      if (group.candidate.effect != fit.effect || group.on_body != body || (!body && group.candidate.joint != j))
        continue;
      if (group.candidate.shape != fit.shape && group.candidate.effect == Ripple::name) continue;
      for (const Found& f : outcome.found) {
        if (f.group == groups[i]) return {&f, i};
      }
      return {nullptr, i};
    }
    return {nullptr, groups.size()};
  };
  for (std::size_t j = 0; j < n; ++j) {
    const auto k = static_cast<Index>(j);
    if (still[j]) {
      json unseen = json::array();
      for (const std::string_view effect : joint_effect_names()) unseen.push_back(effect);
      joints.push_back({{"joint", project.robot.joints[j].name},
                        {"index", j + 1},
                        {"unit", project.robot.joints[j].torque_unit()},
                        {"verdict", "not_excited"},
                        {"gap_before", nullptr},
                        {"gap_after", nullptr},
                        {"noise_floor", nullptr},
                        {"closure", nullptr},
                        {"where", json::array()},
                        {"effects", json::array()},
                        {"resembles", json::array()},
                        {"not_identifiable", unseen}});
      advise(fmt::format("record a log in which joint {} moves", j + 1));
      any_still = true;
      continue;
    }
    double before = 0, after = 0, count = 0;
    std::vector<VectorXd> errors;
    for (std::size_t l = 0; l < shown.size(); ++l) {
      const ProcessedLog& log = *shown[l];
      const Index samples = log.last - log.first;
      errors.push_back(error_of(log, torque_before[l], j));
      before += errors.back().segment(log.first, samples).squaredNorm();
      after += error_of(log, torque_after[l], j).segment(log.first, samples).squaredNorm();
      count += static_cast<double>(samples);
    }
    if (blocks_only) {
      // In-sample errors, by the ratio of judged to fitted ones.
      const LinearFit without = at.solve(at.nuisance()), all = at.solve(columns_of(at, groups));
      const VectorXd rows = at.row_count(at.fit_blocks());
      before *= held.before[k] / std::max(held.rows[k], 1.0) / (at.weights()[k] * without.square[k] / rows[k]);
      after *= held.after[k] / std::max(held.rows[k], 1.0) / (at.weights()[k] * all.square[k] / rows[k]);
    }
    const double rms_before = std::sqrt(before / std::max(count, 1.0)),
                 rms_after = std::sqrt(after / std::max(count, 1.0));
    const double floor = rms_after * std::sqrt(std::max(0.0, 1 - held.leftover[k] / std::max(held.after[k], 1e-300)));
    json effects = json::array(), resembles = json::array();
    for (const EffectFit& fit : found.current.joints[j].effects) {
      const auto [f, i] = found_of(fit, j, false);
      if (i >= groups.size()) continue;
      if (!fit.named) {
        resembles.push_back(fit.effect);
        continue;
      }
      json one = effect_json(fit, j, f, gap[k] > 0 ? held.alone_by_joint[i][k] / gap[k] : 0);
      one["model_share"] = share_of_model(fit, j);
      effects.push_back(std::move(one));
    }
    for (const DeflectionEffect& seen : deflections.found) {
      if (seen.joint != j) continue;
      effects.push_back({{"effect", seen.fit.effect},
                         {"parameters", parameters_json(seen.fit, project.robot.joints[j])},
                         {"score", seen.score},
                         {"held_out_closure", seen.closure},
                         {"signal", "q - qlink"},
                         {"alternatives", json::array()},
                         {"model_share", share_of_model(seen.fit, j)}});
    }
    const bool unexplained = (outcome.lack[j].structured() && (effects.empty() || remains[j])) || !resembles.empty();
    const std::string verdict = unexplained ? "unexplained" : !effects.empty() ? "effects_found" : "nothing_missing";
    any_effect |= !effects.empty();
    any_unexplained |= unexplained;
    std::sort(effects.begin(), effects.end(), [](const json& a, const json& b) { return a["score"] > b["score"]; });
    json one = {{"joint", project.robot.joints[j].name},
                {"index", j + 1},
                {"unit", project.robot.joints[j].torque_unit()},
                {"verdict", verdict},
                {"gap_before", rms_before},
                {"gap_after", rms_after},
                {"noise_floor", std::min(floor, rms_after)},
                {"closure", closure[k]},
                {"where", verdict == "nothing_missing" && rms_before < 1.05 * floor
                              ? json::array()
                              : where(result.nominal, shown, j, errors, std::min(floor, rms_before))},
                {"effects", effects},
                {"resembles", resembles},
                {"not_identifiable", outcome.not_identifiable[j]},
                {"lack_of_fit", {{"state_p", outcome.lack[j].state_p}, {"time_p", outcome.lack[j].time_p}}}};
    if (unexplained) {
      const json& regions = one["where"];
      advise(fmt::format(
          "record more of joint {}{}", j + 1,
          regions.empty()
              ? std::string()
              : fmt::format(" where the gap sits ({} from {:.3g} to {:.3g})", regions[0]["signal"].get<std::string>(),
                            regions[0]["from"].get<double>(), regions[0]["to"].get<double>())));
    }
    joints.push_back(std::move(one));
  }
  json robot = json::array();
  for (const EffectFit& fit : found.current.body) {
    const auto [f, i] = found_of(fit, 0, true);
    if (i >= groups.size() || !fit.named) continue;
    json one = effect_json(fit, 0, f, robot_closure[i]);
    json which = json::array();
    for (std::size_t j = 0; j < n; ++j) {
      if (held.alone_by_joint[i][static_cast<Index>(j)] > 6) which.push_back(j + 1);
    }
    one["joints"] = which;
    robot.push_back(std::move(one));
    any_effect = true;
  }
  if (!robot.empty()) {
    // A joint whose gap a load closes is explained by it.
    for (json& joint : joints) {
      const bool reached = std::any_of(robot.begin(), robot.end(), [&](const json& r) {
        return std::find(r["joints"].begin(), r["joints"].end(), joint["index"]) != r["joints"].end();
      });
      if (reached && joint["verdict"] == "nothing_missing") joint["verdict"] = "effects_found";
    }
  }
  const std::string verdict = any_unexplained ? "unexplained"
                              : any_effect    ? "effects_found"
                              : any_still     ? "not_excited"
                                              : "nothing_missing";
  result.report = {{"schema", "fxdyn.diagnosis/1"},
                   {"verdict", verdict},
                   {"joints", joints},
                   {"robot_effects", robot},
                   {"not_identifiable", outcome.not_identifiable.back()},
                   {"next_experiment", next},
                   {"gate", at.folds().size() == 1 && !blocks_only ? "validate logs" : kind},
                   {"figures_on", kind},
                   {"baseline", models.has_baseline},
                   {"notes", notes}};
  data.notes.insert(data.notes.end(), notes.begin(), notes.end());
  given.notes = data.notes;
  progress.done();
  return result;
}

}  // namespace fxdyn
