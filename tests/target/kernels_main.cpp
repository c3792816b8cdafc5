// Instructions of the tick's kernels, of the tick itself and of a drive's tick that puts out one joint only. The
// kernels are the functions that the tick calls, with the golden tables.

#include "hal/cortex_m/semihosting.hpp"
#include "hal/mps2/systick.hpp"

#include FXDYN_TABLES_HEADER

namespace {

using namespace fxdyn;
using hal::semihosting::print;
using tables::Model;
using tables::Numbers;

/// The model's types taken apart: the same robot with other outputs, or with links of which nothing is known.
template <class>
struct Parts;
template <class N, std::uint32_t outputs, class... Joints>
struct Parts<RobotModel<N, outputs, Joints...>> {
  template <std::uint32_t other>
  using With = RobotModel<N, other, Joints...>;
  using Any = RobotModel<N, outputs, JointModel<Link<Joints::LinkShape::type>>...>;
};

template <class M>
typename M::Parameters& parameters() {
  static typename M::Parameters copy{};
  const auto& page = tables::parameters;
  copy.up = page.up;
  copy.ticks_per_second = page.ticks_per_second;
  copy.geometry = page.geometry;
  copy.inertia = page.inertia;
  copy.constants = page.constants;
  for (std::size_t i = 0; i < copy.words.size(); ++i) copy.words[i] = page.words[i];
  return copy;
}

hal::mps2::ExactSysTick* counter;

/// `run` is a function of its own that works on memory, so that nothing of it can leave the measured stretch.
template <class Run>
std::uint32_t count(Run&& run) {
  const auto measure = [](auto&& f) {
    counter->start();
    f();
    return counter->stop();
  };
  const std::uint32_t empty = measure([] { asm volatile("" ::: "memory"); });
  return measure([&] {
           asm volatile("" ::: "memory");
           run();
           asm volatile("" ::: "memory");
         }) -
         empty;
}

void report(const char* name, std::uint32_t instructions) {
  print(name);
  print(" ");
  print(instructions);
  print("\n");
}

template <class M>
[[gnu::noinline]] void tick(typename M::Torques& out, const typename M::Parameters& in, typename M::State& state,
                            const typename M::Setpoints& setpoints, Saturations& saturations) {
  out = M::tick(in, state, setpoints, saturations);
}

template <class M>
std::uint32_t tick_of() {
  static typename M::State state{};
  static typename M::Setpoints setpoints{};
  static typename M::Torques torques{};
  static Saturations saturations;
  auto& page = parameters<M>();
  return count([&] { tick<M>(torques, page, state, setpoints, saturations); });
}

template <class M>
std::uint32_t rnea_of_model() {
  static std::array<JointState<Numbers>, M::joints> states{};
  static std::array<Torque<Numbers>, M::joints> torques{};
  auto& page = parameters<M>();
  return count([&] { M::template rigid_body<0>(page, states, torques); });
}

template <std::size_t outputs, std::size_t inputs>
std::uint32_t dense_of() {
  static std::array<std::int32_t, outputs * raw::row_words<inputs>> rows{};
  static std::array<std::int32_t, inputs / 2> u{};
  static std::array<std::int32_t, outputs> out{};
  return count([&] { raw::dense<inputs, 16>(outputs, Numbers::weight_bits(), rows.data(), u.data(), out.data()); });
}

template <std::size_t nodes>
std::uint32_t tanh_of_nodes() {
  static std::array<std::int32_t, nodes / 2> coefficients{};
  static std::array<std::int32_t, nodes> x{};
  static volatile std::int64_t sum;
  return count([&] { sum = raw::weighted_tanh(nodes, coefficients.data(), x.data()); });
}

template <std::size_t nodes>
std::uint32_t ramp_of_nodes() {
  static std::array<std::int32_t, nodes / 2> coefficients{};
  static std::array<std::int32_t, nodes> x{};
  static volatile std::int64_t sum;
  return count([&] { sum = raw::weighted_ramp(nodes, coefficients.data(), x.data()); });
}

/// Numbers from a generator of the old kind, all over their range.
struct Samples {
  static constexpr std::size_t nodes = 64;
  std::array<std::int32_t, nodes> x{};
  std::array<std::int32_t, nodes / 2> coefficients{};
  constexpr Samples() {
    std::uint32_t state = 1;
    const auto next = [&] { return static_cast<std::int32_t>(state = state * 1664525U + 1013904223U); };
    for (auto& v : x) v = next() >> 16;
    for (auto& c : coefficients) c = next();
    x[0] = 32767;
    x[1] = -32768;
  }
};

/// The core's instructions give what the compiler computed from the plain sums.
[[gnu::noinline]] bool ramps_are_exact() {
  static constexpr Samples samples;
  static constexpr std::int64_t expected =
      raw::weighted_ramp(Samples::nodes, samples.coefficients.data(), samples.x.data());
  static Samples at_run_time = samples;
  asm volatile("" : : "r"(&at_run_time) : "memory");
  return raw::weighted_ramp(Samples::nodes, at_run_time.coefficients.data(), at_run_time.x.data()) == expected;
}

/// Around every corner of a shift by 17 that saturates, and far beyond.
constexpr std::array<std::int64_t, 22> clamped{0,
                                               1,
                                               -1,
                                               0xFFFF,
                                               0x10000,
                                               -0xFFFF,
                                               -0x10000,
                                               -0x10001,
                                               (raw::max32 << 17) + 0xFFFF,
                                               (raw::max32 << 17) + 0x10000,
                                               (raw::max32 << 17) + 0x1FFFF,
                                               (raw::max32 + 1) << 17,
                                               (raw::min32 * 131072) - 0x10000,
                                               (raw::min32 * 131072) - 0x10001,
                                               raw::min32 * 131072,
                                               (raw::min32 - 1) * 131072,
                                               INT64_MAX,
                                               INT64_MIN,
                                               INT64_MAX - 0x10000,
                                               std::int64_t{1} << 32,
                                               -(std::int64_t{1} << 32),
                                               0x123456789ABCDE};

/// The same of a clamp whose rounding is the shift's carry.
[[gnu::noinline]] bool clamps_are_exact() {
  static constexpr auto expected = [] {
    std::array<std::int32_t, clamped.size()> out{};
    for (std::size_t i = 0; i < out.size(); ++i) {
      std::uint32_t outside = 0;
      out[i] = raw::narrow(clamped[i], 17, outside);
    }
    return out;
  }();
  static auto at_run_time = clamped;
  asm volatile("" : : "r"(&at_run_time) : "memory");
  bool exact = true;
  for (std::size_t i = 0; i < clamped.size(); ++i) exact &= raw::clamp<17>(at_run_time[i]) == expected[i];
  return exact;
}

template <std::size_t... i>
std::uint32_t one_joint_mean(std::index_sequence<i...>) {
  return ((tick_of<typename Parts<Model>::template With<1U << i>>() + ...) + sizeof...(i) / 2) / sizeof...(i);
}

/// An effect's torque of one tick, its state stepped.
template <class E>
std::uint32_t effect_of() {
  static std::array<std::int32_t, words_of<E>> words{};
  static typename E::template State<Numbers> state{};
  static JointInput<Numbers> input{};
  static Saturations saturations;
  static volatile std::int64_t sum;
  if constexpr (needs_peers<E>) input.peers = {&input, 1};
  // What never changes is a constant for the compiler: here it may have been changed.
  asm volatile("" : : "r"(&words), "r"(&state), "r"(&input) : "memory");
  return count([&] { sum = contribution<E, Numbers>(input, Words<Numbers>{words.data()}, state, saturations).raw; });
}

/// What the nodes of a BLS see in one tick.
template <class Inputs>
std::uint32_t inputs_of() {
  static std::array<std::int32_t, Inputs::shape.size()> words{};
  static typename Inputs::template State<Numbers> state{};
  static JointInput<Numbers> input{};
  static Saturations saturations;
  static std::array<Feature<Numbers>, Inputs::size> out{};
  asm volatile("" : : "r"(&words), "r"(&state), "r"(&input) : "memory");
  return count([&] {
    out = Inputs::template values<Numbers>(input, Words<Numbers>{words.data()}, state, saturations);
    asm volatile("" : : "r"(&out) : "memory");
  });
}

/// Kernels of BLS that the golden tables have not. A function of its own: what is inlined into main depends on its
/// size.
[[gnu::noinline]] void report_other_kinds() {
  report("dense_40x8", dense_of<40, 8>());
  report("ramp_40", ramp_of_nodes<40>());
  report("stribeck", effect_of<Stribeck>());
  report("presliding", effect_of<Presliding>());
  report("lugre", effect_of<Lugre>());
  report("inputs_physical", inputs_of<PhysicalInputs>());
  report("inputs_bristles", inputs_of<BristlesInputs>());
}
/// Beside those before: their figures depend on the size of the function that they are in.
[[gnu::noinline]] void report_slip() { report("maxwell_slip", effect_of<MaxwellSlip>()); }
[[gnu::noinline]] void report_knee() { report("soft_knee", effect_of<SoftKnee>()); }
[[gnu::noinline]] void report_curves() {
  report("position_curve", effect_of<PositionCurve>());
  report("friction_over_position", effect_of<FrictionOverPosition>());
  report("cross_position", effect_of<CrossPosition>());
}

}  // namespace

int main() {
  hal::mps2::ExactSysTick systick;
  counter = &systick;
  report("rnea", rnea_of_model<Model>());
  report("rnea_any_links", rnea_of_model<Parts<Model>::Any>());
  report("dense_40x4", dense_of<40, 4>());
  report("dense_40x6", dense_of<40, 6>());
  report("dense_60x40", dense_of<60, 40>());
  report("tanh_40", tanh_of_nodes<40>());
  report("one_joint_mean", one_joint_mean(std::make_index_sequence<Model::joints>{}));
  report_other_kinds();
  report_slip();
  report_knee();
  report_curves();
  hal::semihosting::exit(ramps_are_exact() && clamps_are_exact() ? 0 : 1);
}
