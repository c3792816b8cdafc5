#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

namespace fxdyn {

struct VerifySettings {
  std::filesystem::path project;  ///< empty: where export.json says it was
  std::filesystem::path image;    ///< of a drive, .elf or .bin; empty: none is looked at
};

struct VerifyResult {
  struct File {
    std::string file, is;
  };
  std::vector<File> files;  ///< that are what they should be, in the order in which they were looked at
  std::string refused;      ///< the first file that is not, and why; empty: all belong together
};
nlohmann::json to_json(const VerifyResult& result);
/// A line a file.
std::string verify_table(const VerifyResult& result);

/// Whether the exported tables in `directory`, their model, project, logs and version belong together: each file by the
/// hash that export.json has of it, export.json by its own; the tables by their CRCs, and by being what this program
/// makes of the model. The image holds one of the pages byte by byte.
/// @throws InputError: no tables were exported there
VerifyResult verify(const std::filesystem::path& directory, const VerifySettings& settings = {});

}  // namespace fxdyn
