#include "host_tools/diagnose/features.hpp"

#include <algorithm>
#include <array>
#include <cassert>
#include <numbers>
#include <utility>

#include "host_tools/diagnose/linearised.hpp"
#include "host_tools/effects/effect_roles.hpp"
#include "host_tools/effects/joint_fit.hpp"
#include "host_tools/signals/filter.hpp"
#include "host_tools/support/random.hpp"

namespace fxdyn::diagnosis {
namespace {

using Eigen::ArrayXd;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr Index random_features = 24;
/// Waves over the recorded range: of another joint's position, of the own one, of friction over the own one.
constexpr Index other_waves = 6, own_waves = 8, friction_waves = 10;
/// Functions of another joint's velocity; of the own motion and load, the first of them of the motion alone.
constexpr Index of_other_velocity = 3, of_own = 14, of_own_motion = 10;

/// Functions of the motion alone.
Index motion_functions(Index joints) {
  return (other_waves + of_other_velocity) * (joints - 1) + own_waves + of_own_motion;
}

/// By joint. Those of the logs that fit, which every linearisation has: rows that are kept stay true.
struct Scales {
  ArrayXd speed, acceleration, load, low, range;
  Index fitted[2] = {0, 0};  ///< rows of the session: today's, the healthy one's

  VectorXd of_motion() const {
    VectorXd out(4 * speed.size());
    out << speed, acceleration, low, range;
    return out;
  }
};

Scales scales_of(const LogColumns& columns, const Blocks& blocks) {
  const auto joints = static_cast<Index>(columns.joints());
  Scales s;
  s.speed = s.acceleration = s.load = ArrayXd::Zero(joints);
  s.low = ArrayXd::Constant(joints, 1e300);
  ArrayXd high = -s.low;
  for (std::size_t l = 0; l < columns.logs().size(); ++l) {
    if (!columns.logs()[l].fits) continue;
    const ProcessedLog& log = columns.logs()[l].log;
    const auto inside = [&](const MatrixXd& m) { return m.middleRows(log.first, log.last - log.first).array(); };
    const auto most = [&](const MatrixXd& m) { return inside(m).abs().colwise().maxCoeff().transpose().eval(); };
    s.speed = s.speed.max(most(columns.motion(l).dq));
    s.acceleration = s.acceleration.max(most(columns.motion(l).ddq));
    s.load = s.load.max(most(columns.robot(l).structural()));
    s.low = s.low.min(inside(columns.motion(l).q).colwise().minCoeff().transpose());
    high = high.max(inside(columns.motion(l).q).colwise().maxCoeff().transpose());
    s.fitted[columns.logs()[l].healthy] += blocks.of_log[l].count;
  }
  s.speed = s.speed.max(1e-9);
  s.acceleration = s.acceleration.max(1e-9);
  s.load = s.load.max(1e-9);
  s.range = (high - s.low).max(1e-9);
  return s;
}

/// Of a session's rows that fit, those of a log: from `begins` on, `lasts` long, as shares. Those that judge come after
/// those that fit.
struct Place {
  double begins, lasts;
};

/// Functions of one joint over one log, filtered and decimated a few at a time: at full rate all of them together are
/// several times the log.
class Functions {
 public:
  Functions(const LogColumns& columns, const Scales& scales, std::size_t log, std::size_t joint)
      : columns_(columns),
        scales_(scales),
        log_(log),
        joint_(joint),
        motion_(columns.motion(log)),
        dq_(motion_.dq.col(j()) / scales.speed[j()]),
        ddq_(motion_.ddq.col(j()) / scales.acceleration[j()]),
        pending_(motion_.q.rows(), 8) {}

  MatrixXd of_motion() {
    const auto joints = static_cast<Index>(columns_.joints());
    const ArrayXd one = ArrayXd::Ones(motion_.q.rows());
    for (Index k = 0; k < joints; ++k) {
      if (k != j()) add_waves(position(k), other_waves, one);
    }
    for (Index k = 0; k < joints; ++k) {
      if (k == j()) continue;
      const ArrayXd other = motion_.dq.col(k).array() / scales_.speed[k];
      add((other * 40).tanh());
      add(other);
      add(dq_ * other);
    }
    add_waves(position(j()), own_waves, one);
    for (const double width : {0.01, 0.03, 0.1, 0.3}) {
      add((dq_ / width).tanh());
      add((dq_ / width).tanh().abs());
    }
    add(ddq_);
    add(ddq_ * ddq_.abs());
    return take();
  }

  MatrixXd of_model(const Place& place) {
    const bool turns = columns_.joint_of_robot(joint_).type == JointType::revolute;
    const double sign_width = columns_.joint(joint_).sign_width;
    const ArrayXd load = columns_.robot(log_).structural().col(j()).array() / scales_.load[j()],
                  sign = (motion_.dq.col(j()).array() / sign_width).tanh();
    add(load);
    add(load * (dq_ * 40).tanh());
    for (const double distance : {1e-3, 5e-3}) {
      const JointSeries series{motion_.q.col(j()), motion_.dq.col(j()), motion_.ddq.col(j()), {}, motion_.step_s};
      add(effect_columns(presliding_effect().name, std::array{turns ? distance : 0.1 * distance}, sign_width, series)
              .col(0)
              .array());
    }
    add_waves(position(j()), friction_waves, sign);
    add_random(load, turns ? 0.5 : 5.0);
    add_waves(place.begins + place.lasts * ArrayXd::LinSpaced(motion_.q.rows(), 0, 1), time_features, sign);
    return take();
  }

 private:
  Index j() const { return static_cast<Index>(joint_); }
  /// Over the recorded range.
  ArrayXd position(Index joint) const {
    return (motion_.q.col(joint).array() - scales_.low[joint]) / scales_.range[joint];
  }
  /// cos(m pi u), m = 1..count.
  void add_waves(const ArrayXd& u, Index count, const ArrayXd& times) {
    for (Index m = 1; m <= count; ++m) add((static_cast<double>(m) * std::numbers::pi * u).cos() * times);
  }
  void add_random(const ArrayXd& load, double scale) {
    const ArrayXd slowest = (dq_ / 0.02).asinh();
    Random random(91 + joint_);
    for (Index r = 0; r < random_features; ++r) {
      const double a = 3 * random.normal(), b = 3 * random.normal(), c = 1.5 * random.normal(), d = random.normal(),
                   e = 2 * std::numbers::pi * random.uniform(), f = 2 * random.normal();
      add((a * scale * motion_.q.col(j()).array() + b * dq_ + c * slowest + d * ddq_ + f * load + e).cos());
    }
  }
  void add(const Eigen::Ref<const ArrayXd>& function) {
    pending_.col(count_++) = function;
    if (count_ == pending_.cols()) keep();
  }
  void keep() {
    if (count_ == 0) return;
    const ProcessedLog& log = columns_.logs()[log_].log;
    const Index kept = rows_.cols();
    rows_.conservativeResize(log.rows(), kept + count_);
    rows_.rightCols(count_) = log.decimate(log.filter_columns(pending_.leftCols(count_)));
    count_ = 0;
  }
  MatrixXd take() {
    keep();
    return std::exchange(rows_, {});
  }

  const LogColumns& columns_;
  const Scales& scales_;
  std::size_t log_, joint_;
  const Motion& motion_;
  ArrayXd dq_, ddq_;
  MatrixXd pending_;  ///< at full rate, the first `count_` of them; as many as the filter takes side by side
  Index count_ = 0;
  MatrixXd rows_;  ///< what is kept of those before
};

bool nearly(const VectorXd& kept, const VectorXd& now) {
  return kept.size() > 0 && ((kept - now).array().abs() <= 0.05 * now.array().abs()).all();
}

/// Makes the functions of a log and joint again where the scales that they were made with are no longer true.
void renew(RowCache::AllFeatures& kept, const LogColumns& columns, const Scales& scales, std::size_t log,
           std::size_t joint, Index first, Index whole) {
  const ProcessedLog& l = columns.logs()[log].log;
  Functions functions(columns, scales, log, joint);
  if (const VectorXd now = scales.of_motion(); kept.of_motion.scales.size() == 0 || kept.of_motion.scales != now) {
    kept.of_motion = {now, functions.of_motion()};
    kept.of_model.scales.resize(0);
  }
  // The load moves a little with each fit; these functions need not.
  VectorXd now(scales.load.size() + 3);
  now << scales.load, columns.joint(joint).sign_width, static_cast<double>(first), static_cast<double>(whole);
  if (nearly(kept.of_model.scales, now)) return;
  const auto count = static_cast<double>(l.rows());
  const Place place{static_cast<double>(first) / static_cast<double>(whole), count / static_cast<double>(whole)};
  kept.of_model = {now, functions.of_model(place)};
}

}  // namespace

std::vector<Family> families(std::size_t joints) {
  std::vector<Family> out;
  Index first = 0;
  const auto add = [&](Index count) {
    if (count > 0) out.push_back({first, count});
    first += count;
  };
  const auto others = static_cast<Index>(joints) - 1;
  for (Index k = 0; k < others; ++k) add(other_waves);
  add(of_other_velocity * others);
  add(own_waves);
  add(of_own);
  add(friction_waves);
  first += random_features;
  add(time_features);
  return out;
}

MatrixXd features(const LogColumns& columns, const NoiseModel& noise, const Blocks& blocks, std::size_t joint,
                  bool healthy) {
  const Scales scales = scales_of(columns, blocks);
  const Index of_motion = motion_functions(static_cast<Index>(columns.joints()));
  MatrixXd out;
  // Rows of the session before a log. Those that judge come after those that fit.
  Index fits_before[2] = {0, 0}, judges_before[2] = {scales.fitted[0], scales.fitted[1]};
  for (std::size_t l = 0; l < columns.logs().size(); ++l) {
    const SessionLog& entry = columns.logs()[l];
    if (entry.healthy && !healthy) continue;
    const Block& b = blocks.of_log[l];
    Index& before = (entry.fits ? fits_before : judges_before)[entry.healthy];
    RowCache::AllFeatures& kept = entry.cache->features[joint];
    renew(kept, columns, scales, l, joint, before, scales.fitted[entry.healthy]);
    before += b.count;
    const Index cols = of_motion + kept.of_model.rows.cols();
    assert(kept.of_motion.rows.cols() == of_motion &&
           cols == families(columns.joints()).back().first + families(columns.joints()).back().count);
    if (out.size() == 0) out.setZero(blocks.rows(), cols);
    out.block(b.first, 0, b.count, of_motion) = noise.apply(l, joint, kept.of_motion.rows);
    out.block(b.first, of_motion, b.count, cols - of_motion) = noise.apply(l, joint, kept.of_model.rows);
  }
  return out;
}

namespace {

/// Functions of a log's motion at full rate, as rows of the problem.
template <class Of>
MatrixXd of_motions(const Linearised& problem, std::size_t joint, Index count, Of&& of) {
  const Blocks& blocks = problem.blocks();
  MatrixXd out = MatrixXd::Zero(blocks.rows(), count);
  for (std::size_t l = 0; l < problem.logs().size(); ++l) {
    const SessionLog& entry = problem.logs()[l];
    if (entry.healthy) continue;
    const Block& b = blocks.of_log[l];
    const MatrixXd full = of(problem.motion(l));
    out.middleRows(b.first, b.count) =
        problem.noise().apply(l, joint, entry.log.decimate(entry.log.filter_columns(full)));
  }
  return out;
}

}  // namespace

MatrixXd position_waves(const Linearised& problem, std::size_t joint, Index count) {
  const Scales scales = scales_of(problem.log_columns(), problem.blocks());
  const auto j = static_cast<Index>(joint);
  return of_motions(problem, joint, count, [&](const Motion& motion) {
    const ArrayXd u = (motion.q.col(j).array() - scales.low[j]) / scales.range[j];
    MatrixXd full(u.size(), count);
    for (Index m = 0; m < count; ++m) full.col(m) = (static_cast<double>(m + 1) * std::numbers::pi * u).cos();
    return full;
  });
}

MatrixXd jerk(const Linearised& problem, std::size_t joint) {
  return of_motions(problem, joint, 1, [&](const Motion& motion) {
    return differentiate(motion.ddq.col(static_cast<Index>(joint)), motion.step_s);
  });
}

MatrixXd features(const Linearised& problem, std::size_t joint, bool healthy) {
  return features(problem.log_columns(), problem.noise(), problem.blocks(), joint, healthy);
}

}  // namespace fxdyn::diagnosis
