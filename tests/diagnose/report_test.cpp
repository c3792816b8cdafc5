#include "host_tools/report/report.hpp"
#include "host_tools/effects/identified_model.hpp"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "host_tools/diagnose/plots.hpp"
#include "host_tools/page/diagnosis_plot.hpp"
#include "host_tools/pipeline/pipeline.hpp"
#include "host_tools/support/files.hpp"
#include "tests/diagnose/arm.hpp"
#include "tests/diagnose/example.hpp"

namespace fxdyn {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

/// The example, for the arm's two joints.
json arm_diagnosis() {
  json diagnosis = test::diagnosis();
  diagnosis["joints"].erase(3);
  diagnosis["joints"].erase(2);
  diagnosis["robot_effects"] = json::array();
  return diagnosis;
}

/// The same, as far as plots are drawn from it.
DiagnosisResult to_draw(Verdict elbow) {
  DiagnosisResult out;
  out.joints = {{"shoulder", "N*m", 1, Verdict::explained}, {"elbow", "N*m", 2, elbow}};
  return out;
}

std::size_t count(const std::string& text, const std::string& part) {
  std::size_t found = 0;
  for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++found;
  return found;
}

/// identify has run into DIR on the arm's first log; the second is a test log.
struct Identified {
  explicit Identified(const std::string& name) : arm(name), out(test::folder() / (name + "_out")) {
    const fs::path project = test::write(
        name + "_project.toml", "[robot]\nurdf = \"" + name + ".urdf\"\nrated_torque = [40, 15]\n[[log]]\nfile = \"" +
                                    name + "/a.csv\"\nrole = \"train\"\n[[log]]\nfile = \"" + name +
                                    "/b.csv\"\nrole = \"test\"\n[identify]\neffects = [\"viscous\", \"coulomb\"]\n");
    Pipeline pipeline(project, out);
    pipeline.identify();
    logs = pipeline.logs(Role::test);
    model = read_model(out / "model.json");
  }
  std::string report() const {
    write_report(model, logs, out);
    return read_file(out / "report.html");
  }
  test::Arm arm;
  fs::path out;
  std::vector<ProcessedLog> logs;
  IdentifiedModel model;
};

TEST(DiagnosisReport, IsInTheReportWithPlotsAndTheReportSurvivesWithoutIt) {
  const Identified run("report");
  EXPECT_EQ(run.report().find("<h2>Diagnosis</h2>"), std::string::npos);
  EXPECT_EQ(summary_table(run.out).find("diagnosis"), std::string::npos);

  const json diagnosis = arm_diagnosis();
  const IdentifiedModel truth = run.arm.truth(run.logs[0]);
  const auto plots =
      write_diagnosis_plots(test::without(truth, "stribeck"), truth, run.logs, to_draw(Verdict::unexplained), run.out);
  ASSERT_EQ(plots.size(), 2U);
  for (const fs::path& plot : plots) {
    ASSERT_TRUE(fs::exists(plot));
    const std::string svg = read_file(plot);
    EXPECT_TRUE(svg.starts_with("<svg")) << svg.substr(0, 40);
    for (const char* part : {"velocity [rad/s]", "position [rad]", "frequency [Hz]", "time [s]", "noise"})
      EXPECT_NE(svg.find(part), std::string::npos) << part;
    EXPECT_LT(svg.size(), 400'000U);
  }

  write_file(run.out / "diagnosis.json", diagnosis.dump());
  const std::string page = run.report();
  for (const char* part :
       {"<h2>Diagnosis</h2>", "stribeck", "amplitude 2.1 ± 0.05 N*m", "presliding", "17 % (12 .. 22)", "unexplained",
        "61 % of the gap is at velocity", "after, fixed point", "b.csv", "recorded motion in closed loop",
        "not positive definite", "presliding or lugre is there", "likely: 10^2 to 1 against nothing",
        "Gaps on test logs", "as a whole: gravity_tilt", "slow reversals of joint 1",
        "shoulder: residual before and after"})
    EXPECT_NE(page.find(part), std::string::npos) << part;
  EXPECT_EQ(count(page, "residual before and after</figcaption>"), 2U);
  EXPECT_NE(summary_table(run.out).find("diagnosis: unexplained"), std::string::npos);
}

TEST(DiagnosisReport, ADiagnosisOfOtherLogsIsNotShown) {
  const Identified run("stale");
  write_file(run.out / "diagnosis.json", arm_diagnosis().dump());
  IdentifiedModel nominal = run.model;
  write_file(run.out / "nominal.json", to_json(nominal).dump());
  EXPECT_NE(run.report().find("<h2>Diagnosis</h2>"), std::string::npos);
  nominal.project_hash = "another";
  write_file(run.out / "nominal.json", to_json(nominal).dump());
  EXPECT_EQ(run.report().find("<h2>Diagnosis</h2>"), std::string::npos);
}

TEST(DiagnosisReport, PlotsOfAnEarlierDiagnosisAreRemoved) {
  const Identified run("earlier");
  const IdentifiedModel truth = run.arm.truth(run.logs[0]);
  write_diagnosis_plots(run.model, truth, run.logs, to_draw(Verdict::unexplained), run.out);
  EXPECT_TRUE(fs::exists(diagnosis_plot(run.out, 1)));
  write_diagnosis_plots(run.model, truth, run.logs, to_draw(Verdict::nothing_missing), run.out);
  EXPECT_TRUE(fs::exists(diagnosis_plot(run.out, 0)));
  EXPECT_FALSE(fs::exists(diagnosis_plot(run.out, 1)));
}

}  // namespace
}  // namespace fxdyn
