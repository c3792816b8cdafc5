#include "host_tools/model/evaluator.hpp"

#include "host_tools/error.hpp"
#include "host_tools/model/effects.hpp"

#include <fmt/format.h>

namespace fxdyn {
namespace {

template <class N, class T>
T number(Kind kind, double value) {
  return N::template load<T>(FromSi<N>::word(kind, value));
}

}  // namespace

template <class N>
Evaluator<N>::Evaluator(const IdentifiedModel& model, double tick_s) {
  const std::size_t n = model.robot.size();
  const DhChain chain = to_dh(model.robot);
  const auto up = [](double x) { return from_si<N, Quantity::linear_acceleration>(x); };
  up_ = {up(chain.up.x()), up(chain.up.y()), up(chain.up.z())};
  for (std::size_t i = 0; i < n; ++i) {
    const LinkGeometry<Real>& link = chain.links[i];
    geometry_.push_back({link.type, from_si<N, Quantity::unit>(link.cos_alpha),
                         from_si<N, Quantity::unit>(link.sin_alpha), from_si<N, Quantity::length>(link.a),
                         from_si<N, Quantity::length>(link.d), from_si<N, Quantity::unit>(link.cos_theta),
                         from_si<N, Quantity::unit>(link.sin_theta)});
    const LinkInertia<Real>& body = model.inertia[i];
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
    const auto tau = [](double x) { return from_si<N, Quantity::torque>(x); };
    constants_.push_back({{q(joint.q_lower), q(joint.q_upper), dq(-joint.dq_limit), dq(joint.dq_limit),
                           ddq(-joint.ddq_limit), ddq(joint.ddq_limit), tau(-joint.tau_limit), tau(joint.tau_limit)},
                          from_si<N, Quantity::inverse_velocity>(1 / joint.sign_width)});
  }
  steps_.resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    for (const EffectFit& fit : model.joints[i].effects) add_effect(i, fit, tick_s);
    if (model.joints[i].bls) add_bls(i, *model.joints[i].bls, tick_s);
  }
  limited_.resize(n);
  motions_.resize(n);
  wrenches_.resize(n);
  structural_.resize(n);
  tau_.resize(n);
}

template <class N>
void Evaluator<N>::add_effect(std::size_t joint, const EffectFit& fit, double tick_s) {
  if (const EffectInfo* info = find_effect(fit.effect)) {
    if (const std::string reason = why_not_in_model(*info); !reason.empty()) throw InputError(reason);
  }
  bool found = false;
  Catalogue::for_each([&]<class E>() {
    if (E::name != fit.effect) return;
    found = true;
    auto step = std::make_unique<EffectStep<E>>();
    for (std::size_t i = 0; i < E::shape.size(); ++i) {
      step->words.push_back(word(Kind::number, E::shape[i].quantity, E::stored_shape(i, fit.shape[i], tick_s)));
    }
    for (std::size_t i = 0; i < E::linear.size(); ++i) {
      step->words.push_back(word(Kind::coefficient, E::linear[i].quantity, fit.linear[i]));
    }
    steps_[joint].push_back(std::move(step));
  });
  if (!found) throw InputError(fmt::format("unknown effect '{}': see `fxdyn effects`", fit.effect));
}

template <class N>
void Evaluator<N>::add_bls(std::size_t joint, const BroadLearningFit& fit, double tick_s) {
  auto step = std::make_unique<BroadLearningStep>();
  step->nodes = static_cast<std::size_t>(fit.nodes());
  auto& words = step->words;
  words.push_back(word(Kind::number, Quantity::inverse_velocity, 1 / fit.reference_velocity));
  for (const double distance : fit.distances)
    words.push_back(word(Kind::number, Quantity::inverse_path, tick_s / distance));
  for (Eigen::Index k = 0; k < fit.weights.rows(); ++k) {
    for (Eigen::Index i = 0; i < fit.weights.cols(); ++i)
      words.push_back(word(Kind::number, Quantity::weight, fit.weights(k, i)));
  }
  for (Eigen::Index i = 0; i < fit.coefficients.size(); ++i) {
    const bool input = i < static_cast<Eigen::Index>(BroadLearningInputs::count);
    words.push_back(word(Kind::coefficient, input ? Quantity::argument : Quantity::unit, fit.coefficients[i]));
  }
  steps_[joint].push_back(std::move(step));
}

template <class N>
void Evaluator<N>::reset() {
  for (auto& joint : steps_) {
    for (auto& step : joint) step->reset();
  }
}

template <class N>
std::span<const Torque<N>> Evaluator<N>::tick(std::span<const JointState<N>> setpoints, Saturations& saturations) {
  const std::size_t n = joints();
  for (std::size_t i = 0; i < n; ++i) limited_[i] = limit_setpoint<N>(setpoints[i], constants_[i].limits, saturations);
  rnea<N, std::dynamic_extent>(geometry_, inertia_, up_, limited_, motions_, wrenches_, structural_, saturations);
  for (std::size_t i = 0; i < n; ++i) {
    tau_[i] = joint_feedforward<N>(
        limited_[i], structural_[i], constants_[i],
        [&](const JointInput<N>& u) {
          auto sum = N::no_torque();
          for (auto& step : steps_[i]) sum = sum + (*step)(u, saturations);
          return sum;
        },
        saturations);
  }
  return tau_;
}

template <class N>
std::vector<typename N::Word> Evaluator<N>::words() const {
  // The order of RobotModel::Parameters (model/joint_model.hpp); the target's image of it is compared in a test.
  std::vector<typename N::Word> all;
  if constexpr (std::is_same_v<N, RunTimeNumbers>) {
    const auto add = [&](auto... x) { (all.push_back(x.raw), ...); };
    add(up_.x, up_.y, up_.z);
    for (const auto& g : geometry_) {
      all.push_back(static_cast<std::int32_t>(g.type));
      add(g.cos_alpha, g.sin_alpha, g.a, g.d, g.cos_theta, g.sin_theta);
    }
    for (const auto& b : inertia_) add(b.m, b.h.x, b.h.y, b.h.z, b.xx, b.yy, b.zz, b.xy, b.xz, b.yz);
    for (const auto& c : constants_) {
      add(c.limits.q_lower, c.limits.q_upper, c.limits.dq_lower, c.limits.dq_upper, c.limits.ddq_lower,
          c.limits.ddq_upper, c.limits.tau_lower, c.limits.tau_upper, c.inverse_width);
    }
    for (const auto& joint : steps_) {
      for (const auto& step : joint) all.insert(all.end(), step->words.begin(), step->words.end());
    }
  }
  return all;
}

template class Evaluator<Real>;
template class Evaluator<ObservedNumbers>;
template class Evaluator<RunTimeNumbers>;

Eigen::MatrixXd predict(const IdentifiedModel& model, const Eigen::MatrixXd& q, const Eigen::MatrixXd& dq,
                        const Eigen::MatrixXd& ddq, double step_s) {
  IdentifiedModel unlimited = model;
  for (JointFit& joint : unlimited.joints) {
    joint.q_upper = joint.dq_limit = joint.ddq_limit = joint.tau_limit = unbounded;
    joint.q_lower = -unbounded;
  }
  Evaluator<Real> evaluator(unlimited, step_s);
  const Eigen::Index n = q.cols();
  Eigen::MatrixXd tau(q.rows(), n);
  std::vector<JointState<Real>> state(static_cast<std::size_t>(n));
  Saturations saturations;
  for (Eigen::Index k = 0; k < q.rows(); ++k) {
    for (Eigen::Index i = 0; i < n; ++i) state[static_cast<std::size_t>(i)] = {q(k, i), dq(k, i), ddq(k, i)};
    const auto out = evaluator.tick(state, saturations);
    for (Eigen::Index i = 0; i < n; ++i) tau(k, i) = out[static_cast<std::size_t>(i)];
  }
  return tau;
}

}  // namespace fxdyn
