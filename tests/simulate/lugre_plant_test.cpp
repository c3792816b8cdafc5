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
  explicit Step(const Joint& joint) : joint_(joint) {
    const std::array shape{joint.distance, joint.velocity, share};
    for (std::size_t i = 0; i < shape.size(); ++i) {
      const double stored = Lugre::stored_shape(i, shape[i], tick_s);
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

/// Explicit Euler at 1 us, the simplest there is.
double euler(const Joint& joint, double& z, double v0, double v1) {
  const double sigma0 = joint.static_friction / joint.distance, h = 1e-6;
  const auto rate = [&](double v) {
    const double g = joint.static_friction * (share + (1 - share) * std::exp(-std::pow(v / joint.velocity, 2)));
    return v - sigma0 * std::fabs(v) * z / g;
  };
  for (int i = 0; i < 2000; ++i) z += h * rate(v0 + (v1 - v0) * (i + 0.5) / 2000);
  return sigma0 * z + joint.damping * rate(v1);
}

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
    RecordProperty("largest_error_of_rated", std::to_string(of_fixed / joint.rated));
  }
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

TEST(LuGreEffect, IsStableWhereEulerIsNot) {
  Joint joint = joints[0];
  joint.distance = 1e-5;
  joint.damping = 0;
  Step<Real> step(joint);
  for (int k = 0; k < 1000; ++k) {  // 2000 distances a tick
    const double force = step(k % 2 == 0 ? 10.0 : 9.0 * std::cos(k));
    ASSERT_LE(std::fabs(force), joint.static_friction * (1 + 1e-12));
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
