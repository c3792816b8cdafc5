// threshold_study: diagnoses small cases with each deciding threshold halved and doubled, and writes the table of
// docs/findings/thresholds.md.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <mutex>
#include <nlohmann/json.hpp>
#include <thread>

#include "host_tools/diagnose/diagnose.hpp"
#include "host_tools/identify/gate_data.hpp"
#include "host_tools/simulate/recordings.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/files.hpp"
#include "host_tools/support/heap.hpp"
#include "host_tools/support/parallel.hpp"
#include "tests/campaign/generate.hpp"
#include "tests/campaign/thresholds.hpp"

namespace {

using namespace fxdyn;
using namespace fxdyn::campaign;
namespace fs = std::filesystem;
using nlohmann::json;

/// A case whose logs are read and filtered once.
class Prepared {
 public:
  Prepared(const Case& one, const fs::path& out) : folder_(out / one.name) {
    const fs::path data = folder_ / "data", truth = folder_ / "truth";
    generate(one, data, truth);
    truth_ = json::parse(read_file(truth / "truth.json"));
    project_ = read_project(data / "project.toml");
    data_ = read_gate_data(project_, data);
    for (Log& log : read_logs(project_, Role::baseline, data)) {
      log.role = Role::train;
      baseline_.push_back(process(std::move(log), data_.filter));
    }
  }
  ~Prepared() { fs::remove_all(folder_); }
  Prepared(const Prepared&) = delete;
  Prepared& operator=(const Prepared&) = delete;

  Answer answer(const diagnosis::Options& options) const {
    GateData data = data_;
    Progress progress;
    try {
      return answer_of(truth_, to_json(diagnose(project_, data, baseline_, {}, progress, options).report));
    } catch (const DataError&) {
      return {"refused", {}, {}, false};
    }
  }

 private:
  fs::path folder_;  ///< the diagnosis reads project and URDF again
  json truth_;
  Project project_;
  GateData data_;
  std::vector<ProcessedLog> baseline_;
};

std::string words_of(const Answer& answer) {
  std::string out = answer.verdict;
  for (const std::string& effect : answer.effects) out += " " + effect;
  for (const std::size_t joint : answer.joints) out += fmt::format(" @{}", joint);
  return out;
}

/// A factor on one threshold, all others as they are. What the case does not read changes nothing.
Answer varied(const Prepared& prepared, const Case& one, const Threshold& threshold, const Answer& normal,
              double factor) {
  if (!threshold.is_read(one)) return normal;
  diagnosis::Options options;
  threshold.of(options) *= factor;
  Answer answer = prepared.answer(options);
  if (words_of(answer) != words_of(normal))
    fmt::print("  {}: {} x {:g}: {}, {}\n", one.name, threshold.name, factor, words_of(answer),
               answer.right ? "right" : "wrong");
  return answer;
}

/// What each threshold is multiplied by: halved and doubled, or as good as taken away.
struct Factors {
  double low = 0.5, high = 2;
};

/// What this very program answered before, to these thresholds.
json key_of(const std::vector<Threshold>& thresholds, const Factors& factors) {
  json names = json::array();
  for (const Threshold& threshold : thresholds) names.push_back(threshold.name);
  return {{"program", hash_of_file("/proc/self/exe")}, {"thresholds", names}, {"factors", {factors.low, factors.high}}};
}

CaseAnswers study(const Case& one, const std::vector<Threshold>& thresholds, const Factors& factors,
                  const fs::path& out) {
  const auto start = std::chrono::steady_clock::now();
  const fs::path file = out / (one.name + ".json");
  if (fs::exists(file)) {
    const json before = json::parse(read_file(file));
    if (before.value("key", json()) == key_of(thresholds, factors)) return case_answers(before.at("answers"));
  }
  const Prepared prepared(one, out);
  CaseAnswers answers;
  answers.normal = prepared.answer({});
  for (const Threshold& threshold : thresholds) {
    answers.halved.push_back(varied(prepared, one, threshold, answers.normal, factors.low));
    answers.doubled.push_back(varied(prepared, one, threshold, answers.normal, factors.high));
  }
  fmt::print("{}: {}, {} ({:.1f} s)\n", one.name, words_of(answers.normal), answers.normal.right ? "right" : "wrong",
             std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
  std::fflush(stdout);
  write_file(file, json{{"key", key_of(thresholds, factors)}, {"answers", to_json(answers)}}.dump(1) + "\n");
  return answers;
}

std::vector<CaseAnswers> study_all(const std::vector<Case>& cases, const std::vector<Threshold>& thresholds,
                                   const Factors& factors, const fs::path& out, std::size_t jobs) {
  std::vector<CaseAnswers> answers(cases.size());
  std::atomic<std::size_t> next = 0;
  std::exception_ptr failure;
  std::mutex mutex;
  std::vector<std::jthread> workers;
  for (std::size_t i = 0; i < jobs; ++i) {
    workers.emplace_back([&] {
      for (std::size_t at; (at = next++) < cases.size();) {
        try {
          answers[at] = study(cases[at], thresholds, factors, out);
        } catch (...) {
          const std::lock_guard lock(mutex);
          failure = std::current_exception();
        }
      }
    });
  }
  workers.clear();
  if (failure) std::rethrow_exception(failure);
  return answers;
}

/// Lines of the table that a page does not have.
std::size_t missing_in(const std::string& page, const std::string& table) {
  std::size_t missing = 0;
  for (std::size_t from = 0; from < table.size();) {
    const std::size_t to = table.find('\n', from) + 1;
    const std::string line = table.substr(from, to - from);
    from = to;
    if (page.find(line) != std::string::npos) continue;
    fmt::print("not in the page: {}", line);
    ++missing;
  }
  return missing;
}

template <class T, class Name>
void keep(std::vector<T>& all, const std::vector<std::string>& names, Name&& name) {
  if (names.empty()) return;
  std::erase_if(all, [&](const T& one) { return std::find(names.begin(), names.end(), name(one)) == names.end(); });
  if (all.size() != names.size()) throw InputError("no such case or threshold");
}

int run(int argc, char** argv) {
  CLI::App app("Diagnoses small cases with each deciding threshold halved and doubled");
  fs::path out, against;
  std::size_t jobs = 1;
  Factors factors;
  std::vector<std::string> some_cases, some_thresholds;
  bool list = false;
  app.add_option("--out", out, "folder for table and answers; what this program answered there is not asked again")
      ->required();
  app.add_option("--low", factors.low, "instead of halving; 0 takes a lower bound away")->check(CLI::Range(0.0, 1.0));
  app.add_option("--high", factors.high, "instead of doubling; 1e6 takes an upper bound away")
      ->check(CLI::Range(1.0, 1e9));
  app.add_option("--jobs", jobs, "cases at a time")->check(CLI::Range(1, 64));
  app.add_option("--case", some_cases, "only these");
  app.add_option("--threshold", some_thresholds, "only these");
  app.add_option("--against", against, "exit 1 where this page lacks a line of the table");
  app.add_flag("--list", list, "print the cases' and thresholds' names");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  // Cases side by side: each diagnosis keeps to its core.
  const ThreadLimit alone(1);
  setenv("FXDYN_THREADS", "1", 1);
  std::vector<Case> cases = threshold_cases();
  std::vector<Threshold> thresholds = deciding_thresholds();
  keep(cases, some_cases, [](const Case& one) { return one.name; });
  keep(thresholds, some_thresholds, [](const Threshold& one) { return one.name; });
  if (list) {
    for (const Case& one : cases) fmt::print("{}\n", one.name);
    for (const Threshold& one : thresholds) fmt::print("{}\n", one.name);
    return 0;
  }
  fs::create_directories(out);
  out = fs::absolute(out);
  const std::string table = to_markdown(rows_of(thresholds, study_all(cases, thresholds, factors, out, jobs)));
  write_file(out / "thresholds.md", table);
  fmt::print("{}", table);
  return against.empty() || missing_in(read_file(against), table) == 0 ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  keep_freed_memory();
  try {
    return run(argc, argv);
  } catch (const std::exception& error) {
    fmt::print(stderr, "threshold_study: {}\n", error.what());
    return 2;
  }
}
