#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "host_tools/pipeline/pipeline.hpp"
#include "host_tools/project/project.hpp"
#include "host_tools/regression/dataset.hpp"
#include "host_tools/regression/metrics.hpp"
#include "host_tools/simulate/recordings.hpp"
#include "tests/support/data.hpp"
#include "tests/support/files.hpp"
#include "tests/support/filter.hpp"

namespace fxdyn {
namespace {

namespace fs = std::filesystem;

/// What the published baseline was judged with: base parameters + rotor inertia + Coulomb + viscous + offset by least
/// squares.
struct RealSet {
  std::string name;
  double position_hz, torque_hz, edge_s;  ///< its cut-offs
  std::vector<double> baseline;           ///< its held-out RMSE, N*m or N
  double goal;                            ///< largest geometric mean of ours / baseline
  double diagnosed;                       ///< likewise before training
};

void PrintTo(const RealSet& set, std::ostream* out) { *out << set.name; }

/// Geometric mean over the joints of held-out RMSE / baseline, at the baseline's cut-offs.
double mean_ratio(const RealSet& set, const Project& project, const IdentifiedModel& model, const fs::path& out) {
  double sum = 0;
  for (const Log& log : read_logs(project, Role::test, out)) {
    FilterFit filter = test::filter_of(set.position_hz, set.torque_hz, set.edge_s);
    filter.crossing_hz = model.filter.crossing_hz;  // what the model says of its own motion
    const ProcessedLog held_out = process(log, filter);
    const std::vector<JointMetrics> metrics = judge(held_out, predict(model, held_out));
    EXPECT_EQ(metrics.size(), set.baseline.size());
    for (std::size_t j = 0; j < metrics.size(); ++j) {
      const double ratio = metrics[j].rmse / set.baseline[j];
      sum += std::log(ratio);
      fmt::print(" {:.3g} ({:.1f} %, x{:.2f})", metrics[j].rmse, 100 * metrics[j].relative, ratio);
    }
  }
  const double mean = std::exp(sum / static_cast<double>(set.baseline.size()));
  fmt::print("  geometric mean x{:.3f}\n", mean);
  return mean;
}

class Real : public testing::TestWithParam<RealSet> {};

// Default settings: the projects choose no cut-offs.
TEST_P(Real, HeldOutErrorIsNoWorseThanTheBaseline) {
  const RealSet& set = GetParam();
  FXDYN_NEEDS_DATA(set.name);
  const fs::path out = test::folder() / set.name;
  const fs::path file = fs::path(FXDYN_SOURCE_DIR) / "tests" / "real" / (set.name + ".toml");
  const Project project = read_project(file);
  Pipeline pipeline(file, out);
  pipeline.diagnose();
  fmt::print("{:<14} diagnosed", set.name);
  EXPECT_LE(mean_ratio(set, project, read_model(out / "model.json"), out), set.diagnosed);
  pipeline.run();
  fmt::print("{:<14} trained  ", set.name);
  EXPECT_LE(mean_ratio(set, project, read_model(out / "model.json"), out), set.goal);
}

// Limits: 2 % above what was measured, docs/findings/benchmarks.md, which has the goals, too.
INSTANTIATE_TEST_SUITE_P(
    Sets, Real,
    testing::Values(RealSet{"emps", 100, 40, 0.05, {3.22}, 0.607, 0.607},
                    RealSet{"kuka_kr300", 20, 15, 0.25, {184, 545, 294, 51.8, 94.8, 39.5}, 0.580, 0.616},
                    // Its baseline knows a piece of physics that is not in the nominal list; the torque's default band
                    // is too narrow for it.
                    RealSet{"staubli_tx40", 100, 40, 0.05, {1.85, 4.13, 1.06, 0.590, 1.01, 1.16}, 0.912, 0.912},
                    RealSet{"ur10_unisa", 20, 12, 0.25, {3.03, 3.37, 2.13, 0.851, 0.358, 1.00}, 0.546, 0.546}),
    [](const auto& set) { return set.param.name; });

}  // namespace
}  // namespace fxdyn
