#include "host_tools/verify/verify.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cstring>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>

#include "host_tools/effects/identified_model.hpp"
#include "host_tools/export/export.hpp"
#include "host_tools/project/log_entries.hpp"
#include "host_tools/project/project.hpp"
#include "host_tools/project/provenance.hpp"
#include "host_tools/project/seal.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/files.hpp"
#include "model/table_page.hpp"
#include "model/version.hpp"

namespace fxdyn {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

constexpr const char* anew = "export anew: `fxdyn export PROJECT --out DIR`";
constexpr const char* new_model = "make new ones: `fxdyn run PROJECT --out DIR`";

DataError refusal(const fs::path& file, const std::string& why) {
  return DataError(fmt::format("{}: {}", file.string(), why));
}

/// The header of the page that begins at a byte; none: no whole page begins there.
std::optional<PageHeader> page_at(const std::string& bytes, std::size_t begin) {
  HeaderWords words{};
  if (begin > bytes.size() || bytes.size() - begin < sizeof words) return {};
  std::memcpy(words.data(), bytes.data() + begin, sizeof words);
  const auto header = std::bit_cast<PageHeader>(words);
  if (header.magic != table_magic || header.check != check_of(words)) return {};
  if (header.words > (bytes.size() - begin - sizeof words) / 4) return {};
  Crc32 crc;
  for (std::uint32_t i = 0; i < header.words; ++i) {
    std::uint32_t word = 0;
    std::memcpy(&word, bytes.data() + begin + sizeof words + 4 * std::size_t{i}, 4);
    crc.add(word);
  }
  return crc.value() == header.crc32 ? std::optional(header) : std::nullopt;
}

/// A page of tables and the joints whose torque its drive puts out.
struct Page {
  std::string file;  ///< relative to DIR
  std::uint32_t outputs = 0;
};

class Verifier {
 public:
  Verifier(fs::path directory, const VerifySettings& settings, VerifyResult& result)
      : directory_(std::move(directory)), settings_(settings), result_(result) {}

  void run() {
    read_export();
    check_files();
    check_pages();
    check_logs(check_project());
    if (!settings_.image.empty()) check_image();
  }

 private:
  void good(const fs::path& file, std::string is) { result_.files.push_back({file.string(), std::move(is)}); }

  void read_export() {
    const fs::path file = directory_ / "export.json";
    const std::string text = read_file(file);
    if (!is_sealed(text)) throw refusal(file, fmt::format("changed since the export: {}", anew));
    export_ = json::parse(text);
    const std::string made_by = export_.at("of").at("tool_version");
    if (made_by != version)
      throw refusal(file,
                    fmt::format("made by fxdyn {}, this is {}: verify with that one, or {}", made_by, version, anew));
    good(file, fmt::format("as fxdyn {} exported it", version));
  }

  void check_files() {
    for (const auto& [name, hash] : export_.at("of").at("files").items()) {
      const fs::path file = directory_ / name;
      if (!fs::exists(file)) throw refusal(file, fmt::format("is missing: {}", anew));
      const std::string bytes = read_file(file);
      if (file.extension() == ".bin" && !page_at(bytes, 0))
        throw refusal(file, fmt::format("damaged, its CRC-32 does not hold: {}", anew));
      if (hash_of(bytes) != hash.get<std::string>())
        throw refusal(file, fmt::format("not the file of this export: {}", anew));
      if (file.extension() != ".bin") good(file, "of this export");
    }
  }

  std::vector<Page> pages(const IdentifiedModel& model) const {
    std::vector<Page> out{{"tables.bin", all_joints(model)}};
    for (const json& drive : export_.at("drives")) {
      const int index = drive.at("index");
      out.push_back({fmt::format("joint_{}/tables.bin", index), 1U << (index - 1)});
    }
    return out;
  }

  /// Hashes say that nothing has changed; this, that the words are those of the model.
  void check_pages() {
    const IdentifiedModel model = read_model(directory_ / "model.json");
    if (!model.formats) throw refusal(directory_ / "model.json", fmt::format("has no tables: {}", anew));
    model_project_ = model.project_hash;
    pages_ = pages(model);
    for (const Page& page : pages_) {
      const fs::path file = directory_ / page.file;
      const PageHeader header = header_of(file);
      const FixedModel fixed(model, *model.formats, page.outputs);
      if (header.layout_hash != fixed.layout_hash() || header.crc32 != fixed.crc() ||
          header.origin != model.lineage.origin || header.sequence != model.lineage.sequence)
        throw refusal(file, fmt::format("not what this program makes of model.json: {}", anew));
      good(file, fmt::format("the tables of model.json, CRC-32 {:08x}, update {}", header.crc32, header.sequence));
    }
  }

  Project check_project() {
    const json& made_from = export_.at("of").at("project");
    const fs::path file = !settings_.project.empty()
                              ? settings_.project
                              : (directory_ / made_from.at("file").get<std::string>()).lexically_normal();
    if (!fs::exists(file))
      throw refusal(file, "the project is not where it was at the export: say where, --project robot.toml");
    Project project = read_project(file);
    const std::string hash = project_hash(project);
    if (hash != model_project_ || hash != made_from.at("hash").get<std::string>())
      throw refusal(file, fmt::format("it or its URDF is not the project of these tables: {}", new_model));
    good(file, fmt::format("the project of these tables, hash {}", hash));
    return project;
  }

  /// The project names the same files as it did; they may lie elsewhere now.
  void check_logs(const Project& project) {
    std::set<std::string> looked_at;  // a file can be several logs: windows of it
    for (const LogEntry& entry : project.logs) {
      const fs::path file = log_file(entry, directory_).lexically_normal();
      if (!looked_at.insert(file.string()).second) continue;
      if (!fs::exists(file)) throw refusal(file, "this log of the project is missing: put it back to verify");
      const std::string hash = hash_of_file(file);
      const json& logs = export_.at("of").at("logs");
      if (std::none_of(logs.items().begin(), logs.items().end(), [&](const auto& log) {
            return fs::path(log.key()).filename() == file.filename() && log.value() == hash;
          }))
        throw refusal(file, fmt::format("not the log that the tables were made with: {}", new_model));
      good(file, fmt::format("the log of these tables, hash {}", hash));
    }
  }

  void check_image() {
    const std::string image = read_file(settings_.image);
    for (const Page& page : pages_) {
      const std::size_t at = image.find(read_file(directory_ / page.file));
      if (at == std::string::npos) continue;
      good(settings_.image, fmt::format("holds {} at byte {}", page.file, at));
      return;
    }
    std::string magic(4, '\0');
    std::memcpy(magic.data(), &table_magic, 4);
    for (std::size_t at = image.find(magic); at != std::string::npos; at = image.find(magic, at + 1)) {
      const auto header = page_at(image, at);
      if (!header) continue;
      throw refusal(settings_.image,
                    fmt::format("holds other tables, CRC-32 {:08x}, update {}: build it with those of {}",
                                header->crc32, header->sequence, directory_.string()));
    }
    throw refusal(settings_.image, "holds no whole page of tables: give the .elf or .bin that is flashed");
  }

  fs::path directory_;
  const VerifySettings& settings_;
  VerifyResult& result_;
  json export_;
  std::string model_project_;
  std::vector<Page> pages_;
};

}  // namespace

json to_json(const VerifyResult& result) {
  json files = json::array();
  for (const VerifyResult::File& file : result.files) files.push_back({{"file", file.file}, {"is", file.is}});
  json out{{"schema", "fxdyn.verify/1"}, {"belong_together", result.refused.empty()}, {"files", files}};
  if (!result.refused.empty()) out["refused"] = result.refused;
  return out;
}

std::string verify_table(const VerifyResult& result) {
  std::string out;
  for (const VerifyResult::File& file : result.files) out += fmt::format("{}: {}\n", file.file, file.is);
  return out;
}

VerifyResult verify(const fs::path& directory, const VerifySettings& settings) {
  for (const char* name : {"export.json", "tables.bin"}) {
    if (!fs::exists(directory / name))
      throw InputError(fmt::format("{}: there are no exported tables: run `fxdyn run PROJECT --out {}` first",
                                   (directory / name).string(), directory.string()));
  }
  if (!settings.image.empty() && !fs::exists(settings.image))
    throw InputError(fmt::format("{}: there is no such image", settings.image.string()));
  VerifyResult result;
  try {
    Verifier(directory, settings, result).run();
  } catch (const DataError& error) {
    result.refused = error.what();
  } catch (const InputError& error) {  // a project or model that can't be read is not the one of the tables
    result.refused = error.what();
  }
  return result;
}

}  // namespace fxdyn
