#include "host_tools/signals/fourier.hpp"

#include <cmath>
#include <numbers>

#include "host_tools/support/random.hpp"

namespace fxdyn {

FourierState evaluate(const FourierJoint& joint, double period_s, double t) {
  const double w = 2 * std::numbers::pi / period_s;
  FourierState state{joint.centre, 0, 0};
  for (Eigen::Index i = 0; i < joint.a.size(); ++i) {
    const double kw = static_cast<double>(i + 1) * w;
    const double s = std::sin(kw * t), c = std::cos(kw * t);
    state.q += (joint.a[i] * s - joint.b[i] * c) / kw;
    state.dq += joint.a[i] * c + joint.b[i] * s;
    state.ddq += kw * (joint.b[i] * c - joint.a[i] * s);
  }
  return state;
}

void project_onto_boundary_conditions(FourierJoint& joint) {
  const Eigen::Index order = joint.a.size();
  joint.a.array() -= joint.a.mean();
  Eigen::MatrixXd constraints(2, order);
  for (Eigen::Index i = 0; i < order; ++i) {
    constraints(0, i) = static_cast<double>(i + 1);
    constraints(1, i) = 1.0 / static_cast<double>(i + 1);
  }
  const Eigen::Matrix2d gram = constraints * constraints.transpose();
  joint.b -= constraints.transpose() * gram.ldlt().solve(constraints * joint.b);
}

FourierNullSpace boundary_null_space(int order) {
  Eigen::MatrixXd on_a(order, 1), on_b(order, 2);
  for (Eigen::Index i = 0; i < order; ++i) {
    const auto k = static_cast<double>(i + 1);
    on_a(i, 0) = 1;
    on_b.row(i) << k, 1 / k;
  }
  // The last columns of Q are orthogonal to the constraints.
  const auto complement = [order](const Eigen::MatrixXd& constraints) {
    const Eigen::MatrixXd q = Eigen::HouseholderQR<Eigen::MatrixXd>(constraints).householderQ();
    return Eigen::MatrixXd(q.rightCols(order - constraints.cols()));
  };
  return {complement(on_a), complement(on_b)};
}

FourierJoint random_fourier(std::uint64_t seed, int order, double period_s, const FourierBounds& bounds, double speed) {
  Random random(seed);
  FourierJoint joint{0, Eigen::VectorXd(order), Eigen::VectorXd(order)};
  for (int i = 0; i < order; ++i) joint.a[i] = random.normal();
  for (int i = 0; i < order; ++i) joint.b[i] = random.normal();
  project_onto_boundary_conditions(joint);

  double low = 0, high = 0, velocity = 0, acceleration = 0;
  constexpr int samples = 2000;
  for (int i = 0; i < samples; ++i) {
    const FourierState state = evaluate(joint, period_s, period_s * i / samples);
    low = std::min(low, state.q);
    high = std::max(high, state.q);
    velocity = std::max(velocity, std::fabs(state.dq));
    acceleration = std::max(acceleration, std::fabs(state.ddq));
  }
  const double range = bounds.upper - bounds.lower;
  const double scale = std::min(
      {0.95 * range / (high - low), speed * bounds.velocity / velocity, speed * bounds.acceleration / acceleration});
  joint.a *= scale;
  joint.b *= scale;
  const double first = bounds.lower + 0.02 * range - scale * low, last = bounds.upper - 0.02 * range - scale * high;
  joint.centre = first + (last - first) * random.uniform();
  return joint;
}

}  // namespace fxdyn
