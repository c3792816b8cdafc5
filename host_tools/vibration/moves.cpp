#include "host_tools/vibration/moves.hpp"

#include <cmath>

#include "host_tools/effects/model_parts.hpp"
#include "host_tools/support/random.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

/// Largest |dq| and |ddq| of x(s) = 10 s^3 - 15 s^4 + 6 s^5, s = t / T, per unit of distance / T and distance / T^2.
const double peak_velocity = 1.875, peak_acceleration = 10 / std::sqrt(3.0);

/// The shortest time for a segment at a share of the joint's limits, on whole ticks [s].
double duration(const JointFit& joint, double distance, double share) {
  return std::max(peak_velocity * std::fabs(distance) / (share * joint.dq_limit),
                  std::sqrt(peak_acceleration * std::fabs(distance) / (share * joint.ddq_limit)));
}

class Writer {
 public:
  Writer(VectorXd start, double tick_s) : tick_s_(tick_s), at_(std::move(start)) {}

  void rest(double seconds) { segment(at_, seconds); }
  void segment(const VectorXd& to, double seconds) {
    const auto ticks = static_cast<Index>(std::ceil(seconds / tick_s_ - 1e-9));
    const double period = tick_s_ * static_cast<double>(ticks);
    const VectorXd way = to - at_;
    for (Index k = 0; k < ticks; ++k) {
      const double s = static_cast<double>(k) / static_cast<double>(ticks);
      q_.push_back(at_ + way * (s * s * s * (10 + s * (-15 + 6 * s))));
      dq_.push_back(way * (30 * s * s * (1 - s) * (1 - s) / period));
      ddq_.push_back(way * (60 * s * (1 - s) * (1 - 2 * s) / (period * period)));
    }
    at_ = to;
  }
  Index samples() const { return static_cast<Index>(q_.size()); }
  Reference reference() const {
    const auto matrix = [&](const std::vector<VectorXd>& rows) {
      Eigen::MatrixXd out(samples(), at_.size());
      for (Index k = 0; k < samples(); ++k) out.row(k) = rows[static_cast<std::size_t>(k)];
      return out;
    };
    return {tick_s_, matrix(q_), matrix(dq_), matrix(ddq_), {}};
  }

 private:
  double tick_s_;
  VectorXd at_;
  std::vector<VectorXd> q_, dq_, ddq_;
};

/// A joint's state between two ticks, s in 0 .. 1 of the way, by the polynomial of fifth degree that has the states of
/// both: a segment is one itself, so that it stays as it is.
struct Between {
  double q, dq, ddq;
};
Between between(const Reference& r, Index k, Index j, double s) {
  const double h = r.step_s, p0 = r.q(k, j), v0 = h * r.dq(k, j), a0 = h * h * r.ddq(k, j);
  const double far = r.q(k + 1, j) - (p0 + v0 + 0.5 * a0), fast = h * r.dq(k + 1, j) - (v0 + a0),
               bent = h * h * r.ddq(k + 1, j) - a0;
  const double c3 = 10 * far - 4 * fast + 0.5 * bent, c4 = -15 * far + 7 * fast - bent,
               c5 = 6 * far - 3 * fast + 0.5 * bent;
  return {p0 + s * (v0 + s * (0.5 * a0 + s * (c3 + s * (c4 + s * c5)))),
          (v0 + s * (a0 + s * (3 * c3 + s * (4 * c4 + s * 5 * c5)))) / h,
          (a0 + s * (6 * c3 + s * (12 * c4 + s * 20 * c5))) / (h * h)};
}

}  // namespace

Move slower(const Move& move, Index ticks) {
  const Reference& r = move.reference;
  const Index moving = move.stop - move.start, n = r.q.cols();
  const double pace = static_cast<double>(moving) / static_cast<double>(moving + ticks);
  Move out = move;
  out.stop += ticks;
  for (Eigen::MatrixXd* signal : {&out.reference.q, &out.reference.dq, &out.reference.ddq})
    signal->resize(r.q.rows() + ticks, n);
  for (Index k = 0; k < out.reference.q.rows(); ++k) {
    const bool moves = k >= move.start && k < out.stop;
    const double at = moves            ? static_cast<double>(move.start) + pace * static_cast<double>(k - move.start)
                      : k < move.start ? static_cast<double>(k)
                                       : static_cast<double>(k - ticks);
    const auto before = std::min(static_cast<Index>(at), r.q.rows() - 2);
    for (Index j = 0; j < n; ++j) {
      const Between state = between(r, before, j, at - static_cast<double>(before));
      out.reference.q(k, j) = state.q;
      out.reference.dq(k, j) = (moves ? pace : 1) * state.dq;
      out.reference.ddq(k, j) = (moves ? pace * pace : 1) * state.ddq;
    }
  }
  return out;
}

std::vector<Move> make_moves(const IdentifiedModel& robot, double tick_s, std::uint64_t seed, int repeats) {
  Random random(seed);
  const auto n = static_cast<Index>(joints_of(robot).size());
  const auto joint = [&](Index j) -> const JointFit& { return joints_of(robot)[static_cast<std::size_t>(j)]; };
  const auto pose = [&] {
    VectorXd q(n);
    for (Index j = 0; j < n; ++j) {
      const double middle = 0.5 * (joint(j).q_lower + joint(j).q_upper), half = joint(j).q_upper - middle;
      q[j] = middle + 0.6 * half * random.uniform(-1, 1);
    }
    return q;
  };
  /// Of all joints in the same time: the slowest decides.
  const auto together = [&](const VectorXd& way, double share) {
    double seconds = 0;
    for (Index j = 0; j < n; ++j) seconds = std::max(seconds, duration(joint(j), way[j], share));
    return seconds;
  };
  /// Directions are random, the distance is each joint's.
  const auto nudge = [&](double revolute, double prismatic) {
    VectorXd way(n);
    for (Index j = 0; j < n; ++j) {
      const bool turns = robot_of(robot).joints[static_cast<std::size_t>(j)].type == JointType::revolute;
      way[j] = (random.uniform() < 0.5 ? -1 : 1) * (turns ? revolute : prismatic);
    }
    return way;
  };
  std::vector<Move> moves;
  for (int repeat = 0; repeat < repeats; ++repeat) {
    const auto move = [&](const std::string& kind, auto&& body) {
      const VectorXd start = pose();
      Writer writer(start, tick_s);
      writer.rest(rest_s);
      const Index from = writer.samples();
      body(writer, start);
      const Index to = writer.samples();
      writer.rest(rest_s);
      moves.push_back({kind, writer.reference(), from, to, to});
    };
    move("point_to_point", [&](Writer& writer, const VectorXd& start) {
      const VectorXd end = pose();
      writer.segment(end, together(end - start, 0.8));
    });
    move("reversals", [&](Writer& writer, const VectorXd& start) {
      const VectorXd way = nudge(0.1, 0.02);
      const double seconds = std::max(0.25, together(way, 0.5));
      for (int k = 0; k < 8; ++k) writer.segment(k % 2 == 0 ? VectorXd(start + way) : start, seconds);
    });
    move("slow", [&](Writer& writer, const VectorXd& start) {
      const VectorXd way = nudge(0.06, 0.01);
      const double seconds = std::max(peak_velocity * 0.06 / 0.03, together(way, 0.5));
      writer.segment(start + way, seconds);
      writer.segment(start, seconds);
    });
  }
  return moves;
}

}  // namespace fxdyn
