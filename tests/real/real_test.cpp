#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "host_tools/pipeline/pipeline.hpp"
#include "host_tools/support/files.hpp"
#include "tests/support/data.hpp"
#include "tests/support/files.hpp"

namespace fxdyn {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

struct RealSet {
  std::string name;
  /// Held-out RMSE of the published baseline, N*m or N: base parameters + rotor inertia + Coulomb + viscous + offset by
  /// least squares with the same filters.
  std::vector<double> baseline;
  double goal;       ///< largest geometric mean of ours / baseline
  double diagnosed;  ///< likewise before training
};

void PrintTo(const RealSet& set, std::ostream* out) { *out << set.name; }

class Real : public testing::TestWithParam<RealSet> {};

TEST_P(Real, HeldOutErrorIsNoWorseThanTheBaseline) {
  const RealSet& set = GetParam();
  FXDYN_NEEDS_DATA(set.name);
  const fs::path out = test::folder() / set.name;
  Pipeline(fs::path(FXDYN_SOURCE_DIR) / "tests" / "real" / (set.name + ".toml"), out).run();
  const json metrics = json::parse(read_file(out / "metrics.json"));
  const auto mean_ratio = [&](const json& logs) {
    double sum = 0;
    for (const json& log : logs) {
      if (log.at("role") != "test") continue;
      EXPECT_EQ(log.at("joints").size(), set.baseline.size());
      for (std::size_t j = 0; j < set.baseline.size(); ++j) {
        const double rmse = log.at("joints").at(j).at("rmse"), ratio = rmse / set.baseline[j];
        sum += std::log(ratio);
        fmt::print(" {:.3g} ({:.1f} %, x{:.2f})", rmse, 100 * log.at("joints").at(j).at("relative").get<double>(),
                   ratio);
      }
    }
    const double mean = std::exp(sum / static_cast<double>(set.baseline.size()));
    fmt::print("  geometric mean x{:.3f}\n", mean);
    return mean;
  };
  for (const json& stage : metrics.at("stages")) {
    if (stage.at("stage") != "diagnosed") continue;
    fmt::print("{:<14} diagnosed", set.name);
    EXPECT_LE(mean_ratio(stage.at("logs")), set.diagnosed);
  }
  fmt::print("{:<14} trained  ", set.name);
  const double mean = mean_ratio(metrics.at("logs"));
  EXPECT_LE(mean, set.goal);
}

INSTANTIATE_TEST_SUITE_P(Sets, Real,
                         testing::Values(RealSet{"emps", {3.22}, 0.85, 0.60},
                                         RealSet{"kuka_kr300", {184, 545, 294, 51.8, 94.8, 39.5}, 1.0, 0.80},
                                         // Its baseline knows a piece of physics that is not in the nominal list.
                                         RealSet{"staubli_tx40", {1.85, 4.13, 1.06, 0.590, 1.01, 1.16}, 1.3, 0.90},
                                         RealSet{"ur10_unisa", {3.03, 3.37, 2.13, 0.851, 0.358, 1.00}, 0.85, 0.60}),
                         [](const auto& set) { return set.param.name; });

}  // namespace
}  // namespace fxdyn
