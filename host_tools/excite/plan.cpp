#include "host_tools/excite/plan.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>

#include "host_tools/effects/identified_model.hpp"
#include "host_tools/excite/evolution.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/parallel.hpp"
#include "host_tools/support/random.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double infinity = std::numeric_limits<double>::infinity();

/// What a kind of trajectory does with the limits.
struct Kind {
  const char* name;
  double velocity, acceleration;  ///< share of the limits that it may use
  int periods;                    ///< periods of the series within period_s
};
/// Fast: inertia. Slow: gravity and friction. Reversals: three times as many passes through zero velocity.
constexpr std::array kinds{Kind{"fast", 1, 1, 1}, Kind{"slow", 0.2, 1, 1}, Kind{"reversals", 0.5, 1, 3}};
constexpr std::size_t static_at = 3;  ///< the fourth trajectory is the static one

constexpr int samples_per_harmonic = 16;  ///< while optimising
/// Kept while optimising, beside the margin: what falls between those samples.
constexpr double between_samples = 0.02;
constexpr int population = 16;
/// Generations grow with the number of coordinates (48 with six joints and order 5): of the search for each trajectory
/// and start, of the polish for each trajectory and round.
int search_generations(Index coordinates) { return 30 + static_cast<int>(coordinates); }
int polish_generations(Index coordinates) { return 60 + 6 * static_cast<int>(coordinates); }
constexpr int polish_rounds = 2;
constexpr int pool_size = 150;  ///< feasible poses, to start from and to dwell at
constexpr Index static_poses = 10;
constexpr double dwell_s = 1, static_speed = 0.5;
/// Objective: log(condition of the base) + all_weight log(condition of all) - weight log det / parameters. The
/// determinant is the smoother guide, the condition numbers are the aim.
constexpr double search_weight = 0.5, polish_weight = 1.0, all_weight = 0.25;
/// Of a violation, see LimitCheck: large enough that no optimum lies beyond a limit.
constexpr double penalty = 50;

Motion one_pose(const VectorXd& q) {
  return {"", 1, VectorXd::Zero(1), q.transpose(), MatrixXd::Zero(1, q.size()), MatrixXd::Zero(1, q.size())};
}

/// Series of one kind in coordinates of the null space: per joint z (null_a.cols() + null_b.cols()) and the centre as a
/// share of the half range. Whatever the coordinates, the series keeps the limits of position, velocity and
/// acceleration: it is scaled down where it would not, and its centre moved.
class Coordinates {
 public:
  Coordinates(const LimitCheck& check, const Kind& kind, const ExciteSettings& settings)
      : check_(check),
        kind_(kind),
        period_s_(settings.period_s / kind.periods),
        null_(boundary_null_space(settings.order)),
        step_s_(period_s_ / (samples_per_harmonic * settings.order)) {
    const Index samples = samples_per_harmonic * settings.order;
    q_.resize(samples, null_.size());
    dq_.resize(samples, null_.size());
    ddq_.resize(samples, null_.size());
    for (Index i = 0; i < null_.size(); ++i) {
      const FourierJoint direction = series_of(VectorXd::Unit(null_.size(), i), 0);
      for (Index k = 0; k < samples; ++k) {
        const FourierState state = evaluate(direction, period_s_, step_s_ * static_cast<double>(k));
        q_(k, i) = state.q;
        dq_(k, i) = state.dq;
        ddq_(k, i) = state.ddq;
      }
    }
    Random random(settings.seed);
    unit_ = VectorXd::Zero(joints());
    constexpr int draws = 20;
    for (Index j = 0; j < joints(); ++j) {
      for (int i = 0; i < draws; ++i) unit_[j] += largest_scale(j, normal(random).normalized()) / draws;
    }
  }

  Index joints() const { return check_.lower().size(); }
  Index per_joint() const { return null_.size() + 1; }
  Index size() const { return joints() * per_joint(); }
  double period_s() const { return period_s_; }
  const Kind& kind() const { return kind_; }

  struct Decoded {
    std::vector<FourierJoint> series;
    Motion motion;        ///< one period, coarse
    double overflow = 0;  ///< sum of squared logarithms of how far the coordinates asked beyond the limits
  };
  Decoded decode(const VectorXd& x) const {
    const Index samples = q_.rows();
    Decoded out{{}, {"", step_s_, VectorXd(samples), MatrixXd(samples, joints()), {}, {}}, 0};
    out.motion.dq = out.motion.ddq = out.motion.q;
    for (Index k = 0; k < samples; ++k) out.motion.t[k] = step_s_ * static_cast<double>(k);
    for (Index j = 0; j < joints(); ++j) {
      VectorXd z = unit_[j] * x.segment(j * per_joint(), null_.size());
      const double scale = largest_scale(j, z);
      if (scale < 1) {
        z *= scale;
        out.overflow += std::log(scale) * std::log(scale);
      }
      const double middle = 0.5 * (check_.lower()[j] + check_.upper()[j]);
      const double half = 0.5 * (check_.upper()[j] - check_.lower()[j]);
      const VectorXd moved = q_ * z;
      const double peak = between_samples_share() * half;
      const double first = check_.lower()[j] + peak - std::min(0.0, moved.minCoeff());
      const double last = check_.upper()[j] - peak - std::max(0.0, moved.maxCoeff());
      const double centre = std::max(first, std::min(last, middle + half * x[j * per_joint() + null_.size()]));
      out.series.push_back(series_of(z, centre));
      out.motion.q.col(j) = moved.array() + centre;
      out.motion.dq.col(j) = dq_ * z;
      out.motion.ddq.col(j) = ddq_ * z;
    }
    return out;
  }

  /// A random series that reaches the tightest limit of each joint, about the given centre where the limits let it.
  VectorXd random(std::uint64_t seed, const VectorXd& centre) const {
    Random random(seed);
    VectorXd x(size());
    for (Index j = 0; j < joints(); ++j) {
      const VectorXd z = normal(random);
      x.segment(j * per_joint(), null_.size()) = z * (largest_scale(j, z) / unit_[j]);
      x[j * per_joint() + null_.size()] =
          (2 * centre[j] - check_.lower()[j] - check_.upper()[j]) / (check_.upper()[j] - check_.lower()[j]);
    }
    return x;
  }
  void shrink(VectorXd& x, double factor) const {
    for (Index j = 0; j < joints(); ++j) x.segment(j * per_joint(), null_.size()) *= factor;
  }

 private:
  VectorXd normal(Random& random) const {
    VectorXd z(null_.size());
    for (double& value : z) value = random.normal();
    return z;
  }
  FourierJoint series_of(const VectorXd& z, double centre) const {
    return {centre, null_.a * z.head(null_.a.cols()), null_.b * z.tail(null_.b.cols())};
  }
  /// The peaks between the samples are higher than those at the samples by at most this share (highest harmonic).
  static double between_samples_share() { return 0.5 * std::pow(std::numbers::pi / samples_per_harmonic, 2); }
  /// The factor at which z meets the tightest of the joint's limits.
  double largest_scale(Index j, const VectorXd& z) const {
    const VectorXd moved = q_ * z;
    const double range = std::max(0.0, moved.maxCoeff()) - std::min(0.0, moved.minCoeff());
    const double sampled = 1 - between_samples_share(), kept = sampled * (1 - check_.margin());
    const MotionLimits& limits = check_.limits();
    return std::min({sampled * (check_.upper()[j] - check_.lower()[j]) / range,
                     kept * kind_.velocity * limits.velocity[j] / (dq_ * z).cwiseAbs().maxCoeff(),
                     kept * kind_.acceleration * limits.acceleration[j] / (ddq_ * z).cwiseAbs().maxCoeff()});
  }

  const LimitCheck& check_;
  Kind kind_;
  double period_s_;
  FourierNullSpace null_;
  double step_s_;
  MatrixXd q_, dq_, ddq_;  ///< samples x directions
  VectorXd unit_;          ///< largest_scale() of a usual direction of length 1
};

class Planner {
 public:
  Planner(const Project& project, const std::filesystem::path& directory, Progress& progress)
      : project_(project),
        settings_(project.excite),
        progress_(progress),
        check_(make_check(project, directory, plan_.notes)),
        columns_(project.robot, sign_widths(project, directory)) {
    choose_noise();
  }

  Plan plan() {
    find_poses();
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
  static LimitCheck make_check(const Project& project, const std::filesystem::path& directory,
                               std::vector<std::string>& notes) {
    MotionLimits limits = motion_limits(project);
    notes = limits.notes;
    auto model = torque_model(project, directory, notes);
    return {project.robot, std::move(limits), std::move(model), project.excite.margin};
  }

  static VectorXd sign_widths(const Project& project, const std::filesystem::path& directory) {
    VectorXd widths = VectorXd::Constant(static_cast<Index>(project.robot.size()), JointFit{}.sign_width);
    if (const auto file = directory / "model.json"; std::filesystem::exists(file)) {
      const IdentifiedModel model = read_model(file);
      for (Index j = 0; j < widths.size(); ++j) widths[j] = model.joints[static_cast<std::size_t>(j)].sign_width;
    }
    return widths;
  }

  struct Draw {
    VectorXd x;
    MatrixXd information;
  };
  /// Poses of a static trajectory and the durations of its moves.
  struct Walk {
    std::vector<VectorXd> poses;
    std::vector<double> moves_s;
  };

  Index joints() const { return check_.lower().size(); }
  bool has_static() const { return static_cast<std::size_t>(settings_.trajectories) > static_at; }

  /// Kinds of the Fourier trajectories in the order of the plan.
  std::vector<const Kind*> fourier_kinds() const {
    std::vector<const Kind*> list;
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

  /// Poses at rest within position limits, box and torque limits.
  void find_poses() {
    Random random(settings_.seed * 1000003 + 17);
    const auto draw = [&] {
      VectorXd q(joints());
      for (Index j = 0; j < q.size(); ++j) q[j] = random.uniform(check_.lower()[j], check_.upper()[j]);
      return q;
    };
    VectorXd best;
    double least = infinity;
    for (int tries = 0; tries < 50 * pool_size && pool_.size() < pool_size; ++tries) {
      const VectorXd q = draw();
      const double violation = check_.violation(one_pose(q), between_samples);
      if (violation < least) {
        least = violation;
        best = q;
      }
      if (violation == 0) pool_.push_back(q);
    }
    if (!pool_.empty()) return;
    const VectorXd middle = 0.5 * (check_.lower() + check_.upper()), half = 0.5 * (check_.upper() - check_.lower());
    const auto pose = [&](const VectorXd& x) {
      return VectorXd(middle + half.cwiseProduct(x.cwiseMax(-1).cwiseMin(1)));
    };
    const VectorXd x =
        minimise([&](const VectorXd& at) { return check_.violation(one_pose(pose(at)), between_samples); },
                 (best - middle).cwiseQuotient(half), {200, population, 0.2, settings_.seed}, [] {});
    best = pose(x);
    if (check_.violation(one_pose(best), between_samples) == 0) {
      pool_.push_back(best);
      return;
    }
    refuse("no pose at rest", one_pose(best));
  }

  [[noreturn]] void refuse(std::string_view what, const Motion& nearest) const {
    throw InputError(
        fmt::format("{}: {} keeps the limits and their margins; the best one found violates {}; widen that "
                    "limit or lower [excite] margin ({})",
                    project_.file.string(), what, check_.worst(nearest, between_samples), settings_.margin));
  }

  /// Shrinks the motion until it is feasible; whether it got there.
  bool make_feasible(const Coordinates& coordinates, VectorXd& x) const {
    for (int i = 0; check_.violation(coordinates.decode(x).motion, between_samples) > 0; ++i) {
      if (i == 40) return false;
      coordinates.shrink(x, 0.85);
    }
    return true;
  }

  VectorXd random_feasible(const Coordinates& coordinates, std::uint64_t seed) const {
    Random random(seed);
    VectorXd x;
    for (int tries = 0; tries < 20; ++tries) {
      const auto pick = static_cast<std::size_t>(random.uniform() * static_cast<double>(pool_.size()));
      x = coordinates.random(random.next(), pool_[pick]);
      if (make_feasible(coordinates, x)) return x;
    }
    refuse("no motion", coordinates.decode(x).motion);
  }

  MatrixXd information(const Coordinates& coordinates, const Motion& motion) const {
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
    // A plan that can't tell a parameter still compares with another one.
    const auto log_of = [](double condition) { return std::min(std::log(condition), 40.0); };
    const double determinant = std::max(c.log_determinant / static_cast<double>(columns_.size()), -100.0);
    return log_of(c.base) + all_weight * log_of(c.all) - determinant_weight * determinant;
  }

  /// Random feasible plans: what the optimised one is compared with, and what it starts from.
  void random_baseline() {
    const auto list = fourier_kinds();
    for (const Kind* kind : list) coordinates_.emplace_back(check_, *kind, settings_);
    progress_.stage("random plans", random_plans);
    draws_.assign(list.size(), std::vector<Draw>(random_plans));
    std::vector<Conditioning> plans(random_plans), firsts(random_plans);
    parallel_for(random_plans, [&](std::size_t i) {
      MatrixXd sum = MatrixXd::Zero(columns_.size(), columns_.size());
      for (std::size_t k = 0; k < list.size(); ++k) {
        const std::uint64_t seed = (settings_.seed * 1000 + k) * 1000 + i;
        Draw& draw = draws_[k][i];
        draw.x = random_feasible(coordinates_[k], seed);
        draw.information = information(coordinates_[k], coordinates_[k].decode(draw.x).motion);
        sum += draw.information;
        if (k == 0) firsts[i] = conditioning(sum);
      }
      if (has_static()) {
        Random random(settings_.seed * 7919 + i);
        sum += static_information(walk(random));
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
      const Coordinates& coordinates = coordinates_[k];
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

  void improve(const Coordinates& coordinates, const VectorXd& start, const MatrixXd& others, double weight,
               const EvolutionSettings& evolution, Draw& best, double& best_value) {
    const auto objective = [&](const VectorXd& x) {
      const auto decoded = coordinates.decode(x);
      return value(others + information(coordinates, decoded.motion), weight) + 1e-3 * decoded.overflow +
             penalty * check_.violation(decoded.motion, between_samples);
    };
    VectorXd x = minimise(objective, start, evolution, [&] { progress_.step(); });
    if (!make_feasible(coordinates, x)) return;
    const MatrixXd own = information(coordinates, coordinates.decode(x).motion);
    if (const double at = value(others + own, weight); at < best_value) {
      best_value = at;
      best = {x, own};
    }
  }

  /// Indices in ascending order of the values.
  static std::vector<std::size_t> ascending(const std::vector<double>& values) {
    std::vector<std::size_t> order(values.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return values[a] < values[b]; });
    return order;
  }

  /// Samples the series at the plan's step; what the coarse samples missed shrinks it.
  void add_fourier(std::size_t index) {
    const Coordinates& coordinates = coordinates_[index];
    VectorXd x = chosen_[index].x;
    PlannedTrajectory planned;
    planned.kind = coordinates.kind().name;
    planned.period_s = coordinates.period_s();
    planned.periods = coordinates.kind().periods;
    for (int shrunk = 0;; ++shrunk) {
      planned.series = coordinates.decode(x).series;
      static_cast<Motion&>(planned) = play(planned.series, planned.period_s, planned.periods, settings_.step_s);
      if (check_.violation(planned) == 0 || shrunk == most_shrinks) break;  // what remains, check_all() refuses
      coordinates.shrink(x, 0.98);
    }
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

  MatrixXd matrix(const Walk& walk) const {
    MatrixXd poses(static_cast<Index>(walk.poses.size()), joints());
    for (Index i = 0; i < poses.rows(); ++i) poses.row(i) = walk.poses[static_cast<std::size_t>(i)].transpose();
    return poses;
  }
  Motion motion(const Walk& walk, double step_s) const {
    return dwell_and_move(matrix(walk), walk.moves_s, dwell_s, step_s);
  }
  static constexpr double coarse_step_s = 0.1;
  static constexpr int most_shrinks = 100;
  MatrixXd static_information(const Walk& walk) const {
    return columns_.information(motion(walk, coarse_step_s), plan_.noise);
  }

  /// Duration of a move at which its quintic, with peaks of 1.875 d / T and 5.7735 d / T^2, keeps velocity and
  /// acceleration limits; whole coarse steps.
  double move_s(const VectorXd& from, const VectorXd& to) const {
    const double share = static_speed * (1 - check_.margin());
    double longest = 0;
    for (Index j = 0; j < joints(); ++j) {
      const double distance = std::fabs(to[j] - from[j]);
      longest = std::max({longest, 1.875 * distance / (share * check_.limits().velocity[j]),
                          std::sqrt(5.7735026919 * distance / (share * check_.limits().acceleration[j]))});
    }
    return std::max(1.0, std::ceil(longest / coarse_step_s)) * coarse_step_s;
  }
  bool move_is_feasible(const VectorXd& from, const VectorXd& to) const {
    const Walk walk{{from, to}, {move_s(from, to)}};
    return check_.violation(dwell_and_move(matrix(walk), walk.moves_s, 0, 0.5 * coarse_step_s), between_samples) == 0;
  }

  Walk walk(Random& random) const {
    Walk out;
    for (int tries = 0; tries < 100 && static_cast<Index>(out.poses.size()) < static_poses; ++tries) {
      const auto pick = static_cast<std::size_t>(random.uniform() * static_cast<double>(pool_.size()));
      extend(out, pool_[pick]);
    }
    return out;
  }
  bool extend(Walk& walk, const VectorXd& pose) const {
    if (!walk.poses.empty()) {
      if (pose == walk.poses.back() || !move_is_feasible(walk.poses.back(), pose)) return false;
      walk.moves_s.push_back(move_s(walk.poses.back(), pose));
    }
    walk.poses.push_back(pose);
    return true;
  }

  /// Poses one by one, each the one that adds most to log det.
  void choose_walk() {
    progress_.stage("choosing poses", static_cast<std::size_t>(static_poses));
    std::vector<MatrixXd> gains(pool_.size());
    parallel_for(pool_.size(),
                 [&](std::size_t i) { gains[i] = dwell_s * columns_.information(one_pose(pool_[i]), plan_.noise); });
    MatrixXd sum = total_;
    while (static_cast<Index>(walk_.poses.size()) < static_poses) {
      std::vector<double> lost(pool_.size());
      parallel_for(pool_.size(), [&](std::size_t i) { lost[i] = -log_determinant(sum + gains[i]); });
      const std::vector<std::size_t> order = ascending(lost);
      const auto next =
          std::find_if(order.begin(), order.end(), [&](std::size_t i) { return extend(walk_, pool_[i]); });
      if (next == order.end()) break;
      sum += gains[*next];
      progress_.step();
    }
    total_ += static_information(walk_);
  }

  void add_static() {
    PlannedTrajectory planned;
    static_cast<Motion&>(planned) = motion(walk_, settings_.step_s);
    planned.kind = "static";
    planned.poses = matrix(walk_);
    planned.moves_s = walk_.moves_s;
    planned.dwell_s = dwell_s;
    plan_.trajectories.push_back(std::move(planned));
  }

  /// The motion of a robot that moves freely: random states, uniform within +-pi (sliding joints: +-0.5 m) and
  /// within the velocity and acceleration limits.
  Motion free_motion() const {
    constexpr Index states = 400;
    Random random(1);
    Motion motion{"", 1.0 / states, VectorXd::Zero(states), MatrixXd(states, joints()), {}, {}};
    motion.dq = motion.ddq = motion.q;
    for (Index j = 0; j < joints(); ++j) {
      const bool turns = project_.robot.joints[static_cast<std::size_t>(j)].type == JointType::revolute;
      const MotionLimits& limits = check_.limits();
      const double reach = turns ? std::numbers::pi : 0.5;
      for (Index k = 0; k < states; ++k) {
        motion.q(k, j) = random.uniform(-reach, reach);
        motion.dq(k, j) = random.uniform(-1, 1) * limits.velocity[j];
        motion.ddq(k, j) = random.uniform(-1, 1) * limits.acceleration[j];
      }
    }
    return motion;
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
    const Motion free = free_motion();
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
  LimitCheck check_;
  ParameterColumns columns_;
  std::vector<VectorXd> pool_;
  std::vector<Coordinates> coordinates_;  ///< of each Fourier trajectory
  std::vector<std::vector<Draw>> draws_;  ///< likewise, random ones
  std::vector<Draw> chosen_;              ///< likewise, the plan's
  Walk walk_;
  MatrixXd total_;  ///< information of the plan so far
};

}  // namespace

Motion play(const std::vector<FourierJoint>& series, double period_s, int periods, double step_s) {
  const auto samples = static_cast<Index>(std::llround(period_s * periods / step_s)) + 1;
  const auto n = static_cast<Index>(series.size());
  Motion motion{"", step_s, VectorXd(samples), MatrixXd(samples, n), MatrixXd(samples, n), MatrixXd(samples, n)};
  for (Index k = 0; k < samples; ++k) {
    motion.t[k] = step_s * static_cast<double>(k);
    for (Index j = 0; j < n; ++j) {
      const FourierState state = evaluate(series[static_cast<std::size_t>(j)], period_s, motion.t[k]);
      motion.q(k, j) = state.q;
      motion.dq(k, j) = state.dq;
      motion.ddq(k, j) = state.ddq;
    }
  }
  return motion;
}

Motion dwell_and_move(const MatrixXd& poses, const std::vector<double>& moves_s, double dwell_s_, double step_s) {
  const Index n = poses.cols();
  const double duration =
      std::accumulate(moves_s.begin(), moves_s.end(), 0.0) + dwell_s_ * static_cast<double>(poses.rows());
  const auto samples = static_cast<Index>(std::llround(duration / step_s)) + 1;
  Motion motion{
      "", step_s, VectorXd(samples), MatrixXd(samples, n), MatrixXd::Zero(samples, n), MatrixXd::Zero(samples, n)};
  Index pose = 0;
  double from = 0;  // when the dwell at `pose` begins
  for (Index k = 0; k < samples; ++k) {
    const double t = motion.t[k] = step_s * static_cast<double>(k);
    while (pose + 1 < poses.rows() && t >= from + dwell_s_ + moves_s[static_cast<std::size_t>(pose)]) {
      from += dwell_s_ + moves_s[static_cast<std::size_t>(pose)];
      ++pose;
    }
    motion.q.row(k) = poses.row(pose);
    if (pose + 1 == poses.rows() || t <= from + dwell_s_) continue;
    const double length = moves_s[static_cast<std::size_t>(pose)], u = (t - from - dwell_s_) / length;
    const Eigen::RowVectorXd way = poses.row(pose + 1) - poses.row(pose);
    motion.q.row(k) += u * u * u * (10 + u * (6 * u - 15)) * way;
    motion.dq.row(k) = 30 * u * u * (1 - u) * (1 - u) / length * way;
    motion.ddq.row(k) = 60 * u * (1 - u) * (1 - 2 * u) / (length * length) * way;
  }
  return motion;
}

Plan make_plan(const Project& project, const std::filesystem::path& directory, Progress& progress) {
  return Planner(project, directory, progress).plan();
}

}  // namespace fxdyn
