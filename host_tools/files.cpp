#include "host_tools/files.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <sstream>

#include "host_tools/error.hpp"

namespace fxdyn {

std::string read_file(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::ostringstream text;
  // Inserting nothing, from an empty file, sets the fail bit.
  if (!in || (in.peek() != std::ifstream::traits_type::eof() && !(text << in.rdbuf()))) {
    throw InputError(fmt::format("{}: can't be read: {}", file.string(), std::strerror(errno)));
  }
  return text.str();
}

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
      throw InputError(fmt::format("{}: can't be written: {}", file.string(), std::strerror(cause)));
    }
  }
  std::filesystem::rename(temporary, file, error);
  if (error) {
    std::filesystem::remove(temporary);
    throw InputError(fmt::format("{}: can't be written: {}", file.string(), error.message()));
  }
}

std::string hash_of(std::string_view content) {
  std::uint64_t hash = 14695981039346656037ULL;
  for (const char c : content) hash = (hash ^ static_cast<unsigned char>(c)) * 1099511628211ULL;
  return fmt::format("{:016x}", hash);
}

}  // namespace fxdyn
