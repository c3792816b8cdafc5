#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "host_tools/project/project.hpp"
#include "model/table_page.hpp"

namespace fxdyn {

/// Of the project's keys and values, without [target] accept_error, and of its URDF.
std::string project_hash(const Project& project);

/// What a result was made from: {"logs": {file relative to DIR: hash}, "model": hash of DIR/model.json without its
/// tables, where the result is of that model}.
nlohmann::json made_from(const Project& project, const std::filesystem::path& directory, bool of_model);

/// Whether all of that is in DIR as it was.
bool is_unchanged(const nlohmann::json& made_from, const std::filesystem::path& directory);

/// Wall time of the verbs that make DIR's model, in DIR/timing.json: it differs from run to run.
void note_seconds(const std::filesystem::path& directory, const char* verb, double seconds);
/// Of diagnose and train together; none where one of them is not known.
std::optional<double> training_seconds(const std::filesystem::path& directory);

/// What a file with a page of tables says of itself; all zero where it is too short.
PageHeader header_of(const std::filesystem::path& page);

}  // namespace fxdyn
