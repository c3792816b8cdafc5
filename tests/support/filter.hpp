#pragma once

#include "host_tools/effects/identified_model.hpp"

namespace fxdyn::test {

inline FilterFit filter_of(double position_cutoff_hz, double torque_cutoff_hz, double edge_s) {
  FilterFit filter;
  filter.position_cutoff_hz = position_cutoff_hz;
  filter.torque_cutoff_hz = torque_cutoff_hz;
  filter.edge_s = edge_s;
  return filter;
}

}  // namespace fxdyn::test
