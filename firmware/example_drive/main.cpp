// My drive: the feedforward torque of fxdyn, once per tick.

#include <cstdint>

#include "firmware/tick_budget.hpp"
#include "tables.hpp"

namespace {

using Model = fxdyn::tables::Model;

// Instructions as `fxdyn replay` measured them for these tables. If they outgrow the tick, this stops the build.
constexpr fxdyn::TickBudget budget{.clock_hz = 168'000'000, .tick_us = 2000};
static_assert(budget.allows(fxdyn::Instructions{12'000}));

Model::State state;              // what the effects remember; {} = at rest
fxdyn::Saturations saturations;  // stays 0 while the setpoints are within the limits

// Stand-ins for the drive's own: the newest setpoints from the bus, and the torque offset of its control loop.
volatile std::int32_t bus_setpoints[3 * Model::joints];
volatile std::int32_t torque_offset[Model::outputs];  // of the joints that the tables put out

/// Why there is no torque, for the drive's master.
enum class Fault : std::uint8_t { none, tables };
volatile Fault fault = Fault::none;

void on_tick() {
  Model::Setpoints setpoints;
  for (int j = 0; j < static_cast<int>(Model::joints); ++j) {
    setpoints.q[j].raw = bus_setpoints[3 * j];
    setpoints.dq[j].raw = bus_setpoints[3 * j + 1];
    setpoints.ddq[j].raw = bus_setpoints[3 * j + 2];
  }
  const Model::Torques torques = Model::tick(fxdyn::tables::parameters, state, setpoints, saturations);
  for (int j = 0; j < static_cast<int>(Model::outputs); ++j) torque_offset[j] = torques[j].raw;
}

}  // namespace

int main() {
  // A page may be damaged, half written or another model's: then no tick, and the torque stays zero.
  if (!fxdyn::page_is_valid(fxdyn::tables::page)) {
    fault = Fault::tables;
    return 1;
  }
  for (int tick = 0; tick < 3; ++tick) on_tick();  // on a drive: the timer's interrupt, every 2 ms
  return 0;
}
