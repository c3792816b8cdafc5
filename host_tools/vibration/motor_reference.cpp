#include "host_tools/vibration/motor_reference.hpp"

#include "host_tools/effects/effects.hpp"
#include "host_tools/effects/evaluator.hpp"
#include "host_tools/effects/identified_model.hpp"
#include "host_tools/signals/filter.hpp"

namespace fxdyn {
namespace {

using Eigen::MatrixXd;

/// Of the sampling rate. The drive's model differentiates its deflection twice, tick by tick: what changes within a few
/// ticks would come out as torque that no gear asks for.
constexpr double cutoff = 0.05;

bool moves_the_link(const EffectFit& fit) {
  const EffectInfo* info = find_effect(fit.effect);
  return info != nullptr && info->acts_on == ActsOn::position;
}

/// The model with its effects on the position only: those of the load, or the others.
IdentifiedModel deflections_of(IdentifiedModel model, bool of_load) {
  for (JointFit& joint : model.joints) {
    joint.bls.reset();
    std::erase_if(joint.effects, [&](const EffectFit& fit) {
      return !moves_the_link(fit) || find_effect(fit.effect)->needs_structural != of_load;
    });
  }
  return model;
}

MatrixXd deflections(const IdentifiedModel& model, const Reference& motion) {
  MatrixXd delta;
  predict(model, motion.q, motion.dq, motion.ddq, motion.step_s, &delta);
  return delta;
}

}  // namespace

bool bends(const IdentifiedModel& model) {
  return std::any_of(model.joints.begin(), model.joints.end(), [](const JointFit& joint) {
    return std::any_of(joint.effects.begin(), joint.effects.end(), moves_the_link);
  });
}

Reference motor_reference(const IdentifiedModel& model, const Reference& links) {
  Reference motors = links;
  motors.feedforward.resize(0, 0);
  if (!bends(model)) return motors;
  const ZeroPhaseFilter smooth(cutoff / links.step_s, links.step_s);
  const MatrixXd bent = smooth.apply(deflections(deflections_of(model, true), links));
  const IdentifiedModel shown = deflections_of(model, false);
  MatrixXd delta = bent;
  // 0.15^20 is below the last bit
  for (int i = 0; i < 20; ++i) {
    motors.q = links.q + delta;
    const MatrixXd next = bent + deflections(shown, motors);
    const bool settled = next == delta;
    delta = next;
    if (settled) break;
  }
  motors.q = links.q + delta;
  motors.dq = links.dq + differentiate(delta, links.step_s);
  motors.ddq = links.ddq + differentiate_twice(delta, links.step_s);
  return motors;
}

}  // namespace fxdyn
