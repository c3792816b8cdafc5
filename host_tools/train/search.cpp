#include "host_tools/train/search.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "host_tools/support/error.hpp"
#include "host_tools/support/files.hpp"
#include "host_tools/support/parallel.hpp"

namespace fxdyn {
namespace {

using nlohmann::json;

void save(const ResumeFile& file, const std::vector<Swarm>& swarms) {
  json state = {
      {"schema", "fxdyn.pso/1"}, {"identity", file.identity}, {"inputs", file.inputs}, {"swarms", json::array()}};
  bool finished = true;
  for (const Swarm& swarm : swarms) {
    state["swarms"].push_back(swarm.to_json());
    finished &= swarm.finished();
  }
  state["finished"] = finished;
  write_file(file.path, state.dump() + "\n");
}

DataError of_another(const ResumeFile& file) {
  return DataError(fmt::format(
      "{}: the generations in it are of another project, other logs or other settings; remove it to start anew",
      file.path.string()));
}

/// Calls read(state) with what the file holds, if there is one.
template <class Read>
void with_state(const ResumeFile& file, Read&& read) {
  if (!std::filesystem::exists(file.path)) return;
  try {
    const json state = json::parse(read_file(file.path));
    if (state.at("schema") != "fxdyn.pso/1" || state.at("inputs") != file.inputs) throw of_another(file);
    read(state);
  } catch (const json::exception&) {
    throw DataError(
        fmt::format("{}: not a generation of a search, or cut off; remove it to start anew", file.path.string()));
  } catch (const InputError&) {
    throw of_another(file);
  }
}

void load(const ResumeFile& file, std::vector<Swarm>& swarms) {
  with_state(file, [&](const json& state) {
    if (state.at("identity") != file.identity || state.at("swarms").size() != swarms.size()) throw of_another(file);
    for (std::size_t s = 0; s < swarms.size(); ++s) swarms[s].from_json(state["swarms"][s]);
  });
}

}  // namespace

void ResumeFile::check_inputs() const {
  with_state(*this, [](const json&) {});
}

void ResumeFile::drop_finished() const {
  bool done = false;
  with_state(*this,
             [&](const json& state) { done = state.value("finished", false) && state.at("identity") != identity; });
  if (done) std::filesystem::remove(path);
}

void search(std::vector<Swarm>& swarms, const std::function<double(std::size_t, const Eigen::VectorXd&)>& fitness,
            Progress& progress, const std::optional<ResumeFile>& resume) {
  if (resume) load(*resume, swarms);
  for (const Swarm& swarm : swarms) {
    for (int k = 0; k < swarm.generation(); ++k) progress.step();
  }
  for (;;) {
    struct Particle {
      std::size_t swarm;
      Eigen::Index number;
    };
    std::vector<Particle> all;
    std::vector<Eigen::VectorXd> values(swarms.size());
    for (std::size_t s = 0; s < swarms.size(); ++s) {
      if (swarms[s].finished()) continue;
      values[s].resize(swarms[s].positions().cols());
      for (Eigen::Index p = 0; p < values[s].size(); ++p) all.push_back({s, p});
    }
    if (all.empty()) return;
    parallel_for(all.size(), [&](std::size_t i) {
      const auto& [s, p] = all[i];
      values[s][p] = fitness(s, swarms[s].positions().col(p));
    });
    for (std::size_t s = 0; s < swarms.size(); ++s) {
      if (values[s].size() == 0) continue;
      swarms[s].tell(values[s]);
      progress.step();
    }
    if (resume) save(*resume, swarms);
  }
}

}  // namespace fxdyn
