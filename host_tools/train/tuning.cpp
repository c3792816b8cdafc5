#include "host_tools/train/tuning.hpp"

#include <algorithm>
#include <cmath>

#include "host_tools/random.hpp"
#include "model/broad_learning.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;

/// Weights lie on a grid that every format of theirs holds, so that fixed point does not change them.
constexpr double weight_grid = 512;
constexpr double finest_to_coarsest = 3;
/// The nodes of fixed point are off by up to 4e-5 (model/dense.hpp), and by a tenth of that on the average:
/// coefficients that add up to more than this many times the rated torque would show.
constexpr double largest_sum = 20;
constexpr double node_rounding = 4e-6;
constexpr double price_of_multiplication = 1e-7;

}  // namespace

BlsDesigner::BlsDesigner(const Fitter& fitter, std::size_t joint, std::uint64_t seed)
    : nominal_(fitter.design(joint)), seed_(seed * 100 + joint) {
  const auto j = static_cast<Index>(joint);
  double low = 1e300, high = -1e300;
  for (const ProcessedLog& log : fitter.logs()) {
    low = std::min(low, log.q.col(j).minCoeff());
    high = std::max(high, log.q.col(j).maxCoeff());
    top_speed_ = std::max(top_speed_, log.joint_motion(j).dq.cwiseAbs().maxCoeff());
  }
  range_ = high - low;
}

JointFit BlsDesigner::operator()(const BlsShape& shape) const {
  JointFit design = nominal_;
  BroadLearningFit bls;
  // fixed point's asinh ends at 128
  bls.reference_velocity = std::max(shape.reference_velocity * top_speed_, design.dq_limit / 120);
  bls.span = std::asinh(std::max(top_speed_, design.dq_limit) / bls.reference_velocity);
  const double distance = shape.distance * range_;
  bls.distances = {distance / shape.spread, distance, distance * shape.spread};
  Random random(seed_);
  const auto inputs = static_cast<Index>(BroadLearningLayout::inputs);
  bls.weights.resize(shape.nodes, inputs + 1);
  for (Index k = 0; k < shape.nodes; ++k) {
    const Index window = k % shape.windows;
    const double finer = shape.windows > 1 ? static_cast<double>(window) / static_cast<double>(shape.windows - 1) : 0.0;
    const double scale = shape.scale * std::pow(finest_to_coarsest, finer);
    for (Index i = 0; i <= inputs; ++i) bls.weights(k, i) = scale * random.uniform(-1, 1);
    bls.weights(k, 0) *= 1.5;  // half of what the velocity's curve spans
  }
  bls.weights = (bls.weights * weight_grid).array().round() / weight_grid;
  bls.ridge = shape.ridge;
  design.bls = std::move(bls);
  return design;
}

BlsSpace::BlsSpace(const PsoSettings& settings) {
  const auto log10 = [](double x) { return std::log10(x); };
  lower_.resize(7);
  upper_.resize(7);
  lower_ << settings.nodes[0], settings.windows[0], log10(settings.ridge[0]), log10(0.3), log10(3e-5), log10(1.5),
      log10(5e-3);
  upper_ << settings.nodes[1], settings.windows[1], log10(settings.ridge[1]), log10(6), log10(1e-2), log10(6),
      log10(0.1);
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
  return shape;
}

bool is_quiet(const Judgement& judgement, double rated_torque) {
  return judgement.coefficient_sum <= largest_sum * rated_torque;
}

double fitness(const Judgement& judgement, const JointFit& design) {
  constexpr auto inputs = static_cast<double>(BroadLearningLayout::inputs);
  const double nodes = static_cast<double>(design.bls->nodes());
  const double multiplications = nodes * (inputs + 1) + inputs;
  return (judgement.rmse + node_rounding * judgement.coefficient_sum) / design.rated_torque +
         price_of_multiplication * multiplications;
}

}  // namespace fxdyn
