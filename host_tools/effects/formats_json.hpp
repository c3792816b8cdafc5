#pragma once

#include <nlohmann/json_fwd.hpp>

#include "host_tools/numbers/formats.hpp"

namespace fxdyn {

/// Formats as in model.json and export.json.
nlohmann::json formats_json(const Formats& formats);
Formats formats_of(const nlohmann::json& file);

}  // namespace fxdyn
