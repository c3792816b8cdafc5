#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace fxdyn {

/// What a data set of LeRobot calls the numbers of its lists: column -> names, "elbow.pos" or "elbow". Parquet itself
/// has none: they are in meta/info.json of the data set that the file is in (data/chunk-000/file-000.parquet). Without
/// such a file, or where it says something else, nothing: the numbers are read without names too. Source: LeRobot's
/// data sets of versions 2.0 to 3.0: features.COLUMN.names is a list, or lists of parts ("motors").
std::map<std::string, std::vector<std::string>> lerobot_names(const std::filesystem::path& file);

/// Whether a folder is such a data set, by its meta/info.json.
bool is_lerobot(const std::filesystem::path& folder);
/// Its first file of rows; empty: it has none.
std::filesystem::path first_file_of_lerobot(const std::filesystem::path& folder);

}  // namespace fxdyn
