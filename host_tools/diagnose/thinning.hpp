#pragma once

#include "host_tools/regression/dataset.hpp"

namespace fxdyn::diagnosis {

/// Every k-th sample of a log whose positions are filtered: a drive records at 4 kHz what moves at 3 Hz. The torque is
/// filtered first, at 0.4 of the new rate, so that nothing of it appears at another frequency. What the encoder's noise
/// leaves in the velocity is that of all samples (ProcessedLog::kept_each).
ProcessedLog thinned(ProcessedLog log, Eigen::Index k);

}  // namespace fxdyn::diagnosis
