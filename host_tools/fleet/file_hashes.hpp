#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>

namespace fxdyn::fleet {

/// SHA-256 of files, remembered in a file beside the results: a restart reads no log again that nobody touched. A file
/// counts as untouched where size, inode and the times of its change (mtime, ctime) are as they were, and its last
/// change was over `settled_s` before it was read: within a clock's tick a second change would not show.
class FileHashes {
 public:
  /// Of what is not readable as such a memory nothing is remembered.
  explicit FileHashes(std::filesystem::path memory);
  std::string of(const std::filesystem::path& file);
  /// Writes what has changed.
  void keep() const;

 private:
  struct Entry {
    std::string stamp, hash;
  };
  std::filesystem::path memory_;
  std::map<std::string, Entry> before_, now_;
};

}  // namespace fxdyn::fleet
