#include "tests/campaign/case_fleet.hpp"

#include <gtest/gtest.h>

#include "host_tools/fleet/fleet_file.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/files.hpp"
#include "host_tools/support/temporary_folder.hpp"

namespace fxdyn::campaign {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

class CaseFleet : public testing::Test {
 protected:
  /// A program that takes the place of fxdyn: `fleet FLEET.toml --out DIR ..`.
  void program(const std::string& script) {
    write_file(settings_.program, "#!/bin/sh\n" + script);
    fs::permissions(settings_.program, fs::perms::owner_all);
  }
  fs::path in_out(const std::string& name) const { return settings_.out / name; }

  TemporaryFolder folder_;
  RunSettings settings_{folder_.path() / "out", folder_.path() / "fxdyn", "this program", "this campaign", 12.5};
};

TEST_F(CaseFleet, IsOneThatFxdynReads) {
  write_fleet({"02_b", "01_a"}, settings_);
  const fleet::Fleet fleet = fleet::read_fleet(in_out("fleet.toml"));
  ASSERT_EQ(fleet.members.size(), 2u);
  EXPECT_EQ(fleet.members[0].id, "01_a");
  EXPECT_EQ(fleet.members[1].project, in_out("cases/02_b/data/project.toml"));
  EXPECT_EQ(fleet.verb, "diagnose");
  EXPECT_EQ(fleet.limits.time_s, 12.5);
}

// Fleets look at versions only; here every build counts.
TEST_F(CaseFleet, KeepsNoAnswersOfAnotherProgram) {
  write_fleet({"a"}, settings_);
  write_file(in_out("fleet/robots/a/result.json"), "{}");
  write_fleet({"a"}, settings_);
  EXPECT_TRUE(fs::exists(in_out("fleet/robots/a/result.json")));
  settings_.program_hash = "another program";
  write_fleet({"a"}, settings_);
  EXPECT_FALSE(fs::exists(in_out("fleet/robots/a/result.json")));
}

TEST_F(CaseFleet, WhatFailedIsAResultAndAStopIsNone) {
  write_fleet({"a"}, settings_);
  program(
      "echo \"$@\" >\"$4/words\"\n"
      "echo '{\"robots\": [{\"id\": \"a\", \"error\": \"took longer\", \"files\": []}]}' >\"$4/fleet.json\"\n"
      "exit 1\n");
  const auto robots = run_fleet(settings_, {"--jobs", "3"});
  EXPECT_EQ(read_file(in_out("fleet/words")),
            "fleet " + in_out("fleet.toml").string() + " --out " + in_out("fleet").string() + " --jobs 3\n");
  Case wanted;
  wanted.name = "a";
  const json result = scored_case(wanted, settings_, {{"truth", json::object()}}, robots.at("a"));
  EXPECT_EQ(result.at("status"), "failed");
  EXPECT_EQ(result.at("message"), "took longer");
  EXPECT_FALSE(result.at("passed"));
  EXPECT_EQ(earlier_result(wanted, settings_), result);
  settings_.own_hash = "another campaign";
  EXPECT_TRUE(earlier_result(wanted, settings_).is_null());

  program("exit 1\n");  // as after Ctrl-C: the old summary is not taken for today's
  EXPECT_THROW(run_fleet(settings_, {}), DataError);
}

TEST_F(CaseFleet, TheAnswerIsTheFileThatTheSummaryLinks) {
  const json robot{{"error", nullptr}, {"files", {"robots/a/out/metrics.json", "robots/a/out/diagnosis.json"}}};
  EXPECT_EQ(diagnosis_of(settings_.out, robot), in_out("fleet/robots/a/out/diagnosis.json"));
  EXPECT_EQ(diagnosis_of(settings_.out, {{"error", "gone"}, {"files", json::array()}}), fs::path());
  EXPECT_FALSE(seconds_of(settings_.out, "a"));
  write_file(in_out("fleet/robots/a/timing.json"), "{\"seconds\": 4.5}");
  EXPECT_EQ(seconds_of(settings_.out, "a"), 4.5);
}

}  // namespace
}  // namespace fxdyn::campaign
