// coverage_study: diagnoses many small robots and counts how often an effect's true parameters lie in the 95 %
// intervals that the diagnosis states: docs/findings/coverage.md.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <nlohmann/json.hpp>

#include "host_tools/diagnose/diagnose.hpp"
#include "host_tools/identify/gate_data.hpp"
#include "host_tools/simulate/recordings.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/files.hpp"
#include "host_tools/support/parallel.hpp"
#include "tests/campaign/generate.hpp"

namespace {

using namespace fxdyn;
using namespace fxdyn::campaign;
namespace fs = std::filesystem;
using nlohmann::json;

/// Half of a 95 % interval [deviations].
constexpr double half_interval = 1.96;
/// Beyond it an estimate is another solution, not a bad deviation: it is counted, but kept out of the spread.
constexpr double outlier = 10;

/// What an effect is asked for: RMS torque as a share of rated, or RMS deflection that a link encoder shows.
struct Asked {
  const char* effect;
  double share, deflection = 0;
};
constexpr Asked asked[] = {
    {"elasticity", 0, 5e-4},     {"eccentricity", 0, 2e-4}, {"backlash", 0, 5e-4},   {"stribeck", 0.02},
    {"viscous_quadratic", 0.02}, {"load_friction", 0.02},   {"ripple", 0.02},        {"spring", 0.02},
    {"joint_coupling", 0.02},    {"payload", 0.02},         {"friction_drift", 0.02}};

Case case_of(const Asked& one, std::uint64_t seed) {
  Case out;
  out.robot = small_arm;
  out.seed = seed;
  out.recording = {.log_s = 5, .sample_s = 0.004, .encoder_bits = 17};
  out.effects = {{one.effect, one.share, {}, false, one.deflection}};
  out.link_encoders = one.deflection > 0;
  out.name = fmt::format("{}_{}", one.effect, seed);
  return out;
}

json diagnosed(const fs::path& data) {
  const Project project = read_project(data / "project.toml");
  GateData now = read_gate_data(project, data);
  std::vector<ProcessedLog> baseline;
  for (Log& log : read_logs(project, Role::baseline, data)) {
    log.role = Role::train;
    baseline.push_back(process(std::move(log), now.filter));
  }
  Progress progress;
  return to_json(diagnose(project, now, baseline, {}, progress, {}).report);
}

/// The effect as a diagnosis has it, null: not found where it is.
json found(const json& report, const json& truth) {
  const json& all = truth.contains("joint")
                        ? report.at("joints").at(truth["joint"].get<std::size_t>() - 1).at("effects")
                        : report.at("robot_effects");
  for (const json& effect : all) {
    if (effect.at("effect") == truth.at("effect")) return effect;
  }
  return {};
}

/// Errors of one parameter in stated deviations.
struct Parameter {
  std::vector<double> z, relative;
  std::size_t without = 0;  ///< that have no deviation
};

struct Row {
  std::size_t cases = 0, named = 0;
  std::map<std::string, Parameter> parameters;
};

void count(Row& row, const json& truth, const json& effect, std::uint64_t seed) {
  ++row.named;
  for (const json& p : effect.at("parameters")) {
    const std::string name = p.at("name");
    if (!truth.at("parameters").contains(name)) continue;
    const double right = truth["parameters"][name], value = p.at("value");
    Parameter& to = row.parameters[name];
    if (!p.contains("std") || p["std"].is_null()) {
      ++to.without;
      continue;
    }
    const double std = p["std"];
    to.z.push_back((value - right) / std);
    to.relative.push_back(std / std::max(std::fabs(right), 1e-300));
    fmt::print("{} {} {}: true {:.5g}, {:.5g} +- {:.2g}, z {:.2f}\n", seed, truth["effect"].get<std::string>(), name,
               right, value, std, to.z.back());
  }
  std::fflush(stdout);
}

std::string to_markdown(const std::map<std::string, Row>& rows) {
  std::string out =
      "| Effect | Named | Parameter | Intervals | Covered | Mean of z | Spread of z | Outliers | Deviation |\n";
  out += "|---|---|---|---|---|---|---|---|---|\n";
  for (const auto& [effect, row] : rows) {
    for (const auto& [name, p] : row.parameters) {
      double sum = 0, squares = 0, in = 0, inside = 0;
      for (const double z : p.z) {
        inside += std::fabs(z) <= half_interval;
        if (std::fabs(z) > outlier) continue;
        ++in;
        sum += z;
        squares += z * z;
      }
      const double n = static_cast<double>(p.z.size()), mean = in > 0 ? sum / in : 0;
      std::vector<double> relative = p.relative;
      std::sort(relative.begin(), relative.end());
      out += fmt::format("| {} | {} of {} | {} | {} | {:.1f} % | {:.2f} | {:.2f} | {:.0f} | {:.2g} % |\n", effect,
                         row.named, row.cases, name, p.z.size(), n > 0 ? 100 * inside / n : 0, mean,
                         in > 1 ? std::sqrt(std::max(0.0, squares / in - mean * mean)) : 0, n - in,
                         relative.empty() ? 0 : 100 * relative[relative.size() / 2]);
    }
  }
  return out;
}

int run(int argc, char** argv) {
  CLI::App app("Counts how often true parameters lie in the 95 % intervals of a diagnosis");
  fs::path out;
  std::uint64_t first = 1;
  std::size_t robots = 20;
  std::vector<std::string> some;
  app.add_option("--out", out, "folder for logs and table")->required();
  app.add_option("--seed", first, "of the first robot");
  app.add_option("--robots", robots, "for each effect");
  app.add_option("--effect", some, "only these");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  const ThreadLimit alone(1);
  fs::create_directories(out);
  out = fs::absolute(out);
  std::map<std::string, Row> rows;
  for (std::size_t i = 0; i < robots; ++i) {
    for (const Asked& one : asked) {
      if (!some.empty() && std::find(some.begin(), some.end(), one.effect) == some.end()) continue;
      const fs::path folder = out / one.effect;
      try {
        generate(case_of(one, first + i), folder / "data", folder / "truth");
        const json truth = json::parse(read_file(folder / "truth" / "truth.json")).at("effects").at(0);
        Row& row = rows[one.effect];
        ++row.cases;
        const json effect = found(diagnosed(folder / "data"), truth);
        if (!effect.is_null()) count(row, truth, effect, first + i);
      } catch (const NotPossible&) {  // no joint reaches the size
      }
      fs::remove_all(folder);
    }
    write_file(out / "coverage.md", to_markdown(rows));
  }
  fmt::print("{}", to_markdown(rows));
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(argc, argv);
  } catch (const std::exception& error) {
    fmt::print(stderr, "coverage_study: {}\n", error.what());
    return 2;
  }
}
