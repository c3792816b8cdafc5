// What a drive node with a golden model's tables must answer: for every tick of the golden setpoints, quantised as on
// the bus, the six setpoints and the six torques (per mille and mN*m, little endian), in hexadecimal. A line "reset"
// where the model starts at rest.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>

#include FXDYN_TABLES_HEADER
#include FXDYN_VECTORS_HEADER

#include "firmware/protocol/setpoint_codec.hpp"

namespace {

using namespace fxdyn;
using Model = tables::Model;

void print(const std::uint8_t* bytes, std::size_t size) {
  std::putchar(' ');
  for (std::size_t i = 0; i < size; ++i) std::printf("%02X", bytes[i]);
}

/// Whether no joint moves by more than twice its velocity limit allows, from tick to tick of the run.
bool is_plausible(const std::int32_t* run) {
  for (std::size_t tick = 1; tick < golden::ticks_per_run; ++tick) {
    for (std::size_t j = 0; j < Model::joints; ++j) {
      const auto& limits = tables::parameters.constants[j].limits;
      const double most = 2 * 0.002 * std::max(-limits.dq_lower.raw, limits.dq_upper.raw) *
                          std::exp2(Position<Model::Numbers>::bits - Velocity<Model::Numbers>::bits);
      const std::int32_t* now = run + 3 * (Model::joints * tick + j);
      if (std::abs(double{1} * now[0] - now[-3 * static_cast<int>(Model::joints)]) > most) return false;
    }
  }
  return true;
}

}  // namespace

int main() {
  constexpr RatedTorques<Model> rated{tables::rated_torque};
  constexpr int torque_bits = Torque<Model::Numbers>::bits;
  Model::State state{};
  Saturations saturations;
  const std::int32_t* in = golden::setpoints.data();
  for (std::size_t tick = 0; tick < golden::ticks; ++tick) {
    if (tick % golden::ticks_per_run == 0) {
      if (!is_plausible(in)) {
        tick += golden::ticks_per_run - 1;
        in += 3 * Model::joints * golden::ticks_per_run;
        continue;
      }
      state = {};
      std::puts("reset");
    }
    Model::Setpoints setpoints{};
    std::printf("tick");
    for (std::size_t j = 0; j < Model::joints; ++j, in += 3) {
      const auto& limits = tables::parameters.constants[j].limits;
      const std::int32_t dq_limit = std::max(-limits.dq_lower.raw, limits.dq_upper.raw),
                         ddq_limit = std::max(-limits.ddq_lower.raw, limits.ddq_upper.raw);
      const WireSetpoint wire{in[0], to_share(in[1], dq_limit), to_share(in[2], ddq_limit)};
      std::array<std::uint8_t, WireSetpoint::bytes> bytes;
      wire.store(bytes.data());
      print(bytes.data(), bytes.size());
      const auto i = static_cast<int>(j);
      setpoints.q[i].raw = wire.q;
      setpoints.dq[i].raw = from_share(wire.dq, dq_limit);
      setpoints.ddq[i].raw = from_share(wire.ddq, ddq_limit);
    }
    const Model::Torques torques = Model::tick(tables::parameters, state, setpoints, saturations);
    for (std::size_t j = 0; j < Model::outputs; ++j) {
      const std::int32_t raw = torques[static_cast<int>(j)].raw;
      std::array<std::uint8_t, WireTorque::bytes> bytes;
      WireTorque{to_per_mille(raw, rated.scale[j]), to_milli<torque_bits>(raw), 0, 0}.store(bytes.data());
      print(bytes.data(), 6);
    }
    std::putchar('\n');
  }
}
