#pragma once

#include <string>
#include <vector>

namespace fxdyn {

class Pipeline;

/// Writes the model of a pipeline for simulators: per format the file and certificate_FORMAT.json into its directory;
/// returns the tables for the terminal. The stages that are missing are run first.
/// @param formats names of export_formats()
/// @throws InputError: an unknown format, a project without possible bodies or without a held-out log; DataError: every
/// held-out log has a load, or the file's own library reads it otherwise than it was meant
std::string export_for_simulators(Pipeline& pipeline, const std::vector<std::string>& formats);

}  // namespace fxdyn
