#pragma once

#include <Eigen/Dense>

#include <memory>
#include <span>
#include <vector>

#include "host_tools/effects/model_value.hpp"
#include "host_tools/effects/rigid_torques.hpp"
#include "host_tools/numbers/bounded.hpp"
#include "host_tools/numbers/run_time_fixed.hpp"
#include "model/joint_state.hpp"

namespace fxdyn {

/// Host-side conversion of SI values into a number system.
template <class N>
struct FromSi;
template <>
struct FromSi<Real> {
  static double word(Kind, double value) { return value; }
  static double node_coefficient(double value, int, double) { return value; }
};
template <>
struct FromSi<BoundedNumbers> {
  static Bound with_error(double value, int bits) {
    return {value, value, std::fabs(from_raw(to_raw(value, bits), bits) - value)};
  }
  static Bound word(Kind kind, double value) {
    current_bounding.ranges->see(kind, std::fabs(value));
    if (current_bounding.formats == nullptr) return {value, value, 0};
    return with_error(value, bits_of(*current_bounding.formats, kind));
  }
  static Bound node_coefficient(double value, int bits, double scale) {
    if (current_bounding.formats == nullptr) return {value, value, 0};
    return {value, value, std::fabs(from_raw(to_raw(value * scale, bits), bits) / scale - value)};
  }
};
template <>
struct FromSi<RunTimeNumbers> {
  static std::int32_t word(Kind kind, double value) { return to_raw(value, bits_of(*current_formats, kind)); }
};

/// An update may make coefficients this many times as large before they leave their formats.
inline constexpr double room_for_updates = 2;

/// Fractional bits of a joint's int16 node coefficients (those of BroadLearning<nodes, bits>): the most that hold them
/// all, and those of the tables: of the model's layout where it has one, else with room for updates. 0: no BLS.
int most_node_bits(const JointFit& joint);
int node_bits(const IdentifiedModel& model, std::size_t joint);
/// Nodes in the tables: an even number.
std::size_t stored_nodes(const BroadLearningFit& fit);

/// A joint's effects in the order of the tables: those of its own motion first (then the BLS), then those that need the
/// running total (`of_total`).
std::vector<const EffectFit*> in_order(const JointFit& joint, bool of_total = false);

/// Bit i: joint i+1, for every joint of the model.
std::uint32_t all_joints(const IdentifiedModel& model);

/// The model with the setpoints' limits as the tables hold them, rounded to their formats: what fixed point is compared
/// with, so that both cut alike.
ModelValue with_stored_limits(const IdentifiedModel& model, const Formats& formats);

/// A double as a number of quantity Q in number system N.
template <class N, Quantity quantity>
auto from_si(double value) {
  return N::template load<typename N::template Of<quantity>>(FromSi<N>::word({Kind::number, quantity}, value));
}

/// The model of model.json in any number system, with the effects that the file lists: what RobotModel is in firmware,
/// composed at run time from the same functions. For RunTimeNumbers keep a FormatScope alive around every call.
template <class N>
class Evaluator {
 public:
  explicit Evaluator(const IdentifiedModel& model, double tick_s);
  Evaluator(Evaluator&&) noexcept;
  ~Evaluator();

  std::size_t joints() const { return geometry_.size(); }
  /// Whether an effect acts on the position.
  bool deflects() const { return deflects_; }
  /// Puts out the torques of these joints only (bit i: joint i+1); the others' are zero.
  void set_outputs(std::uint32_t outputs) { outputs_ = outputs; }
  /// Effects back to rest.
  void reset();
  /// Advances by `seconds` what depends on time alone (friction_drift); everything else stays at rest. Call it before
  /// the first tick.
  void warm_up(double seconds);
  /// Keeps the effects' states, and puts the kept ones back: to try a tick that is not taken.
  void mark();
  void rewind();
  /// Rigid-body torque alone of these states; steps no effect. The span is valid until the next call.
  std::span<const Torque<N>> rigid_body(std::span<const JointState<N>> states);
  /// One tick; the span returned is valid until the next call.
  std::span<const Torque<N>> tick(std::span<const JointState<N>> setpoints, Saturations& saturations);
  /// The same where the rigid-body torque of this tick is known: structural() of a model that differs in its torque
  /// effects only.
  std::span<const Torque<N>> tick(std::span<const JointState<N>> setpoints, std::span<const Torque<N>> structural,
                                  Saturations& saturations);
  /// Rigid-body torque of the last tick.
  std::span<const Torque<N>> structural() const { return structural_; }
  /// Between motor and link of each joint in the last tick; at rest where no effect acts on the position.
  std::span<const Deflection<N>> deflections() const { return deflections_; }
  /// Sum of each joint's effects in the last tick.
  std::span<const typename N::TorqueSum> effects() const { return effects_; }

  /// The parameters in the order of RobotModel::Parameters, as words; with the effects of the joints
  /// put out only.
  std::vector<typename N::Word> words() const;

 private:
  struct Step;
  template <class E>
  struct EffectStep;
  template <class Inputs, class Activation>
  struct BroadLearningStep;

  static typename N::Word word(Kind::Group group, Quantity quantity, double value) {
    return FromSi<N>::word({group, quantity}, value);
  }
  bool is_output(std::size_t i) const { return (outputs_ >> i & 1U) != 0; }
  void take(std::span<const JointState<N>> setpoints, Saturations& saturations);
  std::span<const Torque<N>> put_out(Saturations& saturations);
  void add_effect(std::size_t joint, const EffectFit& fit, double tick_s);
  template <class Inputs, class Activation>
  void add_bls(std::size_t joint, const BroadLearningFit& fit, int bits, double tick_s);

  Vector3<LinearAcceleration<N>> up_;
  Count<N> ticks_per_second_{};
  std::uint32_t outputs_ = ~0U;
  bool deflects_ = false, bends_ = false, couples_ = false;
  std::vector<LinkGeometry<N>> geometry_;
  std::vector<LinkInertia<N>> inertia_;
  std::vector<JointConstants<N>> constants_;
  std::vector<std::vector<std::unique_ptr<Step>>> steps_;
  std::vector<JointState<N>> limited_;
  std::vector<JointInput<N>> inputs_;
  std::vector<Deflection<N>> deflections_, kept_deflections_;
  std::vector<LinkMotion<N>> motions_;
  std::vector<Wrench<N>> wrenches_;
  std::vector<Torque<N>> structural_, tau_;
  std::vector<typename N::TorqueSum> effects_;
};

extern template class Evaluator<Real>;
extern template class Evaluator<BoundedNumbers>;
extern template class Evaluator<RunTimeNumbers>;

/// Torques of the model in double precision over a motion that comes in pieces. Limits do not apply: this is the model,
/// not the feedforward that a drive may put out.
class Predictor {
 public:
  /// @param age_s how long the robot has run before the motion (Evaluator::warm_up) [s]
  Predictor(const IdentifiedModel& model, double step_s, double age_s = 0);
  /// The next samples of the motion, samples x joints; writes their torques [N*m | N] and, where asked for, motor minus
  /// link of each joint [rad | m] and the rigid body's part of the torque.
  void operator()(const Eigen::MatrixXd& q, const Eigen::MatrixXd& dq, const Eigen::MatrixXd& ddq,
                  Eigen::Ref<Eigen::MatrixXd> tau, Eigen::MatrixXd* deflections = nullptr,
                  Eigen::MatrixXd* structural = nullptr);

 private:
  Evaluator<Real> evaluator_;
  RigidBody body_;
  std::vector<JointState<Real>> state_;
};

/// The model without its drives' limits: they are not the robot's.
ModelValue unlimited(ModelValue model);

/// Over a whole motion at once.
Eigen::MatrixXd predict(const IdentifiedModel& model, const Eigen::MatrixXd& q, const Eigen::MatrixXd& dq,
                        const Eigen::MatrixXd& ddq, double step_s, Eigen::MatrixXd* deflections = nullptr,
                        double age_s = 0);

/// One joint's torque over a whole motion where the rigid body's part is known (samples x joints), which is what takes
/// the time: for models that differ in this joint's torque effects only.
Eigen::VectorXd predict_joint(const IdentifiedModel& model, std::size_t joint, const Eigen::MatrixXd& q,
                              const Eigen::MatrixXd& dq, const Eigen::MatrixXd& ddq, const Eigen::MatrixXd& structural,
                              double step_s);

}  // namespace fxdyn
