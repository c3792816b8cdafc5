#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "host_tools/project/project.hpp"

// What export.json says beside its figures, so that `fxdyn verify` can tell which files belong together.

namespace fxdyn {

/// The key `of` of export.json: {"tool_version", "project": {"file", "hash"}, "logs": {file: hash}, "files": {file:
/// hash}}. Files of the export are relative to it, project and logs to DIR. Hashes are hash_of(), the project's is
/// project_hash().
/// @param results where the project's results are, DIR @param exported where the files of the export lie
/// @param files of the export, relative to `exported`
nlohmann::json belongings(const Project& project, const std::filesystem::path& results,
                          const std::filesystem::path& exported, const std::vector<std::string>& files);

/// The text of a result file with one more key, `check`: hash_of() the text without it.
std::string sealed(nlohmann::json content);

/// Whether a text is as sealed() wrote it: no byte is another one.
bool is_sealed(const std::string& text);

}  // namespace fxdyn
