#pragma once

#include <memory>
#include <string>

#include "host_tools/identify/gate_data.hpp"
#include "host_tools/identify/options.hpp"
#include "host_tools/project/project.hpp"
#include "host_tools/regression/fitter.hpp"
#include "host_tools/support/progress.hpp"

namespace fxdyn {

/// Weights of joints and rows by the project's method.
void weigh(Fitter& fitter, const IdentifySettings& settings);

/// [identify] prior_error: what the URDF says of the links takes part in the fit; else nothing happens.
/// @throws InputError: the URDF does not say it of every link
void set_prior(Fitter& fitter, const Project& project);

/// Structure and friction: widths and shapes searched on the gate data, coefficients by (weighted) least squares.
/// Returns the fitter with the chosen designs. What it leaves out for want of data goes into data.notes.
std::unique_ptr<Fitter> identify(const Project& project, GateData& data, Progress& progress,
                                 const IdentifyOptions& options = {});

/// For people: how far the torque column is ahead of the motion.
std::string torque_lead_note(double lead_s);

}  // namespace fxdyn
