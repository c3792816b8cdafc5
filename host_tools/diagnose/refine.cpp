#include "host_tools/diagnose/refine.hpp"

#include <algorithm>
#include <cmath>

#include "host_tools/diagnose/base_parameters.hpp"
#include "host_tools/diagnose/dictionary.hpp"
#include "host_tools/diagnose/gain.hpp"
#include "host_tools/diagnose/load_places.hpp"
#include "host_tools/effects/effect_roles.hpp"
#include "host_tools/effects/effects.hpp"
#include "host_tools/regression/search_beside.hpp"
#include "host_tools/regression/solver.hpp"

namespace fxdyn::diagnosis {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Tries shapes of one candidate beside the columns of a fit.
class Refinement {
 public:
  Refinement(const Linearised& problem, const LinearFit& beside, const Group& start)
      : group_(start), problem_(problem), columns_(beside.columns) {
    MatrixXd gram;
    problem_.solver().normal(columns_, problem_.blocks().fit, gram, projection_);
    inverse_ = SymmetricSolver(gram).inverse();
    best_columns_ = problem_.make(group_);
    best_ = gain_with(best_columns_);
    first_ = best_;
    // A column of an effect on the position costs a simulation.
    rounds_ = find_effect(start.candidate.effect)->acts_on == ActsOn::torque ? 4 : 2;
  }

  /// @param value of a group: what is searched
  template <class Value>
  void search(Value&& value, double ratio, double least, double most) {
    struct Tried {
      double square = 0;
      std::vector<MatrixXd> columns;
    };
    const auto make = [&](double there) {
      Group group = group_;
      value(group) = there;
      std::vector<MatrixXd> columns = problem_.make(group);
      const double square = gain_with(columns);
      return Tried{square, std::move(columns)};
    };
    const auto accept = [&](Tried tried) {
      if (tried.square <= best_) return false;
      best_ = tried.square;
      best_columns_ = std::move(tried.columns);
      return true;
    };
    double best = value(group_);
    search_beside(best, ratio, rounds_, least, most, make, accept);
    value(group_) = best;
  }

  /// A load is a body: its second moment brakes and drives as well. Columns around no load lack that, and what they
  /// take for it may be a mass of less than nothing. So they are made around where the load is.
  void place_load() {
    const std::vector<MatrixXd>& any = problem_.load_columns();
    const Reduced body = reduced(any, moments_of_load);
    const auto centre = best_place(body.gram, body.projection);
    if (!centre) return;
    std::vector<MatrixXd> made(any.size());
    for (std::size_t j = 0; j < any.size(); ++j) {
      if (best_columns_[j].size() > 0) made[j] = any[j] * moments_around(*centre);
    }
    const double square = gain_with(made);
    if (square <= best_) return;
    best_ = square;
    best_columns_ = std::move(made);
  }

  /// The candidate, as good as it has become.
  const Group& group() const { return group_; }
  std::optional<Refined> result() {
    if (best_ <= first_) return std::nullopt;
    return Refined{group_, std::move(best_columns_)};
  }

 private:
  double gain_with(const std::vector<MatrixXd>& made) const {
    return gain_of(reduced(made, group_.count), group_.lower, is_share(group_), problem_.options().search.beyond_bound)
        .square;
  }
  Reduced reduced(const std::vector<MatrixXd>& made, Index count) const {
    Reduced out;
    out.gram = MatrixXd::Zero(count, count);
    out.projection = VectorXd::Zero(count);
    MatrixXd cross = MatrixXd::Zero(static_cast<Index>(columns_.size()), count);
    for (std::size_t j = 0; j < problem_.joints(); ++j) {
      if (made[j].size() > 0) add_products(j, made[j], out, cross);
    }
    out.size = out.gram.diagonal();
    const MatrixXd z = inverse_ * cross;
    out.gram -= cross.transpose() * z;
    out.projection -= z.transpose() * projection_;
    return out;
  }

  /// @param cross between the fit's columns and the candidate's
  void add_products(std::size_t joint, const MatrixXd& made, Reduced& reduced, MatrixXd& cross) const {
    const JointRows& rows = problem_.solver().rows(joint);
    const double w = problem_.solver().weights()[static_cast<Index>(joint)];
    for (const std::size_t b : problem_.blocks().fit) {
      const Block& block = problem_.blocks().all[b];
      if (block.healthy) continue;
      const auto c = made.middleRows(block.first, block.count);
      reduced.gram += w * c.transpose() * c;
      reduced.projection += w * c.transpose() * rows.y.segment(block.first, block.count);
      for (std::size_t i = 0; i < columns_.size(); ++i) {
        const Index local = rows.place(columns_[i]);
        if (local >= 0)
          cross.row(static_cast<Index>(i)) += w * rows.x.col(local).segment(block.first, block.count).transpose() * c;
      }
    }
    const auto extra = made.bottomRows(rows.extra_y.size());
    reduced.gram += w * extra.transpose() * extra;
    reduced.projection += w * extra.transpose() * rows.extra_y;
    for (std::size_t i = 0; i < columns_.size(); ++i) {
      const Index local = rows.place(columns_[i]);
      if (local >= 0 && extra.rows() > 0)
        cross.row(static_cast<Index>(i)) += w * rows.extra_x.col(local).transpose() * extra;
    }
  }

  Group group_;
  const Linearised& problem_;
  const std::vector<Index>& columns_;
  MatrixXd inverse_;
  VectorXd projection_;
  std::vector<MatrixXd> best_columns_;
  double best_ = 0, first_ = 0;
  int rounds_ = 0;
};

/// Of shapes that are searched one after the other.
constexpr std::size_t sweeps = 3;

/// First step of the search: a cell of a ripple's grid, else half as much again.
double first_ratio(const Linearised& problem, const EffectCandidate& candidate, std::size_t shape) {
  if (!find_effect(candidate.effect)->of_spectrum()) return 1.5;
  double range = 1e-9;
  for (const SessionLog& entry : problem.logs())
    range = std::max(range, entry.log.q_range[static_cast<Index>(candidate.joint)]);
  return 1 + 1.0 / (range * candidate.shape[shape]);
}

}  // namespace

std::optional<Refined> refined(const Linearised& problem, const LinearFit& beside, const Group& start) {
  const bool load = is_load(start.candidate.effect);
  if (searched_shape(start.candidate) < 0 && !start.rotor && !load) return std::nullopt;
  Refinement search(problem, beside, start);
  if (load) {
    search.place_load();
    return search.result();
  }
  const EffectInfo& info = *find_effect(start.candidate.effect);
  const std::vector<std::size_t> shapes = info.refined_shapes();
  // One at a time: the best value of one depends on the others.
  for (std::size_t sweep = 0; sweep < (shapes.size() > 1 ? sweeps : 1); ++sweep) {
    for (const std::size_t index : shapes) {
      const auto [least, most] = shape_limits(problem.models(), start.candidate.joint, info, info.shape[index]);
      search.search([index](Group& group) -> double& { return group.candidate.shape[index]; },
                    first_ratio(problem, start.candidate, index), least, most);
    }
  }
  if (search.group().rotor_inertia > 0) {
    search.search([](Group& group) -> double& { return group.rotor_inertia; }, 1.25, 0, search.group().rotor->most);
  }
  return search.result();
}

}  // namespace fxdyn::diagnosis
