// Every word of the exported parameters that the model's type does not declare unused changes a torque: a parameter
// that nothing depends on is a parameter that was forgotten.

#include <gtest/gtest.h>

#include <cstring>
#include <string>
#include <vector>

#include FXDYN_TABLES_HEADER
#include FXDYN_VECTORS_HEADER

namespace fxdyn {
namespace {

using tables::Model;
using Parameters = Model::Parameters;
constexpr std::size_t words = sizeof(Parameters) / 4;
constexpr std::size_t joints = Model::joints;

std::vector<std::int32_t> torques(const Parameters& parameters) {
  std::vector<std::int32_t> out;
  Model::State state;
  Model::Setpoints setpoints;
  Saturations ignored;
  for (std::size_t tick = 0; tick < golden::ticks; ++tick) {
    if (tick % golden::ticks_per_run == 0) state = {};
    if (tick % golden::ticks_per_run >= 40) continue;  // the start of each run is enough
    const std::int32_t* in = golden::setpoints.data() + 3 * joints * tick;
    for (int j = 0; j < static_cast<int>(joints); ++j, in += 3) {
      setpoints.q[j].raw = in[0];
      setpoints.dq[j].raw = in[1];
      setpoints.ddq[j].raw = in[2];
    }
    for (const auto torque : Model::tick(parameters, state, setpoints, ignored)) out.push_back(torque.raw);
  }
  return out;
}

template <class>
struct Shapes;
template <class N, std::uint32_t outputs, class... Joints>
struct Shapes<RobotModel<N, outputs, Joints...>> {
  static constexpr std::array codes{Joints::LinkShape::code...};
};

/// Words that Link<...> says are not read, and those for effects on the position where the model has none.
bool is_declared_unused(std::size_t word) {
  constexpr std::size_t geometry = 4, inertia = geometry + 7 * joints, constants = inertia + 10 * joints;
  if (word == 3) return !Model::deflects;  // ticks per second
  // Joint 1 turns about the vertical: no torque depends on where it stands, nor, unless its position does something
  // else, on the limits of that.
  if (word == geometry + 6) return true;
  if (word == constants || word == constants + 1) return !Model::deflects;
  if (word < geometry || word >= constants) return false;
  const bool of_geometry = word < inertia;
  const std::size_t link = of_geometry ? (word - geometry) / 7 : (word - inertia) / 10;
  const std::size_t entry = of_geometry ? (word - geometry) % 7 : (word - inertia) % 10;
  const auto code = static_cast<std::uint32_t>(Shapes<Model>::codes[link]);
  if (!of_geometry) return (code >> 6 >> entry & 1U) == 0;
  if (entry < 3) return entry == 0 || (code >> 1 & 3U) != 0;  // type, twist
  return entry < 6 && (code >> 3 >> (entry - 3) & 1U) == 0;
}

TEST(Golden, EveryParameterChangesATorque) {
  const std::vector<std::int32_t> before = torques(tables::parameters);
  std::string dead;
  std::size_t both = 0;
  for (std::size_t word = 0; word < words; ++word) {
    if (is_declared_unused(word)) continue;
    std::array<std::int32_t, words> raw;
    std::memcpy(raw.data(), &tables::parameters, sizeof raw);
    const std::int32_t value = raw[word];
    // Packed words hold two parameters, of which either must show; limits show where they are narrow.
    const auto shows = [&](std::uint32_t other) {
      raw[word] = static_cast<std::int32_t>(other);
      Parameters changed;
      std::memcpy(static_cast<void*>(&changed), raw.data(), sizeof raw);
      return torques(changed) != before;
    };
    const bool lower = shows(static_cast<std::uint32_t>(value) + 300);
    const bool upper = shows(static_cast<std::uint32_t>(value) + (300U << 16));
    both += lower && upper;
    if (!lower && !upper && !shows(static_cast<std::uint32_t>(value / 64))) dead += std::to_string(word) + " ";
  }
  EXPECT_EQ(dead, "") << "of " << words;
  EXPECT_GT(both, 65 * words / 100);
}

}  // namespace
}  // namespace fxdyn
