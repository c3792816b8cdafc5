// expect: no match for 'operator='
#include "tests/golden/tables.hpp"

using fxdyn::tables::Model;

Model::Torques tick(Model::State& state, double velocity, fxdyn::Saturations& saturations) {
  Model::Setpoints setpoints{};
#ifdef FXDYN_OK
  setpoints.dq[0].raw = static_cast<std::int32_t>(velocity);
#else
  setpoints.dq[0] = velocity;
#endif
  return Model::tick(fxdyn::tables::parameters, state, setpoints, saturations);
}
