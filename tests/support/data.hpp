#pragma once

#include <cstdlib>
#include <filesystem>
#include <string>

namespace fxdyn::test {

/// The folder of measured logs: FXDYN_DATA, else shared/data beside the project.
inline std::filesystem::path data_folder() {
  const char* set = std::getenv("FXDYN_DATA");
  return set != nullptr ? set : FXDYN_SOURCE_DIR "/../shared/data";
}

inline bool data_is_there(const std::string& set) { return std::filesystem::is_directory(data_folder() / set); }

}  // namespace fxdyn::test
