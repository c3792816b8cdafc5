#include "tests/campaign/healthy_friction.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "host_tools/support/random.hpp"

namespace fxdyn::campaign {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

/// One step of the bristle at constant velocity, solved exactly: dz/dt = v - a z.
double step_bristle(double z, double v, double a, double h) {
  if (a * h < 1e-12) return z + v * h;
  const double rest = v / a;
  return rest + (z - rest) * std::exp(-a * h);
}

VectorXd lugre(const DryFriction& f, const VectorXd& t, const VectorXd& dq) {
  const double sigma0 = f.coulomb / f.distance;
  const auto g = [&](double v) { return f.coulomb * (1 + f.excess * std::exp(-v * v / (f.stribeck * f.stribeck))); };
  VectorXd out(dq.size());
  double z = 0;
  for (Index k = 0; k < dq.size(); ++k) {
    if (k > 0) {
      const double dt = t[k] - t[k - 1];
      const int steps = std::max(1, static_cast<int>(std::ceil(dt / 50e-6)));
      const double h = dt / steps, slope = (dq[k] - dq[k - 1]) / steps;
      for (int i = 0; i < steps; ++i) {
        const double v = dq[k - 1] + slope * (i + 0.5);
        z = step_bristle(z, v, sigma0 * std::fabs(v) / g(v), h);
      }
    }
    out[k] = sigma0 * z + f.damping * (dq[k] - sigma0 * std::fabs(dq[k]) * z / g(dq[k]));
  }
  return out;
}

/// Springs whose slip distances spread over a factor of ten; they carry equal shares.
VectorXd maxwell(const DryFriction& f, const VectorXd& t, const VectorXd& dq) {
  constexpr std::array spread{0.2, 0.4, 0.7, 1.0, 1.5, 2.2};
  std::array<double, spread.size()> z{};
  VectorXd out(dq.size());
  for (Index k = 0; k < dq.size(); ++k) {
    const double moved = k > 0 ? 0.5 * (dq[k] + dq[k - 1]) * (t[k] - t[k - 1]) : 0.0;
    double sum = 0;
    for (std::size_t i = 0; i < spread.size(); ++i) {
      const double most = spread[i] * f.distance;
      z[i] = std::clamp(z[i] + moved, -most, most);
      sum += z[i] / most;
    }
    out[k] = f.coulomb * sum / static_cast<double>(spread.size());
  }
  return out;
}

}  // namespace

DryFriction draw_friction(Friction kind, double coulomb, double width, double largest_velocity, double inertia,
                          bool turns, std::uint64_t seed) {
  Random random(seed * 6151 + 3);
  DryFriction f{kind, coulomb, width, 0, 0, 0, 0};
  f.excess = random.uniform(0.1, 0.6);
  f.stribeck = largest_velocity * std::pow(10.0, random.uniform(-2, -1.2));
  f.distance = (turns ? 1.0 : 0.1) * std::pow(10.0, random.uniform(-3, -2.2));
  f.damping = random.uniform(0.3, 1) * std::sqrt(coulomb / f.distance * inertia);
  // More damping than g(v) / v falls makes LuGre active, as no friction is: sigma1 < Fs / vs keeps far from that.
  f.damping = std::min(f.damping, 0.5 * coulomb / f.stribeck);
  return f;
}

VectorXd added_friction(const DryFriction& f, const VectorXd& t, const VectorXd& dq) {
  const VectorXd own = f.coulomb * (dq.array() / f.width).tanh().matrix();
  switch (f.kind) {
    case Friction::catalogue:
      return VectorXd::Zero(dq.size());
    case Friction::lugre:
      return lugre(f, t, dq) - own;
    case Friction::maxwell:
      return maxwell(f, t, dq) - own;
    case Friction::smooth_sign: {
      const auto v = dq.array();
      const Eigen::ArrayXd sign = v / (v.square() + f.width * f.width).sqrt();
      return (f.coulomb * sign * (1 + 0.3 * f.excess / (1 + (v / f.stribeck).square()))).matrix() - own;
    }
  }
  return VectorXd::Zero(dq.size());
}

}  // namespace fxdyn::campaign
