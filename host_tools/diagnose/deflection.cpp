#include "host_tools/diagnose/deflection.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>

#include "host_tools/diagnose/deflection_fit.hpp"
#include "host_tools/diagnose/deflection_polish.hpp"
#include "host_tools/effects/effects.hpp"
#include "host_tools/effects/model_parts.hpp"
#include "host_tools/support/parallel.hpp"

namespace fxdyn::diagnosis {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Logs of one joint, by what they are for.
struct JointLogs {
  std::vector<LinkedLog> train, judge, healthy;
};

std::vector<LinkedLog> with_link(const std::vector<ProcessedLog>& logs, const std::vector<MatrixXd>& load,
                                 std::size_t joint, std::optional<Role> role) {
  std::vector<LinkedLog> out;
  for (std::size_t l = 0; l < logs.size(); ++l) {
    if (logs[l].qlink.size() > 0 && logs[l].has_link[joint] && (!role || logs[l].role == *role))
      out.push_back({&logs[l], &load[l]});
  }
  return out;
}

/// What a set's parts close on data that did not fit their coefficients: squares.
struct Closure {
  double before = 0, after = 0, noise = 0;
  std::vector<double> without;  ///< by part: with all but it

  /// The noise of the two encoders is no gap.
  double gap() const { return std::max(before - std::min(after, noise), 1e-300); }
  double all() const { return (before - after) / gap(); }
};

/// The deflection of one joint: the set of effects that explains it, and what speaks for it.
class JointDeflection {
 public:
  JointDeflection(const IdentifiedModel& model, const MatrixXd& covariance, JointLogs logs, std::size_t joint,
                  const DeflectionOptions& options)
      : options_(options),
        model_(model),
        covariance_(covariance),
        logs_(std::move(logs)),
        joint_(joint),
        rows_(model, logs_.train, joint) {}

  /// @param background what the healthy session has alike
  Deflections find(std::vector<DeflectionEffect>& background) {
    choose();
    if (set_.parts.empty()) return {};
    learn_healthy();
    closure_ = close();
    Deflections out;
    if (closure_.all() < options_.least_closure) {
      // .. where it is more than encoders make themselves, and than the healthy session shows.
      if (closure_.before >= options_.noted * closure_.noise && !healthy_bends_as_much())
        out.unexplained.push_back(joint_);
      return out;
    }
    const VectorXd colour = colour_of_rest();
    for (std::size_t p = 0; p < set_.parts.size(); ++p)
      (healthy_has(p) ? background : out.found).push_back(effect_of(p, colour));
    return out;
  }

 private:
  bool held_out() const { return !logs_.judge.empty() || logs_.train.size() > 1; }
  /// Colour of what the set does not explain.
  VectorXd colour_of_rest() const { return rows_.colour(residual(design(rows_, set_.parts), rows_.delta())); }

  void choose() {
    choose(true);
    if (rotor_ >= 0) return;
    // No rotor has less than nothing.
    rows_ = DeflectionRows(model_, logs_.train, joint_);
    uncertainty_ = {};
    choose(false);
  }

  void choose(bool with_rotor) {
    set_ = best_set(rows_, model_, covariance_, uncertainty_, options_, with_rotor);
    drop_small_parts();
    if (!set_.parts.empty()) refine(with_rotor);
    rotor_ = uncertainty_.rotor > 0 ? uncertainty_.rotor * rows_.z().tail(1)[0] : 0;
  }

  /// Coefficients, shapes and load together, and how sure they are.
  void refine(bool with_rotor) {
    DeflectionRows rows = alike(logs_.train, Rows::independent);
    const VectorXd colour = rows.colour(residual(design(rows, set_.parts), rows.delta()));
    fit(rows, colour, set_);
    polish(rows, colour, set_);
    add_deviations(rows, colour, model_, covariance_, with_rotor, set_);
    if (rows.z().size() > 0) rows_.move(rows.z());
  }

  /// Encoders are so fine that errors of the torque show too: what is a small part of the deflection is no finding.
  void drop_small_parts() {
    while (set_.parts.size() > 1) {
      const VectorXd colour = colour_of_rest();
      double whole = 0;
      std::vector<double> sizes;
      for (std::size_t p = 0; p < set_.parts.size(); ++p) {
        sizes.push_back(std::pow(size_of(rows_, set_.parts[p], set_.theta_of(p)), 2));
        whole += sizes.back();
      }
      const auto least = std::min_element(sizes.begin(), sizes.end());
      if (*least > options_.least_part * whole) return;
      set_.parts.erase(set_.parts.begin() + (least - sizes.begin()));
      fit(rows_, colour, set_);
    }
  }

  /// Logs of the joint with the load that was found.
  DeflectionRows alike(const std::vector<LinkedLog>& logs, Rows rows = Rows::all) const {
    DeflectionRows out(model_, logs, joint_, rows);
    if (rows_.z().size() == 0) return out;
    out.add_slopes(model_, uncertainty_);
    out.move(rows_.z());
    return out;
  }

  void learn_healthy() {
    if (logs_.healthy.empty()) return;
    DeflectionRows rows = alike(logs_.healthy);
    // The load stays where today's deflection has it: only the product with the compliance is known.
    rows.drop_slopes();
    LoadUncertainty same;
    healthy_ = best_set(rows, model_, {}, same, options_);
    for (std::size_t p = 0; p < healthy_.parts.size(); ++p)
      healthy_sizes_.push_back(size_of(rows_, healthy_.parts[p], healthy_.theta_of(p)));
  }

  /// Whether the healthy session has a part alike.
  bool healthy_has(std::size_t part) const {
    bool alike = false;
    const double today = size_of(rows_, set_.parts[part], set_.theta_of(part));
    for (std::size_t p = 0; p < healthy_.parts.size(); ++p) {
      if (healthy_.parts[p].effect == set_.parts[part].effect)
        alike = std::fabs(today - healthy_sizes_[p]) < options_.same * healthy_sizes_[p];
    }
    return alike;
  }

  /// Whether the healthy session's deflection is as large, whatever it is.
  bool healthy_bends_as_much() const {
    if (logs_.healthy.empty()) return false;
    const auto mean_square = [](const DeflectionRows& rows) {
      return residual(rows.offsets(), rows.delta()).squaredNorm() / static_cast<double>(rows.delta().size());
    };
    const double healthy = mean_square(alike(logs_.healthy)), today = mean_square(rows_);
    return today < std::pow(1 + options_.same, 2) * healthy;
  }

  /// Judged by coefficients that were fitted to something else: the validate logs, or each train log by the others.
  Closure close() const {
    Closure out;
    out.without.assign(set_.parts.size(), 0.0);
    if (!logs_.judge.empty()) {
      add(out, alike(logs_.judge), set_);
    } else if (!held_out()) {
      add(out, rows_, set_);
    } else {
      const VectorXd colour = colour_of_rest();
      for (std::size_t l = 0; l < logs_.train.size(); ++l) {
        std::vector<LinkedLog> rest = logs_.train;
        rest.erase(rest.begin() + static_cast<std::ptrdiff_t>(l));
        DeflectionSet other = set_;
        fit(alike(rest), colour, other);
        add(out, alike({logs_.train[l]}), other);
      }
    }
    return out;
  }

  void add(Closure& to, const DeflectionRows& judged, const DeflectionSet& set) const {
    std::vector<VectorXd> part_of;
    VectorXd all = VectorXd::Zero(judged.delta().size());
    for (std::size_t p = 0; p < set.parts.size(); ++p) {
      part_of.push_back(judged.columns(set.parts[p].effect, set.parts[p].shape) * set.theta_of(p));
      all += part_of.back();
    }
    const auto remaining = [&](const VectorXd& taken) {
      return residual(judged.offsets(), judged.delta() - taken).squaredNorm();
    };
    to.before += remaining(VectorXd::Zero(all.size()));
    to.after += remaining(all);
    to.noise += set_.noise * static_cast<double>(all.size());
    for (std::size_t p = 0; p < part_of.size(); ++p) to.without[p] += remaining(all - part_of[p]);
  }

  DeflectionEffect effect_of(std::size_t p, const VectorXd& colour) const {
    const DeflectionPart& part = set_.parts[p];
    const Index first = set_.first(p), count = set_.count(p);
    DeflectionEffect out;
    out.joint = joint_;
    out.fit.effect = part.effect;
    out.fit.shape = part.shape;
    out.fit.named = true;
    for (Index i = first; i < first + count; ++i) {
      out.fit.linear.push_back(set_.theta[i]);
      out.fit.linear_std.push_back(set_.std[i]);
    }
    out.fit.shape_std.assign(part.shape.size(), set_.shape_std[p]);
    out.closure = (closure_.without[p] - closure_.after) / closure_.gap();
    out.held_out = held_out();
    if (bends(part.effect)) out.rotor = rotor_;
    DeflectionSet less = set_, again = set_;
    less.parts.erase(less.parts.begin() + static_cast<std::ptrdiff_t>(p));
    fit(rows_, colour, less);
    fit(rows_, colour, again);
    out.score = again.likelihood - less.likelihood;
    return out;
  }

  const DeflectionOptions& options_;
  const IdentifiedModel& model_;
  const MatrixXd& covariance_;
  JointLogs logs_;
  std::size_t joint_;
  DeflectionRows rows_;
  LoadUncertainty uncertainty_;
  DeflectionSet set_, healthy_;
  std::vector<double> healthy_sizes_;  ///< of the healthy session's parts, over today's rows
  double rotor_ = 0;
  Closure closure_;
};

}  // namespace

Deflections find_deflections(const IdentifiedModel& model, const MatrixXd& base_covariance,
                             const std::vector<ProcessedLog>& now, const std::vector<ProcessedLog>& before,
                             std::vector<DeflectionEffect>& background, const DeflectionOptions& options) {
  const std::size_t n = joints_of(model).size();
  ModelValue healthy_model = model;  // without today's load
  std::erase_if(body_of(healthy_model), [](const EffectFit& fit) { return fit.named; });
  const std::vector<MatrixXd> load_now = rigid_loads(model, now), load_before = rigid_loads(healthy_model, before);
  std::vector<Deflections> found(n);
  std::vector<std::vector<DeflectionEffect>> learned(n);
  parallel_for(n, [&](std::size_t j) {
    JointLogs logs{with_link(now, load_now, j, Role::train), with_link(now, load_now, j, Role::validate),
                   with_link(before, load_before, j, {})};
    if (!logs.train.empty())
      found[j] = JointDeflection(model, base_covariance, std::move(logs), j, options).find(learned[j]);
  });
  Deflections out;
  for (std::size_t j = 0; j < n; ++j) {
    out.found.insert(out.found.end(), found[j].found.begin(), found[j].found.end());
    out.unexplained.insert(out.unexplained.end(), found[j].unexplained.begin(), found[j].unexplained.end());
    background.insert(background.end(), learned[j].begin(), learned[j].end());
  }
  return out;
}

std::vector<DeflectionEffect> at_joint(const Deflections& all, std::size_t joint) {
  std::vector<DeflectionEffect> out;
  for (const DeflectionEffect& effect : all.found) {
    if (effect.joint == joint) out.push_back(effect);
  }
  std::sort(out.begin(), out.end(), [](const auto& a, const auto& b) { return a.fit.effect < b.fit.effect; });
  return out;
}

Refitted take_where_better(const Deflections& before, const Deflections& again, std::size_t joints,
                           const DeflectionOptions& options) {
  const auto closes = [](const std::vector<DeflectionEffect>& all) {
    return std::accumulate(all.begin(), all.end(), 0.0,
                           [](double sum, const DeflectionEffect& effect) { return sum + effect.closure; });
  };
  Refitted out;
  for (std::size_t j = 0; j < joints; ++j) {
    const auto now = at_joint(again, j), was = at_joint(before, j);
    const bool same = std::equal(now.begin(), now.end(), was.begin(), was.end(),
                                 [](const auto& a, const auto& b) { return a.fit.effect == b.fit.effect; });
    const bool better = same && !was.empty() && closes(now) >= closes(was) - options.lost_closure;
    std::vector<DeflectionEffect>& to = better ? out.taken.found : out.kept.found;
    to.insert(to.end(), better ? now.begin() : was.begin(), better ? now.end() : was.end());
  }
  return out;
}

}  // namespace fxdyn::diagnosis
