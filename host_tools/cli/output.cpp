#include "host_tools/cli/output.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <array>
#include <cstdio>
#include <fstream>
#include <new>
#include <nlohmann/json.hpp>
#include <set>

#include "host_tools/support/error.hpp"
#include "host_tools/support/quiet.hpp"

namespace fxdyn::cli {
namespace {

namespace fs = std::filesystem;

/// Their output is a file that is meant for somebody else.
constexpr std::array<std::string_view, 3> print_a_file{"init", "completion", "man"};

const std::string json_help = "print the results as one JSON object, and nothing else";
const std::string quiet_help = "no tables and no progress: only notes and complaints, on standard error";

bool is_set(const CLI::App& verb, const char* name) {
  const CLI::Option* option = verb.get_option_no_throw(name);
  return option != nullptr && option->count() > 0;
}

/// Clocks of file systems are behind by some milliseconds.
constexpr auto behind = std::chrono::milliseconds(20);

/// Names of the files that a folder got since then, in order.
std::set<std::string> written_since(const fs::path& directory, fs::file_time_type begin) {
  std::set<std::string> names;
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator(directory, ignored)) {
    if (entry.is_regular_file(ignored) && entry.last_write_time(ignored) >= begin)
      names.insert(entry.path().filename().string());
  }
  return names;
}

/// What the JSON files among them hold.
nlohmann::json results_of(const fs::path& directory, const std::set<std::string>& names) {
  nlohmann::json out = nlohmann::json::object();
  for (const std::string& name : names) {
    if (!name.ends_with(".json")) continue;
    std::ifstream file(directory / name);
    nlohmann::json content = nlohmann::json::parse(file, nullptr, false);
    if (!content.is_discarded()) out[name] = std::move(content);
  }
  return out;
}

}  // namespace

Ending ending_of(const std::exception_ptr& error) {
  try {
    std::rethrow_exception(error);
  } catch (const InputError& wrong) {
    return {2, wrong.what()};
  } catch (const DataError& wrong) {
    return {1, wrong.what()};
  } catch (const std::bad_alloc&) {
    return {2, "not enough memory: cut the logs by from_s and to_s, or free some"};
  } catch (const fs::filesystem_error& wrong) {
    return {2, fmt::format("{}: {}", wrong.path1().string(), wrong.code().message())};
  } catch (const std::exception& wrong) {
    return {2, fmt::format("internal error: {}", wrong.what())};
  }
}

void Output::add_options(CLI::App& verb) {
  for (const std::string_view name : print_a_file) {
    if (verb.get_name() == name) return;
  }
  verb.add_flag("--quiet", quiet_help);
  if (verb.get_option_no_throw("--json") == nullptr) verb.add_flag("--json", json_help);
}

Output::Output(const CLI::App& verb) : verb_(verb.get_name()), begin_(fs::file_time_type::clock::now() - behind) {
  if (is_set(verb, "--out")) out_ = verb.get_option("--out")->as<std::string>();
  // a verb with a --json of its own prints that itself
  json_ = is_set(verb, "--json") && verb.get_option("--json")->get_description() == json_help;
  if (is_set(verb, "--quiet") || is_set(verb, "--json")) be_quiet();
  if (!json_ && !is_set(verb, "--quiet")) return;
  std::fflush(stdout);
  stdout_ = ::dup(STDOUT_FILENO);
  const int nothing = ::open("/dev/null", O_WRONLY | O_CLOEXEC);
  if (stdout_ < 0 || nothing < 0) throw InputError("standard output can't be redirected: is it closed?");
  ::dup2(nothing, STDOUT_FILENO);
  ::close(nothing);
}

Output::~Output() { restore(); }

void Output::restore() {
  if (stdout_ < 0) return;
  std::fflush(stdout);
  ::dup2(stdout_, STDOUT_FILENO);
  ::close(stdout_);
  stdout_ = -1;
}

void Output::end(const Ending& ending) {
  restore();
  if (!json_) return;
  nlohmann::json said{{"verb", verb_}, {"exit", ending.exit}};
  if (ending.exit != 0) said["complaint"] = ending.complaint;
  if (!out_.empty()) {
    said["out"] = out_.string();
    const std::set<std::string> files = written_since(out_, begin_);
    said["files"] = files;
    said["results"] = results_of(out_, files);
  }
  fmt::print("{}\n", said.dump(1, ' ', false, nlohmann::json::error_handler_t::replace));
}

}  // namespace fxdyn::cli
