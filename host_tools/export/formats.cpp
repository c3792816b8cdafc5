#include <fmt/format.h>

#include <cmath>
#include <limits>

#include "host_tools/effects/effects.hpp"
#include "host_tools/effects/model_parts.hpp"
#include "host_tools/export/export.hpp"
#include "host_tools/export/proof.hpp"
#include "host_tools/numbers/bounded.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/random.hpp"

#include <nlohmann/json.hpp>

namespace fxdyn {
namespace {

/// Largest number of fractional bits with which +-range fits into `width` bits and a sign.
int fitting_bits(double range, int width) {
  return width - static_cast<int>(std::ceil(std::log2(std::max(range, 1e-9))));
}

/// The ranges of a model whose coefficients are `room` times as large. (Not of what deflects positions: an update does
/// not touch that.)
Ranges with_room(Ranges ranges, double room) {
  for (const Kind::Group group : {Kind::coefficient, Kind::mass, Kind::first_moment, Kind::second_moment}) {
    for (std::size_t i = 0; i < quantity_count; ++i) ranges.at({group, static_cast<Quantity>(i)}) *= room;
  }
  for (const Quantity quantity : {Quantity::force, Quantity::torque}) ranges.at({Kind::number, quantity}) *= room;
  return ranges;
}

/// Lowers the formats until products are at least as fine as what they are added to and 64-bit sums hold all of their
/// terms, in these ranges and with coefficients `room` times as large. Formats that it leaves as they are hold the
/// model (but for what leaves a format of 32 bits).
Formats lowered(Formats formats, const IdentifiedModel& model, const Ranges& ranges, double room) {
  using Q = Quantity;
  const auto bits = [&](Q quantity) -> int& { return formats[quantity]; };
  // A product must be at least as fine as what it is added to, and the sum of its terms must fit 62 bits and a sign
  // (model/rigid_body.hpp: align() and proven_narrow()). Bounds are sums of magnitudes, so no partial sum exceeds them.
  const auto at_most = [&](Q quantity, int most) { bits(quantity) = std::min(bits(quantity), most); };
  const auto product_at_most = [&](Q x, Q y, double sum) {
    while (bits(x) + bits(y) > fitting_bits(2 * sum, 62)) --(bits(x) > bits(y) ? bits(x) : bits(y));
  };
  const double v = ranges[Q::velocity], w = ranges[Q::acceleration], a = ranges[Q::linear_acceleration];
  const double l = ranges[Q::length], f = ranges[Q::force], t = ranges[Q::torque];
  at_most(Q::velocity, fitting_bits(2 * (2 * v * v + w + a), 62) / 2);
  at_most(Q::acceleration, 2 * bits(Q::velocity));
  at_most(Q::linear_acceleration, 2 * bits(Q::velocity));
  at_most(Q::velocity_squared, 2 * bits(Q::velocity));
  at_most(Q::velocity_cubed, bits(Q::velocity_squared) + bits(Q::velocity));
  product_at_most(Q::acceleration, Q::length, 3 * w * l + a);
  product_at_most(Q::length, Q::force, 2 * l * f + 2 * t);
  at_most(Q::linear_acceleration, bits(Q::acceleration) + bits(Q::length));
  at_most(Q::torque, bits(Q::length) + bits(Q::force));

  const int fa = bits(Q::linear_acceleration), fw = bits(Q::acceleration);
  const double mass = ranges[Kind{Kind::mass}], first = ranges[Kind{Kind::first_moment}],
               second = ranges[Kind{Kind::second_moment}];
  formats.force_sum =
      std::min({formats.force_sum, fitting_bits(mass, 31) + fa, fitting_bits(first, 31) + fw,
                fitting_bits(second, 31) + 2 * fw - fa, fitting_bits(2 * (mass * a + 3 * w * first), 62),
                fitting_bits(2 * (2 * first * a + 6 * w * second), 62) + fw - fa});
  at_most(Q::force, formats.force_sum);
  at_most(Q::torque, std::min(formats.force_sum - fw + fa, bits(Q::length) + bits(Q::force)));

  // Every partial sum of a joint's contributions, bounded by the sum of the magnitudes.
  double torque_sum = 0, deflection_sum = 0;
  for (const JointFit& joint : joints_of(model)) {
    double torque = ranges[Q::torque], deflection = 0;
    for (const EffectFit& fit : joint.effects) {
      const EffectInfo& info = *find_effect(fit.effect);
      double& sum = info.acts_on == ActsOn::position ? deflection : torque;
      for (std::size_t i = 0; i < fit.linear.size(); ++i)
        sum += room * std::fabs(fit.linear[i]) * std::ldexp(1.0, 31 - formats[info.linear[i].quantity]);
    }
    if (joint.bls) torque += room * joint.bls->coefficients.cwiseAbs().sum();
    torque_sum = std::max(torque_sum, torque);
    deflection_sum = std::max(deflection_sum, deflection);
  }
  formats.torque_sum = std::min(formats.torque_sum, fitting_bits(torque_sum, 62));
  formats.deflection_sum = std::min(formats.deflection_sum, fitting_bits(deflection_sum, 62));
  for (std::size_t i = 0; i < quantity_count; ++i) {
    const auto quantity = static_cast<Quantity>(i);
    const auto hold = [&](Kind::Group group, int& sum) {
      const double most = ranges[Kind{group, quantity}];
      if (most > 0) sum = std::min(sum, fitting_bits(most, 31) + formats.quantity[i]);
    };
    hold(Kind::coefficient, formats.torque_sum);
    hold(Kind::deflection_coefficient, formats.deflection_sum);
  }
  return formats;
}

/// Formats that hold these ranges.
Formats formats_for(const IdentifiedModel& model, const Ranges& ranges) {
  using Q = Quantity;
  Formats formats;
  for (std::size_t i = 0; i < quantity_count; ++i) {
    const auto quantity = static_cast<Quantity>(i);
    const int common = common_bits(quantity);
    // A reserve of 1/64 holds what roundings add; the error bound is checked against the format later.
    formats.quantity[i] = common > 0 ? common : std::min(30, fitting_bits(ranges[quantity] * 65 / 64, 31));
  }
  // A bias has the format of weight times input in 32 bits: where it is much larger than all weights, it decides.
  const double bias = ranges[Kind{Kind::bias, Q::weight}];
  formats[Q::weight] = std::clamp(
      std::min(fitting_bits(ranges[Q::weight] * 32768 / 32767, 15), fitting_bits(bias * 65 / 64, 31) - small_bits), 3,
      15);
  formats.force_sum = formats.torque_sum = formats.deflection_sum = std::numeric_limits<int>::max();
  formats = lowered(formats, model, ranges, room_for_updates);
  int least = formats[Q::torque];
  for (std::size_t j = 0; j < joints_of(model).size(); ++j) {
    if (joints_of(model)[j].bls) least = std::max(least, node_bits(model, j) + small_bits);
  }
  if (formats.torque_sum < least || formats.deflection_sum < formats[Q::position]) {
    throw DataError(
        "the joints' coefficients differ too much in size for one sum: leave out the joint's BLS or raise train.ridge");
  }
  return formats;
}

}  // namespace

Formats choose_formats(const IdentifiedModel& model) {
  Ranges ranges = with_room(prove(model, nullptr).ranges, room_for_updates);
  // Roundings widen the ranges, mostly within the reserve. Where not, the widened ranges choose again.
  constexpr int rounds = 12;
  for (int round = 0; round < rounds; ++round) {
    const Formats formats = formats_for(model, ranges);
    const Proof proof = prove(model, &formats);
    if (proof.too_large.empty()) return formats;
    for (const Kind kind : proof.too_large) ranges.see(kind, std::min(proof.ranges[kind], 2 * ranges[kind]));
  }
  throw DataError(
      "no fixed-point formats can be proven for this model: its effects on the position are too strong for its limits; "
      "check the project's limits and those effects' parameters");
}

bool formats_hold(const IdentifiedModel& model, const Formats& formats) {
  return prove(model, &formats).too_large.empty() &&
         lowered(formats, model, prove(model, nullptr).ranges, 1) == formats;
}

TickStates at_ticks(const ProcessedLog& log, double tick_s, bool whole) {
  const Eigen::Index first = whole ? 0 : log.first, last = whole ? log.t.size() : log.last;
  const double from = log.t[first], to = log.t[last - 1];
  const auto ticks = static_cast<Eigen::Index>(std::floor((to - from) / tick_s + 1e-9)) + 1;
  TickStates out{log.name, Eigen::VectorXd(ticks), Eigen::MatrixXd(ticks, log.q.cols()),
                 Eigen::MatrixXd(ticks, log.q.cols()), Eigen::MatrixXd(ticks, log.q.cols())};
  const MotionRows motion = log.motion();
  for (Eigen::Index k = 0; k < ticks; ++k) {
    const double t = from + tick_s * static_cast<double>(k);
    const double place = (t - from) / log.step_s;
    const auto i = std::min(first + static_cast<Eigen::Index>(place + 1e-9), last - 2);
    const double share = std::clamp((t - log.t[i]) / log.step_s, 0.0, 1.0);
    out.t[k] = t;
    const auto blend = [&](const Eigen::MatrixXd& m) { return ((1 - share) * m.row(i) + share * m.row(i + 1)).eval(); };
    out.q.row(k) = blend(motion.q);
    out.dq.row(k) = blend(motion.dq);
    out.ddq.row(k) = blend(motion.ddq);
  }
  return out;
}

TickStates perturbed(const TickStates& states, const IdentifiedModel& model, std::uint64_t seed) {
  TickStates out = states;
  out.name += " (perturbed)";
  Random random(seed);
  for (Eigen::Index k = 0; k < out.t.size(); ++k) {
    for (Eigen::Index j = 0; j < out.q.cols(); ++j) {
      const JointFit& joint = joints_of(model)[static_cast<std::size_t>(j)];
      const double spike = random.uniform() < 0.01 ? 200 : 1;
      out.q(k, j) += 0.01 * spike * (joint.q_upper - joint.q_lower) * random.normal();
      out.dq(k, j) += 0.01 * spike * joint.dq_limit * random.normal();
      out.ddq(k, j) += 0.01 * spike * joint.ddq_limit * random.normal();
    }
  }
  return out;
}

TickStates within_limits(const IdentifiedModel& model, Eigen::Index count, std::uint64_t seed) {
  Random random(seed);
  const auto n = static_cast<Eigen::Index>(joints_of(model).size());
  TickStates s{"random", Eigen::VectorXd::LinSpaced(count, 0, tick_of(model) * static_cast<double>(count - 1)),
               Eigen::MatrixXd(count, n), Eigen::MatrixXd(count, n), Eigen::MatrixXd(count, n)};
  for (Eigen::Index k = 0; k < count; ++k) {
    for (Eigen::Index j = 0; j < n; ++j) {
      const JointFit& joint = joints_of(model)[static_cast<std::size_t>(j)];
      const auto share = [&] { return k % 2 == 0 ? (random.uniform() < 0.5 ? -1.0 : 1.0) : random.uniform(-1, 1); };
      s.q(k, j) = random.uniform(joint.q_lower, joint.q_upper);
      s.dq(k, j) = joint.dq_limit * share() * (random.uniform() < 0.1 ? 1e-4 : 1);
      s.ddq(k, j) = joint.ddq_limit * share();
    }
  }
  return s;
}

TickStates creeping(const IdentifiedModel& model, const Formats& formats) {
  constexpr Eigen::Index run_up = 500;
  const Eigen::Index count = run_up + static_cast<Eigen::Index>(creeping_ticks);
  const auto n = static_cast<Eigen::Index>(joints_of(model).size());
  TickStates s{"creeping", Eigen::VectorXd::LinSpaced(count, 0, tick_of(model) * static_cast<double>(count - 1)),
               Eigen::MatrixXd(count, n), Eigen::MatrixXd(count, n), Eigen::MatrixXd::Zero(count, n)};
  for (Eigen::Index j = 0; j < n; ++j) {
    const JointFit& joint = joints_of(model)[static_cast<std::size_t>(j)];
    s.q.col(j).setConstant((joint.q_lower + joint.q_upper) / 2);
    s.dq.col(j).setConstant(from_raw(1, formats[Quantity::velocity]));
    s.dq.col(j).head(run_up).setConstant(-joint.dq_limit / 2);
  }
  return s;
}

std::vector<std::int32_t> raw_states(const TickStates& states, Eigen::Index tick, const Formats& formats) {
  std::vector<std::int32_t> words;
  for (Eigen::Index j = 0; j < states.q.cols(); ++j) {
    words.push_back(to_raw(states.q(tick, j), formats[Quantity::position]));
    words.push_back(to_raw(states.dq(tick, j), formats[Quantity::velocity]));
    words.push_back(to_raw(states.ddq(tick, j), formats[Quantity::acceleration]));
  }
  return words;
}

}  // namespace fxdyn
