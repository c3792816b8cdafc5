#include "host_tools/effects/evaluator.hpp"

#include "host_tools/effects/broad_learning_types.hpp"
#include "host_tools/effects/effect_roles.hpp"
#include "host_tools/effects/identified_model.hpp"
#include "host_tools/support/error.hpp"
#include "model/catalogue.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace fxdyn {
namespace {

template <class N, class T>
T number(Kind kind, double value) {
  return N::template load<T>(FromSi<N>::word(kind, value));
}

/// What a node's raw coefficient is multiplied by, as the activation's one need not be 2^15.
template <class Activation>
inline constexpr double coefficient_scale = 32768.0 / Activation::one;

}  // namespace

std::uint32_t all_joints(const IdentifiedModel& model) {
  return model.joints.size() >= 32 ? ~0U : (1U << model.joints.size()) - 1;
}

ModelValue with_stored_limits(const IdentifiedModel& model, const Formats& formats) {
  IdentifiedModel out = model;
  const auto stored = [&](double& limit, Quantity quantity) {
    limit = from_raw(to_raw(limit, formats[quantity]), formats[quantity]);
  };
  for (JointFit& joint : out.joints) {
    stored(joint.q_lower, Quantity::position);
    stored(joint.q_upper, Quantity::position);
    stored(joint.dq_limit, Quantity::velocity);
    stored(joint.ddq_limit, Quantity::acceleration);
  }
  return out;
}

std::vector<const EffectFit*> in_order(const JointFit& joint, bool of_total) {
  std::vector<const EffectFit*> order;
  for (const EffectFit& fit : joint.effects) {
    const EffectInfo* info = find_effect(fit.effect);
    if ((info != nullptr && info->needs_total) == of_total) order.push_back(&fit);
  }
  return order;
}

namespace {

int node_bits_for(const JointFit& joint, double room) {
  if (!joint.bls) return 0;
  double most = room * joint.bls->coefficients.tail(joint.bls->nodes()).cwiseAbs().maxCoeff();
  with_bls_types(*joint.bls, [&]<class, class Activation>() { most *= coefficient_scale<Activation>; });
  int bits = 24;  // enough for coefficients that are next to nothing
  while (std::ldexp(most, bits) > 32767) --bits;
  return bits;
}

}  // namespace

int most_node_bits(const JointFit& joint) { return node_bits_for(joint, 1); }

int node_bits(const IdentifiedModel& model, std::size_t joint) {
  return model.layout ? model.layout->node_bits[joint] : node_bits_for(model.joints[joint], room_for_updates);
}

std::size_t stored_nodes(const BroadLearningFit& fit) { return static_cast<std::size_t>(fit.nodes() + 1) / 2 * 2; }

template <class N>
struct Evaluator<N>::Step {
  virtual ~Step() = default;
  /// theta^T phi where the effect acts on this, else zero; steps the effect's state.
  virtual typename N::TorqueSum torque(JointInput<N>&, typename N::TorqueSum, Saturations&) { return N::no_torque(); }
  virtual typename N::DeflectionSum deflection(const JointInput<N>&, Saturations&) { return N::no_deflection(); }
  virtual void reset() = 0;
  virtual void warm_up(double) {}
  virtual void mark() {}
  virtual void rewind() {}
  std::vector<typename N::Word> words;
};
template <class N>
template <class E>
struct Evaluator<N>::EffectStep final : Step {
  typename E::template State<N> state{}, kept{};
  std::vector<double> shape;
  typename N::TorqueSum torque(JointInput<N>& u, typename N::TorqueSum so_far, Saturations& saturations) override {
    if constexpr (acts_on<E> == ActsOn::torque) {
      if constexpr (needs_total<E>) u.total = running_total<N>(u.structural, so_far);
      return contribution<E, N>(u, Words<N>{this->words.data()}, state, saturations);
    }
    return N::no_torque();
  }
  typename N::DeflectionSum deflection(const JointInput<N>& u, Saturations& saturations) override {
    if constexpr (acts_on<E> == ActsOn::position)
      return contribution<E, N>(u, Words<N>{this->words.data()}, state, saturations);
    return N::no_deflection();
  }
  void reset() override { state = {}; }
  void warm_up(double seconds) override {
    if constexpr (E::traits.drifts()) state.w = from_si<N, Quantity::unit>(E::warmth(seconds, shape[0]));
  }
  void mark() override { kept = state; }
  void rewind() override { state = kept; }
};
template <class N>
template <class Inputs, class Activation>
struct Evaluator<N>::BroadLearningStep final : Step {
  std::size_t nodes = 0;
  int bits = 0;
  typename Inputs::template State<N> state{}, kept{};
  std::vector<typename N::NodeArgument> scratch;
  typename N::TorqueSum torque(JointInput<N>& u, typename N::TorqueSum, Saturations& saturations) override {
    return broad_learning_sum<Inputs, Activation, N>(nodes, bits, u, Words<N>{this->words.data()}, state, saturations,
                                                     scratch);
  }
  void reset() override { state = {}; }
  void mark() override { kept = state; }
  void rewind() override { state = kept; }
};

template <class N>
Evaluator<N>::Evaluator(Evaluator&&) noexcept = default;
template <class N>
Evaluator<N>::~Evaluator() = default;

template <class N>
Evaluator<N>::Evaluator(const IdentifiedModel& model, double tick_s) {
  const std::size_t n = model.robot.size();
  const RigidBody rigid = rigid_body_of(model);
  const auto up = [](double x) { return from_si<N, Quantity::linear_acceleration>(x); };
  up_ = {up(rigid.up.x), up(rigid.up.y), up(rigid.up.z)};
  ticks_per_second_ = from_si<N, Quantity::count>(1 / tick_s);
  for (std::size_t i = 0; i < n; ++i) {
    const LinkGeometry<Real>& link = rigid.geometry[i];
    const auto length = [](double x) { return from_si<N, Quantity::length>(x); };
    geometry_.push_back({link.type,
                         from_si<N, Quantity::unit>(link.cos_alpha),
                         from_si<N, Quantity::unit>(link.sin_alpha),
                         {length(link.p.x), length(link.p.y), length(link.p.z)},
                         from_si<N, Quantity::position>(link.theta)});
    const LinkInertia<Real>& body = rigid.inertia[i];
    const auto first = [](double x) { return number<N, typename N::FirstMoment>({Kind::first_moment}, x); };
    const auto second = [](double x) { return number<N, typename N::SecondMoment>({Kind::second_moment}, x); };
    inertia_.push_back({number<N, typename N::Mass>({Kind::mass}, body.m),
                        {first(body.h.x), first(body.h.y), first(body.h.z)},
                        second(body.xx),
                        second(body.yy),
                        second(body.zz),
                        second(body.xy),
                        second(body.xz),
                        second(body.yz)});
    const JointFit& joint = model.joints[i];
    const auto q = [](double x) { return from_si<N, Quantity::position>(x); };
    const auto dq = [](double x) { return from_si<N, Quantity::velocity>(x); };
    const auto ddq = [](double x) { return from_si<N, Quantity::acceleration>(x); };
    // torques are cut to their limits, so that a limit beyond the format is as good as the format's end
    const auto tau = [](double x) {
      if constexpr (std::is_same_v<N, BoundedNumbers>)
        return Torque<N>{{x, x, 0}};
      else
        return from_si<N, Quantity::torque>(x);
    };
    constants_.push_back({{q(joint.q_lower), q(joint.q_upper), dq(-joint.dq_limit), dq(joint.dq_limit),
                           ddq(-joint.ddq_limit), ddq(joint.ddq_limit), tau(-joint.tau_limit), tau(joint.tau_limit)},
                          from_si<N, Quantity::inverse_velocity>(1 / joint.sign_width)});
  }
  steps_.resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    for (const EffectFit* fit : in_order(model.joints[i])) add_effect(i, *fit, tick_s);
    if (const auto& bls = model.joints[i].bls)
      with_bls_types(*bls, [&]<class Inputs, class Activation>() {
        add_bls<Inputs, Activation>(i, *bls, node_bits(model, i), tick_s);
        ;
      });
    for (const EffectFit* fit : in_order(model.joints[i], true)) add_effect(i, *fit, tick_s);
  }
  limited_.resize(n);
  inputs_.resize(n);
  deflections_.resize(n);
  motions_.resize(n);
  wrenches_.resize(n);
  structural_.resize(n);
  effects_.resize(n);
  tau_.resize(n);
}

template <class N>
void Evaluator<N>::add_effect(std::size_t joint, const EffectFit& fit, double tick_s) {
  bool found = false;
  const std::size_t joints_of_robot = geometry_.size();
  Catalogue::for_each([&]<class E>() {
    if (E::name != fit.effect) return;
    found = true;
    constexpr bool position = acts_on<E> == ActsOn::position;
    deflects_ |= position;
    bends_ |= position && needs_structural<E>;
    couples_ |= needs_peers<E>;
    if constexpr (needs_peers<E>) {
      const double other = fit.shape[0];
      if (other != std::floor(other) || other < 1 || other > static_cast<double>(joints_of_robot) ||
          other == static_cast<double>(joint + 1)) {
        throw InputError(fmt::format("joint {}: {} with joint {}: expected another one of 1 .. {}", joint + 1,
                                     fit.effect, other, joints_of_robot));
      }
    }
    if constexpr (E::traits.most_ticks > 0) {
      if (fit.shape[0] > E::traits.most_ticks * tick_s * (1 + 1e-9)) {  // a step from time stamps is off by rounding
        throw InputError(fmt::format("joint {}: {} of {} s: at most {} ticks of {} s", joint + 1, E::name, fit.shape[0],
                                     E::traits.most_ticks, tick_s));
      }
    }
    auto step = std::make_unique<EffectStep<E>>();
    step->shape = fit.shape;
    for (std::size_t i = 0; i < E::shape.size(); ++i) {
      step->words.push_back(word(Kind::number, E::shape[i].quantity, E::stored_shape(i, fit.shape[i], tick_s)));
    }
    for (std::size_t i = 0; i < E::linear.size(); ++i) {
      step->words.push_back(
          word(position ? Kind::deflection_coefficient : Kind::coefficient, E::linear[i].quantity, fit.linear[i]));
    }
    steps_[joint].push_back(std::move(step));
  });
  if (!found) throw InputError(fmt::format("unknown effect '{}': see `fxdyn effects`", fit.effect));
}

template <class N>
template <class Inputs, class Activation>
void Evaluator<N>::add_bls(std::size_t joint, const BroadLearningFit& fit, int bits, double tick_s) {
  constexpr auto inputs = static_cast<Eigen::Index>(Inputs::size);
  constexpr double scale = coefficient_scale<Activation>;
  auto step = std::make_unique<BroadLearningStep<Inputs, Activation>>();
  step->nodes = stored_nodes(fit);
  step->bits = bits;
  step->scratch.resize(step->nodes);
  auto& words = step->words;
  const auto stored = Inputs::stored(fit, tick_s);
  for (std::size_t i = 0; i < stored.size(); ++i) words.push_back(word(Kind::number, Inputs::shape[i], stored[i]));
  const auto weight = [&](Eigen::Index k, Eigen::Index i) {
    return word(Kind::number, Quantity::weight, k < fit.nodes() ? fit.weights(k, i) : 0);
  };
  const auto output = [&](Eigen::Index k) { return k < fit.nodes() ? fit.coefficients[inputs + k] : 0; };
  const auto nodes = static_cast<Eigen::Index>(step->nodes);
  for (Eigen::Index k = 0; k < nodes; ++k) {
    auto bias = word(Kind::bias, Quantity::weight, k < fit.nodes() ? fit.weights(k, inputs) : 0);
    if constexpr (N::packed) {
      // dense() rounds down: half a unit of its result makes that the nearest
      bias += 1 << (N::weight_bits() + small_bits - Activation::argument_bits - 1);
      words.push_back(bias);
      for (Eigen::Index i = 0; i < inputs; i += 2) words.push_back(raw::pack(weight(k, i), weight(k, i + 1)));
    } else {
      words.push_back(bias);
      for (Eigen::Index i = 0; i < inputs; ++i) words.push_back(weight(k, i));
    }
  }
  for (Eigen::Index i = 0; i < inputs; ++i)
    words.push_back(word(Kind::coefficient, Quantity::feature, fit.coefficients[i]));
  if constexpr (N::packed) {
    const auto raw_output = [&](Eigen::Index k) { return to_raw(output(k) * scale, step->bits); };
    for (Eigen::Index k = 0; k < nodes; k += 2) words.push_back(raw::pack(raw_output(k), raw_output(k + 1)));
  } else {
    for (Eigen::Index k = 0; k < nodes; ++k) words.push_back(FromSi<N>::node_coefficient(output(k), step->bits, scale));
  }
  steps_[joint].push_back(std::move(step));
}

template <class N>
void Evaluator<N>::reset() {
  for (auto& joint : steps_) {
    for (auto& step : joint) step->reset();
  }
  for (auto& deflection : deflections_) deflection = {};
}

template <class N>
void Evaluator<N>::warm_up(double seconds) {
  for (auto& joint : steps_) {
    for (auto& step : joint) step->warm_up(seconds);
  }
}

template <class N>
void Evaluator<N>::mark() {
  for (auto& joint : steps_) {
    for (auto& step : joint) step->mark();
  }
  kept_deflections_ = deflections_;
}

template <class N>
void Evaluator<N>::rewind() {
  for (auto& joint : steps_) {
    for (auto& step : joint) step->rewind();
  }
  deflections_ = kept_deflections_;
}

template <class N>
std::span<const Torque<N>> Evaluator<N>::rigid_body(std::span<const JointState<N>> states) {
  std::copy(states.begin(), states.end(), limited_.begin());
  rnea<N, std::dynamic_extent>(geometry_, inertia_, up_, limited_, motions_, wrenches_, structural_);
  return structural_;
}

template <class N>
void Evaluator<N>::take(std::span<const JointState<N>> setpoints, Saturations& saturations) {
  for (std::size_t i = 0; i < joints(); ++i) {
    limited_[i] = limit_setpoint<N>(setpoints[i], constants_[i].limits, saturations);
    inputs_[i] = joint_input<N>(limited_[i], constants_[i]);
    if (couples_) inputs_[i].peers = inputs_;
  }
}

template <class N>
std::span<const Torque<N>> Evaluator<N>::put_out(Saturations& saturations) {
  for (std::size_t i = 0; i < joints(); ++i) {
    if (!is_output(i)) continue;
    inputs_[i].structural = structural_[i];
    auto sum = N::no_torque();
    JointInput<N> u = inputs_[i];
    for (auto& step : steps_[i]) sum = sum + step->torque(u, sum, saturations);
    effects_[i] = sum;
    tau_[i] = joint_feedforward<N>(structural_[i], sum, constants_[i].limits, saturations);
  }
  return tau_;
}

template <class N>
std::span<const Torque<N>> Evaluator<N>::tick(std::span<const JointState<N>> setpoints, Saturations& saturations) {
  // RobotModel::tick() with what is a type there read from lists
  const std::size_t n = joints();
  const auto rigid_body = [&] {
    rnea<N, std::dynamic_extent>(geometry_, inertia_, up_, limited_, motions_, wrenches_, structural_);
  };
  take(setpoints, saturations);
  if (!deflects_ || bends_) rigid_body();
  if (deflects_) {
    for (std::size_t i = 0; bends_ && i < n; ++i) inputs_[i].structural = structural_[i];
    for (std::size_t i = 0; i < n; ++i) {
      auto sum = N::no_deflection();
      for (auto& step : steps_[i]) sum = sum + step->deflection(inputs_[i], saturations);
      limited_[i] = deflections_[i].step(limited_[i], sum, ticks_per_second_, constants_[i].limits, saturations);
    }
    rigid_body();
  }
  return put_out(saturations);
}

template <class N>
std::span<const Torque<N>> Evaluator<N>::tick(std::span<const JointState<N>> setpoints,
                                              std::span<const Torque<N>> structural, Saturations& saturations) {
  take(setpoints, saturations);
  std::copy(structural.begin(), structural.end(), structural_.begin());
  return put_out(saturations);
}

template <class N>
std::vector<typename N::Word> Evaluator<N>::words() const {
  // The order of RobotModel::Parameters (model/joint_model.hpp); the target's image of it is compared in a test.
  std::vector<typename N::Word> all;
  if constexpr (std::is_same_v<N, RunTimeNumbers>) {
    const auto add = [&](auto... x) { (all.push_back(x.raw), ...); };
    add(up_.x, up_.y, up_.z, ticks_per_second_);
    for (const auto& g : geometry_) {
      all.push_back(static_cast<std::int32_t>(g.type));
      add(g.cos_alpha, g.sin_alpha, g.p.x, g.p.y, g.p.z, g.theta);
    }
    for (const auto& b : inertia_) add(b.m, b.h.x, b.h.y, b.h.z, b.xx, b.yy, b.zz, b.xy, b.xz, b.yz);
    for (const auto& c : constants_) {
      add(c.limits.q_lower, c.limits.q_upper, c.limits.dq_lower, c.limits.dq_upper, c.limits.ddq_lower,
          c.limits.ddq_upper, c.limits.tau_lower, c.limits.tau_upper, c.inverse_width);
    }
    for (std::size_t i = 0; i < steps_.size(); ++i) {
      if (!is_output(i) && !deflects_) continue;
      for (const auto& step : steps_[i]) all.insert(all.end(), step->words.begin(), step->words.end());
    }
  }
  return all;
}

template class Evaluator<Real>;
template class Evaluator<BoundedNumbers>;
template class Evaluator<RunTimeNumbers>;

ModelValue unlimited(ModelValue model) {
  for (JointFit& joint : model->joints) {
    joint.q_upper = joint.dq_limit = joint.ddq_limit = joint.tau_limit = unbounded;
    joint.q_lower = -unbounded;
  }
  return model;
}

Predictor::Predictor(const IdentifiedModel& model, double step_s, double age_s)
    : evaluator_(unlimited(model), step_s), body_(rigid_body_of(model)), state_(model.joints.size()) {
  evaluator_.warm_up(age_s);
}

void Predictor::operator()(const Eigen::MatrixXd& q, const Eigen::MatrixXd& dq, const Eigen::MatrixXd& ddq,
                           Eigen::Ref<Eigen::MatrixXd> tau, Eigen::MatrixXd* deflections, Eigen::MatrixXd* structural) {
  Saturations saturations;
  // What is beyond a deflection depends on the sample before it.
  const bool known = !evaluator_.deflects();
  Eigen::MatrixXd here;
  Eigen::MatrixXd& rigid = structural != nullptr ? *structural : here;
  if (deflections != nullptr) deflections->resize(q.rows(), q.cols());
  if (structural != nullptr || known) rigid.resize(q.rows(), q.cols());
  if (known) rigid_torques(body_, q, dq, ddq, rigid);
  std::vector<double> at_sample(known ? state_.size() : 0);
  for (Eigen::Index k = 0; k < q.rows(); ++k) {
    for (Eigen::Index i = 0; i < q.cols(); ++i) state_[static_cast<std::size_t>(i)] = {q(k, i), dq(k, i), ddq(k, i)};
    for (std::size_t i = 0; i < at_sample.size(); ++i) at_sample[i] = rigid(k, static_cast<Eigen::Index>(i));
    const auto out = known ? evaluator_.tick(state_, at_sample, saturations) : evaluator_.tick(state_, saturations);
    for (Eigen::Index i = 0; i < q.cols(); ++i) {
      const auto at = static_cast<std::size_t>(i);
      tau(k, i) = out[at];
      if (deflections != nullptr) (*deflections)(k, i) = evaluator_.deflections()[at].delta;
      if (structural != nullptr && !known) rigid(k, i) = evaluator_.structural()[at];
    }
  }
}

Eigen::MatrixXd predict(const IdentifiedModel& model, const Eigen::MatrixXd& q, const Eigen::MatrixXd& dq,
                        const Eigen::MatrixXd& ddq, double step_s, Eigen::MatrixXd* deflections, double age_s) {
  Eigen::MatrixXd tau(q.rows(), q.cols());
  Predictor(model, step_s, age_s)(q, dq, ddq, tau, deflections);
  return tau;
}

Eigen::VectorXd predict_joint(const IdentifiedModel& model, std::size_t joint, const Eigen::MatrixXd& q,
                              const Eigen::MatrixXd& dq, const Eigen::MatrixXd& ddq, const Eigen::MatrixXd& structural,
                              double step_s) {
  Evaluator<Real> evaluator(unlimited(model), step_s);
  evaluator.set_outputs(1U << joint);
  std::vector<JointState<Real>> state(model.joints.size());
  std::vector<double> known(model.joints.size());
  Saturations saturations;
  Eigen::VectorXd tau(q.rows());
  for (Eigen::Index k = 0; k < q.rows(); ++k) {
    for (Eigen::Index i = 0; i < q.cols(); ++i) {
      state[static_cast<std::size_t>(i)] = {q(k, i), dq(k, i), ddq(k, i)};
      known[static_cast<std::size_t>(i)] = structural(k, i);
    }
    tau[k] = evaluator.tick(state, known, saturations)[joint];
  }
  return tau;
}

}  // namespace fxdyn
