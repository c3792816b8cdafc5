#include "host_tools/project/seal.hpp"

#include "host_tools/project/provenance.hpp"
#include "host_tools/support/files.hpp"
#include "model/version.hpp"

namespace fxdyn {

using nlohmann::json;
namespace fs = std::filesystem;

json belongings(const Project& project, const fs::path& results, const fs::path& exported,
                const std::vector<std::string>& files) {
  json out = made_from(project, results, false);
  out["tool_version"] = version;
  out["project"] = {{"file", fs::relative(project.file, results).generic_string()}, {"hash", project_hash(project)}};
  out["files"] = json::object();
  for (const std::string& file : files) out["files"][file] = hash_of_file(exported / file);
  return out;
}

std::string sealed(json content) {
  content.erase("check");
  content["check"] = hash_of(content.dump(1));
  return content.dump(1) + "\n";
}

bool is_sealed(const std::string& text) {
  const json content = json::parse(text, nullptr, false);
  return content.is_object() && sealed(content) == text;
}

}  // namespace fxdyn
