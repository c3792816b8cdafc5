#include "host_tools/bags/bag.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <fstream>

#include "host_tools/bytes/unpack.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/pipes.hpp"
#include "host_tools/support/temporary_folder.hpp"

namespace fxdyn {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view mcap_magic = "\x89MCAP", sqlite_magic = "SQLite format 3";

std::string first_bytes(const fs::path& file) {
  std::array<char, 16> bytes;
  std::ifstream stream(file, std::ios::binary);
  stream.read(bytes.data(), bytes.size());
  return {bytes.data(), static_cast<std::size_t>(stream.gcount())};
}

/// "x.db3" of "x.db3.zstd".
fs::path without_packing(const fs::path& file) {
  const std::string extension = file.extension().string();
  return extension == ".zstd" || extension == ".zst" ? file.stem() : file.filename();
}

bool is_part(const fs::path& file) {
  const std::string extension = without_packing(file).extension().string();
  return extension == ".mcap" || extension == ".db3";
}

/// What a list of YAML below a key holds; metadata.yaml of rosbag2 is written by its program, always in this form.
std::vector<std::string> yaml_list(const fs::path& file, const std::string& key) {
  std::vector<std::string> out;
  std::ifstream stream(file);
  bool inside = false;
  for (std::string line; std::getline(stream, line);) {
    const std::size_t start = line.find_first_not_of(" \t");
    if (start == std::string::npos) continue;
    std::string text = line.substr(start);
    while (text.ends_with(' ') || text.ends_with('\r')) text.pop_back();
    if (inside && text.starts_with("- ")) {
      text.erase(0, 2);
      std::erase_if(text, [](char c) { return c == '"' || c == '\''; });
      out.push_back(text);
    } else {
      inside = text == key + ":";
    }
  }
  return out;
}

/// The files of a bag's folder, in their order.
std::vector<fs::path> parts_of(const fs::path& folder) {
  std::vector<fs::path> out;
  for (const std::string& name : yaml_list(folder / "metadata.yaml", "relative_file_paths")) {
    // Early versions wrote the folder's name in front.
    const fs::path part = folder / fs::path(name).filename();
    if (!fs::exists(part))
      throw InputError(fmt::format("{}: its metadata.yaml lists {}, which is not there: copy the whole folder",
                                   folder.string(), part.filename().string()));
    out.push_back(part);
  }
  if (!out.empty()) return out;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(folder, error))
    if (is_part(entry.path())) out.push_back(entry.path());
  std::sort(out.begin(), out.end());
  return out;
}

BagEnd read_part(const fs::path& file, BagVisitor& visitor) {
  if (!fs::exists(file)) throw InputError(file.string() + ": can't be read; check the path of the log");
  const std::string bytes = first_bytes(file);
  if (bytes.starts_with(mcap_magic)) return read_mcap(file, visitor);
  if (bytes.starts_with(sqlite_magic)) return read_rosbag2(file, visitor);
  if (!is_zstd(bytes))
    throw InputError(fmt::format("{}: {}: record it again, or copy it again", file.string(),
                                 bytes.empty() ? "is empty" : "is neither MCAP nor a database of rosbag2"));
  const TemporaryFolder room;
  const fs::path unpacked = room.path() / without_packing(file);
  unpack_zstd_file(file, unpacked);
  if (is_zstd(first_bytes(unpacked))) throw InputError(file.string() + ": is packed twice: unpack it with unzstd");
  try {
    return read_part(unpacked, visitor);
  } catch (const InputError& error) {
    // Under the name that the user knows.
    std::string text = error.what();
    if (const std::size_t at = text.find(unpacked.string()); at != std::string::npos)
      text.replace(at, unpacked.string().size(), file.string());
    throw InputError(text);
  }
}

}  // namespace

bool is_bag(const fs::path& file) {
  std::error_code error;
  if (is_pipe(file)) return false;
  if (fs::is_directory(file, error)) {
    if (fs::exists(file / "metadata.yaml", error)) return true;
    const fs::directory_iterator all(file, error);
    return std::any_of(begin(all), end(all), [](const auto& entry) { return is_part(entry.path()); });
  }
  const std::string bytes = first_bytes(file);
  return bytes.starts_with(mcap_magic) || bytes.starts_with(sqlite_magic) || (is_zstd(bytes) && is_part(file));
}

BagEnd read_bag(const fs::path& file, BagVisitor& visitor) {
  if (!fs::is_directory(file)) return read_part(file, visitor);
  const std::vector<fs::path> parts = parts_of(file);
  if (parts.empty())
    throw InputError(file.string() + ": is a folder without a recording (.mcap or .db3) in it: name the log's file");
  BagEnd out;
  for (const fs::path& part : parts) {
    const BagEnd end = read_part(part, visitor);
    if (end.cut) out = end;
  }
  return out;
}

}  // namespace fxdyn
