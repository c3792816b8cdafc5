#include "host_tools/fleet/file_hashes.hpp"

#include <fmt/format.h>
#include <sys/stat.h>

#include <ctime>
#include <nlohmann/json.hpp>

#include "host_tools/fleet/sha256.hpp"
#include "host_tools/support/files.hpp"

namespace fxdyn::fleet {
namespace {

using nlohmann::json;

constexpr std::time_t settled_s = 3;  // coarser than the time stamps of any usual file system (FAT: 2 s)

/// Empty: it changed a moment ago, or can't be looked at.
std::string stamp_of(const std::filesystem::path& file) {
  struct stat s {};
  if (::stat(file.c_str(), &s) != 0) return "";
  const std::time_t now = std::time(nullptr);
  if (s.st_mtim.tv_sec + settled_s > now || s.st_ctim.tv_sec + settled_s > now) return "";
  return fmt::format("{} {} {} {}.{:09} {}.{:09}", s.st_size, s.st_dev, s.st_ino, s.st_mtim.tv_sec, s.st_mtim.tv_nsec,
                     s.st_ctim.tv_sec, s.st_ctim.tv_nsec);
}

}  // namespace

FileHashes::FileHashes(std::filesystem::path memory) : memory_(std::move(memory)) {
  if (!std::filesystem::exists(memory_)) return;
  const json content = json::parse(read_file(memory_), nullptr, false);
  if (!content.is_object()) return;
  for (const auto& [file, entry] : content.items()) {
    if (entry.is_array() && entry.size() == 2 && entry[0].is_string() && entry[1].is_string())
      before_[file] = {entry[0], entry[1]};
  }
}

std::string FileHashes::of(const std::filesystem::path& file) {
  const std::string stamp = stamp_of(file);
  const auto known = before_.find(file.string());
  if (!stamp.empty() && known != before_.end() && known->second.stamp == stamp) {
    now_[file.string()] = known->second;
    return known->second.hash;
  }
  const std::string hash = sha256_of_file(file);
  // Whoever writes it meanwhile leaves another stamp.
  if (!stamp.empty() && stamp_of(file) == stamp) now_[file.string()] = {stamp, hash};
  return hash;
}

void FileHashes::keep() const {
  json content = json::object();
  for (const auto& [file, entry] : now_) content[file] = {entry.stamp, entry.hash};
  const std::string text = content.dump(1) + "\n";
  if (!std::filesystem::exists(memory_) || read_file(memory_) != text) write_file(memory_, text);
}

}  // namespace fxdyn::fleet
