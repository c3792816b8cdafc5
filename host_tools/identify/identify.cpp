#include "host_tools/identify/identify.hpp"

#include <fmt/format.h>

#include <cmath>

#include "host_tools/effects/effects.hpp"
#include "host_tools/identify/plausible.hpp"
#include "host_tools/identify/shape_search.hpp"
#include "host_tools/identify/torque_lead.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/parallel.hpp"

namespace fxdyn {
namespace {

std::string joined(const std::vector<std::string>& names) {
  std::string out;
  for (const std::string& name : names) out += (out.empty() ? "" : ", ") + name;
  return out;
}

/// One run: designs that become better stage by stage.
class Identification {
 public:
  Identification(const Project& project, GateData& data, Progress& progress, const IdentifyOptions& options)
      : project_(project), data_(data), progress_(progress), options_(options), joints_(project.robot.size()) {
    if (project.identify.effects) {
      nominal_ = *project.identify.effects;
      optional_.clear();
    }
    for (const std::string& effect : nominal_) {
      if (const std::string reason = why_not_identified(*find_effect(effect)); !reason.empty())
        throw InputError(fmt::format("{}: identify.effects: {}", project.file.string(), reason));
    }
  }

  std::unique_ptr<Fitter> run() {
    const std::vector<JointFit> design = nominal_design();
    progress_.stage("building the regressor", 1);
    fitter_ = std::make_unique<Fitter>(project_.robot, data_.logs, design);
    set_prior(*fitter_, project_);
    check_saturation();
    for (const Suspicion& suspicion : check_plausible(project_.robot, data_.logs, design, options_.plausible)) {
      if (suspicion.severity == Severity::error) throw DataError(suspicion.text);
      data_.notes.push_back(suspicion.text);
    }
    leave_out_dependent();
    reweight();
    search_nominal_shapes();
    search_optional_effects();
    progress_.stage("widths and distances", 1);
    fitter_->polish();
    weigh(*fitter_, project_.identify);
    progress_.step();
    progress_.done();
    add_notes();
    return std::move(fitter_);
  }

 private:
  bool is_left_out(std::size_t joint) const { return data_.logs.front().is_left_out(static_cast<Eigen::Index>(joint)); }
  const std::string& name(std::size_t joint) const { return project_.robot.joints[joint].name; }
  void reweight() {
    if (project_.identify.method != "ls") fitter_->reweight();
  }

  /// Nominal effects without a shape; a rotor that the base parameters hold already is none.
  std::vector<JointFit> nominal_design() {
    const DhChain chain = to_dh(project_.robot);
    const BaseSet base = find_base(chain);
    std::vector<JointFit> design = initial_joints(project_, data_);
    for (std::size_t j = 0; j < joints_; ++j) {
      const auto k = static_cast<Eigen::Index>(j);
      scales_.push_back({data_.dq[k], data_.q_upper[k] - data_.q_lower[k]});
      if (is_left_out(j)) continue;
      for (const std::string& effect : nominal_) {
        if (in_base(effect) && rotor_inertia_is_absorbed(chain, base, k)) continue;
        if (!find_effect(effect)->shape.empty()) continue;
        EffectFit fit;
        fit.effect = effect;
        design[j].effects.push_back(fit);
      }
    }
    return design;
  }

  void check_saturation() const {
    const std::vector<Eigen::Index> saturated = fitter_->saturated_rows();
    for (std::size_t j = 0; j < joints_; ++j) {
      const double share = static_cast<double>(saturated[j]) / static_cast<double>(fitter_->rows());
      if (share < options_.structure.most_saturated || is_left_out(j)) continue;
      throw DataError(fmt::format(
          "torque of joint {} ({}) is at its limit for {:.0f} % of the logs: record with less load or speed, or "
          "check torque_gain",
          j + 1, name(j), 100 * share));
    }
  }

  void leave_out_dependent() {
    const auto dependent = fitter_->dependent_effects();
    for (auto d = dependent.rbegin(); d != dependent.rend(); ++d) {
      JointFit joint = fitter_->design(d->joint);
      data_.notes.push_back(
          fmt::format("{}: {} left out, these logs can't tell it from the base parameters and the other effects",
                      name(d->joint), joint.effects[d->effect].effect));
      joint.effects.erase(joint.effects.begin() + static_cast<std::ptrdiff_t>(d->effect));
      fitter_->set_design(d->joint, joint);
    }
  }

  /// All joints at once from the same state, then accepted together: the outcome does not depend on the thread count.
  template <class Propose>
  void improve(const std::string& stage, bool always, Propose&& propose) {
    progress_.stage(stage, joints_);
    const std::vector<Judgement> before = fitter_->held_out();
    std::vector<Candidate> best(joints_);
    parallel_for(joints_, [&](std::size_t j) {
      if (!is_left_out(j)) best[j] = propose(j);
      progress_.step();
    });
    for (std::size_t j = 0; j < joints_; ++j) {
      if (is_left_out(j)) continue;
      if (always || best[j].judgement.beats(before[j], options_.structure.worth_keeping))
        fitter_->set_design(j, best[j].design);
    }
    reweight();
  }

  void search_nominal_shapes() {
    improve("width of the Coulomb sign", true, [&](std::size_t j) { return search_width(*fitter_, j, scales_[j]); });
    // A width that is off by the grid's step looks like another effect.
    fitter_->polish();
    reweight();
    for (const std::string& effect : nominal_) {
      if (find_effect(effect)->shape.empty()) continue;
      improve("shape of " + effect, true,
              [&](std::size_t j) { return search_effect(*fitter_, j, effect, scales_[j], options_.structure); });
    }
  }

  void align() {
    if (project_.signals.torque_lead_s) return;
    progress_.stage("is the torque ahead of the motion?", 1);
    find_torque_lead(*fitter_, data_.filter.torque_cutoff_hz, options_.structure);
    reweight();
    progress_.step();
  }

  std::size_t effect_count() const {
    std::size_t count = 0;
    for (std::size_t j = 0; j < joints_; ++j) count += fitter_->design(j).effects.size();
    return count;
  }

  /// A torque that is not aligned hides effects, and missing effects look like one that is not: effects first, then
  /// again where that changed something.
  void search_optional_effects() {
    for (int round = 0; round < 2; ++round) {
      const std::size_t before = effect_count();
      for (const std::string_view effect : optional_) {
        if (joints_ == 1 && find_effect(effect)->needs_peers) continue;
        improve("is there " + std::string(effect) + "?", false, [&](std::size_t j) {
          return fitter_->design(j).find(effect) != nullptr
                     ? Candidate{fitter_->design(j), {}}
                     : search_effect(*fitter_, j, effect, scales_[j], options_.structure);
        });
      }
      fitter_->polish();
      reweight();
      const bool was_aligned = fitter_->torque_lead_s() != 0;
      align();
      if (effect_count() == before && was_aligned == (fitter_->torque_lead_s() != 0)) break;
    }
  }

  void add_notes() const {
    for (std::size_t j = 0; j < joints_; ++j) {
      std::vector<std::string> found;
      for (const std::string_view effect : optional_) {
        if (fitter_->design(j).find(effect) != nullptr) found.emplace_back(effect);
      }
      if (!found.empty()) data_.notes.push_back(fmt::format("joint {} ({}): found {}", j + 1, name(j), joined(found)));
    }
    if (fitter_->torque_lead_s() != 0) data_.notes.push_back(torque_lead_note(fitter_->torque_lead_s()));
  }

  const Project& project_;
  GateData& data_;
  Progress& progress_;
  const IdentifyOptions& options_;
  std::size_t joints_;
  std::vector<std::string> nominal_ = nominal_effects();
  std::vector<std::string_view> optional_ = identified_effects();
  std::vector<Scales> scales_;
  std::unique_ptr<Fitter> fitter_;
};

}  // namespace

void weigh(Fitter& fitter, const IdentifySettings& settings) {
  if (settings.method == "ls") return;
  if (settings.method == "irls") {
    fitter.reweight_rows();
  } else {
    fitter.reweight();
  }
  if (settings.method == "rls" && settings.forgetting < 1) fitter.forget(settings.forgetting);
}

void set_prior(Fitter& fitter, const Project& project) {
  if (!project.identify.prior_error) return;
  try {
    fitter.set_prior(prior_of_urdf(project.robot, fitter.chain(), fitter.base(), *project.identify.prior_error));
  } catch (const InputError& error) {
    throw InputError(fmt::format("{}: identify.prior_error: {}; add it, or leave prior_error out",
                                 project.file.string(), error.what()));
  }
}

std::string torque_lead_note(double lead_s) {
  return fmt::format(
      "the torque column is {:.2f} ms {} the motion: taken into account ([signals] torque_lead_s overrides)",
      1e3 * std::fabs(lead_s), lead_s > 0 ? "ahead of" : "behind");
}

std::unique_ptr<Fitter> identify(const Project& project, GateData& data, Progress& progress,
                                 const IdentifyOptions& options) {
  return Identification(project, data, progress, options).run();
}

}  // namespace fxdyn
