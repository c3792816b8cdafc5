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

/// Why a test of that set can't be skipped though it is not there: its folder was named, or other sets are in it. Data
/// that was asked for and is missing must not pass unseen. Empty: there is no measured data at all.
inline std::string missing_data(const std::string& set) {
  if (std::getenv("FXDYN_DATA") != nullptr) return "FXDYN_DATA is set, but has no folder " + set;
  if (std::filesystem::is_directory(data_folder())) return data_folder().string() + " has no folder " + set;
  return {};
}

}  // namespace fxdyn::test

/// Leaves a test whose measured set is not there: by a failure where it should be, else skipped.
#define FXDYN_NEEDS_DATA(set)                                                              \
  if (!fxdyn::test::data_is_there(set)) {                                                  \
    ASSERT_EQ(fxdyn::test::missing_data(set), "");                                         \
    GTEST_SKIP() << "no measured data: set FXDYN_DATA to the folder that holds " << (set); \
  }                                                                                        \
  static_assert(true)
