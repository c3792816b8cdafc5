#pragma once

#include "host_tools/diagnose/gate.hpp"

namespace fxdyn::diagnosis {

/// Whether what is left at a joint is no more than the error of a law's form: small, and in the own motion and load
/// alone. A law of friction that was found there may leave a share of the gap. Without one, and without a baseline, the
/// smooth sign of the nominal model, s = tanh(dq / width), may leave a share of the dry friction's power, on the rows
/// that fit and on those that judge.
/// @param held of these logs @param gap see Gate::gap
bool is_error_of_law(const Outcome& outcome, const HeldOut& held, double gap, std::size_t joint);

}  // namespace fxdyn::diagnosis
