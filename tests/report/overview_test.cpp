// The first screen: what each joint's answer and colour are, the sketch, the drive's line.

#include "host_tools/effects/identified_model.hpp"
#include "host_tools/report/drive_line.hpp"
#include "host_tools/report/joint_answer.hpp"
#include "host_tools/report/robot_sketch.hpp"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "firmware/tick_budget.hpp"
#include "host_tools/regression/metrics_result.hpp"
#include "host_tools/report/export_result.hpp"
#include "host_tools/report/replay_result.hpp"
#include "tests/diagnose/example.hpp"
#include "tests/simulate/support.hpp"
#include "tests/support/files.hpp"

namespace fxdyn {
namespace {

using nlohmann::json;

/// Four joints of 20 N*m, as in test::diagnosis(): explained, unexplained, nothing missing, not excited.
struct Page {
  Page() {
    model = test::plant_of(read_urdf(test::puma560));
    model.joints.resize(4);
    model.robot.joints.resize(4);
    model.inertia.resize(4);
    for (JointFit& joint : model.joints) joint.rated_torque = 20;
    results.role = "test";
    results.files["diagnosis"] = test::diagnosis();
    results.files["diagnosis"]["next_experiment"] =
        "record more of joint 2, at reversals, below 0.1 rad/s; presliding or lugre at joint 2: slow reversals; "
        "stribeck at joint 12: creeping; payload: the same motions recorded without it";
  }
  /// Metrics with this error of every joint on the test logs, in two stages.
  void set_errors(const std::array<double, 4>& friction, const std::array<double, 4>& diagnosed) {
    MetricsResult metrics;
    for (const auto& [stage, errors] : {std::pair{"friction", friction}, std::pair{"diagnosed", diagnosed}}) {
      LogErrors log{"a.csv", Role::test, 0, 1, {}};
      for (const double rmse : errors) log.joints.push_back({"j", "N*m", {rmse, 0.1, rmse, 0.1, 0}});
      metrics.logs = {log};
      metrics.stages.push_back({stage, metrics.logs});
    }
    results.files["metrics"] = to_json(metrics);
  }
  ReportInput input() const { return {model, logs, results, directory, settings}; }
  std::vector<JointAnswer> answers() const { return joint_answers(input()); }
  std::string section() const {
    const auto sections = report_sections();
    return draw_sections(input(), sections.subspan(0, 1));
  }
  IdentifiedModel model;
  std::vector<ProcessedLog> logs;
  Results results;
  std::filesystem::path directory = test::folder();
  ReportSettings settings;
};

TEST(JointAnswers, ColourFollowsWhatIsLeftOfRatedTorqueThenStructureThenTheTestLogs) {
  Page page;
  page.set_errors({1.9, 0.9, 0.1, 3}, {0.4, 0.9, 0.1, 3});  // 2 %, 4.5 %, 0.5 %, 15 % of rated
  auto answers = page.answers();
  ASSERT_EQ(answers.size(), 4U);
  EXPECT_EQ(answers[0].mood, Mood::calm) << "above good_enough, but what is left is noise";
  EXPECT_EQ(answers[0].word, "noise is left");
  EXPECT_EQ(answers[2].word, "good");
  EXPECT_EQ(answers[1].mood, Mood::red);
  EXPECT_EQ(answers[2].mood, Mood::calm);
  EXPECT_EQ(answers[3].mood, Mood::unknown);

  page.results.files["diagnosis"]["joints"][0]["carries_over"] = false;
  EXPECT_EQ(page.answers()[0].mood, Mood::amber);
  page.settings.good_enough = 0.02;
  EXPECT_EQ(page.answers()[0].mood, Mood::calm) << "2 % is good enough now";
  EXPECT_EQ(page.answers()[1].mood, Mood::red);
  page.settings.good_enough = 0.05;
  EXPECT_EQ(page.answers()[1].mood, Mood::calm);
  EXPECT_EQ(page.answers()[3].mood, Mood::unknown) << "it never moved";
}

TEST(JointAnswers, AmberWhereAnotherStageIsBetterOnTheTestLogsOnly) {
  Page page;
  page.set_errors({0.3, 0.9, 0.1, 3}, {0.4, 0.9, 0.1, 3});
  EXPECT_EQ(page.answers()[0].mood, Mood::amber);
  page.results.role = "validate";  // no test log: nothing that could disagree
  EXPECT_NE(page.answers()[0].mood, Mood::amber);
}

TEST(JointAnswers, WithoutADiagnosisNothingIsKnownAboveGoodEnough) {
  Page page;
  page.set_errors({1.9, 0.9, 0.1, 3}, {0.4, 0.9, 0.1, 3});
  page.results.files["diagnosis"] = nullptr;
  EXPECT_EQ(page.answers()[0].mood, Mood::unknown);
  EXPECT_EQ(page.answers()[0].next, "Run fxdyn diagnose.");
  EXPECT_EQ(page.answers()[2].mood, Mood::calm);
}

TEST(JointAnswers, SayWhatWasFoundWhatItBringsAndWhatToDoNext) {
  Page page;
  page.set_errors({1.9, 0.9, 0.1, 3}, {0.4, 0.9, 0.1, 3});
  const auto answers = page.answers();
  EXPECT_EQ(answers[0].found, "Stribeck found");
  EXPECT_EQ(answers[0].brings, "error 1.9 → 0.4 N*m (-79 %)");
  EXPECT_EQ(*answers[0].share(), 0.02);
  EXPECT_EQ(answers[1].found, "Presliding or lugre (these logs do not tell which) found");
  EXPECT_NE(answers[1].next.find("90 % of the gap is in negative direction"), std::string::npos) << answers[1].next;
  EXPECT_TRUE(answers[1].next.ends_with("Slow reversals.")) << answers[1].next;
  EXPECT_EQ(answers[2].found, "Nothing is missing");
  EXPECT_EQ(answers[3].found, "The logs hardly move it");
  EXPECT_EQ(answers[3].next, "Record motion that moves it.");
}

TEST(Overview, HasEveryJointTheSketchAndTheDrive) {
  Page page;
  page.set_errors({1.9, 0.9, 0.1, 3}, {0.4, 0.9, 0.1, 3});
  page.model.robot.joints[1].name = "<b>elbow</b>" + std::string(200, 'x');
  const std::string html = page.section();
  for (const char* part : {"id=\"joint-4\"", "2 of 4 joints are good", "structure is left: 1", "class=\"disc bad\"",
                           "no tables yet: run fxdyn export", "Left: 4.5 % of rated", "payload mass 2 ± 0.1 kg",
                           "To learn more:</strong> payload: the same motions recorded without it.</p>"})
    EXPECT_NE(html.find(part), std::string::npos) << part << " not in " << html;
  EXPECT_EQ(html.find("<b>elbow"), std::string::npos);
  page.set_errors({1.9, 0.9, 0.1, 3}, {0.04, 0.09, 0.1, 0.1});
  page.results.files["diagnosis"] = nullptr;
  EXPECT_NE(page.section().find("All 4 joints are good: at most 0.5 % of rated torque is left"), std::string::npos);
}

TEST(Sketch, DrawsEveryJointOnceInsideThePictureEvenOfFortyAtOnePlace) {
  Robot robot;
  robot.name = "many";
  std::vector<JointAnswer> answers;
  for (int j = 0; j < 40; ++j) {
    Joint joint;
    joint.name = "j" + std::to_string(j);
    joint.type = j % 3 == 0 ? JointType::prismatic : JointType::revolute;
    joint.origin.translation() = Eigen::Vector3d(0, 0, j < 4 ? 0.3 : 0);  // the rest at the fourth's place
    robot.joints.push_back(joint);
    answers.push_back({joint.name, "N*m"});
  }
  const std::string svg = robot_sketch(robot, answers);
  std::size_t discs = 0;
  for (std::size_t at = svg.find("class=\"disc"); at != std::string::npos; at = svg.find("class=\"disc", at + 1))
    ++discs;
  EXPECT_EQ(discs, 40U);
  EXPECT_EQ(svg.find("nan"), std::string::npos);
  EXPECT_EQ(robot_sketch(robot, answers), svg);
}

ReplayResult replayed(std::int64_t different) {
  ReplayResult out;
  out.image = "mps2-an386.elf";
  ReplayedLog log;
  log.name = "a";
  log.ticks = 1000;
  log.different_ticks = different;
  log.fewest = log.most = 10'000;
  out.logs = {log};
  out.size = ImageSize{20'480, 4'096, 1'000};
  return out;
}

TEST(DriveLine, SaysInstructionsTimeMemoryAndWhetherItIsBitExact) {
  Results results;
  EXPECT_EQ(drive_line(results), "no tables yet: run fxdyn export");
  results.files["replay"] = to_json(replayed(0));
  const std::string exact = drive_line(results);
  for (const char* part : {"10000 instructions a tick on Cortex-M4", "at most 188 µs on an STM32G4 at 170 MHz",
                           "20.0 KiB flash, 4.0 KiB RAM", "bit-exact in 1000 ticks"})
    EXPECT_NE(exact.find(part), std::string::npos) << part << " not in " << exact;
  results.files["replay"] = to_json(replayed(3));
  EXPECT_NE(drive_line(results).find("3 of 1000 ticks DIFFER"), std::string::npos);
}

TEST(DriveLine, CountsCyclesAsTheFirmwaresOwnBudgetDoes) {
  EXPECT_EQ(100 * stm32g4_cycles_per_instruction, cycles_per_instruction::stm32g4_no_caches.hundredths);
}

}  // namespace
}  // namespace fxdyn
