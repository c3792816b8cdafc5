#include "host_tools/signals/log_reader.hpp"

#include <algorithm>
#include <cctype>

namespace fxdyn {
namespace {

/// The last one reads what no other knows.
constexpr std::array readers{
    LogReader{"csv", ".csv", read_csv},
};

}  // namespace

std::span<const LogReader> log_readers() { return readers; }

const LogReader& reader_of(const std::filesystem::path& file, std::span<const LogReader> all) {
  std::string extension = file.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  const auto found =
      std::find_if(all.begin(), all.end(), [&](const LogReader& reader) { return reader.extension == extension; });
  return found == all.end() ? all.back() : *found;
}

}  // namespace fxdyn
