#include "host_tools/arrays/lerobot.hpp"

#include <fstream>
#include <nlohmann/json.hpp>

namespace fxdyn {
namespace {

using nlohmann::json;

void add_names(const json& value, std::vector<std::string>& out) {
  if (value.is_string()) {
    out.push_back(value.get<std::string>());
    for (char& c : out.back())
      if (static_cast<unsigned char>(c) < ' ') c = '_';  // a name stands in one line
  } else if (value.is_array() || value.is_object()) {
    for (const json& part : value) add_names(part, out);
  }
}

}  // namespace

std::map<std::string, std::vector<std::string>> lerobot_names(const std::filesystem::path& file) {
  std::map<std::string, std::vector<std::string>> out;
  std::error_code error;
  const std::filesystem::path whole = std::filesystem::absolute(file, error);
  std::ifstream in(whole.parent_path().parent_path().parent_path() / "meta" / "info.json");
  const json info = in && !error ? json::parse(in, nullptr, false) : json();
  if (!info.is_object() || !info.contains("features") || !info["features"].is_object()) return out;
  for (const auto& [column, feature] : info["features"].items())
    if (feature.is_object() && feature.contains("names")) add_names(feature["names"], out[column]);
  return out;
}

}  // namespace fxdyn
