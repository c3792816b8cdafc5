#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "host_tools/fleet/fleet_file.hpp"
#include "host_tools/fleet/summary.hpp"

namespace fxdyn::fleet {

/// DIR/accepted/ID.json; none: nobody has accepted a state of it.
/// @throws InputError: the file is none
std::optional<Acceptance> acceptance_of(const std::filesystem::path& directory, const std::string& id);

/// Takes the state of these robots as their new baseline. "all": of all that have a result.
/// @throws InputError: no robot of that name, or one without a result; then nothing is accepted
void accept(const Fleet& fleet, const std::filesystem::path& directory, const std::vector<std::string>& ids);

}  // namespace fxdyn::fleet
