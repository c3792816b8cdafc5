#include <fmt/format.h>

#include <map>

#include "host_tools/cli/verb.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/heap.hpp"
#include "model/version.hpp"

namespace {

using namespace fxdyn;

int run(int argc, char** argv) {
  CLI::App app{
      "fxdyn: from a robot's measured log to torque feedforward on its drive controllers.\n"
      "Example: fxdyn run robot.toml --out out/robot"};
  app.set_version_flag("--version", version);
  app.require_subcommand(1);
  app.failure_message([](const CLI::App*, const CLI::Error& error) {
    return fmt::format("fxdyn: {}: see fxdyn VERB --help\n", error.what());
  });
  std::map<const CLI::App*, cli::Action> actions;
  for (const cli::Verb& verb : cli::verbs()) {
    CLI::App* options =
        app.add_subcommand(verb.name, fmt::format("{}\nExample: fxdyn {} {}", verb.help, verb.name, verb.example));
    actions[options] = verb.add(*options);
  }

  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    // What is missing is missing because of the word that is misspelt.
    const auto unknown = app.remaining(true);
    if (error.get_exit_code() != 0 && !unknown.empty()) {
      const bool option = unknown.front().starts_with("-"), no_verb = app.get_subcommands().empty();
      fmt::print(stderr, "fxdyn: '{}' {}: see fxdyn {}--help\n", unknown.front(),
                 option ? "is no option here" : (no_verb ? "is no verb" : "was not expected"), no_verb ? "" : "VERB ");
      return 2;
    }
    return app.exit(error) == 0 ? 0 : 2;
  }
  actions.at(app.get_subcommands().front())();
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  fxdyn::keep_freed_memory();
  try {
    return run(argc, argv);
  } catch (const fxdyn::InputError& error) {
    fmt::print(stderr, "fxdyn: {}\n", error.what());
    return 2;
  } catch (const fxdyn::DataError& error) {
    fmt::print(stderr, "fxdyn: {}\n", error.what());
    return 1;
  } catch (const std::exception& error) {
    fmt::print(stderr, "fxdyn: internal error: {}\n", error.what());
    return 2;
  }
}
