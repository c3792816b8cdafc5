#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "host_tools/effects/log_reference.hpp"

// Which model a file holds, without the model: what tells whether a result belongs to it.

namespace fxdyn {

struct ModelIdentity {
  std::string project_hash;
  std::vector<LogReference> logs;           ///< that it was made from
  std::optional<std::uint32_t> tables_crc;  ///< of the exported tables; none: not exported
};
/// None where there is no such file.
/// @throws InputError naming the file: not a model.
std::optional<ModelIdentity> read_identity(const std::filesystem::path& file);

/// Hash of a model's file without what an export adds to it: its tables. Empty where there is no such file.
std::string hash_without_tables(const std::filesystem::path& file);

}  // namespace fxdyn
