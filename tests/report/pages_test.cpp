// Whole pages of report.html: what stands in them, and the pages that tests/report/browser opens: it sets FXDYN_PAGES.

#include "host_tools/effects/identified_model.hpp"
#include "host_tools/report/report.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <chrono>
#include <cstdlib>
#include <nlohmann/json.hpp>

#include "host_tools/page/diagnosis_plot.hpp"
#include "host_tools/page/live_plot.hpp"
#include "host_tools/page/plot.hpp"
#include "host_tools/regression/metrics_result.hpp"
#include "host_tools/report/replay_result.hpp"
#include "host_tools/support/files.hpp"
#include "tests/diagnose/example.hpp"
#include "tests/diagnose/small_log.hpp"
#include "tests/support/files.hpp"

namespace fxdyn {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

/// A robot with results of every kind.
struct Case {
  explicit Case(const std::string& name, const Robot& robot = read_urdf(test::puma560)) : name(name) {
    model = test::plant_of(robot);
    model.project = name + ".toml";
    model.stage = "trained";
    for (JointFit& joint : model.joints) {
      joint.rated_torque = 40;
      joint.effects = {test::effect("viscous", {}, {2.25}), test::effect("coulomb", {}, {1.5})};
    }
    BaseParameter parameter;
    parameter.name = "hx3";
    parameter.column = 21;
    parameter.value = -1.5;
    parameter.std = 0.75;
    model.base.assign(36, parameter);
  }

  MetricsResult metrics() const {
    MetricsResult out;
    out.gate = "the validate logs";
    out.base_parameters = model.base.size();
    for (const auto& [stage, error] : {std::pair{"rigid", 2.5}, {"friction", 1.5}, {"diagnosed", 0.5}, {"bls", 0.45}}) {
      out.logs.clear();
      for (const Role role : {Role::train, Role::validate, Role::test}) {
        LogErrors log{to_string(role) + ".csv", role, 1190, 1198.5, {}};
        for (const Joint& joint : model.robot.joints)
          log.joints.push_back({joint.name, joint.torque_unit(), {error, 0.1, error, 0.1, 0}});
        out.logs.push_back(log);
      }
      out.stages.push_back({stage, out.logs});
    }
    out.training.emplace();
    for (const Joint& joint : model.robot.joints) {
      TrainedJoint trained{joint.name, joint.torque_unit(), 0.5, 0.45, true, 7, {}};
      trained.choice = TrainedJoint::Choice{.nodes = 12};
      out.training->push_back(trained);
      out.gate_errors.push_back({joint.name, joint.torque_unit(), 1.5, 0.5, 0.45, "bls"});
    }
    return out;
  }

  /// The example's four verdicts, again and again.
  json diagnosis() const {
    json out = test::diagnosis();
    const json kinds = out.at("joints");
    out["joints"] = json::array();
    std::string& next = out["next_experiment"].get_ref<std::string&>();
    for (std::size_t j = 1; j <= model.robot.size(); ++j)
      next += fmt::format(
          "; presliding or lugre at joint {}: slow reversals of a few milliradians, and of a few degrees", j);
    for (std::size_t j = 0; j < model.robot.size(); ++j) {
      json joint = kinds.at(j % kinds.size());
      joint["joint"] = model.robot.joints[j].name;
      joint["index"] = j + 1;
      out["joints"].push_back(joint);
    }
    out["joints"][0]["carries_over"] = false;
    return out;
  }

  ReplayResult replay() const {
    ReplayResult out;
    out.image = "fxdyn-mps2-an386.elf";
    ReplayedLog log;
    log.name = "test.csv";
    log.ticks = 1000;
    log.fewest = log.most = 12'000;
    out.logs = {log};
    out.size = ImageSize{26'636, 4'064, 1'640};
    return out;
  }

  /// As full as diagnosis draws them: clouds of many samples in each of four charts.
  static std::string diagnosis_picture() {
    const Eigen::VectorXd t = Eigen::VectorXd::LinSpaced(5000, 0, 100);
    const Eigen::VectorXd x = t.array().sin(), y = (7 * t.array()).cos();
    const Chart chart{
        "velocity [rad/s]", "residual [N*m]", {{x, y, "#e4572e", 0.6, {}, true}, {x, x, "#2e6fb7", 0.6, {}, true}}};
    return draw(std::vector{chart, chart, chart, chart}, 2);
  }

  /// The page, drawn from the results.
  std::string page() const {
    const fs::path out = test::folder() / name;
    write_file(out / "metrics.json", to_json(metrics()).dump());
    write_file(out / "diagnosis.json", diagnosis().dump());
    write_file(out / "model.json", json{{"tables_crc", 0}, {"project_hash", ""}, {"logs", json::array()}}.dump());
    write_file(out / "replay.json", to_json(replay()).dump());
    const std::string plot = logs.empty() ? "" : diagnosis_picture();
    for (std::size_t j = 0; j < model.robot.size() && !plot.empty(); ++j) write_file(diagnosis_plot(out, j), plot);
    write_report(model, logs, out);
    return read_file(out / "report.html");
  }

  /// The same for the browser, if it asks.
  void hand_over(const std::string& page, bool first_screen, bool plots = false) const {
    const char* folder = std::getenv("FXDYN_PAGES");
    if (folder == nullptr) return;
    const fs::path limits = fs::path(folder) / "limits.json";
    json all = fs::exists(limits) ? json::parse(read_file(limits)) : json::object();
    all[name] = {{"joints", model.robot.size()},
                 {"first_screen", first_screen},
                 {"plots", plots},
                 {"live", logs.size() * model.robot.size()}};
    write_file(limits, all.dump());
    write_file(fs::path(folder) / (name + ".html"), page);
  }

  std::string name;
  IdentifiedModel model;
  std::vector<ProcessedLog> logs;
};

/// Two effects that were found, as diagnosis leaves them in a model.
void add_findings(IdentifiedModel& model) {
  for (std::size_t j = 0; j < model.joints.size(); ++j) {
    EffectFit stribeck = test::effect("stribeck", {0.1}, {0.8}), ripple = test::effect("ripple", {20}, {0.3, 0.2});
    stribeck.named = ripple.named = true;
    stribeck.linear_std = {0.05};
    ripple.linear_std = {0.02, 0.02};
    model.joints[j].effects.push_back(stribeck);
    model.joints[j].effects.push_back(ripple);
  }
}

TEST(Pages, SameInputSameBytesAndNothingFromElsewhere) {
  Case puma("puma");
  add_findings(puma.model);
  puma.logs = {test::small_log(puma.model, Role::test, 1)};
  const std::string page = puma.page();
  EXPECT_EQ(page, puma.page());
  for (const char* part : {"http:", "https:", "src=", "@import", "url("})
    EXPECT_EQ(page.find(part), std::string::npos) << part;
  for (const char* part : {"<a href=\"#diagnosis\">Diagnosis</a>", "<section id=\"diagnosis\">", "1190.0", "1198.5",
                           "bit-exact in 1000 ticks", "<caption>"})
    EXPECT_NE(page.find(part), std::string::npos) << part;
  EXPECT_EQ(page.find("e+03"), std::string::npos);
  puma.hand_over(page, true, true);
}

TEST(Pages, LivePlotsComeWithTheirLibraryOnceAndItsLicence) {
  if (!page::has_live_plots()) GTEST_SKIP() << "built without npm: pictures only";
  Case puma("licence");
  const std::string without = puma.page();
  EXPECT_EQ(without.find("<script"), std::string::npos);  // nothing to draw, nothing to run
  puma.logs = {test::small_log(puma.model, Role::test, 1)};
  const std::string page = puma.page();
  const std::size_t script = page.find("<script>");
  ASSERT_NE(script, std::string::npos);
  EXPECT_EQ(page.find("<script", script + 1), std::string::npos);
  EXPECT_NE(page.find("Permission is hereby granted, free of charge", script), std::string::npos);
  std::size_t figures = 0;
  for (std::size_t at = page.find("<figure class=\"live\""); at < script;
       at = page.find("<figure class=\"live\"", at + 1))
    ++figures;
  EXPECT_EQ(figures, 6U);
}

TEST(Pages, SixJointsAndSevenLogsAreAtMostTwoMegabytesInThreeSeconds) {
  Case puma("seven_logs");
  add_findings(puma.model);
  for (std::uint64_t seed = 1; seed <= 7; ++seed)
    puma.logs.push_back(test::small_log(puma.model, Role::test, seed, 0.2));
  const auto start = std::chrono::steady_clock::now();
  const std::string page = puma.page();
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  RecordProperty("bytes", std::to_string(page.size()));
  RecordProperty("seconds", std::to_string(seconds));
  EXPECT_LE(page.size(), 2'000'000U);
  fmt::print("{} bytes in {:.2f} s\n", page.size(), seconds);
  puma.hand_over(page, true);
}

TEST(Pages, NamesWithMarkupAndOfTwoHundredCharactersDoNoHarm) {
  Robot robot = read_urdf(test::puma560);
  robot.name = "<script>alert(1)</script>";
  robot.joints[0].name = "<img src=x onerror=alert(1)>";
  robot.joints[1].name = "\"&quot;'</td></table><h1>" + std::string(180, 'x');
  robot.joints[2].name = std::string(200, 'W');
  const Case hostile("hostile", robot);
  const std::string page = hostile.page();
  EXPECT_EQ(page.find("<script>alert"), std::string::npos);
  EXPECT_EQ(page.find("<img"), std::string::npos);
  EXPECT_EQ(page.find("<h1>xx"), std::string::npos);
  hostile.hand_over(page, false);
}

TEST(Pages, AHalfWrittenResultIsLeftOutAndSaid) {
  const Case puma("half");
  puma.page();
  const fs::path out = test::folder() / "half";
  write_file(out / "replay.json", read_file(out / "replay.json").substr(0, 40));
  write_file(out / "diagnosis.json", "");
  write_report(puma.model, puma.logs, out);
  const std::string page = read_file(out / "report.html");
  for (const char* part :
       {"replay.json can't be read", "diagnosis.json can't be read", "Not replayed with these tables"})
    EXPECT_NE(page.find(part), std::string::npos) << part;
  EXPECT_EQ(page.find("<section id=\"diagnosis\">"), std::string::npos);
}

TEST(Pages, OneJointAndFortyJointsAreDrawn) {
  Robot one = read_urdf(test::puma560), forty = one;
  one.joints.resize(1);
  while (forty.joints.size() < 40) {
    forty.joints.push_back(forty.joints[forty.joints.size() - 5]);
    forty.joints.back().name = fmt::format("joint_{}", forty.joints.size());
  }
  for (const auto& [name, robot] : {std::pair{"one", one}, {"forty", forty}}) {
    Case some(name, robot);
    // The sketch of one joint would be a dot: its torque stands there.
    const bool single = robot.size() == 1;
    if (single) some.logs = {test::small_log(some.model, Role::test, 1)};
    const std::string page = some.page(), last = fmt::format("id=\"joint-{}\"", robot.size());
    EXPECT_NE(page.find(last), std::string::npos);
    EXPECT_EQ(page.find(fmt::format("id=\"joint-{}\"", robot.size() + 1)), std::string::npos);
    EXPECT_EQ(page.find("<svg class=\"sketch\"") == std::string::npos, single);
    EXPECT_EQ(page.find("<h2 class=\"first\">The joint: test logs disagree<") != std::string::npos, single);
    const std::size_t first = page.find("<figcaption>Torque of ");
    EXPECT_EQ(first < page.find("<section id=\"error\">"), single);
    some.hand_over(page, single, single);
  }
}

}  // namespace
}  // namespace fxdyn
