// The table of sections, and what the report shows of compare.json, vibration.json and efficiency.json.

#include "host_tools/report/section.hpp"
#include "host_tools/effects/identified_model.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>

#include "host_tools/page/comparison_plots.hpp"
#include "host_tools/regression/metrics_result.hpp"
#include "host_tools/support/files.hpp"
#include "tests/diagnose/example.hpp"
#include "tests/diagnose/small_log.hpp"
#include "tests/support/files.hpp"

namespace fxdyn {
namespace {

using nlohmann::json;

void expect_all(const std::string& page, const std::vector<std::string>& parts) {
  for (const std::string& part : parts) EXPECT_NE(page.find(part), std::string::npos) << part << " not in " << page;
}

/// The page without what narrow screens show in front of a cell.
std::string without_labels(std::string page) {
  const std::string label = " data-label=\"";
  for (std::size_t at = page.find(label); at != std::string::npos; at = page.find(label, at))
    page.erase(at, page.find('"', at + label.size()) + 1 - at);
  return page;
}

/// What the section of that name draws from its result; for those that show the model or the logs, from these too.
std::string drawn(std::string_view name, const json& result, const std::filesystem::path& directory = test::folder(),
                  const IdentifiedModel& model = {}, const std::vector<ProcessedLog>& logs = {}) {
  const auto sections = report_sections();
  const auto section = std::find_if(sections.begin(), sections.end(), [&](const auto& s) { return s.name == name; });
  if (section == sections.end()) return "no such section";
  Results results;
  results.files[std::string(section->needs.name)] = result;
  return without_labels(draw_sections({model, logs, results, directory}, {&*section, 1}));
}

TEST(Sections, EachHasItsName) {
  std::set<std::string_view> names;
  for (const ReportSection& section : report_sections()) EXPECT_TRUE(names.insert(section.name).second) << section.name;
  EXPECT_TRUE(names.contains("replay"));
}

TEST(Sections, OneThatIsAlwaysDrawnSaysHowToMakeItsResult) {
  expect_all(drawn("replay", nullptr), {"<h2>Replay on the firmware</h2>", "run fxdyn replay"});
  expect_all(drawn("fixed_point", nullptr), {"run fxdyn export"});
}

TEST(Sections, OneMoreIsDrawnInItsPlace) {
  constexpr ReportSection first{"first", {"numbers"}, false, [](const ReportInput&, const json& result) {
                                  return "first " + std::to_string(result.at("count").get<int>()) + "\n";
                                }};
  constexpr ReportSection second{"second", {""}, true, [](const ReportInput& input, const json&) {
                                   return "second " + input.results.role + "\n";
                                 }};
  const std::array both{first, second};
  const IdentifiedModel model;
  const std::vector<ProcessedLog> logs;
  Results results;
  results.role = "test";
  const auto directory = test::folder();
  const ReportInput input{model, logs, results, directory};
  EXPECT_EQ(draw_sections(input, both), "second test\n");
  results.files["numbers"] = {{"count", 3}};
  EXPECT_EQ(draw_sections(input, both), "first 3\nsecond test\n");
}

TEST(ModelSections, ShowBaseParametersAndEffects) {
  IdentifiedModel model = test::plant_of(read_urdf(test::puma560));
  BaseParameter parameter;
  parameter.column = 21;
  parameter.name = "hx3";
  parameter.value = -1.5;
  parameter.std = 0.75;
  model.base = {parameter};
  model.joints[1].effects = {test::effect("viscous", {}, {2.25})};
  const auto nowhere = test::folder();
  expect_all(drawn("base", nullptr, nowhere, model),
             {"<h2>Base parameters</h2>", "hx3", "-1.5", "0.75", "50 %", "kg*m", "scale with torque_gain"});
  expect_all(drawn("effects", nullptr, nowhere, model),
             {"<h2>Effects</h2>", "viscous", "coefficient = 2.25 N*m*s/rad"});
}

/// Metrics of two joints: their errors in three stages, on the validate log and on the test log.
MetricsResult metrics(const std::vector<std::array<double, 2>>& validate,
                      const std::vector<std::array<double, 2>>& shown) {
  MetricsResult out;
  const std::vector<std::string> names{"friction", "diagnosed", "bls"};
  for (std::size_t s = 0; s < names.size(); ++s) {
    out.logs.clear();
    for (const auto& [role, errors] : {std::pair{Role::validate, validate[s]}, std::pair{Role::test, shown[s]}}) {
      LogErrors log{"a.csv", role, 0, 1, {}};
      for (const double rmse : errors) log.joints.push_back({"j", "N*m", {rmse, 0.1, rmse, 0.1, 0}});
      out.logs.push_back(log);
    }
    out.stages.push_back({names[s], out.logs});
  }
  const std::vector<std::string> exported{"bls", "diagnosed"};
  for (std::size_t j = 0; j < 2; ++j)
    out.gate_errors.push_back({"j", "N*m", validate[0][j], validate[1][j], validate[2][j], exported[j]});
  return out;
}

/// A section of two joints, its results on test logs.
std::string section_page(std::string_view name, const MetricsResult& metrics, double rated = 20) {
  IdentifiedModel model = test::plant_of(read_urdf(test::puma560));
  for (JointFit& joint : model.joints) joint.rated_torque = rated;
  model.joints.resize(2);
  model.robot.joints.resize(2);
  model.inertia.resize(2);
  Results results;
  results.files["metrics"] = to_json(metrics);
  results.role = "test";
  const auto sections = report_sections();
  const auto section = std::find_if(sections.begin(), sections.end(), [&](const auto& s) { return s.name == name; });
  const std::vector<ProcessedLog> logs;
  const auto directory = test::folder();
  return without_labels(draw_sections({model, logs, results, directory}, {&*section, 1}));
}

TEST(ErrorSection, TheExportedStageIsGreenWhereItIsTheBest) {
  const std::string page = section_page(
      "error", metrics({{{2.5, 3.5}, {0.75, 1.25}, {0.5, 1.25}}}, {{{2.6, 3.6}, {0.85, 1.35}, {0.55, 1.35}}}));
  expect_all(page, {"<td class=\"\">+ BLS: exported</td><td class=\"n\">0.5</td><td class=\"n good\">0.55</td>",
                    "<td class=\"\">+ diagnosed: exported</td><td class=\"n\">1.25</td><td class=\"n good\">1.35</td>",
                    "<td class=\"\">+ BLS</td><td class=\"n\">1.25</td><td class=\"n\">1.35</td>"});
  EXPECT_EQ(page.find("amber\""), std::string::npos);
}

TEST(ErrorSection, ItIsAmberWhereTheTestLogsOrTheGateSayOtherwise) {
  // On the test logs joint 1 was better before it got a BLS; on the gate joint 2 was better without any effect.
  const std::string page = section_page(
      "error", metrics({{{2.5, 1.15}, {0.75, 1.25}, {0.5, 1.25}}}, {{{2.6, 3.6}, {0.85, 1.35}, {0.95, 1.35}}}));
  expect_all(page,
             {"<td class=\"\">+ BLS: exported</td><td class=\"n\">0.5</td><td class=\"n amber\">0.95</td>",
              "<td class=\"\">+ diagnosed: exported</td><td class=\"n\">1.25</td><td class=\"n amber\">1.35</td>"});
  EXPECT_EQ(page.find("n good"), std::string::npos);
}

TEST(ErrorSection, WhatIsGoodEnoughIsGreenWhateverTheOtherStages) {
  // 0.95 and 1.35 N*m are within 1 % of 140 N*m, the second is not of 120.
  const MetricsResult result =
      metrics({{{2.5, 1.15}, {0.75, 1.25}, {0.5, 1.25}}}, {{{2.6, 3.6}, {0.85, 1.35}, {0.95, 1.35}}});
  const std::string all = section_page("error", result, 140), one = section_page("error", result, 120);
  expect_all(all, {"<td class=\"n good\">0.95</td>", "<td class=\"n good\">1.35</td>"});
  expect_all(one, {"<td class=\"n good\">0.95</td>", "<td class=\"n amber\">1.35</td>"});
}

TEST(BlsSection, ABlsThatTheTestLogsDoNotLikeIsKeptInAmber) {
  MetricsResult result = metrics({{{2.5, 3.5}, {0.75, 1.25}, {0.5, 1.05}}}, {{{2.6, 3.6}, {0.85, 1.35}, {0.95, 1.15}}});
  result.training.emplace();
  for (const double with : {0.5, 1.05}) {
    TrainedJoint joint{"j", "N*m", 1.5 * with, with, true, 7, {}};
    joint.choice = TrainedJoint::Choice{.nodes = 12};
    result.training->push_back(joint);
  }
  const std::string page = section_page("bls", result);
  expect_all(page, {"<td class=\"amber\">kept</td><td class=\"n\">0.85</td><td class=\"n\">0.95</td>",
                    "<td class=\"good\">kept</td><td class=\"n\">1.35</td><td class=\"n\">1.15</td>",
                    "What the search settled on", "<td class=\"n\">12</td>"});
  result.training->at(0).choice.reset();
  result.training->at(0).kept = false;
  expect_all(section_page("bls", result),
             {"<td class=\"n\">-</td><td class=\"\">none that fixed point could hold</td>"});
}

TEST(DiagnosisSection, AJointThatTheTestLogsDoNotBearOutIsAmberWithBothFigures) {
  json diagnosis = test::diagnosis();
  json& shoulder = diagnosis["joints"][0];
  shoulder["gap_before"] = 9.47;
  shoulder["gap_after"] = 23.4;
  shoulder["gate_before"] = 21.5;
  shoulder["gate_after"] = 18.5;
  shoulder["carries_over"] = false;
  diagnosis["verdict"] = "explained";
  const std::string page = drawn("diagnosis", diagnosis);
  expect_all(page, {"<td class=\"amber\">explained</td>", "The test logs disagree: with what was found",
                    "shoulder (9.47 -&gt; 23.4 N*m; 21.5 -&gt; 18.5 on the gate data)",
                    "<td class=\"n\">21.5</td><td class=\"n\">18.5</td>"});
  EXPECT_EQ(page.find("what is left is noise"), std::string::npos);
  shoulder["carries_over"] = true;
  expect_all(drawn("diagnosis", diagnosis), {"<td class=\"good\">explained</td>", "what is left is noise"});
}

TEST(TorqueSection, DrawsEveryJointOfEveryLog) {
  const IdentifiedModel model = test::plant_of(read_urdf(test::puma560));
  const std::vector<ProcessedLog> logs{test::small_log(model, Role::test, 1)};
  const std::string page = drawn("torque", nullptr, test::folder(), model, logs);
  for (const Joint& joint : model.robot.joints)
    expect_all(page, {"<figcaption>" + joint.name + " in small.csv: RMSE "});
  expect_all(page, {"<h2>Torque, measured and predicted</h2>", "<svg"});
}

json method(const std::string& name, double percent, const json& fixed) {
  return {{"name", name},
          {"rmse", {0.5, 0.25}},
          {"percent_rated", {percent, percent / 2}},
          {"mean_percent_rated", 0.75 * percent},
          {"peak", {1.5, 0.75}},
          {"smoothness", 1.25},
          {"macs_per_tick", 321},
          {"train_s", nullptr},
          {"predict_us", 2.5},
          {"fixed_error", fixed}};
}

json comparison(bool paper) {
  return {
      {"against", "truth"}, {"paper", paper}, {"methods", {method("rls", 2, 1.5e-5), method("bls_pso", 4, nullptr)}}};
}

TEST(ComparisonSection, HasEveryMethodAndJoint) {
  EXPECT_EQ(drawn("comparison", nullptr), "");
  const std::string page = drawn("comparison", comparison(false));
  expect_all(page, {"<h2>Methods compared</h2>", "against the truth", "rls", "bls_pso", "1.500 %", "3.000 %", "2 %",
                    "1 %", "321", "1.5e-05", "0.5, 1.5", "0.25, 0.75", "joint 2"});
  EXPECT_EQ(page.find("Table 2"), std::string::npos);
}

TEST(ComparisonSection, ShowsThePapersTableAndThePicturesThatAreThere) {
  const auto directory = test::folder() / "pictures";
  write_file(directory / "plots" / comparison_plots[2].file, "<svg>picture</svg>");
  const std::string page = drawn("comparison", comparison(true), directory);
  // Mean of the joints' RMSE; the MLP, which was not run, has no row.
  expect_all(page, {"Table 2", "0.375", "0.11723", "0.10893", ">picture</svg>", comparison_plots[2].title});
  EXPECT_EQ(page.find("0.11116"), std::string::npos);
  EXPECT_EQ(page.find(comparison_plots[1].title), std::string::npos);
}

json move(double motor) {
  return {{"tracking_motor", motor}, {"tracking_link", 0.44}, {"residual", 0.017},  {"residual_late", 0.0091},
          {"settling_s", 0.123},     {"still_s", 0.287},      {"roughness", 0.0016}};
}

TEST(VibrationSection, HasATableOfEveryKindOfMove) {
  EXPECT_EQ(drawn("vibration", nullptr), "");
  json moves;
  for (const char* kind : {"all", "point_to_point", "reversals", "slow"}) moves[kind] = move(0.0137);
  const json vibration = {
      {"control",
       {{"bandwidth_hz", 32},
        {"damping", 0.3},
        {"tick_s", 0.002},
        {"encoder_step", 1.5e-6},
        {"settling_band", 3e-4},
        {"late_s", 0.132},
        {"grid", {{"bandwidth_hz", {32}}, {"damping", {0.3}}}}}},
      {"methods",
       {{{"feedforward", "rigid"}, {"numbers", "fixed"}, {"parameters_off", "-20 %"}, {"moves", moves}},
        {{"feedforward", "model_elastic_shaped"},
         {"numbers", "fixed"},
         {"parameters_off", "none"},
         {"path", {{"kind", "shaped"}, {"delay_s", {0.104, 0.082}}, {"cut_short", 1.73}}},
         {"moves", moves}}}}};
  expect_all(drawn("vibration", vibration), {"<h2>Vibration</h2>",
                                             "PD of 32 Hz",
                                             "damping 0.3",
                                             "tick 2 ms",
                                             "Moves: all",
                                             "Moves: point_to_point",
                                             "Moves: reversals",
                                             "Moves: slow",
                                             "rigid",
                                             "-20 %",
                                             "0.0137",
                                             "0.44",
                                             "0.017",
                                             "123",
                                             "0.0016",
                                             "0.0091",
                                             "287",
                                             "model_elastic_shaped",
                                             "82 .. 104",
                                             "1.73"});
}

TEST(EfficiencySection, DrawsACurveOfEveryMethodThatHasFigures) {
  EXPECT_EQ(drawn("efficiency", nullptr), "");
  const auto point = [](double seconds, double slow) {
    return json{
        {"seconds", seconds}, {"slow_share", slow}, {"percent_rated", {{"lugre", 0.1 * seconds}, {"mlp", nullptr}}}};
  };
  const json efficiency = {{"curve", {point(5, 0.5), point(10, 0.5)}}, {"mix", {point(10, 0), point(10, 0.5)}}};
  const std::string page = drawn("efficiency", efficiency);
  expect_all(page, {"<h2>Error against seconds of data</h2>", "<svg", "lugre", "lugre, 10 s", "seconds of train data",
                    "share of slow motion"});
  EXPECT_EQ(page.find("mlp"), std::string::npos);  // it failed everywhere
}

}  // namespace
}  // namespace fxdyn
