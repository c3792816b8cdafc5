// LuGre friction twice: the plants' differential equation, and the model's step at the drive's tick in double and in
// fixed point. They share no code.

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>

#include "host_tools/effects/identified_model.hpp"
#include "host_tools/numbers/run_time_fixed.hpp"
#include "host_tools/simulate/lugre_plant.hpp"
#include "model/effects/lugre.hpp"

namespace fxdyn {
namespace {

constexpr double tick_s = 0.002;

struct TestFormats {
  static constexpr int position = 28, velocity = 28, acceleration = 24, linear_acceleration = 24, length = 28;
  static constexpr int force = 20, torque = 22, inverse_velocity = 20, inverse_path = 24, weight = 24;
  static constexpr int velocity_squared = 22, velocity_cubed = 19, inverse_position = 22, inverse_torque = 20;
  static constexpr int force_sum = 44, torque_sum = 50, deflection_sum = 44;
};
using Fixed32 = FixedNumbers<TestFormats>;

/// Friction of the six joints of the paper's scenario, and their rated torques [N*m].
struct Joint {
  double distance, velocity, static_friction, damping, rated;
};
constexpr double share = 1 / 1.4;
constexpr std::array joints{Joint{0.0042, 0.08, 9.8, 51.58, 97.6},  Joint{0.0028, 0.06, 14.84, 158, 186.4},
                            Joint{0.0035, 0.1, 8.82, 45.65, 89.4},  Joint{0.0056, 0.15, 1.498, 7.314, 24.2},
                            Joint{0.0049, 0.12, 1.19, 6.593, 20.1}, Joint{0.0056, 0.15, 0.98, 5.812, 21.3}};

EffectFit fit_of(const Joint& joint) {
  EffectFit fit;
  fit.effect = "lugre";
  fit.shape = {joint.distance, joint.velocity, share};
  fit.linear = {joint.static_friction, joint.damping};
  return fit;
}

/// Both phi of a tick times their coefficients [N*m]; the sign is left out, so it is the bristles' force alone.
template <class N>
class Step {
 public:
  explicit Step(const Joint& joint, double tick = tick_s) : joint_(joint) {
    const std::array shape{joint.distance, joint.velocity, share};
    for (std::size_t i = 0; i < shape.size(); ++i) {
      const double stored = Lugre::stored_shape(i, shape[i], tick);
      if constexpr (std::is_same_v<N, Real>)
        words_[i] = stored;
      else
        words_[i] = to_raw(stored, Fixed32::bits(Lugre::shape[i].quantity));
    }
  }
  double operator()(double dq) {
    JointInput<N> u{};
    if constexpr (std::is_same_v<N, Real>)
      u.dq = dq;
    else
      u.dq = {to_raw(dq, TestFormats::velocity)};
    double sum = 0;
    Lugre::basis<N>(u, Words<N>{words_.data()}, state_, saturations_,
                    [&]([[maybe_unused]] auto tag, std::size_t i, auto phi) {
                      const double coefficient = i == 0 ? joint_.static_friction : joint_.damping;
                      if constexpr (std::is_same_v<N, Real>)
                        sum += coefficient * phi;
                      else
                        sum += coefficient * from_raw(phi.raw, Fixed32::bits(decltype(tag)::value));
                    });
    return sum;
  }

 private:
  Joint joint_;
  std::array<typename N::Word, 3> words_{};
  Lugre::State<N> state_{};
  Saturations saturations_;
};

double quantised(double dq) { return from_raw(to_raw(dq, TestFormats::velocity), TestFormats::velocity); }

/// Creep at 0.1 mrad/s, slow motion that reverses a few times a second, and stretches at rest.
double creep_and_reversals(double t) {
  constexpr double turn = 2 * std::numbers::pi;
  const double phase = std::fmod(t, 60);
  if (phase < 10) return 1e-4 * std::sin(turn * 0.2 * t);
  if (phase < 15) return 0;
  return 0.02 * std::sin(turn * 0.7 * t) + 0.01 * std::sin(turn * 3.1 * t) + 0.004 * std::sin(turn * 9.3 * t);
}

/// dz/dt [rad/s]
double bending(const Joint& joint, double z, double v) {
  const double sigma0 = joint.static_friction / joint.distance, x = v / joint.velocity;
  return v - sigma0 * std::fabs(v) * z / (joint.static_friction * (share + (1 - share) * std::exp(-x * x)));
}

/// Explicit Euler at 1 us, the simplest there is.
double euler(const Joint& joint, double& z, double v0, double v1, double tick = tick_s) {
  const double h = 1e-6;
  const int steps = static_cast<int>(std::lround(tick / h));
  for (int i = 0; i < steps; ++i) z += h * bending(joint, z, v0 + (v1 - v0) * (i + 0.5) / steps);
  return joint.static_friction / joint.distance * z + joint.damping * bending(joint, z, v1);
}

/// Full speed and acceleration of the scenario's joints, the fastest of them [rad/s, rad/s^2].
constexpr double fastest = 4, hardest = 12;

/// Velocity that goes up and down between +-most at an acceleration.
double to_and_fro(double t, double most, double acceleration) {
  const double quarter = most / acceleration, phase = std::fmod(t, 4 * quarter);
  if (phase < quarter) return acceleration * phase;
  return phase < 3 * quarter ? acceleration * (2 * quarter - phase) : acceleration * (phase - 4 * quarter);
}

/// From 0.001 rad/s to full speed and back in 2.5 s, by the same factor in the same time; then the other way round.
double all_speeds(double t) {
  const double phase = std::fmod(t, 2.5) / 2.5, up = phase < 0.5 ? 2 * phase : 2 - 2 * phase;
  return (std::fmod(t, 5) < 2.5 ? 1 : -1) * 0.001 * std::pow(fastest / 0.001, up);
}

using Program = double (*)(double);
constexpr double creep = 0.001;
constexpr std::array<Program, 5> programs{
    [](double t) { return creep * std::sin(3 * t); }, all_speeds,
    [](double t) { return to_and_fro(t, fastest, hardest); },  // full speed, hard reversals
    [](double t) { return to_and_fro(t, 0.1, hardest); },      // reversals within Stribeck's curve
    [](double t) { return 0.5 * std::sin(2 * t) + 0.3 * std::sin(7 * t) + 0.1 * std::sin(23 * t); }};

TEST(LuGrePlant, AgreesWithASmallerStepOfASimplerMethod) {
  for (const Joint& joint : joints) {
    LuGreBristles bristles(fit_of(joint));
    double z = 0, last = 0;
    for (int k = 1; k < 2500; ++k) {
      const double t = tick_s * k, dq = 0.4 * std::sin(2 * t) + 0.2 * std::sin(11 * t);
      ASSERT_NEAR(bristles.advance(last, dq, tick_s), euler(joint, z, last, dq), 1e-5 * joint.rated) << t;
      last = dq;
    }
  }
}

TEST(LuGrePlant, SlidesOnTheStribeckCurve) {
  const Joint& joint = joints[0];
  for (const double dq : {0.01, -0.08, 0.5}) {
    LuGreBristles bristles(fit_of(joint));
    double force = 0;
    for (int k = 0; k < 5000; ++k) force = bristles.advance(dq, dq, tick_s);
    const double curve = 7 + 2.8 * std::exp(-std::pow(dq / 0.08, 2));
    EXPECT_NEAR(force, std::copysign(curve, dq), 1e-6) << dq;
  }
}

TEST(LuGreEffect, FollowsTheOdeForTenMinutesOfCreepAndReversals) {
  double largest = 0;  // of rated
  for (const Joint& joint : joints) {
    LuGreBristles bristles(fit_of(joint));
    Step<Real> real(joint);
    Step<Fixed32> fixed(joint);
    double last = 0, of_real = 0, of_fixed = 0, most = 0;
    for (int k = 1; k <= 300'000; ++k) {
      const double dq = quantised(creep_and_reversals(tick_s * k));
      const double truth = bristles.advance(last, dq, tick_s);
      of_real = std::max(of_real, std::fabs(real(dq) - truth));
      of_fixed = std::max(of_fixed, std::fabs(fixed(dq) - truth));
      most = std::max(most, std::fabs(truth));
      last = dq;
    }
    EXPECT_GT(most, joint.static_friction * share);
    EXPECT_LT(of_real, 1e-4 * joint.rated);
    EXPECT_LT(of_fixed, 1e-4 * joint.rated);
    largest = std::max(largest, of_fixed / joint.rated);
  }
  RecordProperty("largest_error_per_million_of_rated", std::to_string(1e6 * largest));
}

/// What the model's step does over the whole range of velocities, with the bristles' damping and without: largest error
/// and RMS, of rated torque. docs/findings/2026-11-25-lugre-step.md has these figures.
TEST(LuGreEffect, FollowsTheOdeFromCreepToFullSpeed) {
  double largest = 0, largest_rms = 0, of_creep = 0, largest_fixed = 0;
  for (const Program program : programs) {
    for (const Joint& joint : joints) {
      Joint undamped = joint;
      undamped.damping = 0;
      std::array<Step<Real>, 2> real{Step<Real>(joint), Step<Real>(undamped)};
      std::array<Step<Fixed32>, 2> fixed{Step<Fixed32>(joint), Step<Fixed32>(undamped)};
      std::array<double, 2> squares{};
      double z = 0, last = 0;
      constexpr int ticks = 2500;
      for (int k = 1; k <= ticks; ++k) {
        const double dq = quantised(program(tick_s * k));
        const double damped = euler(joint, z, last, dq), bent = damped - joint.damping * bending(joint, z, dq);
        for (const std::size_t i : {0U, 1U}) {
          const double truth = i == 0 ? damped : bent;
          const double error = std::fabs(real[i](dq) - truth) / joint.rated;
          largest = std::max(largest, error);
          if (program == programs[0]) of_creep = std::max(of_creep, error);
          squares[i] += error * error;
          largest_fixed = std::max(largest_fixed, std::fabs(fixed[i](dq) - truth) / joint.rated);
        }
        last = dq;
      }
      for (const double square : squares) largest_rms = std::max(largest_rms, std::sqrt(square / ticks));
    }
  }
  RecordProperty("largest_of_rated", std::to_string(largest));
  RecordProperty("rms_of_rated", std::to_string(largest_rms));
  EXPECT_LT(of_creep, 1e-7);
  EXPECT_LT(largest, 8.5e-4);
  EXPECT_LT(largest_rms, 1.5e-4);
  EXPECT_LT(largest_fixed, 8.5e-4);
}

/// The step takes n at a tick's end, so its error is of first order: half the tick, half the error.
TEST(LuGreEffect, ErrorGoesWithTheTick) {
  const Joint& joint = joints[2];
  const auto error_at = [&](double tick) {
    Step<Real> step(joint, tick);
    double z = 0, last = 0, most = 0;
    for (int k = 1; k * tick < 2; ++k) {
      const double dq = to_and_fro(k * tick, 1, 6);
      most = std::max(most, std::fabs(step(dq) - euler(joint, z, last, dq, tick)));
      last = dq;
    }
    return most;
  };
  const double at_tick = error_at(tick_s), at_half = error_at(tick_s / 2), at_quarter = error_at(tick_s / 4);
  EXPECT_NEAR(at_half / at_tick, 0.5, 0.06) << at_tick << ' ' << at_half;
  EXPECT_NEAR(at_quarter / at_half, 0.5, 0.06) << at_half << ' ' << at_quarter;
}

TEST(LuGrePlant, ShortBristlesSlideOnTheStribeckCurve) {
  Joint joint = joints[0];
  for (const double distance : {1e-5, 1e-7}) {
    joint.distance = distance;
    LuGreBristles bristles(fit_of(joint));
    double last = 0;
    for (int k = 1; k < 1000; ++k) {  // up to 60 000 distances a tick
      const double t = tick_s * k, dq = 3 * std::sin(3 * t);
      const double force = bristles.advance(last, dq, tick_s);
      const double curve = 7 + 2.8 * std::exp(-std::pow(dq / 0.08, 2));
      // Bristles lag by the time in which they move by their distance.
      if (std::fabs(dq) * tick_s > 30 * distance && std::fabs(dq) > 0.01)
        ASSERT_NEAR(force, std::copysign(curve, dq), 0.02 * curve) << distance << ' ' << t;
      ASSERT_LE(std::fabs(force), 9.8 + joint.damping * 3) << distance << ' ' << t;
      last = dq;
    }
  }
}

/// |y| <= 1 at any tick, so the force is at most static + damping |dq| (1 + 1 / share). Explicit Euler at the same tick
/// leaves every bound.
TEST(LuGreEffect, IsStableWhereEulerIsNot) {
  Joint joint = joints[0];
  joint.distance = 4e-5;
  for (const double damping : {0.0, 51.58, 2000.0}) {
    joint.damping = damping;
    Step<Real> step(joint);
    Step<Fixed32> fixed(joint);
    double y = 0, most_of_euler = 0;
    for (int k = 0; k < 1000; ++k) {  // 150 distances a tick; Euler bears 2
      const double dq = k % 2 == 0 ? 3.0 : 2.9 * std::cos(k);
      const double most = joint.static_friction + damping * std::fabs(dq) * (1 + 1 / share);
      ASSERT_LE(std::fabs(step(dq)), most * (1 + 1e-12)) << damping << ' ' << k;
      ASSERT_LE(std::fabs(fixed(dq)), most * (1 + 1e-5)) << damping << ' ' << k;
      if (most_of_euler < 1e6) y += tick_s * bending(joint, y * joint.distance, dq) / joint.distance;
      most_of_euler = std::max(most_of_euler, std::fabs(y));
    }
    EXPECT_GT(most_of_euler, 1e6);
  }
}

TEST(LuGrePlant, TorqueAddsUpWithCoulombs) {
  IdentifiedModel plant;
  plant.joints.resize(1);
  plant.joints[0].sign_width = 1e-6;
  plant.joints[0].effects = {fit_of(joints[0])};
  Eigen::MatrixXd dq = Eigen::MatrixXd::Constant(4000, 1, 0.5);
  const Eigen::MatrixXd tau = lugre_torque(plant, dq, tick_s);
  EXPECT_NEAR(tau(3999, 0), 0, 1e-6);  // Coulomb's friction is all there is at 0.5 rad/s
  EXPECT_TRUE(has_lugre(plant));
  plant.joints[0].effects.clear();
  EXPECT_FALSE(has_lugre(plant));
  EXPECT_EQ(lugre_torque(plant, dq, tick_s).cwiseAbs().maxCoeff(), 0);
}

}  // namespace
}  // namespace fxdyn
