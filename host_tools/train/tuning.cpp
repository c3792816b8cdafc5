#include "host_tools/train/tuning.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "host_tools/effects/broad_learning_types.hpp"
#include "host_tools/effects/effect_roles.hpp"
#include "host_tools/support/random.hpp"
#include "host_tools/train/sparse_features.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

/// Weights lie on a grid that every format of theirs holds, so that fixed point does not change them.
constexpr double weight_grid = 512;
constexpr double finest_to_coarsest = 3;
/// Of which fixed point holds the reciprocal (ExtendedInputs) [rad/s^2 | m/s^2].
constexpr double least_acceleration = 1.0 / 15;
/// The nodes of fixed point are off by up to 4e-5 (model/dense.hpp), and by a tenth of that on the average:
/// coefficients that add up to more than this many times the rated torque would show.
constexpr double largest_sum = 20;
constexpr double node_rounding = 4e-6;
constexpr double price_of_multiplication = 1e-7;
/// Sums that fixed point could not hold count as so many times as bad as they are.
constexpr double price_of_noise = 10;

bool is_constant(const EffectFit& fit) { return find_effect(fit.effect)->has_constant; }

}  // namespace

BlsDesigner::BlsDesigner(const Fitter& fitter, std::size_t joint, const TrainSettings& settings)
    : fitter_(&fitter),
      joint_(joint),
      settings_(settings),
      nominal_(fitter.design(joint)),
      seed_(settings.seed * 100 + joint),
      revolute_(fitter.chain().links[joint].type == JointType::revolute) {
  const auto j = static_cast<Index>(joint);
  low_ = 1e300;
  high_ = -1e300;
  for (const ProcessedLog& log : fitter.logs()) {
    low_ = std::min(low_, log.q.col(j).minCoeff());
    high_ = std::max(high_, log.q.col(j).maxCoeff());
    const MotionRows motion = log.joint_motion(j);
    top_speed_ = std::max(top_speed_, motion.dq.cwiseAbs().maxCoeff());
    top_acceleration_ = std::max(top_acceleration_, motion.ddq.cwiseAbs().maxCoeff());
  }
}

MatrixXd BlsDesigner::random_weights(Index nodes, Index inputs) const {
  Random random(seed_);
  MatrixXd weights(nodes, inputs + 1);
  for (Index k = 0; k < nodes; ++k) {
    for (Index i = 0; i <= inputs; ++i) weights(k, i) = random.uniform(-1, 1);
    weights(k, 0) *= 1.5;  // half of what the velocity's curve spans
  }
  return weights;
}

JointFit BlsDesigner::operator()(const BlsShape& shape) const {
  JointFit design = nominal_;
  BroadLearningFit bls;
  bls.inputs = settings_.inputs;
  // fixed point's asinh ends at 128
  bls.reference_velocity = std::max(shape.reference_velocity * top_speed_, design.dq_limit / 120);
  bls.span = std::asinh(std::max(top_speed_, design.dq_limit) / bls.reference_velocity);
  const double range = high_ - low_;
  const double distance = shape.distance * range;
  bls.distances = {distance / shape.spread, distance, distance * shape.spread};
  // The joint's limits count as 1; where a model has none, the logs.
  const bool limited = design.q_lower < design.q_upper && design.q_upper - design.q_lower < unbounded;
  bls.middle = limited ? (design.q_lower + design.q_upper) / 2 : (low_ + high_) / 2;
  bls.half_range = (limited ? design.q_upper - design.q_lower : range) / 2;
  bls.velocity = std::max(top_speed_, design.dq_limit);
  bls.stribeck = shape.stribeck * top_speed_;
  bls.share = shape.share;
  bls.acceleration = std::max({top_acceleration_, design.ddq_limit, least_acceleration});
  bls.torque = design.tau_limit > 0 ? design.tau_limit : design.rated_torque;
  bls.wavenumber = settings_.wavenumber.value_or(revolute_ ? 1 : 2 * std::numbers::pi / range);

  const Index inputs = bls_inputs(bls);
  bls.weights = settings_.features == "sparse"
                    ? sparse_weights(fitter_->bls_inputs(joint_, bls), shape.nodes, settings_.windows.value_or(4),
                                     settings_.nodes.value_or(10), seed_)
                    : random_weights(shape.nodes, inputs);
  const bool sigmoid = shape.activation == "sigmoid";
  for (Index k = 0; k < shape.nodes; ++k) {
    const Index window = k % shape.windows;
    const double finer = shape.windows > 1 ? static_cast<double>(window) / static_cast<double>(shape.windows - 1) : 0.0;
    bls.weights.row(k) *= shape.scale * std::pow(finest_to_coarsest, finer) / (sigmoid ? 2 : 1);
  }
  bls.weights = (bls.weights * weight_grid).array().round() / weight_grid;
  bls.activation = sigmoid ? "tanh" : shape.activation;
  // The constant half of every sigmoid.
  if (sigmoid && std::none_of(design.effects.begin(), design.effects.end(), is_constant)) {
    EffectFit offset;
    offset.effect = constant_effect().name;
    design.effects.push_back(offset);
  }
  bls.ridge = shape.ridge;
  design.bls = std::move(bls);
  return design;
}

JointFit first_nodes(JointFit design, Index nodes) {
  design.bls->weights = design.bls->weights.topRows(nodes).eval();
  return design;
}

BlsSpace::BlsSpace(const TrainSettings& settings) : bristles_(settings.inputs == BristlesInputs::name) {
  const PsoSettings pso = settings.pso.value_or(PsoSettings{});
  activations_ = pso.activations.empty() ? std::vector{settings.activation} : pso.activations;
  using Bounds = std::array<double, 2>;
  const auto log10 = [](Bounds x) { return Bounds{std::log10(x[0]), std::log10(x[1])}; };
  std::vector<Bounds> all{{static_cast<double>(pso.nodes[0]), static_cast<double>(pso.nodes[1])},
                          {static_cast<double>(pso.windows[0]), static_cast<double>(pso.windows[1])},
                          log10(pso.ridge),
                          log10({0.3, 6}),
                          log10({3e-5, 1e-2}),
                          log10({1.5, 6}),
                          log10({5e-3, 0.1})};
  if (bristles_) {
    all.push_back(log10({3e-3, 0.3}));
    all.push_back({0.4, 0.95});
  }
  if (activations_.size() > 1) all.push_back({0, static_cast<double>(activations_.size())});
  lower_.resize(static_cast<Index>(all.size()));
  upper_.resize(lower_.size());
  for (Index i = 0; i < lower_.size(); ++i) {
    lower_[i] = all[static_cast<std::size_t>(i)][0];
    upper_[i] = all[static_cast<std::size_t>(i)][1];
  }
}

BlsShape BlsSpace::operator()(const Eigen::VectorXd& x) const {
  const auto from_log = [&](Index i) { return std::pow(10, x[i]); };
  BlsShape shape;
  shape.nodes = static_cast<Index>(std::lround(x[0]));
  shape.windows = static_cast<int>(std::lround(x[1]));
  shape.ridge = from_log(2);
  shape.scale = from_log(3);
  shape.distance = from_log(4);
  shape.spread = from_log(5);
  shape.reference_velocity = from_log(6);
  if (bristles_) {
    shape.stribeck = from_log(7);
    shape.share = x[8];
  }
  const double choice = activations_.size() > 1 ? x[x.size() - 1] : 0;
  shape.activation = activations_[std::min(static_cast<std::size_t>(choice), activations_.size() - 1)];
  return shape;
}

bool is_quiet(const Judgement& judgement, double rated_torque) {
  return judgement.coefficient_sum <= largest_sum * rated_torque;
}

double fitness_of(const Judgement& judgement, const JointFit& design) {
  const double rated = design.rated_torque;
  const auto products = static_cast<double>(multiplications(*design.bls));
  const double value =
      (judgement.rmse + node_rounding * judgement.coefficient_sum) / rated + price_of_multiplication * products;
  return is_quiet(judgement, rated) ? value : price_of_noise * value;
}

BlsFitness::BlsFitness(const Fitter& fitter, std::size_t joint, const TrainSettings& settings)
    : fitter_(&fitter), joint_(joint), space_(settings), design_of_(fitter, joint, settings) {}

BlsFitness::Outcome BlsFitness::operator()(const Eigen::VectorXd& x) const {
  Outcome out;
  out.shape = space_(x);
  out.design = design_of_(out.shape);
  out.judgement = fitter_->held_out_with(joint_, out.design, {out.design.bls->ridge})[0];
  out.quiet = is_quiet(out.judgement, out.design.rated_torque);
  out.value = fitness_of(out.judgement, out.design);
  return out;
}

}  // namespace fxdyn
