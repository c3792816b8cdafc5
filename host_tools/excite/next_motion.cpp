#include "host_tools/excite/next_motion.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>

#include "host_tools/effects/effects.hpp"
#include "host_tools/effects/model_parts.hpp"
#include "host_tools/excite/effect_information.hpp"
#include "host_tools/excite/evolution.hpp"
#include "host_tools/excite/feasible.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/parallel.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Full speed, slow, creep and reversals: friction at low speed needs other motions than inertia.
constexpr std::array kinds{SeriesKind{"fast", 1, 1, 1}, SeriesKind{"slow", 0.2, 1, 1}, SeriesKind{"creep", 0.05, 1, 1},
                           SeriesKind{"reversals", 0.5, 1, 3}};
constexpr double step_s = 0.01;  ///< of motions that are only judged
/// Of a violation, as a share of what all questions are worth: no optimum lies beyond a limit.
constexpr double penalty = 10;

/// What a motion shows: information on all columns, and seconds within the parts of each place (a row each).
struct Shown {
  MatrixXd gram, seconds;
};

class NextPlanner {
 public:
  NextPlanner(const Project& project, const IdentifiedModel& model, const OpenQuestions& questions,
              const VectorXd& noise, const std::filesystem::path& directory, Progress& progress,
              const NextMotionOptions& options)
      : project_(project),
        model_(model),
        questions_(questions),
        options_(options),
        progress_(progress),
        feasible_(project, directory, out_.notes) {
    // White noise that leaves as much below the cut-off.
    noise_ = noise * std::sqrt(0.5 / step_s / std::min(0.5 / step_s, filter_of(model).torque_cutoff_hz));
    for (const SeriesKind& kind : kinds) coordinates_.emplace_back(feasible_.check(), kind, project.excite);
    choose_candidates();
  }

  NextMotions plan() {
    draw();
    choose_questions();
    Shown so_far = nothing();
    for (std::size_t m = 0; m < options_.most_motions && asked_ > 0; ++m) {
      if (m > 0 && is_decided(so_far)) break;
      const Draw best = search(so_far, m);
      so_far = sum(so_far, best.shown);
      add(best, m);
    }
    progress_.done();
    if (!questions_.effects.empty()) out_.odds = odds(so_far.gram);
    out_.seconds = covered(so_far);
    out_.usual = usual(out_.trajectories.size());
    return std::move(out_);
  }

 private:
  struct Draw {
    std::size_t kind = 0;
    VectorXd x;
    Shown shown;
  };
  struct Columns {
    std::size_t effect = 0;           ///< index of its block beyond the nominal ones
    std::vector<std::size_t> rivals;  ///< likewise, one for each shape
  };

  Motion played(std::size_t kind, const VectorXd& x) const {
    const SeriesCoordinates& c = coordinates_[kind];
    return play(c.decode(x).series, c.period_s(), c.kind().periods, step_s);
  }

  void choose_candidates() {
    // Typical shapes belong to a range of speed: that of a fast motion.
    const std::vector<Motion> fast{played(0, feasible_.random(coordinates_[0], project_.excite.seed))};
    const RobotColumns columns(model_, fast[0]);
    for (const EffectQuestion& q : questions_.effects) {
      Columns of{candidates_.size(), {}};
      EffectCandidate own = q.effect;
      if (own.shape.empty())
        own.shape =
            typical_shapes(own.effect, own.joint, robot_of(model_), fast, {columns.torque()}, {columns.structural()})
                .front();
      candidates_.push_back(own);
      if (!q.rival.empty()) {
        for (const auto& shape : typical_shapes(q.rival, q.rival_joint, robot_of(model_), fast, {columns.torque()},
                                                {columns.structural()})) {
          of.rivals.push_back(candidates_.size());
          candidates_.push_back({q.rival, q.rival_joint, shape});
        }
      }
      columns_.push_back(std::move(of));
    }
    const Information of_fast(model_, fast, noise_, filter_of(model_).torque_cutoff_hz, candidates_);
    nominal_blocks_ = of_fast.nominal_blocks;
    blocks_ = of_fast.blocks;
    nominal_ = columns_from(0, of_fast.base);
    for (std::size_t b = 0; b < nominal_blocks_; ++b) {
      for (const Index i : columns_from(blocks_[b].first, blocks_[b].count)) nominal_.push_back(i);
    }
    for (std::size_t i = 0; i < questions_.effects.size(); ++i) coefficients_.push_back(coefficients_of(i));
  }

  /// As found; else of the size that is asked for, on a fast motion.
  VectorXd coefficients_of(std::size_t question) const {
    const EffectQuestion& q = questions_.effects[question];
    if (q.coefficients.size() > 0) return q.coefficients;
    const Block& block = blocks_[nominal_blocks_ + columns_[question].effect];
    VectorXd theta = VectorXd::Zero(block.count);
    theta[0] = 1;
    double most = 0;
    for (std::size_t j = 0; j < block.raw.size(); ++j) {
      if (block.raw[j].size() == 0) continue;
      most = std::max(most, std::sqrt(block.raw[j](0, 0)) / joints_of(model_)[j].rated_torque);
    }
    return most > 0 ? VectorXd(theta * q.share / most) : theta;
  }

  Shown nothing() const {
    const Index size = blocks_.back().first + blocks_.back().count;
    return {MatrixXd::Zero(size, size), MatrixXd::Zero(static_cast<Index>(questions_.places.size()), options_.parts)};
  }
  static Shown sum(const Shown& a, const Shown& b) { return {a.gram + b.gram, a.seconds + b.seconds}; }

  Shown show(const Motion& motion) const {
    Shown out = nothing();
    if (!questions_.effects.empty())
      out.gram = Information(model_, {motion}, noise_, filter_of(model_).torque_cutoff_hz, candidates_).gram;
    for (std::size_t i = 0; i < questions_.places.size(); ++i)
      visit(motion, questions_.places[i], out.seconds.row(static_cast<Index>(i)));
    return out;
  }

  /// Adds the seconds that a moving joint is in each part of a place.
  void visit(const Motion& motion, const PlaceQuestion& place,
             Eigen::Ref<Eigen::RowVectorXd, 0, Eigen::InnerStride<>> seconds) const {
    const auto j = static_cast<Index>(place.of_joint);
    const VectorXd values = place.signal == "q"       ? motion.q.col(j)
                            : place.signal == "dq"    ? motion.dq.col(j)
                            : place.signal == "ddq"   ? motion.ddq.col(j)
                            : place.signal == "speed" ? VectorXd(motion.dq.col(j).cwiseAbs())
                                                      : VectorXd(motion.dq.col(j).cwiseSign());
    const double standing = options_.standing * feasible_.check().limits().velocity[j];
    for (Index k = 0; k < values.size(); ++k) {
      const double part = (values[k] - place.from) / (place.to - place.from) * static_cast<double>(options_.parts);
      if (std::fabs(motion.dq(k, j)) < standing || !(part >= 0) || part > static_cast<double>(options_.parts)) continue;
      // The direction has one value in its interval.
      const Index first = place.signal == "direction" ? 0 : std::min(static_cast<Index>(part), options_.parts - 1);
      const Index last = place.signal == "direction" ? options_.parts - 1 : first;
      for (Index p = first; p <= last; ++p) seconds[p] += motion.step_s / static_cast<double>(last - first + 1);
    }
  }

  /// Seconds within each place, in no part more than its share.
  VectorXd covered(const Shown& shown) const {
    return shown.seconds.cwiseMin(options_.enough_s / static_cast<double>(options_.parts)).rowwise().sum();
  }

  /// log10 of the odds that each question would be decided with.
  VectorXd odds(const MatrixXd& gram) const {
    MatrixXd nuisance = gram(nominal_, nominal_);
    if (questions_.known_base) {
      const Index base = blocks_.front().first, friction = nuisance.rows() - base;
      nuisance.topLeftCorner(base, base) +=
          information_left(nuisance.topLeftCorner(base, base), nuisance.bottomLeftCorner(friction, base),
                           nuisance.bottomRightCorner(friction, friction));
    }
    const MatrixXd left = information_left(gram, gram(nominal_, Eigen::all), nuisance);
    VectorXd out(static_cast<Index>(columns_.size()));
    for (std::size_t i = 0; i < columns_.size(); ++i) {
      const auto own = here(columns_[i].effect);
      const VectorXd& theta = coefficients_[i];
      double least = theta.dot(left(own, own) * theta);
      for (const std::size_t rival : columns_[i].rivals) {
        const auto other = here(rival);
        const MatrixXd beside = information_left(left(own, own), left(other, own), left(other, other));
        least = std::min(least, theta.dot(beside * theta));
      }
      out[static_cast<Index>(i)] = std::max(0.0, least) / (2 * std::numbers::ln10);
    }
    return out;
  }
  std::vector<Index> here(std::size_t candidate) const {
    const Block& block = blocks_[nominal_blocks_ + candidate];
    return columns_from(block.first, block.count);
  }

  /// What no drawn motion shows at all stays out of what is searched for.
  void choose_questions() {
    VectorXd most = VectorXd::Zero(static_cast<Index>(columns_.size()));
    if (most.size() > 0) {
      for (const Draw& one : draws_) most = most.cwiseMax(odds(one.shown.gram));
    }
    for (const double odds : most) out_.hopeless.push_back(odds < options_.hopeless);
    VectorXd longest = VectorXd::Zero(static_cast<Index>(questions_.places.size()));
    for (const Draw& one : draws_) longest = longest.cwiseMax(covered(one.shown));
    for (const double seconds : longest) out_.hopeless_places.push_back(seconds <= 0);
    for (const auto* hopeless : {&out_.hopeless, &out_.hopeless_places})
      asked_ += static_cast<std::size_t>(std::count(hopeless->begin(), hopeless->end(), false));
  }

  bool is_decided(const Shown& shown) const {
    const VectorXd reached = questions_.effects.empty() ? VectorXd() : odds(shown.gram);
    for (std::size_t i = 0; i < out_.hopeless.size(); ++i) {
      if (!out_.hopeless[i] && reached[static_cast<Index>(i)] < options_.enough) return false;
    }
    const VectorXd seconds = covered(shown);
    for (std::size_t i = 0; i < out_.hopeless_places.size(); ++i) {
      if (!out_.hopeless_places[i] && seconds[static_cast<Index>(i)] < options_.enough_s) return false;
    }
    return true;
  }

  /// Mean over the questions of how far each is decided, 0 .. 1; the root makes the first odds worth most. Beyond what
  /// is enough, more still counts a little.
  double worth(const Shown& shown) const {
    constexpr double beyond = 0.01;
    double sum = 0;
    if (!questions_.effects.empty()) {
      const VectorXd share = odds(shown.gram) / options_.enough;
      for (std::size_t i = 0; i < out_.hopeless.size(); ++i) {
        const double one = share[static_cast<Index>(i)];
        if (!out_.hopeless[i]) sum += std::sqrt(std::min(one, 1.0)) + beyond * std::log1p(one);
      }
    }
    sum += covered(shown).sum() / options_.enough_s;
    return sum / static_cast<double>(asked_);
  }

  void draw() {
    draws_.resize(kinds.size() * options_.draws);
    progress_.stage("drawing motions", draws_.size());
    for (std::size_t i = 0; i < draws_.size(); ++i) {
      Draw& one = draws_[i];
      one.kind = i % kinds.size();
      one.x = feasible_.random(coordinates_[one.kind], project_.excite.seed * 1000003 + i);
      one.shown = show(played(one.kind, one.x));
      progress_.step();
    }
  }

  Draw search(const Shown& so_far, std::size_t m) {
    std::vector<double> worths;
    worths.reserve(draws_.size());
    for (const Draw& one : draws_) worths.push_back(worth(sum(so_far, one.shown)));
    const auto at = std::max_element(worths.begin(), worths.end());
    Draw best = draws_[static_cast<std::size_t>(at - worths.begin())];
    double most = *at;
    const SeriesCoordinates& coordinates = coordinates_[best.kind];
    progress_.stage(fmt::format("searching motion {}", m + 1), static_cast<std::size_t>(options_.generations));
    const auto objective = [&](const VectorXd& x) {
      const auto decoded = coordinates.decode(x);
      return -worth(sum(so_far, show(played(best.kind, x)))) + 1e-3 * decoded.overflow +
             penalty * feasible_.violation(decoded.motion);
    };
    VectorXd x = minimise(objective, best.x, {options_.generations, 12, 0.1, project_.excite.seed + m},
                          [&] { progress_.step(); });
    if (feasible_.make_feasible(coordinates, x)) {
      const Shown shown = show(played(best.kind, x));
      if (const double now = worth(sum(so_far, shown)); now > most) best = {best.kind, x, shown};
    }
    return best;
  }

  void add(const Draw& best, std::size_t m) {
    const SeriesCoordinates& coordinates = coordinates_[best.kind];
    PlannedTrajectory planned;
    planned.kind = coordinates.kind().name;
    planned.period_s = coordinates.period_s();
    planned.periods = coordinates.kind().periods;
    FeasibleMotions::Sampled sampled = feasible_.sample(coordinates, best.x);
    planned.series = std::move(sampled.series);
    static_cast<Motion&>(planned) = std::move(sampled.motion);
    planned.name = fmt::format("next_{}_{}", m + 1, planned.kind);
    if (feasible_.check().violation(planned) > 0)
      throw DataError(
          fmt::format("{}: no motion of kind '{}' fits into the limits; widen them or choose another "
                      "[excite] seed",
                      project_.file.string(), planned.kind));
    out_.trajectories.push_back(std::move(planned));
  }

  /// The middle one of as many random fast motions as were drawn, each as often as there are motions.
  VectorXd usual(std::size_t motions) const {
    if (questions_.effects.empty()) return VectorXd();
    std::vector<VectorXd> all;
    for (const Draw& one : draws_) {
      if (one.kind == 0) all.push_back(odds(one.shown.gram * static_cast<double>(motions)));
    }
    VectorXd out(all.front().size());
    for (Index i = 0; i < out.size(); ++i) {
      std::vector<double> values;
      values.reserve(all.size());
      for (const VectorXd& one : all) values.push_back(one[i]);
      std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2), values.end());
      out[i] = values[values.size() / 2];
    }
    return out;
  }

  const Project& project_;
  const IdentifiedModel& model_;
  const OpenQuestions& questions_;
  const NextMotionOptions& options_;
  Progress& progress_;
  NextMotions out_;
  FeasibleMotions feasible_;
  VectorXd noise_;
  std::vector<SeriesCoordinates> coordinates_;  ///< of each kind
  std::vector<EffectCandidate> candidates_;     ///< effects and rivals with their shapes
  std::vector<Columns> columns_;                ///< of each question
  std::vector<VectorXd> coefficients_;          ///< likewise
  std::vector<Block> blocks_;
  std::size_t nominal_blocks_ = 0;
  std::vector<Index> nominal_;
  std::vector<Draw> draws_;
  std::size_t asked_ = 0;  ///< questions that motion may decide
};

}  // namespace

NextMotions plan_next(const Project& project, const IdentifiedModel& model, const OpenQuestions& questions,
                      const VectorXd& noise, const std::filesystem::path& directory, Progress& progress,
                      const NextMotionOptions& options) {
  return NextPlanner(project, model, questions, noise, directory, progress, options).plan();
}

}  // namespace fxdyn
