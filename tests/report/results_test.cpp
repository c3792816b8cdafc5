// Which results of a folder the report takes: those that belong to the model there.

#include "host_tools/report/results.hpp"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "host_tools/effects/identified_model.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/files.hpp"
#include "tests/diagnose/small_log.hpp"
#include "tests/support/files.hpp"

namespace fxdyn {
namespace {

using nlohmann::json;

class ResultsOfAFolder : public ::testing::Test {
 protected:
  ResultsOfAFolder() : folder_(test::folder() / "results"), model_(test::plant_of(read_urdf(test::puma560))) {
    std::filesystem::remove_all(folder_);
    model_.project_hash = "of the project";
    model_.logs = {{"a.csv", "train", "of the log", 0, 10}};
    write("model", to_json(model_));
  }
  void write(const std::string& name, const json& content) const {
    write_file(folder_ / (name + ".json"), content.dump());
  }
  bool has(const char* name) const { return !read_results(folder_)[name].is_null(); }

  std::filesystem::path folder_;
  IdentifiedModel model_;
};

TEST_F(ResultsOfAFolder, AnExportIsThatOfTheModelsTables) {
  write("export", {{"tables_crc", 77}});
  EXPECT_FALSE(has("export"));  // the model was not exported
  model_.formats.emplace();
  model_.tables_crc = 77;
  write("model", to_json(model_));
  EXPECT_TRUE(has("export"));
  write("export", {{"tables_crc", 78}});
  EXPECT_FALSE(has("export"));
}

TEST_F(ResultsOfAFolder, ADiagnosisIsOfTheModelsProjectAndLogs) {
  write("diagnosis", {{"verdict", "explained"}});
  EXPECT_TRUE(has("diagnosis"));  // nothing says otherwise
  write("nominal", to_json(model_));
  EXPECT_TRUE(has("diagnosis"));
  IdentifiedModel other = model_;
  other.logs[0].hash = "of another log";
  write("nominal", to_json(other));
  EXPECT_FALSE(has("diagnosis"));
  other = model_;
  other.project_hash = "of another project";
  write("nominal", to_json(other));
  EXPECT_FALSE(has("diagnosis"));
}

TEST_F(ResultsOfAFolder, AComparisonOfAnotherProjectIsLeftOutAndNamed) {
  const json made_from = {{"logs", json::object()}};
  write("compare", {{"project_hash", "of the project"}, {"made_from", made_from}});
  EXPECT_TRUE(has("compare"));
  write("compare", {{"project_hash", "of another project"}, {"made_from", made_from}});
  EXPECT_FALSE(has("compare"));
  EXPECT_EQ(read_results(folder_).stale, std::vector<std::string>{"compare"});
}

TEST_F(ResultsOfAFolder, WithoutAModelNothingOfItsTablesOrInputsIsThere) {
  write("export", {{"tables_crc", 77}});
  write("compare", {{"project_hash", "of the project"}, {"made_from", {{"logs", json::object()}}}});
  std::filesystem::remove(folder_ / "model.json");
  EXPECT_FALSE(has("export"));
  EXPECT_FALSE(has("compare"));
}

TEST_F(ResultsOfAFolder, AModelWithoutItsProjectIsRefused) {
  write("model", {{"schema", "fxdyn.model/1"}});
  EXPECT_THROW(read_results(folder_), InputError);
}

}  // namespace
}  // namespace fxdyn
