// The page of tables with its proofs, what export.json says of it, and the pages of single drives.

#include "host_tools/pipeline/tables_export.hpp"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "host_tools/export/export.hpp"
#include "host_tools/project/provenance.hpp"
#include "host_tools/support/error.hpp"
#include "tests/support/files.hpp"
#include "tests/support/pendulum.hpp"

namespace fxdyn {
namespace {

namespace fs = std::filesystem;

class TablesExport : public testing::Test {
 protected:
  TablesExport() {
    fs::remove_all(directory_);
    fs::create_directories(directory_);
    model_.tick_s = 0.002;
  }
  ExportResult run() {
    Progress progress;
    return export_tables(model_, choose_formats(model_), target_, logs_, directory_, directory_ / "model.json",
                         progress);
  }
  /// What the refusal says; empty: there are tables.
  std::string refused() {
    try {
      run();
    } catch (const DataError& error) {
      return error.what();
    }
    return "";
  }

  IdentifiedModel model_ =
      test::model_of(test::pendulum(2), {test::effect_fit("viscous", {}, {1.5}), test::effect_fit("coulomb", {}, {2})});
  std::vector<ProcessedLog> logs_ = test::processed({test::exact_log(model_, Role::train, 1, 6)});
  TargetSettings target_;
  const fs::path directory_ = test::folder() / "tables";
};

TEST_F(TablesExport, WhatIsObservedIsWithinWhatIsProven) {
  const ExportResult result = run();
  ASSERT_EQ(result.joints.size(), 2U);
  const Eigen::VectorXd largest = logs_[0].tau.cwiseAbs().colwise().maxCoeff();
  for (std::size_t j = 0; j < 2; ++j) {
    const ExportResult::Joint& joint = result.joints[j];
    EXPECT_GT(joint.rms_error, 0);
    EXPECT_LT(joint.rms_error, joint.largest_error);
    EXPECT_LE(joint.largest_error, joint.proven_error);
    EXPECT_LT(joint.proven_error, 0.01 * joint.rated_torque);
    EXPECT_LE(joint.attained_torque, joint.proven_torque);
    EXPECT_LE(joint.attained_structural, joint.proven_structural);
    // Within the limits more is attained than in a log, and the proof is not far off.
    EXPECT_GT(joint.attained_torque, largest[static_cast<Eigen::Index>(j)]);
    EXPECT_LT(joint.proven_structural, 2.5 * joint.attained_structural);
  }
  EXPECT_EQ(result.saturations_on_logs, 0U);
}

TEST_F(TablesExport, TheModelLearnsWhatItsTablesAre) {
  const ExportResult result = run();
  ASSERT_TRUE(model_.formats && model_.layout);
  EXPECT_EQ(result.tables_crc, FixedModel(model_, *model_.formats).crc());
  EXPECT_EQ(model_.tables_crc, result.tables_crc);
  EXPECT_EQ(model_.lineage.origin, result.tables_crc);
  EXPECT_EQ(model_.lineage.sequence, 1U);
  EXPECT_EQ(fs::file_size(directory_ / "tables.bin"), result.table_bytes);
  EXPECT_EQ(header_of(directory_ / "tables.bin").crc32, result.tables_crc);
}

TEST_F(TablesExport, ASecondPageHasTheOriginOfTheFirst) {
  const std::uint32_t first = run().tables_crc;
  model_.joints[0].effects[0].linear[0] = 1.6;
  target_.sequence = 5;
  const ExportResult second = run();
  EXPECT_NE(second.tables_crc, first);
  EXPECT_EQ(second.lineage.origin, first);
  EXPECT_EQ(second.lineage.sequence, 5U);
  target_.sequence = 1;
  EXPECT_EQ(run().lineage.sequence, 5U);  // never back
}

TEST_F(TablesExport, DrivesHaveTheirOwnPagesWhereTheProjectAsksForThem) {
  target_.joints = {0, 1};
  const ExportResult both = run();
  ASSERT_EQ(both.drives.size(), 2U);
  for (const ExportResult::Drive& drive : both.drives) {
    const fs::path page = directory_ / ("joint_" + std::to_string(drive.joint + 1)) / "tables.bin";
    EXPECT_EQ(fs::file_size(page), drive.table_bytes);
    EXPECT_EQ(header_of(page).crc32, drive.tables_crc);
  }
  target_.joints = {1};
  run();
  EXPECT_FALSE(fs::exists(directory_ / "joint_1" / "tables.bin"));  // would be of another model
  EXPECT_TRUE(fs::exists(directory_ / "joint_2" / "tables.bin"));
}

TEST_F(TablesExport, TooCoarseTablesAreRefused) {
  model_.joints[1].rated_torque = 1e-3;
  const std::string message = refused();
  EXPECT_EQ(message.rfind("joint 2 (joint_2): fixed point is off by ", 0), 0U) << message;
  EXPECT_NE(message.find("narrow the project's [limits]"), std::string::npos) << message;
}

TEST_F(TablesExport, WhatIsAcceptedIsTheBoundAndATenthOfItObserved) {
  double needed = 0;
  for (const ExportResult::Joint& joint : run().joints)
    needed = std::max(needed, std::max(joint.proven_error, 10 * joint.largest_error) / joint.rated_torque);
  EXPECT_LT(needed, TargetSettings().accept_error);
  model_.drop_tables();
  fs::remove(directory_ / "tables.bin");
  for (const double accepted : {0.99 * needed, 1e-9}) {  // of the second one no joint stays below it
    target_.accept_error = accepted;
    const std::string message = refused();
    EXPECT_NE(message.find("no tables are written"), std::string::npos) << message;
    EXPECT_NE(message.find("`fxdyn report`"), std::string::npos) << message;
    EXPECT_FALSE(fs::exists(directory_ / "tables.bin"));
    // The value that it names is enough for all of them.
    const std::string key = "[target] accept_error = ";
    ASSERT_NE(message.find(key), std::string::npos) << message;
    target_.accept_error = std::stod(message.substr(message.find(key) + key.size()));
    EXPECT_LT(target_.accept_error, 2.1 * needed);
    EXPECT_EQ(refused(), "");
    fs::remove(directory_ / "tables.bin");
  }
}

TEST_F(TablesExport, TheFileCountsJointsFromOne) {
  target_.joints = {1};
  target_.board = "a board";
  const ExportResult result = run();
  const nlohmann::json file = to_json(result);
  EXPECT_EQ(file.at("schema"), "fxdyn.export/1");
  EXPECT_EQ(file.at("board"), "a board");
  EXPECT_EQ(file.at("tables_crc"), result.tables_crc);
  EXPECT_EQ(file.at("drives").at(0).at("index"), 2);
  const nlohmann::json& joint = file.at("joints").at(1);
  EXPECT_EQ(joint.at("joint"), "joint_2");
  EXPECT_EQ(joint.at("index"), 2);
  EXPECT_EQ(joint.at("unit"), "N*m");
  EXPECT_EQ(joint.at("proven_bound"), result.joints[1].proven_error);
  EXPECT_EQ(joint.at("proven_bound_of_rated"), result.joints[1].proven_error / 20);
  EXPECT_EQ(joint.at("torque_range").at("attained"), result.joints[1].attained_torque);
}

}  // namespace
}  // namespace fxdyn
