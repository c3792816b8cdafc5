#include "host_tools/excite/plan.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "host_tools/excite/evolution.hpp"
#include "host_tools/excite/feasible.hpp"
#include "host_tools/excite/pose_walk.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/parallel.hpp"
#include "host_tools/support/random.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double infinity = std::numeric_limits<double>::infinity();

/// Fast: inertia. Slow: gravity and friction. Reversals: three times as many passes through zero velocity.
constexpr std::array kinds{SeriesKind{"fast", 1, 1, 1}, SeriesKind{"slow", 0.2, 1, 1},
                           SeriesKind{"reversals", 0.5, 1, 3}};
constexpr std::size_t static_at = 3;  ///< the fourth trajectory is the static one

constexpr int population = 16;
/// Generations grow with the number of coordinates (48 with six joints and order 5): of the search for each trajectory
/// and start, of the polish for each trajectory and round.
int search_generations(Index coordinates) { return 30 + static_cast<int>(coordinates); }
int polish_generations(Index coordinates) { return 60 + 6 * static_cast<int>(coordinates); }
constexpr int polish_rounds = 2;
constexpr Index static_poses = 10;
/// Objective: log(condition of the base) + all_weight log(condition of all) - weight log det / parameters. The
/// determinant is the smoother guide, the condition numbers are the aim.
constexpr double search_weight = 0.5, polish_weight = 1.0, all_weight = 0.25;
/// Of a violation, see LimitCheck: large enough that no optimum lies beyond a limit.
constexpr double penalty = 50;

constexpr double between_samples = FeasibleMotions::between_samples;

/// Indices in ascending order of the values.
std::vector<std::size_t> ascending(const std::vector<double>& values) {
  std::vector<std::size_t> order(values.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return values[a] < values[b]; });
  return order;
}

class Planner {
 public:
  Planner(const Project& project, const std::filesystem::path& directory, Progress& progress)
      : project_(project),
        settings_(project.excite),
        progress_(progress),
        feasible_(project, directory, plan_.notes),
        check_(feasible_.check()),
        columns_(project.robot, sign_widths(project, directory)) {
    choose_noise();
  }

  Plan plan() {
    random_baseline();
    search();
    if (has_static()) choose_walk();
    polish();
    for (std::size_t k = 0; k < coordinates_.size(); ++k) {
      if (k == static_at) add_static();
      add_fourier(k);
    }
    if (coordinates_.size() == static_at && has_static()) add_static();
    for (std::size_t i = 0; i < plan_.trajectories.size(); ++i) {
      plan_.trajectories[i].name = fmt::format("{}_{}", i + 1, plan_.trajectories[i].kind);
    }
    judge();
    return std::move(plan_);
  }

 private:
  struct Draw {
    VectorXd x;
    MatrixXd information;
  };
  Index joints() const { return check_.lower().size(); }
  bool has_static() const { return static_cast<std::size_t>(settings_.trajectories) > static_at; }

  /// Kinds of the Fourier trajectories in the order of the plan.
  std::vector<const SeriesKind*> fourier_kinds() const {
    std::vector<const SeriesKind*> list;
    for (std::size_t i = 0; i < static_cast<std::size_t>(settings_.trajectories); ++i) {
      if (i != static_at) list.push_back(&kinds[i < static_at ? i : (i - static_at - 1) % kinds.size()]);
    }
    return list;
  }

  void choose_noise() {
    plan_.noise.resize(joints());
    plan_.rated.resize(joints());
    for (Index j = 0; j < joints(); ++j) {
      const auto i = static_cast<std::size_t>(j);
      const double given = settings_.noise.empty() ? 0 : settings_.noise[i];
      double rated = 1;
      if (!project_.rated_torque.empty()) {
        rated = project_.rated_torque[i];
      } else if (std::isfinite(check_.limits().torque[j])) {
        rated = check_.limits().torque[j];
      } else if (given > 0) {
        rated = 100 * given;
      }
      plan_.rated[j] = rated;
      plan_.noise[j] = given > 0 ? given : 0.01 * rated;
    }
    if (settings_.noise.empty() || plan_.noise.minCoeff() <= 0) {
      plan_.notes.push_back("torque noise not given: 1 % of the rated torque (else of the torque limit) assumed");
    }
  }

  MatrixXd information(const SeriesCoordinates& coordinates, const Motion& motion) const {
    return columns_.information(motion, plan_.noise) * coordinates.kind().periods;
  }

  Conditioning conditioning(const MatrixXd& information) const {
    const Index base = columns_.base_size();
    return {scaled_condition(information.topLeftCorner(base, base)), scaled_condition(information),
            log_determinant(information)};
  }

  static void keep_best(Conditioning& best, const Conditioning& one) {
    best.base = std::min(best.base, one.base);
    best.all = std::min(best.all, one.all);
    best.log_determinant = std::max(best.log_determinant, one.log_determinant);
  }

  double value(const MatrixXd& information, double determinant_weight) const {
    const Conditioning c = conditioning(information);
    // A plan that can't determine a parameter still compares with another one.
    const auto log_of = [](double condition) { return std::min(std::log(condition), 40.0); };
    const double determinant = std::max(c.log_determinant / static_cast<double>(columns_.size()), -100.0);
    return log_of(c.base) + all_weight * log_of(c.all) - determinant_weight * determinant;
  }

  /// Random feasible plans: what the optimised one is compared with, and what it starts from.
  void random_baseline() {
    const auto list = fourier_kinds();
    for (const SeriesKind* kind : list) coordinates_.emplace_back(check_, *kind, settings_);
    progress_.stage("random plans", random_plans);
    draws_.assign(list.size(), std::vector<Draw>(random_plans));
    std::vector<Conditioning> plans(random_plans), firsts(random_plans);
    parallel_for(random_plans, [&](std::size_t i) {
      MatrixXd sum = MatrixXd::Zero(columns_.size(), columns_.size());
      for (std::size_t k = 0; k < list.size(); ++k) {
        const std::uint64_t seed = (settings_.seed * 1000 + k) * 1000 + i;
        Draw& draw = draws_[k][i];
        draw.x = feasible_.random(coordinates_[k], seed);
        draw.information = information(coordinates_[k], coordinates_[k].decode(draw.x).motion);
        sum += draw.information;
        if (k == 0) firsts[i] = conditioning(sum);
      }
      if (has_static()) {
        Random random(settings_.seed * 7919 + i);
        sum += static_information(random_walk(random));
      }
      plans[i] = conditioning(sum);
      progress_.step();
    });
    plan_.before = plan_.trajectory_before = {infinity, infinity, -infinity};
    for (const Conditioning& one : plans) keep_best(plan_.before, one);
    for (const Conditioning& one : firsts) keep_best(plan_.trajectory_before, one);
  }

  /// From several starts, each trajectory with those before it.
  void search() {
    total_ = MatrixXd::Zero(columns_.size(), columns_.size());
    for (std::size_t k = 0; k < coordinates_.size(); ++k) {
      const SeriesCoordinates& coordinates = coordinates_[k];
      progress_.stage(fmt::format("searching {} ({}/{})", coordinates.kind().name, k + 1, coordinates_.size()),
                      static_cast<std::size_t>(settings_.starts * search_generations(coordinates.size())));
      std::vector<double> ranks(draws_[k].size());
      parallel_for(ranks.size(),
                   [&](std::size_t i) { ranks[i] = value(total_ + draws_[k][i].information, search_weight); });
      const std::vector<std::size_t> order = ascending(ranks);
      Draw best = draws_[k][order[0]];
      double best_value = ranks[order[0]];
      for (std::size_t start = 0; start < static_cast<std::size_t>(settings_.starts); ++start) {
        const EvolutionSettings evolution{search_generations(coordinates.size()), population, 0.2,
                                          settings_.seed * 100 + start};
        improve(coordinates, draws_[k][order[start % order.size()]].x, total_, search_weight, evolution, best,
                best_value);
      }
      total_ += best.information;
      chosen_.push_back(best);
    }
  }

  /// Each trajectory again, with all the others.
  void polish() {
    const int generations = polish_generations(coordinates_[0].size());
    progress_.stage("polishing", static_cast<std::size_t>(polish_rounds * generations) * coordinates_.size());
    for (int round = 0; round < polish_rounds; ++round) {
      for (std::size_t k = 0; k < coordinates_.size(); ++k) {
        const MatrixXd others = total_ - chosen_[k].information;
        double best_value = value(total_, polish_weight);
        const EvolutionSettings evolution{generations, population, 0.1,
                                          settings_.seed * 100 + 50 + static_cast<std::uint64_t>(round)};
        improve(coordinates_[k], VectorXd(chosen_[k].x), others, polish_weight, evolution, chosen_[k], best_value);
        total_ = others + chosen_[k].information;
      }
    }
  }

  void improve(const SeriesCoordinates& coordinates, const VectorXd& start, const MatrixXd& others, double weight,
               const EvolutionSettings& evolution, Draw& best, double& best_value) {
    const auto objective = [&](const VectorXd& x) {
      const auto decoded = coordinates.decode(x);
      return value(others + information(coordinates, decoded.motion), weight) + 1e-3 * decoded.overflow +
             penalty * check_.violation(decoded.motion, between_samples);
    };
    VectorXd x = minimise(objective, start, evolution, [&] { progress_.step(); });
    if (!feasible_.make_feasible(coordinates, x)) return;
    const MatrixXd own = information(coordinates, coordinates.decode(x).motion);
    if (const double at = value(others + own, weight); at < best_value) {
      best_value = at;
      best = {x, own};
    }
  }

  void add_fourier(std::size_t index) {
    const SeriesCoordinates& coordinates = coordinates_[index];
    PlannedTrajectory planned;
    planned.kind = coordinates.kind().name;
    planned.period_s = coordinates.period_s();
    planned.periods = coordinates.kind().periods;
    FeasibleMotions::Sampled sampled = feasible_.sample(coordinates, chosen_[index].x);
    planned.series = std::move(sampled.series);
    static_cast<Motion&>(planned) = std::move(sampled.motion);
    plan_.trajectories.push_back(std::move(planned));
  }

  /// Nothing is written that leaves its limits between the samples that the search looked at.
  void check_all() const {
    for (const PlannedTrajectory& planned : plan_.trajectories) {
      if (check_.violation(planned) == 0) continue;
      throw DataError(
          fmt::format("{}: trajectory '{}' does not fit into the limits with a margin of {:.0f} %; widen the limits or "
                      "choose another [excite] seed",
                      project_.file.string(), planned.kind, 100 * check_.margin()));
    }
  }

  MatrixXd static_information(const PoseWalk& walk) const {
    return columns_.information(walk.motion(coarse_step_s), plan_.noise);
  }

  PoseWalk random_walk(Random& random) const {
    PoseWalk out;
    for (int tries = 0; tries < 100 && static_cast<Index>(out.poses.size()) < static_poses; ++tries) {
      const auto pick = static_cast<std::size_t>(random.uniform() * static_cast<double>(feasible_.poses().size()));
      out.extend(feasible_.poses()[pick], check_, between_samples);
    }
    return out;
  }

  /// Poses one by one, each the one that adds most to log det.
  void choose_walk() {
    progress_.stage("choosing poses", static_cast<std::size_t>(static_poses));
    std::vector<MatrixXd> gains(feasible_.poses().size());
    parallel_for(feasible_.poses().size(), [&](std::size_t i) {
      gains[i] = PoseWalk::dwell_s * columns_.information(one_pose(feasible_.poses()[i]), plan_.noise);
    });
    MatrixXd sum = total_;
    while (static_cast<Index>(walk_.poses.size()) < static_poses) {
      std::vector<double> lost(feasible_.poses().size());
      parallel_for(feasible_.poses().size(), [&](std::size_t i) { lost[i] = -log_determinant(sum + gains[i]); });
      const std::vector<std::size_t> order = ascending(lost);
      const auto next = std::find_if(order.begin(), order.end(), [&](std::size_t i) {
        return walk_.extend(feasible_.poses()[i], check_, between_samples);
      });
      if (next == order.end()) break;
      sum += gains[*next];
      progress_.step();
    }
    total_ += static_information(walk_);
  }

  void add_static() {
    PlannedTrajectory planned;
    static_cast<Motion&>(planned) = walk_.motion(settings_.step_s);
    planned.kind = "static";
    planned.poses = walk_.matrix();
    planned.moves_s = walk_.moves_s;
    planned.dwell_s = PoseWalk::dwell_s;
    plan_.trajectories.push_back(std::move(planned));
  }

  void judge() {
    progress_.done();
    check_all();
    const std::vector<Motion> motions(plan_.trajectories.begin(), plan_.trajectories.end());
    // of what is written, at the rate that it is written with
    MatrixXd whole = MatrixXd::Zero(columns_.size(), columns_.size());
    for (const Motion& motion : motions) {
      whole += columns_.information(motion, plan_.noise);
      if (&motion == &motions.front()) plan_.trajectory_after = conditioning(whole);
    }
    plan_.after = conditioning(whole);
    plan_.information = whole / settings_.step_s;
    const Motion free = free_motion(project_.robot, check_.limits());
    ParameterSizes sizes{columns_.names(),
                         columns_.joints(),
                         {},
                         columns_.information(free, plan_.rated).diagonal().cwiseSqrt().cwiseInverse()};
    for (Index i = 0; i < columns_.size(); ++i) sizes.of_link.push_back(i < columns_.base_size());
    VectorXd movement(joints());
    for (Index j = 0; j < joints(); ++j) {
      double low = infinity, high = -infinity;
      for (const Motion& motion : motions) {
        low = std::min(low, motion.q.col(j).minCoeff());
        high = std::max(high, motion.q.col(j).maxCoeff());
      }
      movement[j] = (high - low) / (free.q.col(j).maxCoeff() - free.q.col(j).minCoeff());
    }
    std::vector<std::string> lost;
    Index joint = -1;
    plan_.parameters = weak_parameters(plan_.information, sizes, movement, 0);
    for (const WeakParameter& parameter : plan_.parameters) {
      if (parameter.identifiable) continue;
      lost.push_back(parameter.name);
      if (joint < 0 || movement[parameter.joint] < movement[joint]) joint = parameter.joint;
    }
    if (!lost.empty()) {
      throw DataError(
          fmt::format("{}: within these limits {} can't be told; let joint '{}' move more (it covers {:.2g} "
                      "of a free joint's range) by wider limits or a larger box, or take a higher order or more "
                      "trajectories",
                      project_.file.string(), fmt::join(lost, ", "),
                      project_.robot.joints[static_cast<std::size_t>(joint)].name, movement[joint]));
    }
    plan_.usage = check_.usage(motions);
  }

  const Project& project_;
  const ExciteSettings& settings_;
  Progress& progress_;
  Plan plan_;
  FeasibleMotions feasible_;
  const LimitCheck& check_;
  ParameterColumns columns_;
  std::vector<SeriesCoordinates> coordinates_;  ///< of each Fourier trajectory
  std::vector<std::vector<Draw>> draws_;        ///< likewise, random ones
  std::vector<Draw> chosen_;                    ///< likewise, the plan's
  PoseWalk walk_;
  MatrixXd total_;  ///< information of the plan so far
};

}  // namespace

Plan make_plan(const Project& project, const std::filesystem::path& directory, Progress& progress) {
  return Planner(project, directory, progress).plan();
}

}  // namespace fxdyn
