#pragma once

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "host_tools/identify/identify.hpp"
#include "host_tools/project/project.hpp"
#include "host_tools/train/tuning.hpp"

namespace fxdyn::swarm_peers {

/// Structure and friction of a project, as the search of the BLS finds them.
struct Identified {
  Identified(const std::filesystem::path& file, const std::filesystem::path& directory);
  Project project;
  GateData data;
  std::unique_ptr<Fitter> fitter;
};

/// The demo with logs of another duration [s]; 0: as they are. Returns the project.
std::filesystem::path demo_of(const std::filesystem::path& folder, double duration_s);

/// Best value so far of a search: where it fell, and to what.
class Trace {
 public:
  void add(double value) {
    ++evaluations_;
    if (!std::isfinite(value)) value = std::numeric_limits<double>::max();  // no number of a file
    if (steps_.empty() || value < steps_.back().best) steps_.push_back({evaluations_, value});
  }
  double after(std::size_t evaluations) const {
    const auto next = std::find_if(steps_.begin(), steps_.end(), [&](const Step& s) { return s.at > evaluations; });
    return next == steps_.begin() ? steps_.front().best : std::prev(next)->best;
  }
  /// Nothing: never.
  std::optional<std::size_t> first_below(double value) const {
    const auto at = std::find_if(steps_.begin(), steps_.end(), [&](const Step& s) { return s.best <= value; });
    return at != steps_.end() ? std::optional<std::size_t>(at->at) : std::nullopt;
  }
  std::size_t evaluations() const { return evaluations_; }

  nlohmann::json to_json() const;
  static Trace of(const nlohmann::json& file);

 private:
  struct Step {
    std::size_t at;  ///< evaluation, from 1
    double best;
  };
  std::vector<Step> steps_;
  std::size_t evaluations_ = 0;
};

struct Method {
  std::string name;
  bool ours = false;
};
inline const std::vector<Method> methods{{"ours", true}, {"pagmo pso"}, {"pagmo cmaes"}};

struct Budget {
  int particles = 30, generations = 40;
  std::size_t evaluations() const {
    return static_cast<std::size_t>(particles) * static_cast<std::size_t>(generations + 1);
  }
};

Trace run(const Method& method, const BlsFitness& fitness, const Budget& budget, std::uint64_t seed);

}  // namespace fxdyn::swarm_peers
