#include "host_tools/support/files.hpp"

#include <fmt/format.h>

#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <sstream>
#include <vector>

#include "host_tools/support/error.hpp"
#include "host_tools/support/pipes.hpp"

namespace fxdyn {

std::string read_file(const std::filesystem::path& file) {
  if (const std::string* bytes = piped(file)) return *bytes;
  std::ifstream in(file, std::ios::binary);
  std::ostringstream text;
  // Inserting nothing, from an empty file, sets the fail bit.
  if (!in || (in.peek() != std::ifstream::traits_type::eof() && !(text << in.rdbuf()))) {
    throw InputError(fmt::format("{}: can't be read: {}", file.string(), std::strerror(errno)));
  }
  return text.str();
}

namespace {

/// With what helps, where something does.
std::string why(int cause) {
  const bool full = cause == ENOSPC || cause == EDQUOT;
  return fmt::format("{}{}", std::strerror(cause), full ? ": free some space there, or choose another folder" : "");
}

}  // namespace

void write_file(const std::filesystem::path& file, std::string_view content) {
  std::error_code error;
  if (file.has_parent_path()) std::filesystem::create_directories(file.parent_path(), error);
  const std::filesystem::path temporary = fmt::format("{}.{}.tmp", file.string(), ::getpid());
  {
    std::ofstream out(temporary, std::ios::binary);
    out.write(content.data(), static_cast<std::streamsize>(content.size()));
    out.close();
    if (!out) {
      const int cause = errno;
      std::filesystem::remove(temporary, error);
      throw InputError(fmt::format("{}: can't be written: {}", file.string(), why(cause)));
    }
  }
  std::filesystem::rename(temporary, file, error);
  if (error) {
    const int cause = error.value();
    std::filesystem::remove(temporary, error);
    throw InputError(fmt::format("{}: can't be written: {}", file.string(), why(cause)));
  }
}

void check_writable(const std::filesystem::path& directory) {
  if (directory.empty()) throw InputError("--out \"\": name the directory for the results");
  std::error_code error;
  std::filesystem::path there = std::filesystem::absolute(directory);
  while (!std::filesystem::exists(there, error) && there.has_parent_path() && there != there.parent_path())
    there = there.parent_path();
  std::string why = "is a file";
  if (std::filesystem::is_directory(there, error)) {
    // Permissions alone do not say it: of root, on a full or read-only disk, below /proc.
    const std::string probe = (there / fmt::format(".fxdyn.{}", ::getpid())).string();
    if (::mkdir(probe.c_str(), 0700) == 0) {
      ::rmdir(probe.c_str());
      return;
    }
    why = errno == EACCES ? "is not yours to write to" : fmt::format("takes no folder ({})", std::strerror(errno));
  }
  throw InputError(
      fmt::format("{}: can't be written: {} {}; choose another --out", directory.string(), there.string(), why));
}

namespace {

class Fnv1a {
 public:
  void add(std::string_view content) {
    for (const char c : content) hash_ = (hash_ ^ static_cast<unsigned char>(c)) * 1099511628211ULL;
  }
  std::string text() const { return fmt::format("{:016x}", hash_); }

 private:
  std::uint64_t hash_ = 14695981039346656037ULL;
};

/// Of the recordings that are a folder: names and hashes of its files.
std::string hash_of_folder(const std::filesystem::path& folder) {
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(folder))
    if (entry.is_regular_file()) files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  Fnv1a hash;
  for (const std::filesystem::path& file : files) hash.add(file.filename().string() + ' ' + hash_of_file(file) + '\n');
  return hash.text();
}

}  // namespace

std::string hash_of(std::string_view content) {
  Fnv1a hash;
  hash.add(content);
  return hash.text();
}

std::string hash_of_file(const std::filesystem::path& file) {
  if (const std::string* bytes = piped(file)) return hash_of(*bytes);
  if (std::filesystem::is_directory(file)) return hash_of_folder(file);
  std::ifstream stream(file, std::ios::binary);
  std::vector<char> piece(std::size_t{1} << 20);
  Fnv1a hash;
  while (stream) {
    stream.read(piece.data(), static_cast<std::streamsize>(piece.size()));
    hash.add({piece.data(), static_cast<std::size_t>(stream.gcount())});
  }
  if (!stream.eof()) throw InputError(file.string() + ": can't be read");
  return hash.text();
}

}  // namespace fxdyn
