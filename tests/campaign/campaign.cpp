// campaign: generates cases, diagnoses them blind, scores them and writes the page of docs/findings.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <thread>

#include "host_tools/support/error.hpp"
#include "host_tools/support/files.hpp"
#include "host_tools/support/heap.hpp"
#include "tests/campaign/case_fleet.hpp"
#include "tests/campaign/run_case.hpp"
#include "tests/campaign/write_up.hpp"

namespace {

using namespace fxdyn;
using namespace fxdyn::campaign;
namespace fs = std::filesystem;
using nlohmann::json;

/// made_case() of each. Its steps are many and short beside a diagnosis, so threads of this process do them.
std::vector<json> make_all(const std::vector<Case>& cases, const RunSettings& settings, std::size_t jobs) {
  std::vector<json> made(cases.size());
  std::atomic<std::size_t> next = 0;
  std::vector<std::jthread> workers;
  for (std::size_t i = 0; i < jobs; ++i) {
    workers.emplace_back([&] {
      for (std::size_t at; (at = next++) < cases.size();) {
        made[at] = made_case(cases[at], settings);
        fmt::print("made {}{}\n", cases[at].name,
                   made[at].contains("status") ? ": " + made[at].at("message").get<std::string>() : "");
        std::fflush(stdout);
      }
    });
  }
  workers.clear();
  return made;
}

/// What fxdyn says of the cases, as a fleet, and what that is worth. Results of an earlier run are taken as they are.
std::vector<json> run_all(const std::vector<Case>& cases, const RunSettings& settings, std::size_t jobs,
                          const std::vector<std::string>& fleet_words) {
  std::vector<json> results;
  std::vector<Case> left;
  for (const Case& one : cases) {
    results.push_back(earlier_result(one, settings));
    if (results.back().is_null()) left.push_back(one);
  }
  const std::vector<json> made = make_all(left, settings, jobs);
  std::vector<std::string> names;
  for (std::size_t i = 0; i < left.size(); ++i) {
    if (!made[i].contains("status")) names.push_back(left[i].name);
  }
  std::map<std::string, json> robots;
  if (!names.empty()) {
    write_fleet(names, settings);
    robots = run_fleet(settings, fleet_words);
  }
  auto at = results.begin();
  for (std::size_t i = 0; i < left.size(); ++i, ++at) {
    while (!at->is_null()) ++at;
    *at = scored_case(left[i], settings, made[i], robots[left[i].name]);
  }
  return results;
}

/// For the test of the second campaign. Returns what does not hold.
std::vector<std::string> drawn_complaints(const std::vector<json>& results) {
  std::vector<std::string> list;
  std::size_t wrong = 0;
  for (const json& result : results) {
    const std::string name = result.at("name");
    if (result.at("status") == "not_generated") continue;
    if (result.at("status") != "done") {
      list.push_back(fmt::format("{}: {}", name, result.value("message", "no result")));
    } else if (!result.at("passed").get<bool>()) {
      fmt::print("{}: wrong\n", name);
      ++wrong;
    }
  }
  if (5 * wrong > results.size()) list.push_back(fmt::format("{} of {} cases wrong", wrong, results.size()));
  return list;
}

/// For the test: what has to hold on a few cases. Returns what does not.
std::vector<std::string> complaints(const std::vector<json>& results) {
  std::vector<std::string> list;
  std::size_t visible = 0, right = 0, names = 0;
  std::vector<double> closures;
  for (const json& result : results) {
    const std::string name = result.at("name");
    if (result.at("status") != "done") {
      list.push_back(fmt::format("{}: {}", name, result.value("message", "no result")));
      continue;
    }
    const json &score = result.at("score"), &effects = result.at("truth").at("effects");
    if (effects.empty()) {
      if (score.at("false_alarm").get<bool>()) list.push_back(name + ": false alarm");
    } else if (effects.front().value("outside", false)) {
      if (score.at("accepted").get<bool>()) list.push_back(name + ": named, though no name is right");
      if (!score.at("flagged").get<bool>()) list.push_back(name + ": not seen");

    } else if (effects.front().contains("wanted_deflection")) {
      if (!score.at("top1").get<bool>()) list.push_back(name + ": not named, though the link encoder shows it");
    } else if (effects.front().at("expected").at("verdict") == "visible") {
      ++visible;
      names += score.at("spurious").get<std::size_t>();
      right += static_cast<std::size_t>(result.at("passed").get<bool>());
      if (!result.at("passed").get<bool>()) fmt::print("{}: wrong\n", name);
      if (!score.at("right_joint").get<bool>()) list.push_back(name + ": at the wrong joint");
      const bool internal = result.at("truth").at("plant") == "internal";
      if (internal && score.contains("closure") && effects.front().contains("wanted_share"))
        closures.push_back(score.at("closure").get<double>());
    }
  }
  std::sort(closures.begin(), closures.end());
  if (closures.empty() || closures[closures.size() / 2] < 0.9)
    list.push_back("half of the gaps are closed by less than 90 %");
  if (visible < 7) list.push_back(fmt::format("only {} effects are visible beforehand", visible));
  if (names > 1) list.push_back(fmt::format("{} names too many beside the right ones", names));
  if (10 * right < 9 * visible) list.push_back(fmt::format("{} of {} visible effects named right", right, visible));
  return list;
}

/// Which cases.
struct Choice {
  bool small = false;
  std::size_t drawn = 0, most = 0;  ///< 0: no drawn ones; no limit
  std::uint64_t seed = 0;
  std::vector<std::string> filters;
};

std::vector<Case> chosen(const Choice& choice) {
  std::vector<Case> cases = choice.drawn > 0 ? drawn_cases(choice.seed, choice.drawn)
                            : choice.small   ? small_cases()
                                             : all_cases();
  std::erase_if(cases, [&](const Case& one) {
    return !choice.filters.empty() &&
           std::none_of(choice.filters.begin(), choice.filters.end(),
                        [&](const std::string& filter) { return one.name.find(filter) != std::string::npos; });
  });
  if (choice.most == 0 || choice.most >= cases.size()) return cases;
  std::vector<Case> some;
  for (std::size_t i = 0; i < choice.most; ++i) some.push_back(cases[i * cases.size() / choice.most]);
  return some;
}

int run(int argc, char** argv) {
  CLI::App app("Generates robots with hidden effects, lets fxdyn diagnose them, and scores what it says");
  RunSettings settings;
  settings.program = FXDYN_PROGRAM;
  Choice choice;
  std::size_t jobs = 2;
  bool check = false, list = false, slurm = false;
  std::string commit, slurm_args;
  app.add_option("--out", settings.out, "folder for cases and results; what is there already is not run again")
      ->required();
  app.add_flag("--small", choice.small, "the cases of the test");
  app.add_option("--drawn", choice.drawn,
                 "the second campaign: so many robots, frictions and recordings drawn at random");
  app.add_option("--seed", choice.seed,
                 "of the first of them; thresholds are chosen on 1000 .. 1999, judged from 5000 on")
      ->needs("--drawn");
  app.add_option("--cases", choice.most, "at most so many, spread over the list");
  app.add_option("--filter", choice.filters, "only cases with one of these in their name");
  app.add_option("--jobs", jobs, "cases at a time")->check(CLI::Range(1, 64));
  app.add_flag("--slurm", slurm, "the diagnoses as a job array of Slurm: --out has to be seen by all nodes");
  app.add_option("--slurm-args", slurm_args, "further arguments of sbatch")->needs("--slurm");
  app.add_option("--program", settings.program, "the fxdyn to test");
  app.add_option("--commit", commit, "what the program was built from, for the page");
  app.add_option("--time-limit", settings.time_limit_s, "of one diagnosis, seconds");
  app.add_flag("--keep", settings.keep, "keep the logs of cases that passed");
  app.add_flag("--check", check, "exit 1 where the figures of the test are not met");
  app.add_flag("--list", list, "print the cases' names");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  // Cases side by side: each diagnosis keeps to its core.
  setenv("FXDYN_THREADS", "1", 1);

  const std::vector<Case> cases = chosen(choice);
  if (list) {
    for (const Case& one : cases) fmt::print("{}\n", one.name);
    return 0;
  }
  settings.out = fs::absolute(settings.out);
  settings.program = fs::absolute(settings.program);
  settings.program_hash = hash_of_file(settings.program);
  settings.own_hash = hash_of_file("/proc/self/exe");
  std::vector<std::string> words{"--jobs", fmt::format("{}", jobs)};
  if (slurm) words = {"--slurm", "--slurm-args", slurm_args};
  const std::vector<json> results = run_all(cases, settings, jobs, words);

  const std::string command =
      fmt::format("campaign {}", fmt::join(std::vector<std::string>(argv + 1, argv + argc), " "));
  write_file(settings.out / "results.json", json(results).dump(1) + "\n");
  write_file(settings.out / "campaign.md", write_up(results, command, commit));
  for (const Figure& figure : figures(results)) {
    if (figure.cases > 0)
      fmt::print("{:62} {:>8} {:7.3f} of {:3} {}\n", figure.what, figure.goal, figure.value, figure.cases,
                 figure.met ? "" : "<-");
  }
  fmt::print("{}\n", (settings.out / "campaign.md").string());
  if (!check) return 0;
  const auto wrong = choice.drawn > 0 ? drawn_complaints(results) : complaints(results);
  for (const std::string& line : wrong) fmt::print("{}\n", line);
  return wrong.empty() ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  keep_freed_memory();
  try {
    return run(argc, argv);
  } catch (const std::exception& error) {
    fmt::print(stderr, "campaign: {}\n", error.what());
    return 2;
  }
}
