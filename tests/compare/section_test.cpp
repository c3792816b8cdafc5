// What the report shows of compare.json, vibration.json and efficiency.json.

#include "host_tools/report/comparison_section.hpp"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "host_tools/compare/figures.hpp"
#include "host_tools/support/files.hpp"
#include "tests/support/files.hpp"

namespace fxdyn {
namespace {

using nlohmann::json;

void expect_all(const std::string& page, const std::vector<std::string>& parts) {
  for (const std::string& part : parts) EXPECT_NE(page.find(part), std::string::npos) << part << " not in " << page;
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
  EXPECT_EQ(comparison_section(nullptr, test::folder()), "");
  const std::string page = comparison_section(comparison(false), test::folder());
  expect_all(page, {"<h2>Methods compared</h2>", "against the truth", "rls", "bls_pso", "1.500 %", "3.000 %", "2 %",
                    "1 %", "321", "1.5e-05", "0.5, 1.5", "0.25, 0.75", "joint 2"});
  EXPECT_EQ(page.find("Table 2"), std::string::npos);
}

TEST(ComparisonSection, ShowsThePapersTableAndThePicturesThatAreThere) {
  const auto directory = test::folder() / "pictures";
  write_file(directory / "plots" / comparison_plots[2].file, "<svg>picture</svg>");
  const std::string page = comparison_section(comparison(true), directory);
  // Mean of the joints' RMSE; the MLP, which was not run, has no row.
  expect_all(page, {"Table 2", "0.375", "0.11723", "0.10893", "<svg>picture</svg>", comparison_plots[2].title});
  EXPECT_EQ(page.find("0.11116"), std::string::npos);
  EXPECT_EQ(page.find(comparison_plots[1].title), std::string::npos);
}

json move(double motor) {
  return {{"tracking_motor", motor},
          {"tracking_link", 0.44},
          {"residual", 0.017},
          {"settling_s", 0.123},
          {"roughness", 0.0016}};
}

TEST(VibrationSection, HasATableOfEveryKindOfMove) {
  EXPECT_EQ(vibration_section(nullptr), "");
  json moves;
  for (const char* kind : {"all", "point_to_point", "reversals", "slow"}) moves[kind] = move(0.0137);
  const json vibration = {
      {"control", {{"bandwidth_hz", 32}, {"damping", 0.3}, {"tick_s", 0.002}}},
      {"methods", {{{"feedforward", "rigid"}, {"numbers", "fixed"}, {"parameters_off", "-20 %"}, {"moves", moves}}}}};
  expect_all(vibration_section(vibration),
             {"<h2>Vibration</h2>", "PD of 32 Hz", "damping 0.3", "tick 2 ms", "Moves: all", "Moves: point_to_point",
              "Moves: reversals", "Moves: slow", "rigid", "-20 %", "0.0137", "0.44", "0.017", "123", "0.0016"});
}

TEST(EfficiencySection, DrawsACurveOfEveryMethodThatHasFigures) {
  EXPECT_EQ(efficiency_section(nullptr), "");
  const auto point = [](double seconds, double slow) {
    return json{
        {"seconds", seconds}, {"slow_share", slow}, {"percent_rated", {{"lugre", 0.1 * seconds}, {"mlp", nullptr}}}};
  };
  const json efficiency = {{"curve", {point(5, 0.5), point(10, 0.5)}}, {"mix", {point(10, 0), point(10, 0.5)}}};
  const std::string page = efficiency_section(efficiency);
  expect_all(page, {"<h2>Error against seconds of data</h2>", "<svg", "lugre", "lugre, 10 s", "seconds of train data",
                    "share of slow motion"});
  EXPECT_EQ(page.find("mlp"), std::string::npos);  // it failed everywhere
}

}  // namespace
}  // namespace fxdyn
