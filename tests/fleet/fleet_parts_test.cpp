#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "host_tools/fleet/file_hashes.hpp"
#include "host_tools/fleet/fleet_file.hpp"
#include "host_tools/fleet/inputs.hpp"
#include "host_tools/fleet/robot_folder.hpp"
#include "host_tools/fleet/run.hpp"
#include "host_tools/fleet/sha256.hpp"
#include "host_tools/fleet/slurm.hpp"
#include "host_tools/fleet/summary.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/files.hpp"
#include "host_tools/support/temporary_folder.hpp"

namespace fxdyn {
namespace {

using fleet::benjamini_hochberg;

std::string sha256(std::string_view text) {
  Sha256 hash;
  hash.add(text);
  return hash.text();
}

// Examples of NIST (FIPS 180-2, appendix B).
TEST(Sha256, IsThatOfTheStandardsExamples) {
  EXPECT_EQ(sha256("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EXPECT_EQ(sha256("abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq"),
            "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1");
  EXPECT_EQ(sha256(std::string(1000000, 'a')), "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0");
  EXPECT_EQ(sha256(""), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
}

TEST(Sha256, DoesNotDependOnThePieces) {
  const std::string text(300, 'x');
  for (std::size_t cut = 0; cut <= text.size(); cut += 7) {
    Sha256 hash;
    hash.add(text.substr(0, cut));
    hash.add(text.substr(cut));
    EXPECT_EQ(hash.text(), sha256(text)) << cut;
  }
}

// Benjamini and Hochberg 1995, sec. 3.2: 15 p-values of a study, rate 0.05: the first four.
TEST(FalseDiscovery, IsThatOfThePapersExample) {
  std::vector<double> p{0.0001, 0.0004, 0.0019, 0.0095, 0.0201, 0.0278, 0.0298, 0.0344,
                        0.0459, 0.3240, 0.4262, 0.5719, 0.6528, 0.7590, 1.0000};
  for (double& value : p) value = std::log10(value);
  std::reverse(p.begin(), p.end());
  const auto found = benjamini_hochberg(p, 0.05);
  EXPECT_EQ(found.hypotheses, 15u);
  EXPECT_EQ(found.discoveries, 4u);
  EXPECT_NEAR(found.log10_threshold, std::log10(0.05 * 4 / 15), 1e-12);
}

TEST(FalseDiscovery, OfNothingIsNothing) {
  EXPECT_EQ(benjamini_hochberg({}, 0.05).discoveries, 0u);
  EXPECT_EQ(benjamini_hochberg({0, 0, -0.5}, 0.05).discoveries, 0u);
}

// A p that is too large alone may be small enough beside smaller ones.
TEST(FalseDiscovery, TakesTheLargestRankThatPasses) {
  EXPECT_EQ(benjamini_hochberg({std::log10(0.04), std::log10(0.045)}, 0.05).discoveries, 2u);
  EXPECT_EQ(benjamini_hochberg({std::log10(0.04), 0}, 0.05).discoveries, 0u);
}

TEST(FileHashes, RemembersWhatNobodyTouched) {
  const TemporaryFolder folder;
  const auto file = folder.path() / "log.csv", memory = folder.path() / "files.json";
  const auto write = [&](const std::string& text) { std::ofstream(file) << text; };
  const auto hash = [&] {
    fleet::FileHashes hashes(memory);
    std::string out = hashes.of(file);
    hashes.keep();
    return out;
  };
  write("abc");
  EXPECT_EQ(hash(), sha256("abc"));
  // Written a moment ago: nothing is remembered yet.
  EXPECT_EQ(read_file(memory), "{}\n");
  write("abd");
  EXPECT_EQ(hash(), sha256("abd"));
  // What the memory says of a file with another stamp does not count.
  std::ofstream(memory) << "{\"" + file.string() + "\": [\"1 2 3\", \"wrong\"]}";
  EXPECT_EQ(hash(), sha256("abd"));
  std::ofstream(memory) << "half of somethi";
  EXPECT_EQ(hash(), sha256("abd"));
  // An old file, as of the system: its hash comes from the memory.
  const auto program = std::filesystem::canonical("/bin/sh");
  fleet::FileHashes first(memory);
  const std::string of_program = first.of(program);
  first.keep();
  const std::string kept = read_file(memory);
  std::string other = kept;
  other.replace(other.find(of_program), 4, "beef");
  std::ofstream(memory) << other;
  EXPECT_EQ(fleet::FileHashes(memory).of(program).substr(0, 4), "beef");
}

class FleetFile : public testing::Test {
 protected:
  void write(const std::string& name, const std::string& text) const {
    std::filesystem::create_directories((folder_.path() / name).parent_path());
    std::ofstream(folder_.path() / name) << text;
  }
  fleet::Fleet read(const std::string& text) const {
    write("fleet.toml", text);
    return fleet::read_fleet(folder_.path() / "fleet.toml");
  }
  /// What it complains of.
  std::string complaint(const std::string& text) const {
    try {
      read(text);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  }
  TemporaryFolder folder_;
};

TEST_F(FleetFile, NamesRobotsByWhatThePatternLeavesOpen) {
  for (const char* cell : {"b", "a"}) write(std::string("cells/") + cell + "/robot.toml", "");
  write("single/c.toml", "");
  const auto found = read("projects = [\"cells/*/robot.toml\", \"single/*.toml\"]");
  ASSERT_EQ(found.members.size(), 3u);
  EXPECT_EQ(found.members[0].id, "a");
  EXPECT_EQ(found.members[1].id, "b");
  EXPECT_EQ(found.members[2].id, "c");
  EXPECT_EQ(found.members[1].project, folder_.path() / "cells/b/robot.toml");
  EXPECT_EQ(found.verb, "diagnose");
}

TEST_F(FleetFile, ATableSaysMoreOfARobotThatThePatternFound) {
  write("cells/a.toml", "");
  write("healthy.csv", "");
  const auto found = read(
      "projects = \"cells/*.toml\"\n[[robot]]\nid = \"a\"\nbaseline = \"healthy.csv\"\n"
      "overrides = { diagnose.max_effects = 1 }");
  ASSERT_EQ(found.members.size(), 1u);
  EXPECT_EQ(found.members[0].project, folder_.path() / "cells/a.toml");
  EXPECT_EQ(found.members[0].baseline.front(), folder_.path() / "healthy.csv");
  EXPECT_NE(found.members[0].overrides.find("max_effects = 1"), std::string::npos);
}

// "*.toml" beside the robots finds the fleet file, too.
TEST_F(FleetFile, IsNoRobotOfItself) {
  write("a.toml", "");
  const auto found = read("projects = \"*.toml\"");
  ASSERT_EQ(found.members.size(), 1u);
  EXPECT_EQ(found.members[0].id, "a");
}

TEST_F(FleetFile, PathsMayStartWithAVariableOrTheHomeFolder) {
  write("cells/a.toml", "");
  const char* const home = std::getenv("HOME");
  const std::string before = home == nullptr ? folder_.path().string() : home;
  ::setenv("HOME", folder_.path().c_str(), 1);
  ::setenv("FXDYN_TEST_CELLS", (folder_.path() / "cells").c_str(), 1);
  EXPECT_EQ(read("projects = \"~/cells/*.toml\"").members.size(), 1u);
  EXPECT_EQ(read("projects = \"${FXDYN_TEST_CELLS}/*.toml\"").members.size(), 1u);
  ::unsetenv("FXDYN_TEST_CELLS");
  ::setenv("HOME", before.c_str(), 1);
  EXPECT_NE(complaint("projects = \"${FXDYN_TEST_CELLS}/*.toml\"").find("FXDYN_TEST_CELLS is not set"),
            std::string::npos);
}

constexpr const char* pendulum =
    "<robot name=\"pendulum\"><link name=\"base\"/><link name=\"arm\"/>"
    "<joint name=\"hinge\" type=\"continuous\"><parent link=\"base\"/><child link=\"arm\"/>"
    "<axis xyz=\"0 1 0\"/></joint></robot>";

class FleetInputs : public FleetFile {
 protected:
  fleet::Inputs inputs(const std::string& project, const std::string& more = "") const {
    write("robot.urdf", pendulum);
    write("a.toml", "[robot]\nurdf = \"robot.urdf\"\n" + project);
    const auto found = read("[[robot]]\nid = \"a\"\nproject = \"a.toml\"\n" + more);
    return fleet::inputs_of(found, found.members.front(), folder_.path() / "out");
  }
};

TEST_F(FleetInputs, ARecordingMayBeAFolder) {
  const std::string project = "[[log]]\nfile = \"bag\"\nrole = \"train\"\n";
  write("bag/metadata.yaml", "a");
  write("bag/bag_0.db3", "b");
  const std::string first = inputs(project).hash;
  EXPECT_EQ(inputs(project).hash, first);
  write("bag/bag_0.db3", "c");
  const std::string second = inputs(project).hash;
  EXPECT_NE(second, first);
  write("bag/bag_1.db3", "");
  EXPECT_NE(inputs(project).hash, second);
}

// A project that is written anew elsewhere names the same files.
TEST_F(FleetInputs, OverridesLeaveTheLogsWhereTheyAre) {
  write("logs/run.csv", "t,q1,tau1\n");
  ::setenv("FXDYN_TEST_LOGS", (folder_.path() / "logs").c_str(), 1);
  const auto made = inputs("[[log]]\nfile = \"${FXDYN_TEST_LOGS}/run.csv\"\nrole = \"train\"\n",
                           "overrides = { diagnose = { max_effects = 1 } }");
  ::unsetenv("FXDYN_TEST_LOGS");
  const std::string text = read_file(made.project);
  EXPECT_NE(text.find((folder_.path() / "logs/run.csv").string()), std::string::npos) << text;
}

// The program of those effects reads it; this one only asks whether it has changed.
TEST_F(FleetInputs, AProjectMayNeedAnotherProgramsEffects) {
  write("run.csv", "t,q1,tau1\n");
  const std::string project = "[[log]]\nfile = \"run.csv\"\nrole = \"train\"\n[effects]\nlibrary = \"of_others\"\n";
  const std::string first = inputs(project).hash;
  write("run.csv", "t,q1,tau1\n0,0,0\n");
  EXPECT_NE(inputs(project).hash, first);
}

// A joint passes by its strongest effect. What else was found there is not chance because it is weaker than that.
TEST_F(FleetFile, AWeakerEffectOfTheSameJointIsADiscoveryToo) {
  write("a.toml", "");
  const auto found = read("projects = \"a.toml\"");
  fleet::RobotState state;
  state.verdict = Verdict::explained;
  state.baseline = true;
  state.joints = {{"hinge",
                   "N*m",
                   Verdict::explained,
                   {},
                   {{"presliding", true, 2000, {}}, {"ripple", true, 20, {}}, {"spring", false, 1.3, {}}},
                   {}}};
  fleet::RobotFolder(folder_.path() / "out", "a").finish(state, 1);
  const fleet::Summary summary = fleet::summarise(found, folder_.path() / "out");
  EXPECT_EQ(summary.false_discovery.discoveries, 1u);  // of the joint and the robot as a whole
  EXPECT_NEAR(summary.false_discovery.log10_threshold, std::log10(0.05 / 2), 1e-12);
  const auto& findings = summary.robots.front().findings;
  ASSERT_EQ(findings.size(), 3u);
  EXPECT_TRUE(findings[0].discovered);
  EXPECT_TRUE(findings[1].discovered);
  EXPECT_FALSE(findings[2].discovered);  // twice 10^-1.3 is more than 0.025
}

// What every robot has makes no room for chance among what is new.
TEST_F(FleetFile, WhatIsNewIsHeldAgainstWhatIsNewAlone) {
  const auto state_with = [](std::vector<fleet::FoundEffect> effects) {
    fleet::RobotState state;
    state.verdict = Verdict::explained;
    state.joints = {{"hinge", "N*m", Verdict::explained, {}, std::move(effects), {}}};
    return state;
  };
  const fleet::FoundEffect known{"presliding", true, 2000, {}}, doubtful{"backlash", false, 1.9, {}};
  const std::filesystem::path out = folder_.path() / "out";
  std::string projects;
  for (int i = 0; i < 10; ++i) {
    const std::string id = fmt::format("r{}", i);
    write(id + ".toml", "");
    write("out/accepted/" + id + ".json", nlohmann::json{{"schema", "fxdyn.fleet_accepted/1"},
                                                         {"id", id},
                                                         {"by", "test"},
                                                         {"at", "2026-11-28T00:00:00Z"},
                                                         {"state", fleet::to_json(state_with({known}))}}
                                              .dump());
    fleet::RobotFolder(out, id).finish(i == 7 ? state_with({known, doubtful}) : state_with({known}), 1);
  }
  const fleet::Summary summary = fleet::summarise(read("projects = \"*.toml\""), out);
  EXPECT_EQ(summary.false_discovery.discoveries, 10u);
  // 2 * 10^-1.9 is less than 0.05 / 2, and more than 0.05 / 20.
  EXPECT_EQ(summary.false_discovery_of_new.hypotheses, 20u);
  EXPECT_EQ(summary.false_discovery_of_new.discoveries, 0u);
  for (const fleet::RobotSummary& robot : summary.robots) EXPECT_FALSE(robot.drifts) << robot.id;
}

TEST(SlurmArguments, StayTogetherInQuotes) {
  using Words = std::vector<std::string>;
  EXPECT_EQ(fleet::words_of(" -p night  --mem=4G "), (Words{"-p", "night", "--mem=4G"}));
  EXPECT_EQ(fleet::words_of("--comment=\"a 'b' c\" -x ''"), (Words{"--comment=a 'b' c", "-x", ""}));
  EXPECT_THROW(fleet::words_of("--comment=\"a"), InputError);
}

TEST_F(FleetFile, WhatIsAtWorkIsToldWhileNothingEnds) {
  write("a.toml", "");
  write("slow.sh", "#!/bin/sh\necho reading logs\nsleep 1\nexit 3\n");
  std::filesystem::permissions(folder_.path() / "slow.sh", std::filesystem::perms::owner_all);
  const auto found = read("projects = \"a.toml\"");
  testing::internal::CaptureStderr();
  fleet::run_tasks(found, {{&found.members.front(), found.members.front().project, "hash"}}, folder_.path() / "out",
                   {folder_.path() / "slow.sh", 1, 0.2});
  const std::string said = testing::internal::GetCapturedStderr();
  EXPECT_NE(said.find("[0/1] at work: a for "), std::string::npos) << said;
  EXPECT_NE(said.find(" s (reading logs)\n"), std::string::npos) << said;
  EXPECT_NE(said.find("a: failed: reading logs\n"), std::string::npos) << said;
}

// A queue may hold a job for hours, and a node that is drained for ever.
TEST_F(FleetFile, WhatTheQueueSaysIsToldWhileNothingEnds) {
  write("a.toml", "");
  write("state/jobs", "");
  const auto found = read("projects = \"a.toml\"");
  const char* const found_path = std::getenv("PATH");
  const std::string path = found_path == nullptr ? "" : found_path;
  ::setenv("PATH", (FXDYN_SOURCE_DIR "/tests/fleet/fake_slurm:" + path).c_str(), 1);
  ::setenv("FAKE_SLURM", (folder_.path() / "state").c_str(), 1);
  ::setenv("FAKE_SLURM_ELSEWHERE", "1", 1);
  ::setenv("FAKE_SLURM_PENDS", "2", 1);
  fleet::SlurmOptions options;
  options.chunk_size = 1;
  options.look_s = options.ask_s = options.settle_s = 0.1;
  options.tell_s = 0.2;
  options.useless_rounds = 1;
  testing::internal::CaptureStderr();
  EXPECT_THROW(fleet::run_on_slurm(found, {{&found.members.front(), found.members.front().project, "hash"}},
                                   folder_.path() / "out", {"/bin/true", 1}, options),
               DataError);
  const std::string said = testing::internal::GetCapturedStderr();
  for (const char* name : {"FAKE_SLURM", "FAKE_SLURM_ELSEWHERE", "FAKE_SLURM_PENDS"}) ::unsetenv(name);
  ::setenv("PATH", path.c_str(), 1);
  EXPECT_NE(said.find("[0/1] job 1: 1 PENDING Resources\n"), std::string::npos) << said;
}

TEST_F(FleetFile, SaysWhatIsWrongAndWhere) {
  write("x/a.toml", "");
  write("y/a.toml", "");
  write("healthy.csv", "");
  const auto said = [this](const std::string& text, const std::string& part) {
    const std::string what = complaint(text);
    EXPECT_NE(what.find(part), std::string::npos) << what;
    EXPECT_NE(what.find("fleet.toml:"), std::string::npos) << what;
  };
  said("verb = \"diagnose\"", "no robots");
  said("verb = \"compare\"", "nearest is");
  said("projects = \"z/*.toml\"", "paths are relative to the fleet file");
  said("project = \"x/*.toml\"", "nearest is 'projects'");
  said("projects = \"?/*.toml\"", "two robots have the id 'a'");
  said("[robot]\nurdf = \"a.urdf\"", "is this the project of a robot?");
  said("[[robot]]\nid = \"a/b\"\nproject = \"x/a.toml\"", "letters, digits");
  said("[[robot]]\nproject = \"x/a.toml\"", "key 'id' is missing");
  said("[[robot]]\nid = \"a\"", "key 'project' is missing");
  said("[[robot]]\nid = \"a\"\nproject = \"x/a.toml\"\nbaseline = \"gone.csv\"", "healthy session");
  said(
      "[[robot]]\nid = \"a\"\nproject = \"x/a.toml\"\nbaseline = \"healthy.csv\"\n"
      "[[robot]]\nid = \"b\"\nproject = \"y/a.toml\"\nbaseline = \"healthy.csv\"",
      "its baseline is that of 'a', too");
  said("[limits]\ntime_s = 0\n[[robot]]\nid = \"a\"\nproject = \"x/a.toml\"", "above 0");
}

}  // namespace
}  // namespace fxdyn
