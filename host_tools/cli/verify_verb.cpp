// Whether exported files belong together.

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "host_tools/cli/verb.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/verify/verify.hpp"

namespace fxdyn::cli {

Action add_verify(CLI::App& verb) {
  struct Options {
    std::string folder, project, image;
    bool as_json = false;
  };
  const auto options = std::make_shared<Options>();
  verb.add_option("DIR", options->folder, "results of `export`")->required();
  verb.add_option("--project", options->project, "project file (default: where it was at the export)");
  verb.add_option("--image", options->image, "firmware (.elf or .bin) that is to hold the tables");
  verb.add_flag("--json", options->as_json, "what was seen as JSON");
  return [options] {
    const VerifyResult result = verify(options->folder, {.project = options->project, .image = options->image});
    fmt::print("{}", options->as_json ? to_json(result).dump(2) + "\n" : verify_table(result));
    std::fflush(stdout);
    if (!result.refused.empty()) throw DataError(result.refused);
  };
}

}  // namespace fxdyn::cli
