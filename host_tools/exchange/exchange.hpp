#pragma once

#include <string>
#include <vector>

namespace fxdyn {

class Pipeline;

/// Writes the model of a pipeline for simulators: per format the file and certificate_FORMAT.json into its directory;
/// returns the tables for the terminal. The stages that are missing are run first.
/// @param formats names of export_formats()
/// @throws InputError: an unknown format; DataError: no possible bodies, no held-out log, or a file that its own
/// library reads otherwise than it was meant
std::string export_for_simulators(Pipeline& pipeline, const std::vector<std::string>& formats);

}  // namespace fxdyn
