#include "tests/train/swarm_fleet.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <map>
#include <numeric>

#include "host_tools/support/error.hpp"
#include "host_tools/support/files.hpp"
#include "host_tools/support/parallel.hpp"
#include "tests/support/run_fleet.hpp"

namespace fxdyn::swarm_peers {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

std::string quoted(const fs::path& path) { return "'" + path.string() + "'"; }

/// A fleet calls its program as PROGRAM VERB PROJECT --out DIR.
fs::path write_program(const FleetOptions& options) {
  fs::path file = options.folder / "seed.sh";
  std::string text = fmt::format("#!/bin/sh\nexec {} --seed-of \"$2\" --out \"$4\" --particles {} --generations {}",
                                 quoted(options.self), options.budget.particles, options.budget.generations);
  if (!options.joints.empty()) text += fmt::format(" --joints {}", fmt::join(options.joints, ","));
  write_file(file, text + "\n");
  fs::permissions(file, fs::perms::owner_all);
  return file;
}

std::string id_of(std::uint64_t seed) { return fmt::format("seed_{}", seed); }

/// What was done with other settings or programs does not count: a fleet knows only projects and versions.
void forget_others(const FleetOptions& options, const fs::path& program) {
  const fs::path sign = options.folder / "settings.txt", results = options.folder / "fleet";
  const std::string settings = hash_of_file(options.self) + "\n" + read_file(program);
  if (fs::exists(sign) && read_file(sign) == settings) return;
  fs::remove_all(results);
  write_file(sign, settings);
}

}  // namespace

std::vector<std::vector<SeedRun>> run_seeds(const FleetOptions& options) {
  demo_of(options.folder, options.duration_s);
  const fs::path program = write_program(options), file = options.folder / "fleet.toml";
  forget_others(options, program);
  std::string text = "verb = \"train\"\n";
  for (std::uint64_t seed = options.first_seed; seed < options.first_seed + options.seeds; ++seed)
    text +=
        fmt::format("\n[[robot]]\nid = \"{}\"\nproject = \"project.toml\"\noverrides = {{ train = {{ seed = {} }} }}\n",
                    id_of(seed), seed);
  write_file(file, text);
  std::vector<std::string> words = options.words;
  words.insert(words.end(), {"--program", program.string()});
  const json summary = test::run_fleet(options.fxdyn, file, options.folder / "fleet", words);
  std::map<std::string, json> robots;
  for (const json& robot : summary.at("robots")) robots[robot.at("id")] = robot;
  std::vector<std::vector<SeedRun>> out;
  for (std::uint64_t seed = options.first_seed; seed < options.first_seed + options.seeds; ++seed) {
    const json& robot = robots.at(id_of(seed));
    if (!robot.at("error").is_null())
      throw DataError(fmt::format("seed {}: {}", seed, robot.at("error").get<std::string>()));
    const fs::path folder = options.folder / "fleet/robots" / id_of(seed) / "out";
    const json result = json::parse(read_file(folder / "swarm.json"));
    out.emplace_back();
    for (const json& joint : result.at("joints")) {
      SeedRun run{joint.at("joint"), {}};
      for (const Method& method : methods) run.of_method.push_back(Trace::of(joint.at("methods").at(method.name)));
      out.back().push_back(std::move(run));
    }
    if (out.back().empty()) throw DataError(fmt::format("seed {}: no joint was searched", seed));
  }
  return out;
}

void run_seed(const fs::path& project, const fs::path& folder, const std::vector<std::size_t>& joints,
              const Budget& budget) {
  const Identified demo(project, folder);
  const std::uint64_t seed = demo.project.train.seed;
  // The swarm's seed alone: the features of all searches are the same ones.
  TrainSettings settings = demo.project.train;
  settings.seed = TrainSettings{}.seed;
  std::vector<std::size_t> wanted = joints;
  if (wanted.empty()) {
    wanted.resize(demo.fitter->joints());
    std::iota(wanted.begin(), wanted.end(), std::size_t{1});
  }
  std::vector<BlsFitness> fitness;
  for (const std::size_t joint : wanted) {
    if (joint < 1 || joint > demo.fitter->joints()) throw InputError(fmt::format("--joints: no joint {}", joint));
    fitness.emplace_back(*demo.fitter, joint - 1, settings);
  }
  std::vector<Trace> traces(wanted.size() * methods.size());
  parallel_for(traces.size(), [&](std::size_t i) {
    traces[i] = run(methods[i % methods.size()], fitness[i / methods.size()], budget, seed);
  });
  json list = json::array();
  for (std::size_t j = 0; j < wanted.size(); ++j) {
    json of_method = json::object();
    for (std::size_t m = 0; m < methods.size(); ++m) {
      const Trace& trace = traces[j * methods.size() + m];
      if (trace.evaluations() != budget.evaluations())
        throw DataError(fmt::format("{} evaluations instead of {}", trace.evaluations(), budget.evaluations()));
      of_method[methods[m].name] = trace.to_json();
    }
    list.push_back({{"joint", wanted[j]}, {"methods", of_method}});
  }
  write_file(folder / "model.json", json{{"robot", {{"name", demo.project.robot.name}}}}.dump(1) + "\n");
  const json metrics{{"schema", "fxdyn.metrics/1"}, {"numbers", "real"}, {"logs", json::array()}};
  write_file(folder / "metrics.json", metrics.dump(1) + "\n");
  write_file(folder / "swarm.json", json{{"seed", seed}, {"joints", list}}.dump(1) + "\n");
}

}  // namespace fxdyn::swarm_peers
