#include <fmt/format.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>
#include <vector>

#include "host_tools/effects/effects.hpp"
#include "host_tools/numbers/run_time_fixed.hpp"
#include "model/catalogue.hpp"

// Every effect in the firmware's fixed point against double, both fed with the same quantised inputs and parameters, so
// that the difference is the arithmetic's alone: over random inputs and at the corners of the limits. The same code
// with formats of run time gives the same bits.

namespace fxdyn {
namespace {

constexpr double step_s = 0.002;

// Limits of the inputs, and formats that hold them and what follows from them.
constexpr double q_limit = 3.2, dq_limit = 15, ddq_limit = 130, tau_limit = 250;
constexpr double sign_limit = 0.99999977;  // tanh(8), where the fixed-point tanh ends
struct TestFormats {
  static constexpr int position = 28;      // +-8
  static constexpr int velocity = 26;      // +-32
  static constexpr int acceleration = 22;  // +-512
  static constexpr int linear_acceleration = 24;
  static constexpr int length = 28;
  static constexpr int force = 20;
  static constexpr int torque = 22;            // +-512: differences of two torques
  static constexpr int inverse_velocity = 18;  // +-8192
  static constexpr int inverse_path = 22;      // +-512
  static constexpr int weight = 24;
  static constexpr int velocity_squared = 22;  // +-512
  static constexpr int velocity_cubed = 19;    // +-4096
  static constexpr int inverse_position = 22;  // +-512
  static constexpr int inverse_torque = 20;    // +-2048
  static constexpr int force_sum = 44;
  static constexpr int torque_sum = 44;
  static constexpr int deflection_sum = 44;
};
using Fixed32 = FixedNumbers<TestFormats>;

Formats run_time_formats() {
  Formats formats;
  for (std::size_t i = 0; i < quantity_count; ++i) formats.quantity[i] = Fixed32::bits(static_cast<Quantity>(i));
  formats.force_sum = TestFormats::force_sum;
  formats.torque_sum = TestFormats::torque_sum;
  formats.deflection_sum = TestFormats::deflection_sum;
  return formats;
}

constexpr double lsb(Quantity quantity) {
  return 1.0 / static_cast<double>(std::int64_t{1} << Fixed32::bits(quantity));
}

/// Range of the shape parameter that the test varies, the first one, and the largest error of each phi.
struct Case {
  std::string_view effect;
  std::array<double, 2> shape;
  std::array<double, 12> tolerance;
};
constexpr double exact = 0, torque = lsb(Quantity::torque);
constexpr double curve_span = 4;
// A bump is nowhere steeper than 1 a knot distance: a place rounded twice, and a few units of the weights.
constexpr double of_curve(double span, Quantity quantity) {
  return 4e-9 + 9 / span * lsb(quantity) + lsb(Quantity::argument);
}
constexpr std::array<double, 12> all_bumps(double tolerance) {
  std::array<double, 12> out{};
  out.fill(tolerance);
  return out;
}

constexpr std::array cases{
    Case{"viscous", {}, {exact}},
    Case{"coulomb", {}, {exact}},
    Case{"offset", {}, {exact}},
    Case{"rotor_inertia", {}, {exact}},
    Case{"stribeck", {0.02, 10}, {3e-7}},  // exp ends at exp(-16)
    Case{"soft_knee", {0.02, 10}, {1.6e-6}},
    Case{"presliding", {1e-5, 0.03}, {3e-7}},  // the same, and rounding of the state
    // the state as presliding's; dq's phi has its error and the reciprocal's times dq
    Case{"lugre", {1e-4, 0.03}, {1e-6, 15 * 8e-6}},
    // the mean velocity's rounding, times rate and contact, over all ticks: half of them go each way
    Case{"maxwell_slip", {1e-3, 0.1}, {1e-6, 2e-6, 4e-6, 8e-6, 1.6e-5}},
    Case{"asymmetric_friction", {}, {exact, exact}},
    Case{"viscous_quadratic", {}, {0.51 * lsb(Quantity::velocity_squared)}},
    Case{"viscous_cubic", {}, {0.51 * (dq_limit * lsb(Quantity::velocity_squared) + lsb(Quantity::velocity_cubed))}},
    Case{"load_friction", {}, {0.51 * torque}},
    Case{"torque_gain", {}, {exact}},
    Case{"ripple", {0.5, 3000}, {4e-9, 4e-9}},
    Case{"spring", {}, {exact, exact}},
    Case{"gravity_compensator", {}, {8e-9, 8e-9}},
    Case{"friction_drift", {0.1, 1000}, {2e-7, 15 * 2e-7}},
    Case{"saturation", {0, 250}, {exact}},
    Case{"joint_coupling", {1, 4}, {exact, exact}},  // one more than there are
    Case{"delay", {0, 0.03}, {0.51 * torque}},
    Case{"elasticity", {0, 0.1}, {26 * torque}},  // half a unit for each tick that the low-pass remembers
    Case{"backlash", {1e-3, 100}, {1.6e-6}},
    Case{"eccentricity", {}, {8e-9, 8e-9}},
    // the sign at a velocity that was rounded twice, of a width of 0.05 rad/s
    Case{"motor_coupling",
         {1, 4},
         {1.6e-6 + 20 * lsb(Quantity::velocity), 0.51 * lsb(Quantity::velocity), 0.51 * lsb(Quantity::acceleration)}},
    Case{"position_curve", {-3.5, 1}, all_bumps(of_curve(curve_span, Quantity::position))},
    Case{"velocity_curve", {-16, 10}, all_bumps(of_curve(curve_span, Quantity::velocity))},
    Case{"load_curve", {-260, 100}, all_bumps(of_curve(curve_span, Quantity::torque))},
    Case{"friction_over_position", {-3.5, 1}, all_bumps(of_curve(curve_span, Quantity::position))},
    Case{"cross_position", {1, 4}, all_bumps(of_curve(curve_span, Quantity::position))},
};

/// Null: it has none.
const Case* find_case(std::string_view effect) {
  const auto found = std::find_if(cases.begin(), cases.end(), [&](const Case& c) { return c.effect == effect; });
  return found == cases.end() ? nullptr : &*found;
}

/// visit<E>(case) for all effects that have one.
template <class Visit>
void for_each_case(Visit&& visit) {
  Catalogue::for_each([&]<class E>() {
    if (const Case* c = find_case(E::name)) visit.template operator()<E>(*c);
  });
}

TEST(EffectsFixed, EveryEffectHasItsRangeAndTolerance) {
  Catalogue::for_each([]<class E>() {
    EXPECT_NE(find_case(E::name), nullptr) << "no range and tolerance for " << E::name << ": write them into cases";
  });
}

/// Shares of the limits, [-1, 1].
struct Tick {
  double q, dq, ddq, sign, structural, total;
};

template <class N, Quantity quantity>
auto number(double value) {
  const std::int32_t raw = to_raw(value, Fixed32::bits(quantity));
  if constexpr (std::is_same_v<N, Real>) {
    return from_raw(raw, Fixed32::bits(quantity));
  } else {
    return N::template load<typename N::template Of<quantity>>(raw);
  }
}

template <class N>
JointInput<N> input(const Tick& t) {
  using Q = Quantity;
  return {number<N, Q::position>(t.q * q_limit),          number<N, Q::velocity>(t.dq * dq_limit),
          number<N, Q::acceleration>(t.ddq * ddq_limit),  number<N, Q::unit>(t.sign * sign_limit),
          number<N, Q::torque>(t.structural * tau_limit), number<N, Q::torque>(t.total * tau_limit)};
}

/// phi of all ticks as doubles, one after the other.
template <class E, class N>
std::vector<double> run(const std::vector<Tick>& ticks, double varied) {
  std::vector<typename N::Word> words;
  for (std::size_t i = 0; i < E::shape.size(); ++i) {
    const double shape = i == 0 ? varied
                                : (E::shape[i].name == "ratio"   ? -0.7
                                   : E::shape[i].name == "span"  ? curve_span
                                   : E::shape[i].name == "share" ? 0.95
                                                                 : 0.05);
    const std::int32_t raw = to_raw(E::stored_shape(i, shape, step_s), Fixed32::bits(E::shape[i].quantity));
    if constexpr (std::is_same_v<N, Real>) {
      words.push_back(from_raw(raw, Fixed32::bits(E::shape[i].quantity)));
    } else {
      words.push_back(raw);
    }
  }
  typename E::template State<N> state{};
  Saturations saturations;
  std::vector<double> out;
  for (const Tick& t : ticks) {
    const std::array peers{input<N>({t.q, t.total, t.q, t.structural, 0, 0}), input<N>({t.q, t.ddq, t.q, t.q, 0, 0}),
                           input<N>(t)};
    JointInput<N> u = input<N>(t);
    u.peers = peers;
    E::template basis<N>(
        u, Words<N>{words.data()}, state, saturations, [&]([[maybe_unused]] auto tag, std::size_t, auto phi) {
          if constexpr (std::is_same_v<N, Real>) {
            out.push_back(phi);
          } else {
            static_assert(std::is_same_v<decltype(phi), typename N::template Of<decltype(tag)::value>>);
            out.push_back(from_raw(phi.raw, Fixed32::bits(decltype(tag)::value)));
          }
        });
  }
  EXPECT_EQ(saturations.count, 0U) << E::name;
  return out;
}

struct Powers {
  double signal = 0, error = 0;
};

/// A shape parameter at a share of its range, geometric where that spans decades.
double shape_at(const Case& c, double share) {
  const bool index = c.effect == "joint_coupling" || c.effect == "motor_coupling" || c.effect == "cross_position";
  if (c.shape[0] > 0 && !index) return c.shape[0] * std::pow(c.shape[1] / c.shape[0], share);
  const double value = c.shape[0] + share * (c.shape[1] - c.shape[0]);
  return index ? std::round(value) : value;
}

/// Compares the three, the shape at a share of its range; returns what is wrong, or nothing.
template <class E>
std::string compare(const Case& c, const std::vector<Tick>& ticks, double share, Powers* powers = nullptr) {
  const double shape = shape_at(c, share);
  const Formats formats = run_time_formats();
  const FormatScope scope(formats);
  const std::vector<double> real = run<E, Real>(ticks, shape), fixed = run<E, Fixed32>(ticks, shape);
  if (run<E, RunTimeNumbers>(ticks, shape) != fixed) return fmt::format("{}: formats of run time differ", E::name);
  for (std::size_t i = 0; i < real.size(); ++i) {
    const double error = fixed[i] - real[i];
    if (powers != nullptr) {
      powers->signal += real[i] * real[i];
      powers->error += error * error;
    }
    if (!(std::fabs(error) <= c.tolerance[i % E::linear.size()])) {
      return fmt::format("{} with shape {}: phi {} is {} off from {} at tick {}", E::name, shape,
                         i % E::linear.size() + 1, error, real[i], i / E::linear.size());
    }
  }
  return {};
}

RC_GTEST_PROP(EffectsFixed, EveryEffectFollowsDoubleOverItsLimits, ()) {
  constexpr std::size_t ticks = 60, fields = 6;
  constexpr int one = 10000;
  const auto values = *rc::gen::container<std::vector<int>>(
      ticks * fields, rc::gen::resize(rc::kNominalSize, rc::gen::inRange(-one, one + 1)));
  const double share = *rc::gen::inRange(0, one + 1) / static_cast<double>(one);
  std::vector<Tick> list;
  for (std::size_t k = 0; k < ticks; ++k) {
    const auto at = [&](std::size_t i) { return values[k * fields + i] / static_cast<double>(one); };
    list.push_back({at(0), at(1), at(2), at(3), at(4), at(5)});
  }
  for_each_case([&]<class E>(const Case& c) {
    const std::string wrong = compare<E>(c, list, share);
    if (!wrong.empty()) RC_FAIL(wrong);
  });
}

TEST(EffectsFixed, EveryEffectFollowsDoubleAtTheCorners) {
  // All combinations of -1, 0, 1, in two orders: neighbours alike, and far jumps.
  std::vector<Tick> list;
  for (const int stride : {1, 376}) {
    for (int k = 0; k < 729; ++k) {
      int code = k * stride % 729;
      std::array<double, 6> x{};
      for (double& value : x) {
        value = code % 3 - 1;
        code /= 3;
      }
      list.push_back({x[0], x[1], x[2], x[3], x[4], x[5]});
    }
  }
  for_each_case([&]<class E>(const Case& c) {
    for (const double share : {0.0, 0.5, 1.0}) EXPECT_EQ(compare<E>(c, list, share), "");
  });
}

TEST(EffectsFixed, SignalToNoise) {
  std::vector<Tick> list;
  for (int k = 0; k < 3000; ++k) {  // smooth motion, the torque lags behind
    const double t = step_s * k;
    list.push_back({std::sin(3 * t), std::cos(3 * t), -std::sin(3 * t), std::tanh(50 * std::cos(3 * t)),
                    std::sin(2 * t + 1), std::sin(2 * t + 1.2)});
  }
  for_each_case([&]<class E>(const Case& c) {
    Powers powers;
    EXPECT_EQ(compare<E>(c, list, 0.4, &powers), "");
    EXPECT_GT(powers.signal, 3e10 * powers.error) << E::name;  // 105 dB; stribeck's exp(-16) is the least
  });
}

}  // namespace
}  // namespace fxdyn
