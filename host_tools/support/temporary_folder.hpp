#pragma once

#include <unistd.h>

#include <filesystem>
#include <string>

#include "host_tools/support/error.hpp"

namespace fxdyn {

/// A folder of this process below TMPDIR, gone with it.
class TemporaryFolder {
 public:
  /// @throws InputError: none can be made
  TemporaryFolder() {
    std::error_code error;
    const std::filesystem::path root = std::filesystem::temp_directory_path(error);
    if (error) throw InputError("TMPDIR names no folder: set it to one that exists, or unset it");
    std::string name = (root / "fxdyn-XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr)
      throw InputError(root.string() + ": no folder can be made in it; set TMPDIR to one that can be written");
    path_ = name;
  }
  ~TemporaryFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

}  // namespace fxdyn
