#include "host_tools/check/arrangement_search.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "host_tools/support/parallel.hpp"

namespace fxdyn {

using Eigen::Index;
using Eigen::Vector3d;
using Eigen::VectorXd;

std::string to_string(Mistake mistake) {
  switch (mistake) {
    case Mistake::swapped_joints:
      return "swapped_joints";
    case Mistake::swapped_motion:
      return "swapped_motion";
    case Mistake::swapped_torques:
      return "swapped_torques";
    case Mistake::mirrored_motion:
      return "mirrored_motion";
    case Mistake::mirrored_torque:
      return "mirrored_torque";
    case Mistake::mirrored_joint:
      return "mirrored_joint";
    case Mistake::zero:
      return "zero";
    case Mistake::axis:
      return "axis";
    case Mistake::gravity:
      return "gravity";
    case Mistake::torque_gain:
      return "torque_gain";
    case Mistake::torque_unit:
      return "torque_unit";
    case Mistake::position_unit:
      return "position_unit";
    case Mistake::spring:
      return "spring";
  }
  return "";
}

namespace {

constexpr double pi = std::numbers::pi;

bool is_gain(Mistake mistake) { return mistake == Mistake::torque_gain || mistake == Mistake::torque_unit; }

bool has_all_masses(const Robot& robot) {
  return std::all_of(robot.joints.begin(), robot.joints.end(),
                     [](const Joint& one) { return one.inertial.has_value(); });
}

bool changes_motion(Mistake mistake) {
  return mistake != Mistake::swapped_torques && mistake != Mistake::mirrored_torque && mistake != Mistake::spring &&
         !is_gain(mistake);
}

/// All single changes of an arrangement, continuous ones on a grid.
class Moves {
 public:
  Moves(const ArrangementEvidence& evidence, const Arrangement& now, const ArrangementOptions& options,
        bool columns_only)
      : evidence_(evidence), now_(now), options_(options) {
    const auto n = static_cast<Index>(evidence.robot().size());
    for (Index j = 0; j < n; ++j) {
      for (Index other = j + 1; other < n; ++other) swap(j, other);
      if (evidence.moves(now.motion_from[static_cast<std::size_t>(j)])) {
        signs_and_gains(j);
        spring(j);
      }
      zeros(j);
      if (!columns_only) axes(j);
      units(j);
    }
    if (!columns_only) directions_of_gravity();
    units_of_torque();
  }
  std::vector<ArrangementMove> all;

 private:
  void units_of_torque() {
    if (!has_all_masses(evidence_.robot())) return;  // nothing to compare with
    for (const double gain : {1e-3, 0.01, 0.03, 0.1, 0.3, 3.0, 10.0, 30.0, 100.0, 1e3}) {
      ArrangementMove& move = add(Mistake::torque_unit, 0);
      move.value = gain;
      move.result.torque_gain *= gain;
    }
  }
  ArrangementMove& add(Mistake mistake, Index joint) {
    all.push_back({mistake, joint, joint, 0, Vector3d::Zero(), now_, 0});
    return all.back();
  }
  const Joint& joint(Index j) const { return evidence_.robot().joints[static_cast<std::size_t>(j)]; }

  void swap(Index a, Index b) {
    const auto i = static_cast<std::size_t>(a), k = static_cast<std::size_t>(b);
    if (evidence_.moves(now_.motion_from[i]) && evidence_.moves(now_.motion_from[k])) {
      ArrangementMove& torques = add(Mistake::swapped_torques, a);
      torques.other = b;
      std::swap(torques.result.torque_from[i], torques.result.torque_from[k]);
    }
    if (joint(a).type != joint(b).type) return;
    if (evidence_.moves(now_.motion_from[i]) && evidence_.moves(now_.motion_from[k])) {
      ArrangementMove& motion = add(Mistake::swapped_motion, a);
      motion.other = b;
      std::swap(motion.result.motion_from[i], motion.result.motion_from[k]);
    }
    ArrangementMove& joints = add(Mistake::swapped_joints, a);
    joints.other = b;
    std::swap(joints.result.torque_from[i], joints.result.torque_from[k]);
    std::swap(joints.result.motion_from[i], joints.result.motion_from[k]);
  }

  void signs_and_gains(Index j) {
    add(Mistake::mirrored_torque, j).result.torque_gain[j] *= -1;
    add(Mistake::mirrored_motion, j).result.motion_gain[j] *= -1;
    ArrangementMove& both = add(Mistake::mirrored_joint, j);
    both.result.torque_gain[j] *= -1;
    both.result.motion_gain[j] *= -1;
    for (const double gain : {1e-3, 1e-2, 0.1, 0.2, 0.35, 0.5, 0.7, 0.85, 1.2, 1.5, 2.0, 3.0, 5.0, 10.0, 1e2, 1e3}) {
      ArrangementMove& move = add(Mistake::torque_gain, j);
      move.value = gain;
      move.result.torque_gain[j] *= gain;
    }
  }

  void spring(Index j) {
    if (!now_.sprung[static_cast<std::size_t>(j)])
      add(Mistake::spring, j).result.sprung[static_cast<std::size_t>(j)] = true;
  }

  void zeros(Index j) {
    if (joint(j).type != JointType::revolute) return;
    constexpr int steps = 12;
    for (int i = 1; i < steps; ++i) {
      ArrangementMove& move = add(Mistake::zero, j);
      move.value = std::remainder(2 * pi * i / steps, 2 * pi);
      move.result.motion_offset[j] += move.value;
    }
  }

  void axes(Index j) {
    const Vector3d given = now_.axis[static_cast<std::size_t>(j)];
    for (int i = 0; i < 3; ++i) {
      for (const double sign : {1.0, -1.0}) {
        const Vector3d axis = sign * Vector3d::Unit(i);
        if (std::fabs(axis.dot(given)) > 0.9) continue;
        ArrangementMove& move = add(Mistake::axis, j);
        move.direction = axis;
        move.result.axis[static_cast<std::size_t>(j)] = axis;
      }
    }
  }

  /// Another unit of the position: only where the range as given is none that the joint can have. A smaller motion
  /// always explains a joint that hardly feels its own, and a larger one is told from it by nothing but the torque.
  void units(Index j) {
    const auto [lower, upper] = evidence_.range(now_.motion_from[static_cast<std::size_t>(j)]);
    const double range = std::fabs(now_.motion_gain[j]) * (upper - lower);
    const bool turns = joint(j).type == JointType::revolute;
    std::vector<double> factors;
    if (evidence_.excess(now_, j) > 0)
      factors = turns ? std::vector<double>{pi / 180} : std::vector<double>{1e-3, 0.01};
    if (!turns && range < options_.shortest_slide) factors.push_back(1e3);
    for (const double factor : factors) {
      ArrangementMove& move = add(Mistake::position_unit, j);
      move.value = factor;
      move.result.motion_gain[j] *= factor;
    }
  }

  void directions_of_gravity() {
    if (now_.gravity.norm() == 0) return;
    for (int x = -1; x <= 1; ++x) {
      for (int y = -1; y <= 1; ++y) {
        for (int z = -1; z <= 1; ++z) {
          if (x == 0 && y == 0 && z == 0) continue;
          const Vector3d direction = Vector3d(x, y, z).normalized();
          if (direction.dot(now_.gravity.normalized()) > 0.99) continue;
          ArrangementMove& move = add(Mistake::gravity, 0);
          move.direction = direction * now_.gravity.norm();
          move.result.gravity = move.direction;
        }
      }
    }
  }

  const ArrangementEvidence& evidence_;
  const Arrangement& now_;
  const ArrangementOptions& options_;
};

struct Scored {
  ArrangementMove move;
  ArrangementScore score;
};

std::vector<Scored> score_all(const ArrangementEvidence& evidence, const Arrangement& now,
                              std::vector<ArrangementMove> moves) {
  const ArrangementEvidence::Design as_now = evidence.design(now);
  std::vector<Scored> out(moves.size());
  parallel_for(moves.size(), [&](std::size_t i) {
    out[i].score =
        changes_motion(moves[i].mistake) ? evidence(moves[i].result) : evidence.score(as_now, moves[i].result);
    out[i].move = std::move(moves[i]);
  });
  std::sort(out.begin(), out.end(), [](const Scored& a, const Scored& b) { return a.score.nats < b.score.nats; });
  return out;
}

/// Halves the steps of a continuous change around where the grid found it best.
void refine(const ArrangementEvidence& evidence, const Arrangement& now, Scored& best) {
  std::vector<VectorXd> directions;
  double step = 0;
  const Mistake mistake = best.move.mistake;
  if (mistake == Mistake::zero) {
    step = pi / 12;
  } else if (is_gain(mistake)) {
    step = 0.2;  // of the logarithm
  } else if (mistake == Mistake::gravity) {
    step = pi / 8;
  } else {
    return;
  }
  const auto moved = [&](const ArrangementMove& from, double by, int axis) {
    ArrangementMove move = from;
    const Index j = move.joint;
    if (mistake == Mistake::zero) {
      move.value += by;
      move.result.motion_offset[j] = now.motion_offset[j] + move.value;
    } else if (mistake == Mistake::torque_gain) {
      move.value *= std::exp(by);
      move.result.torque_gain[j] = now.torque_gain[j] * move.value;
    } else if (mistake == Mistake::torque_unit) {
      move.value *= std::exp(by);
      move.result.torque_gain = now.torque_gain * move.value;
    } else {
      move.direction = Eigen::AngleAxisd(by, Vector3d::Unit(axis)) * move.direction;
      move.result.gravity = move.direction;
    }
    return move;
  };
  const int axes = mistake == Mistake::gravity ? 3 : 1;
  for (int round = 0; round < 6; ++round, step /= 2) {
    for (int axis = 0; axis < axes; ++axis) {
      for (const double by : {step, -step}) {
        Scored next{moved(best.move, by, axis), {}};
        next.score = evidence(next.move.result);
        if (next.score.nats < best.score.nats) best = std::move(next);
      }
    }
  }
}

bool is_small(const ArrangementMove& move, const Arrangement& now, const ArrangementOptions& options) {
  switch (move.mistake) {
    case Mistake::zero:
      return std::fabs(std::remainder(move.value, 2 * pi)) < options.least_zero;
    case Mistake::torque_gain:
      return std::fabs(std::log(move.value)) < std::log1p(options.least_gain);
    case Mistake::torque_unit:
      return std::fabs(std::log(move.value)) < std::log(options.least_unit);
    case Mistake::gravity:
      return std::acos(std::clamp(move.direction.normalized().dot(now.gravity.normalized()), -1.0, 1.0)) <
             options.least_turn;
    default:
      return false;
  }
}

/// A direction of gravity as robots are mounted, or a unit.
bool is_simple(const ArrangementMove& move) {
  if (move.mistake == Mistake::gravity) return true;
  return is_gain(move.mistake) && std::fabs(std::remainder(std::log10(move.value), 1.0)) < 1e-9;
}

bool same_thing(const ArrangementMove& a, const ArrangementMove& b) {
  return a.mistake == b.mistake && a.joint == b.joint && a.other == b.other;
}

/// The best of each kind and joint, continuous ones refined where they may be the best.
std::vector<Scored> best_of_each(const ArrangementEvidence& evidence, const Arrangement& now, double nats,
                                 const ArrangementOptions& options, bool columns_only) {
  std::vector<Scored> best;
  for (Scored& one : score_all(evidence, now, Moves(evidence, now, options, columns_only).all)) {
    const bool known =
        std::any_of(best.begin(), best.end(), [&](const Scored& b) { return same_thing(b.move, one.move); });
    if (!known) best.push_back(std::move(one));
  }
  // A grid point beside a sharp minimum may be no better than nothing.
  parallel_for(best.size(), [&](std::size_t i) {
    if (best[i].score.nats >= nats + options.gain) return;
    const Scored simple = best[i];
    refine(evidence, now, best[i]);
    // What no joint feels of a direction would be noise; and units are powers of ten.
    if (is_simple(simple.move) && simple.score.nats < best[i].score.nats + options.as_good) best[i] = simple;
    // Nor turns gravity over where parallel axes feel no more of it than a tilt.
    if (best[i].move.mistake != Mistake::gravity || best[i].move.direction.dot(now.gravity) >= 0) return;
    Scored tilted = simple;
    tilted.move.direction = tilted.move.result.gravity = now.gravity;
    tilted.score = evidence(now);
    refine(evidence, now, tilted);
    if (tilted.score.nats < best[i].score.nats + options.as_good) best[i] = std::move(tilted);
  });
  std::sort(best.begin(), best.end(), [](const Scored& a, const Scored& b) { return a.score.nats < b.score.nats; });
  return best;
}

/// A URDF without masses explains nearly any torque a little better in some other way, or with a spring as well.
bool is_doubtful(const ArrangementFinding& finding, double nats, const ArrangementOptions& options) {
  if (nats > options.vague_gain) return false;
  const bool spring = std::any_of(finding.others.begin(), finding.others.end(), [&](const ArrangementMove& other) {
    return other.mistake == Mistake::spring && other.nats > nats - options.as_good;
  });
  return spring || finding.after > options.vague_leaves * finding.before;
}

}  // namespace

std::vector<ArrangementFinding> find_mistakes(const ArrangementEvidence& evidence, const ArrangementOptions& options,
                                              bool columns_only) {
  std::vector<ArrangementFinding> out;
  if (!evidence.enough()) return out;
  Arrangement now = as_given(evidence.robot());
  ArrangementScore score = evidence(now);
  for (int found = 0; found < options.most;) {
    std::vector<Scored> best = best_of_each(evidence, now, score.nats, options, columns_only);
    if (best.empty() || best.front().score.nats > score.nats - options.gain) break;
    ArrangementFinding finding;
    finding.from = now;
    for (Scored& one : best) one.move.nats = score.nats - one.score.nats;
    (best.front().score.rms.array() / score.rms.array()).minCoeff(&finding.felt);
    finding.before = score.rms[finding.felt];
    finding.after = best.front().score.rms[finding.felt];
    for (std::size_t i = 1; i < best.size() && best[i].score.nats < best.front().score.nats + options.gain; ++i)
      if (!is_small(best[i].move, now, options)) finding.others.push_back(best[i].move);
    const bool spring = best.front().move.mistake == Mistake::spring;
    if (!spring && !has_all_masses(evidence.robot()) && is_doubtful(finding, best.front().move.nats, options)) break;
    const bool is_none = spring || is_small(best.front().move, now, options);
    if (!spring) ++found;
    now = best.front().move.result;
    score = best.front().score;
    finding.move = std::move(best.front().move);
    if (!is_none) out.push_back(std::move(finding));
  }
  return out;
}

}  // namespace fxdyn
