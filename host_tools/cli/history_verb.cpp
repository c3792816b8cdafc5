// Many sessions of one robot.

#include <fmt/format.h>

#include <charconv>
#include <cmath>

#include "host_tools/cli/verb.hpp"
#include "host_tools/history/history.hpp"
#include "host_tools/support/error.hpp"

namespace fxdyn::cli {
namespace {

/// "elbow coulomb amplitude=2.5"
std::pair<std::string, double> limit_of(const std::string& text) {
  const std::size_t equals = text.rfind('=');
  const char* from = equals == std::string::npos ? nullptr : text.data() + equals + 1;
  double value = 0;
  const auto end = text.data() + text.size();
  if (from == nullptr || std::from_chars(from, end, value).ptr != end || from == end || !std::isfinite(value))
    throw InputError(
        fmt::format("--limit {}: expected \"JOINT QUANTITY=NUMBER\", as in \"elbow coulomb amplitude=2.5\"", text));
  return {text.substr(0, equals), value};
}

}  // namespace

Action add_history(CLI::App& verb) {
  struct Options {
    std::vector<std::string> folders, limits;
    std::string out;
    history::Options history;
  };
  const auto options = std::make_shared<Options>();
  verb.add_option("DIR", options->folders, "result folders of diagnose or identify, each of one session")->required();
  verb.add_option("--out", options->out, "directory for the results")->required();
  verb.add_option("--limit", options->limits,
                  "\"JOINT QUANTITY=NUMBER\": when a trend reaches it; quantities as history.json names them")
      ->allow_extra_args(false);
  verb.add_option("--good-enough", options->history.good_enough,
                  "limit of a joint's error, as a share of its rated torque")
      ->check(CLI::Range(1e-6, 1.0))
      ->capture_default_str();
  return [options] {
    for (const std::string& text : options->limits) options->history.limits.push_back(limit_of(text));
    fmt::print("{}", history::write_history({options->folders.begin(), options->folders.end()}, options->history,
                                            options->out));
  };
}

}  // namespace fxdyn::cli
