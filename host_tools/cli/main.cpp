#include <fmt/format.h>

#include <unistd.h>
#include <filesystem>
#include <map>

#include "host_tools/cli/output.hpp"
#include "host_tools/cli/shell_files.hpp"
#include "host_tools/cli/verb.hpp"
#include "host_tools/effects/effect_library.hpp"
#include "host_tools/support/heap.hpp"
#include "host_tools/support/pipes.hpp"
#include "model/version.hpp"

namespace {

using namespace fxdyn;

/// Messages quote what stands in a file: one line, and nothing that a terminal acts upon.
std::string one_line(std::string text) {
  for (char& c : text) {
    if (c == '\n' || c == '\r' || c == '\t') c = ' ';
    if (static_cast<unsigned char>(c) < ' ' || c == '\x7f') c = '?';
  }
  return text;
}

/// The arguments, with "~" as a shell has it: of "--out=~/x" it leaves that to the program.
std::vector<std::string> words_of(int argc, char** argv) {
  std::vector<std::string> words;
  for (int i = argc - 1; i > 0; --i) {  // CLI11 takes them from the back
    const std::string word = argv[i];
    const std::size_t value = word.starts_with("--") ? word.find('=') + 1 : 0;
    words.push_back(word.substr(0, value) + with_home(word.substr(value)));
  }
  return words;
}

/// One line: what is wrong, and a command that would work.
void complain_of_usage(const CLI::App& app, const CLI::ParseError& error, const std::vector<std::string>& words) {
  // What is missing is missing because of the word that is misspelt.
  const auto unknown = app.remaining(true);
  const std::string word = unknown.empty() ? "" : unknown.front(), works = cli::command_that_works(app, words, word);
  const bool option = word.starts_with("-"), no_verb = app.get_subcommands().empty();
  const std::string wrong =
      word.empty()
          ? error.what()
          : fmt::format("'{}' {}", word, option ? "is no option here" : (no_verb ? "is no verb" : "was not expected"));
  fmt::print(stderr, "fxdyn: {}: {}\n", one_line(wrong), one_line(fmt::format("as in `{}`", works)));
}

/// Starts the program that has the project's effects in this one's place; returns where it is not there.
void start_instead(const std::string& library, char** argv) {
  std::error_code none;
  const auto self = std::filesystem::read_symlink("/proc/self/exe", none);
  const std::string program = (self.parent_path() / ("fxdyn-" + library)).string();
  std::fflush(nullptr);
  ::execv(program.c_str(), argv);
}

int run(int argc, char** argv) {
  CLI::App app{
      "fxdyn: from a robot's measured log to torque feedforward on its drive controllers.\n"
      "Example: fxdyn run robot.toml --out out/robot",
      "fxdyn"};
  app.set_version_flag("--version", version);
  app.require_subcommand(1);
  std::map<const CLI::App*, cli::Action> actions;
  for (const cli::Verb& verb : cli::verbs()) {
    CLI::App* options =
        app.add_subcommand(verb.name, fmt::format("{}\nExample: fxdyn {} {}", verb.help, verb.name, verb.example));
    actions[options] = verb.add(*options);
    cli::Output::add_options(*options);
  }

  try {
    app.parse(words_of(argc, argv));
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return app.exit(error);
    complain_of_usage(app, error, {argv + 1, argv + argc});
    return 2;
  }
  const CLI::App* verb = app.get_subcommands().front();
  cli::Output output(*verb);
  try {
    actions.at(verb)();
  } catch (const OtherEffectLibrary&) {
    throw;  // the other program says it
  } catch (...) {
    output.end(cli::ending_of(std::current_exception()));
    throw;
  }
  output.end({});
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  fxdyn::keep_freed_memory();
  const auto complain = [](const std::string& what) { fmt::print(stderr, "fxdyn: {}\n", one_line(what)); };
  try {
    return run(argc, argv);
  } catch (const fxdyn::OtherEffectLibrary& error) {
    start_instead(error.library, argv);
    complain(error.what());
    return 2;
  } catch (...) {
    const fxdyn::cli::Ending ending = fxdyn::cli::ending_of(std::current_exception());
    complain(ending.complaint);
    return ending.exit;
  }
}
