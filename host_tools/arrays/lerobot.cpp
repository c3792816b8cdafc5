#include "host_tools/arrays/lerobot.hpp"

#include <fstream>
#include <nlohmann/json.hpp>

namespace fxdyn {
namespace {

using nlohmann::json;

/// @param depth of lists that may still be inside: LeRobot has two, a broken file any number
void add_names(const json& value, int depth, std::vector<std::string>& out) {
  if (value.is_string()) {
    out.push_back(value.get<std::string>());
    for (char& c : out.back())
      if (static_cast<unsigned char>(c) < ' ') c = '_';  // a name stands in one line
  } else if (depth > 0 && (value.is_array() || value.is_object())) {
    for (const json& part : value) add_names(part, depth - 1, out);
  }
}

}  // namespace

std::map<std::string, std::vector<std::string>> lerobot_names(const std::filesystem::path& file) {
  constexpr int deepest = 2;
  std::map<std::string, std::vector<std::string>> out;
  std::error_code error;
  const std::filesystem::path whole = std::filesystem::absolute(file, error);
  std::ifstream in(whole.parent_path().parent_path().parent_path() / "meta" / "info.json");
  const json info = in && !error ? json::parse(in, nullptr, false) : json();
  if (!info.is_object() || !info.contains("features") || !info["features"].is_object()) return out;
  for (const auto& [column, feature] : info["features"].items())
    if (feature.is_object() && feature.contains("names")) add_names(feature["names"], deepest, out[column]);
  return out;
}

bool is_lerobot(const std::filesystem::path& folder) {
  std::error_code error;
  return std::filesystem::is_directory(folder, error) &&
         std::filesystem::is_regular_file(folder / "meta/info.json", error);
}

std::filesystem::path first_file_of_lerobot(const std::filesystem::path& folder) {
  std::filesystem::path first;
  std::error_code error;
  for (std::filesystem::recursive_directory_iterator at(folder / "data", error), end; !error && at != end;
       at.increment(error))
    if (at->path().extension() == ".parquet" && (first.empty() || at->path() < first)) first = at->path();
  return first;
}

}  // namespace fxdyn
