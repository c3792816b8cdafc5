#pragma once

#include <memory>
#include <span>
#include <vector>

#include "host_tools/model/identified_model.hpp"
#include "host_tools/numbers/observed.hpp"
#include "host_tools/numbers/run_time_fixed.hpp"
#include "model/joint_model.hpp"

namespace fxdyn {

/// Host-side conversion of SI values into a number system.
template <class N>
struct FromSi;
template <>
struct FromSi<Real> {
  static double word(Kind, double value) { return value; }
  static double to_si(Kind, double word) { return word; }
};
template <>
struct FromSi<ObservedNumbers> {
  static double word(Kind kind, double value) {
    current_ranges->see(kind, value);
    return value;
  }
};
template <>
struct FromSi<RunTimeNumbers> {
  static std::int32_t word(Kind kind, double value) { return to_raw(value, bits_of(*current_formats, kind)); }
};

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
  Evaluator(Evaluator&&) noexcept = default;

  std::size_t joints() const { return geometry_.size(); }
  /// Effects back to rest.
  void reset();
  /// One tick; the span returned is valid until the next call.
  std::span<const Torque<N>> tick(std::span<const JointState<N>> setpoints, Saturations& saturations);
  /// Rigid-body torque of the last tick.
  std::span<const Torque<N>> structural() const { return structural_; }

  /// The parameters in the order of RobotModel::Parameters, as words.
  std::vector<typename N::Word> words() const;

 private:
  struct Step {
    virtual ~Step() = default;
    virtual typename N::TorqueSum operator()(const JointInput<N>& u, Saturations& saturations) = 0;
    virtual void reset() = 0;
    std::vector<typename N::Word> words;
  };
  template <class E>
  struct EffectStep final : Step {
    typename E::template State<N> state{};
    typename N::TorqueSum operator()(const JointInput<N>& u, Saturations& saturations) override {
      return contribution<E, N>(u, Words<N>{this->words.data()}, state, saturations);
    }
    void reset() override { state = {}; }
  };
  struct BroadLearningStep final : Step {
    std::size_t nodes = 0;
    BroadLearningState<N> state{};
    typename N::TorqueSum operator()(const JointInput<N>& u, Saturations& saturations) override {
      const Words<N> coefficients{this->words.data() + broad_learning_shape_words(nodes)};
      auto sum = N::no_torque();
      broad_learning_basis<N>(nodes, u, Words<N>{this->words.data()}, state, saturations,
                              [&](auto tag, std::size_t i, auto phi) {
                                sum = sum + coefficients.template coefficient<decltype(tag)::value>(i) * phi;
                              });
      return sum;
    }
    void reset() override { state = {}; }
  };

  static typename N::Word word(Kind::Group group, Quantity quantity, double value) {
    return FromSi<N>::word({group, quantity}, value);
  }
  void add_effect(std::size_t joint, const EffectFit& fit, double tick_s);
  void add_bls(std::size_t joint, const BroadLearningFit& fit, double tick_s);

  Vector3<LinearAcceleration<N>> up_;
  std::vector<LinkGeometry<N>> geometry_;
  std::vector<LinkInertia<N>> inertia_;
  std::vector<JointConstants<N>> constants_;
  std::vector<std::vector<std::unique_ptr<Step>>> steps_;
  std::vector<JointState<N>> limited_;
  std::vector<LinkMotion<N>> motions_;
  std::vector<Wrench<N>> wrenches_;
  std::vector<Torque<N>> structural_, tau_;
};

extern template class Evaluator<Real>;
extern template class Evaluator<ObservedNumbers>;
extern template class Evaluator<RunTimeNumbers>;

/// Torques of the model in double precision over a log's states, samples x joints [N*m | N]. Limits do not apply: this
/// is the model, not the feedforward that a drive may put out.
Eigen::MatrixXd predict(const IdentifiedModel& model, const Eigen::MatrixXd& q, const Eigen::MatrixXd& dq,
                        const Eigen::MatrixXd& ddq, double step_s);

}  // namespace fxdyn
