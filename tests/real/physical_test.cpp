#include "host_tools/regression/physical.hpp"
#include "host_tools/effects/identified_model.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <chrono>

#include "host_tools/effects/evaluator.hpp"
#include "host_tools/identify/identify.hpp"
#include "host_tools/identify/plausible.hpp"
#include "host_tools/regression/metrics.hpp"
#include "host_tools/robot/write_urdf.hpp"
#include "host_tools/simulate/recordings.hpp"
#include "tests/support/data.hpp"
#include "tests/support/files.hpp"

namespace fxdyn {
namespace {

namespace fs = std::filesystem;

/// Nominal effects, the widths as they start.
std::vector<JointFit> nominal(const Project& project, const GateData& data) {
  std::vector<JointFit> joints = initial_joints(project, data);
  for (JointFit& joint : joints) {
    for (const char* name : {"viscous", "coulomb", "offset"}) {
      EffectFit effect;
      effect.effect = name;
      joint.effects.push_back(effect);
    }
  }
  return joints;
}

class RealPhysical : public testing::TestWithParam<const char*> {};

TEST_P(RealPhysical, HeldOutErrorStaysWithinTwoPercentOfTheUnconstrainedFit) {
  const std::string set = GetParam();
  FXDYN_NEEDS_DATA(set);
  const fs::path out = test::folder() / set;
  const Project project = read_project(fs::path(FXDYN_SOURCE_DIR) / "tests" / "real" / (set + ".toml"));
  GateData data = read_gate_data(project, out);
  Progress progress;
  const auto fitter = identify(project, data, progress);
  const auto start = std::chrono::steady_clock::now();
  const PhysicalFit fit = fit_physical(*fitter, project.robot);
  const double ms = std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
  const IdentifiedModel models[] = {fitter->to_model(fitter->fit()),
                                    fitter->to_model(physical_solution(fitter->fit(), fit))};

  double sum = 0;
  fmt::print("{}: {} ms, {}, {:.1f} kg, prior: {}\n", set, static_cast<int>(ms),
             fit.constrained ? "constrained" : "free", fit.mass, fit.prior);
  for (const Log& log : read_logs(project, Role::test, out)) {
    const ProcessedLog processed = process(log, data.filter);
    std::vector<JointMetrics> metrics[2];
    for (int k = 0; k < 2; ++k) metrics[k] = judge(processed, predict(models[k], processed));
    for (std::size_t j = 0; j < project.robot.size(); ++j) {
      const double ratio = metrics[1][j].rmse / metrics[0][j].rmse;
      fmt::print("  joint {}: {:.4g} -> {:.4g} (x{:.3f})\n", j + 1, metrics[0][j].rmse, metrics[1][j].rmse, ratio);
      sum += std::log(ratio);
    }
  }
  const double mean = std::exp(sum / static_cast<double>(project.robot.size()));
  fmt::print("  geometric mean x{:.4f}\n", mean);
  EXPECT_LE(mean, 1.02);
  for (std::size_t i = 0; i < fit.inertia.size(); ++i) {
    EXPECT_GT(fit.smallest_eigenvalue[i], 0);
    const LinkMass link = mass_check(project.robot, to_dh(project.robot), fit).links[i];
    fmt::print("  {}: {:.3g} kg (data {:.2f}), centre {:.3f} {:.3f} {:.3f} (data {:.2f} {:.2f} {:.2f})\n", link.link,
               link.identified.mass, link.share.mass, link.identified.centre.x(), link.identified.centre.y(),
               link.identified.centre.z(), link.share.centre.x(), link.share.centre.y(), link.share.centre.z());
  }
}

TEST_P(RealPhysical, TheWrittenUrdfHasTheFitsTorque) {
  const std::string set = GetParam();
  FXDYN_NEEDS_DATA(set);
  const fs::path out = test::folder() / (set + "_urdf");
  const Project project = read_project(fs::path(FXDYN_SOURCE_DIR) / "tests" / "real" / (set + ".toml"));
  GateData data = read_gate_data(project, out);
  const Fitter fitter(project.robot, data.logs, nominal(project, data));
  const PhysicalFit fit = fit_physical(fitter, project.robot);
  const DhChain chain = to_dh(project.robot);
  write_urdf(project.urdf, out / "identified.urdf", project.robot, chain, fit.inertia);
  Robot back = read_urdf(out / "identified.urdf");
  back.gravity = project.robot.gravity;
  IdentifiedModel from_fit, from_urdf;
  from_fit.robot = from_urdf.robot = back;
  from_fit.inertia = fit.inertia;
  for (std::size_t i = 0; i < back.size(); ++i)
    from_urdf.inertia.push_back(to_link_inertia(*back.joints[i].inertial, chain.urdf_in_dh[i]));
  from_fit.joints.resize(back.size());
  from_urdf.joints.resize(back.size());
  const ProcessedLog& log = data.logs.front();
  const Eigen::MatrixXd expected = predict(from_fit, log);
  EXPECT_LT((predict(from_urdf, log) - expected).norm(), 1e-9 * expected.norm());
}

TEST_P(RealPhysical, TheChecksNameATurnedSignAndNothingElse) {
  const std::string set = GetParam();
  FXDYN_NEEDS_DATA(set);
  const Project project = read_project(fs::path(FXDYN_SOURCE_DIR) / "tests" / "real" / (set + ".toml"));
  const GateData data = read_gate_data(project, test::folder());
  const auto joints = initial_joints(project, data);
  for (const Suspicion& suspicion : check_plausible(project.robot, data.logs, joints)) ADD_FAILURE() << suspicion.text;
  int named = 0;
  const auto n = static_cast<Eigen::Index>(joints.size());
  for (Eigen::Index j = 0; j < n; ++j) {
    std::vector<ProcessedLog> logs = data.logs;
    for (ProcessedLog& log : logs) log.tau.col(j) *= -1;
    for (const Suspicion& suspicion : check_plausible(project.robot, logs, joints)) {
      fmt::print("  {} joint {} turned: {}\n", set, j + 1, suspicion.text);
      if (suspicion.severity == Severity::error) {
        EXPECT_EQ(suspicion.joint.value_or(0), static_cast<std::size_t>(j));
        ++named;
      }
    }
  }
  EXPECT_EQ(named, n);
}

/// Torques of all joints in other units: said once, of the robot and not of a joint. A slide has no reach that its mass
/// could be held against, so nothing is said of EMPS.
TEST_P(RealPhysical, TheChecksNameOtherUnits) {
  const std::string set = GetParam();
  FXDYN_NEEDS_DATA(set);
  const Project project = read_project(fs::path(FXDYN_SOURCE_DIR) / "tests" / "real" / (set + ".toml"));
  const GateData data = read_gate_data(project, test::folder());
  const auto joints = initial_joints(project, data);
  for (const auto& [factor, unit] : {std::pair(1e3, "mN*m or motor current"), {1e-3, "kN*m, or on the motor's side"}}) {
    std::vector<ProcessedLog> logs = data.logs;
    for (ProcessedLog& log : logs) log.tau *= factor;
    int named = 0;
    for (const Suspicion& suspicion : check_plausible(project.robot, logs, joints)) {
      fmt::print("  {} x{:g}: {}\n", set, factor, suspicion.text);
      EXPECT_EQ(suspicion.severity, Severity::warning) << suspicion.text;
      named += !suspicion.joint.has_value() && suspicion.text.find(unit) != std::string::npos;
    }
    EXPECT_EQ(named, set == "emps" ? 0 : 1) << "x" << factor;
  }
}

INSTANTIATE_TEST_SUITE_P(Sets, RealPhysical, testing::Values("emps", "kuka_kr300", "staubli_tx40", "ur10_unisa"),
                         [](const auto& set) { return std::string(set.param); });

}  // namespace
}  // namespace fxdyn
