#include "host_tools/export/proof.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <queue>

#include "host_tools/effects/effects.hpp"
#include "host_tools/effects/evaluator.hpp"
#include "host_tools/effects/identified_model.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/parallel.hpp"
#include "host_tools/support/random.hpp"

namespace fxdyn {
namespace {

using State = JointState<BoundedNumbers>;

/// Every joint anywhere within its limits.
std::vector<State> whole_box(const IdentifiedModel& model) {
  std::vector<State> box;
  for (const JointFit& joint : model.joints) {
    box.push_back({{{joint.q_lower, joint.q_upper, 0}},
                   {{-joint.dq_limit, joint.dq_limit, 0}},
                   {{-joint.ddq_limit, joint.ddq_limit, 0}}});
  }
  return box;
}

/// The same model whose torques are not cut, so that they show.
IdentifiedModel uncut(const IdentifiedModel& model, bool effects) {
  IdentifiedModel out = model;
  for (JointFit& joint : out.joints) {
    joint.tau_limit = unbounded;
    if (effects) continue;
    joint.effects.clear();
    joint.bls.reset();
  }
  return out;
}

/// Until the longest memory of the catalogue is full, and four more for what its input remembers.
int memory_ticks() {
  std::uint32_t most = 0;
  for (const EffectInfo& info : effect_infos()) most = std::max(most, info.most_ticks + 1);
  return static_cast<int>(most) + 4;
}

bool delays(const IdentifiedModel& model) {
  return std::any_of(model.joints.begin(), model.joints.end(), [](const JointFit& joint) {
    return std::any_of(joint.effects.begin(), joint.effects.end(),
                       [](const EffectFit& fit) { return find_effect(fit.effect)->of_total == OfTotal::delays; });
  });
}

/// The error bound of one joint's torque. A state that moves fast rounds coarsely and forgets fast, one that creeps
/// does neither; over all velocities at once the bound would be that of a state which rounds coarsely and forgets
/// slowly. So the joint's velocity is cut into octaves, one direction after the other: within its acceleration limit it
/// turns from tick to tick only at velocities below that of a tick's acceleration. States keep the largest error of all
/// octaves, which the first round collects; then comes a creep, which adds to it, and after it the octaves again.
/// @param turning largest velocity at which the joint may turn from tick to tick [rad/s | m/s]
double error_of(Evaluator<BoundedNumbers>& evaluator, std::vector<State> box, std::size_t joint, double turning) {
  constexpr int octaves = 28;
  const double most = box[joint].dq.value.high;
  Saturations none;
  double error = 0;
  const auto at = [&](double low, double high, double sign, int ticks) {
    box[joint].dq.value = sign > 0 ? Bound{low, high, 0} : Bound{-high, -low, 0};
    for (int tick = 0; tick < ticks; ++tick) error = std::max(error, evaluator.tick(box, none)[joint].value.error);
  };
  const auto octave = [&](int i, double sign) { at(std::ldexp(most, -i - 1), std::ldexp(most, -i), sign, 2); };
  evaluator.reset();
  for (int round = 0; round < 3; ++round) {
    for (const double sign : {1.0, -1.0})
      for (int i = 0; i < octaves; ++i) octave(i, sign);
    for (int i = 0; i < octaves; ++i) {
      if (std::ldexp(most, -i - 1) > turning) continue;
      for (const double sign : {1.0, -1.0}) octave(i, sign);
    }
    current_bounding.creeps = round == 1;
    if (round == 1)
      for (const double sign : {1.0, -1.0}) at(0, std::ldexp(most, -octaves), sign, 1);
    current_bounding.creeps = false;
  }
  return error;
}

}  // namespace

Proof prove(const IdentifiedModel& identified, const Formats* formats) {
  const IdentifiedModel model = formats != nullptr ? with_stored_limits(identified, *formats) : ModelValue(identified);
  Proof proof;
  const BoundScope scope(proof.ranges, formats);
  Evaluator<BoundedNumbers> evaluator(uncut(model, true), model.tick_s);
  const std::vector<State> box = whole_box(model);
  for (const State& joint : box) {
    proof.ranges.see({Kind::number, Quantity::position}, joint.q.value.magnitude());
    proof.ranges.see({Kind::number, Quantity::velocity}, joint.dq.value.magnitude());
    proof.ranges.see({Kind::number, Quantity::acceleration}, joint.ddq.value.magnitude());
  }
  Saturations none;
  const auto n = static_cast<Eigen::Index>(model.joints.size());
  proof.torque = proof.effects = proof.error = Eigen::VectorXd::Zero(n);
  const int ticks = memory_ticks();
  for (int tick = 0; tick < ticks; ++tick) {
    const auto torques = evaluator.tick(box, none);
    for (Eigen::Index j = 0; j < n; ++j) {
      const auto i = static_cast<std::size_t>(j);
      proof.torque[j] = std::max(proof.torque[j], torques[i].value.magnitude());
      proof.effects[j] = std::max(proof.effects[j], evaluator.effects()[i].value.magnitude());
      proof.error[j] = std::max(proof.error[j], torques[i].value.error);
    }
  }
  // What a delay has kept may come from any velocity: then only the bound over all of them at once holds.
  if (formats != nullptr && !delays(model)) {
    for (Eigen::Index j = 0; j < n; ++j) {
      const auto i = static_cast<std::size_t>(j);
      proof.error[j] = error_of(evaluator, box, i, model.joints[i].ddq_limit * model.tick_s);
    }
  }
  if (formats == nullptr) return proof;
  for (std::size_t g = 0; g < group_count; ++g) {
    for (std::size_t i = 0; i < quantity_count; ++i) {
      const Kind kind{static_cast<Kind::Group>(g), static_cast<Quantity>(i)};
      const bool small = kind.quantity == Quantity::weight && kind.group == Kind::number;
      if (proof.ranges[kind] > std::ldexp(small ? 32767.0 : 2147483647.0, -bits_of(*formats, kind)))
        proof.too_large.push_back(kind);
    }
  }
  return proof;
}

Attained attain(const IdentifiedModel& model) {
  const auto n = model.joints.size();
  const IdentifiedModel free = uncut(model, true);
  Attained out{Eigen::VectorXd::Zero(static_cast<Eigen::Index>(n)),
               Eigen::VectorXd::Zero(static_cast<Eigen::Index>(n))};
  constexpr int starts = 150;
  constexpr int steps = 16;
  parallel_for(n, [&](std::size_t target) {
    Evaluator<Real> evaluator(free, model.tick_s);
    Random random(100 + target);
    Saturations none;
    double structural = 0, total = 0;
    std::vector<JointState<Real>> state(n);
    const auto torque = [&] {
      evaluator.reset();
      const double whole = std::fabs(evaluator.tick(state, none)[target]);
      const double rigid = std::fabs(evaluator.structural()[target]);
      structural = std::max(structural, rigid);
      total = std::max(total, whole);
      return whole;
    };
    for (int start = 0; start < starts; ++start) {
      const auto either = [&](double x) { return random.uniform() < 0.5 ? -x : x; };
      for (std::size_t j = 0; j < n; ++j) {
        const JointFit& joint = model.joints[j];
        state[j] = {random.uniform(joint.q_lower, joint.q_upper), either(joint.dq_limit), either(joint.ddq_limit)};
      }
      double best = torque();
      for (int round = 0; round < 4; ++round) {
        const double before = best;
        const auto along = [&](double& x, double low, double high, int count) {
          double kept = x;
          for (int i = 0; i < count; ++i) {
            x = low + (high - low) * i / (count - 1);
            const double value = torque();
            if (value > best) {
              best = value;
              kept = x;
            }
          }
          x = kept;
        };
        for (std::size_t j = 0; j < n; ++j) {
          const JointFit& joint = model.joints[j];
          along(state[j].q, joint.q_lower, joint.q_upper, 2 * steps);
          along(state[j].dq, -joint.dq_limit, joint.dq_limit, 3);
          along(state[j].ddq, -joint.ddq_limit, joint.ddq_limit, 2);
        }
        if (best <= before) break;
      }
    }
    out.structural[static_cast<Eigen::Index>(target)] = structural;
    out.total[static_cast<Eigen::Index>(target)] = total;
  });
  return out;
}

Eigen::VectorXd prove_structural(const IdentifiedModel& model, const Eigen::VectorXd& attained, double goal,
                                 int boxes) {
  struct Box {
    std::vector<State> states;
    double bound;
    bool operator<(const Box& other) const { return bound < other.bound; }
  };
  const auto n = model.joints.size();
  Eigen::VectorXd proven(static_cast<Eigen::Index>(n));
  parallel_for(n, [&](std::size_t target) {
    Ranges ignored;
    const BoundScope scope(ignored, nullptr);
    Evaluator<BoundedNumbers> evaluator(uncut(model, false), model.tick_s);
    Saturations none;
    const auto make = [&](std::vector<State> states) {
      const double bound = evaluator.tick(states, none)[target].value.magnitude();
      return Box{std::move(states), bound};
    };
    std::priority_queue<Box> open;
    open.push(make(whole_box(model)));
    for (int used = 0; used < boxes && open.top().bound > goal * attained[static_cast<Eigen::Index>(target)];) {
      const Box box = open.top();
      open.pop();
      // halved where that helps most
      std::optional<std::pair<Box, Box>> best;
      const auto halve = [&](auto&& part) {
        std::vector<State> lower = box.states, upper = box.states;
        Bound &below = part(lower), &above = part(upper);
        below.high = above.low = (below.low + below.high) / 2;
        Box a = make(std::move(lower)), b = make(std::move(upper));
        used += 2;
        if (!best || a.bound + b.bound < best->first.bound + best->second.bound)
          best.emplace(std::move(a), std::move(b));
      };
      for (std::size_t j = 0; j < n; ++j) {
        halve([&](std::vector<State>& states) -> Bound& { return states[j].q.value; });
        halve([&](std::vector<State>& states) -> Bound& { return states[j].dq.value; });
      }
      open.push(std::move(best->first));
      open.push(std::move(best->second));
    }
    proven[static_cast<Eigen::Index>(target)] = open.top().bound;
  });
  return proven;
}

}  // namespace fxdyn
