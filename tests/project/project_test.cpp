#include "host_tools/project/project.hpp"

#include <gtest/gtest.h>

#include "host_tools/identify/identify.hpp"
#include "host_tools/project/provenance.hpp"
#include "host_tools/simulate/recordings.hpp"
#include "host_tools/simulate/simulate.hpp"
#include "tests/support/files.hpp"

namespace fxdyn {
namespace {

using test::Bad;
using test::write;

const std::string robot = "[robot]\nurdf = \"arm.urdf\"\n";               // lines 1, 2
const std::string log = "[[log]]\nfile = \"a.csv\"\nrole = \"train\"\n";  // three lines

std::filesystem::path write_project(const std::string& name, const std::string& text) {
  write("arm.urdf",
        "<robot name=\"arm\"><link name=\"a\"/><link name=\"b\"/><link name=\"c\"/>"
        "<joint name=\"j1\" type=\"continuous\"><parent link=\"a\"/><child link=\"b\"/></joint>"
        "<joint name=\"j2\" type=\"revolute\"><parent link=\"b\"/><child link=\"c\"/>"
        "<limit lower=\"-1\" upper=\"1\" velocity=\"1\" effort=\"1\"/></joint></robot>");
  std::string csv = "t,q1,q2,tau1,tau2\n";
  for (int i = 0; i < 100; ++i) csv += std::to_string(0.1 * i) + ",0,0,0,0\n";
  write("a.csv", csv);
  write("copy.csv", csv);
  write("s.toml", "");
  return write(name + ".toml", text);
}

class BadProject : public testing::TestWithParam<Bad> {};
TEST_P(BadProject, IsRefusedInOneLine) {
  const auto file = write_project("bad_" + GetParam().name, GetParam().text);
  test::expect_refused(file, GetParam().message, [&] { read_project(file); });
}

INSTANTIATE_TEST_SUITE_P(
    Table, BadProject,
    testing::Values(
        Bad{"not_toml", robot + "gravity = [1, 2\n[x]\n", {":4:", "not valid TOML"}},
        Bad{"empty", "", {":1:", "'robot' is missing"}}, Bad{"no_urdf", "[robot]\n", {":1:", "'urdf' is missing"}},
        Bad{"urdf_file", "[robot]\nurdf = \"army.urdf\"\n", {":2:", "robot.urdf", "no file", "army.urdf"}},
        Bad{"urdf_number", "[robot]\nurdf = 3\n", {":2:", "expected a string"}},
        Bad{"section", robot + "[identity]\n" + log, {":3:", "unknown key 'identity'", "nearest is 'identify'"}},
        Bad{"key",
            robot + "gravty = [0,0,1]\n" + log,
            {":3:", "robot", "unknown key 'gravty'", "nearest is 'gravity'"}},
        Bad{"log_key", robot + log + "from = 3\n", {":6:", "unknown key 'from'", "nearest is 'from_s'"}},
        Bad{"signal", robot + log + "columns = { torque = \"i\" }\n", {":6:", "log.columns", "unknown key 'torque'"}},
        Bad{"gravity", robot + "gravity = [0.0, -9.81]\n" + log, {":3:", "has 2 values, expected 3"}},
        Bad{"gravity_mm", robot + "gravity = [0, 0, -9810]\n" + log, {":3:", "m/s^2"}},
        Bad{"gravity_text", robot + "gravity = [0, 0, \"down\"]\n" + log, {":3:", "expected a number"}},
        Bad{"rated", robot + "rated_torque = [1.0]\n" + log, {":3:", "has 1 values, expected 2", "arm.urdf"}},
        Bad{"rated_sign", robot + "rated_torque = [1.0, -1.0]\n" + log, {":3:", "above 0"}},
        Bad{"limits", robot + "[limits]\nposition = [[1, -1], [0, 1]]\n" + log, {":4:", "lower limit"}},
        Bad{"limits_count", robot + "[limits]\nvelocity = [1, 2, 3]\n" + log, {":4:", "has 3 values, expected 2"}},
        Bad{"box", robot + "[limits]\nbox = [[0, 0, 1], [1, 1, 0]]\n", {":4:", "first corner must be below"}},
        Bad{"noise", robot + "[excite]\nnoise = [1.0]\n", {":4:", "has 1 values, expected 2"}},
        Bad{"order", robot + "[excite]\norder = 1\n", {":4:", "at least 2"}},
        Bad{"step", robot + "[excite]\nstep_s = 1.0\n", {":3:", "period_s / (10 x order)"}},
        Bad{"period", robot + "[excite]\nperiod_s = 9.9995\n", {":3:", "no multiple of step_s"}},
        Bad{"no_role", robot + "[[log]]\nfile = \"a.csv\"\n", {":3:", "'role' is missing"}},
        Bad{"role",
            robot + "[[log]]\nfile = \"a.csv\"\nrole = \"trian\"\n",
            {":5:", "unknown role 'trian'", "nearest is 'train'"}},
        Bad{"log_file", robot + "[[log]]\nfile = \"b.csv\"\nrole = \"train\"\n", {":4:", "no file", "b.csv"}},
        Bad{"no_file", robot + "[[log]]\nrole = \"train\"\n", {":3:", "either file or scenario"}},
        Bad{"scenario_log", robot + "[[log]]\nscenario = \"s.toml\"\nrole = \"train\"\n", {":4:", "add log ="}},
        Bad{"window", robot + log + "from_s = 2\nto_s = 1\n", {":3:", "from_s is not below to_s"}},
        Bad{"overlap",
            robot + log + "to_s = 20\n[[log]]\nfile = \"./a.csv\"\nrole = \"test\"\nfrom_s = 19.9\n",
            {":7:", "overlaps the log in line 3"}},
        Bad{"copy",
            robot + log + "[[log]]\nfile = \"copy.csv\"\nrole = \"validate\"\n",
            {":6:", "overlaps the log in line 3", "same content under another name"}},
        Bad{"same_topic",
            robot + log + "topic = \"episode_0\"\n[[log]]\nfile = \"a.csv\"\ntopic = \"episode_0\"\nrole = \"test\"\n",
            {":7:", "overlaps the log in line 3", "same file"}},
        Bad{"time_unit", robot + log + "time_unit = \"nsec\"\n", {":6:", "unknown unit of time 'nsec'", "'ns'"}},
        Bad{"good_enough", robot + "[report]\ngood_enough = 1.5\n" + log, {":4:", "share of rated torque"}},
        Bad{"accept_error", robot + "[target]\naccept_error = 5\n" + log, {":4:", "share of rated torque"}},
        Bad{"torque_gain", robot + log + "torque_gain = [1]\n", {":6:", "has 1 values, expected 2"}},
        Bad{"method",
            robot + "[identify]\nmethod = \"lsq\"\n" + log,
            {":4:", "unknown method 'lsq'", "nearest is 'ls'"}},
        Bad{"effect",
            robot + "[identify]\neffects = [\"viscous\", \"colomb\"]\n" + log,
            {":4:", "unknown effect 'colomb'", "nearest is 'coulomb'"}},
        Bad{"board",
            robot + "[target]\nboard = \"mps2-an387\"\n" + log,
            {":4:", "unknown board", "nearest is 'mps2-an38"}},
        Bad{"tick", robot + "[target]\ntick_s = 0\n" + log, {":4:", "above 0"}},
        Bad{"seed", robot + "[train]\nseed = 1.5\n" + log, {":4:", "expected an integer"}},
        Bad{"enabled", robot + "[train]\nenabled = 1\n" + log, {":4:", "true or false"}},
        Bad{"cutoff", robot + "[signals]\ntorque_cutoff_hz = -3\n" + log, {":4:", "above 0"}},
        Bad{"log_table", robot + "log = 3\n", {":3:"}}, Bad{"robot_value", "robot = 3\n", {":1:", "expected a table"}}),
    [](const auto& parameter) { return parameter.param.name; });

TEST(Project, MissingFileIsNamed) {
  test::expect_refused("nowhere.toml", {"can't be read"}, [] { read_project("/nowhere.toml"); });
}

TEST(Project, ReadsEveryKeyOfTheGuide) {
  const auto file = write_project("full", R"(
[robot]
urdf = "arm.urdf"
gravity = [0, 0, -9.81]
rated_torque = [250, 30.5]
[limits]
position = [[-3, 3], [-1, 1]]
velocity = [1, 2]
acceleration = [10, 20]
torque = [250, 30]
box = [[-1, -1, 0], [1, 1, 2]]
[[log]]
file = "a.csv"
role = "train"
to_s = 50
columns = { tau = "i" }
time_unit = "us"
torque_gain = [12.5, 1]
payload = { mass = 0.0 }
[[log]]
file = "a.csv"
role = "test"
from_s = 50.0
[[log]]
scenario = "s.toml"
log = "slow"
role = "baseline"
[signals]
position_cutoff_hz = 20
torque_cutoff_hz = 12
edge_s = 0.25
columns = { dq = "v", tau = "torque" }
time_unit = "ns"
[identify]
method = "ls"
physical = true
effects = ["viscous", "stribeck"]
[diagnose]
max_effects = 3
[train]
enabled = false
seed = 7
inputs = "state"
windows = 2
nodes = 10
enhancement = 20
activation = "sigmoid"
features = "sparse"
wavenumber = 2.5
ridge = 1e-3
[train.pso]
particles = 12
iterations = 20
stall = 6
activations = ["tanh", "relu"]
bounds = { nodes = [5, 30], windows = [2, 3], ridge = [1e-3, 1e-2] }
[excite]
period_s = 10.0
order = 5
trajectories = 3
noise = 0.0
[target]
board = "stm32g474"
tick_s = 0.001
accept_error = 0.02
joints = "all"
[report]
good_enough = 0.03
)");
  const Project project = read_project(file);
  EXPECT_EQ(project.robot.size(), 2U);
  EXPECT_EQ(project.robot.gravity.z(), -9.81);
  EXPECT_EQ(project.rated_torque, std::vector({250.0, 30.5}));
  EXPECT_EQ(project.limits.position[1][0], -1);
  EXPECT_EQ((*project.limits.box)[1].z(), 2);
  EXPECT_EQ(project.excite.period_s, 10);
  EXPECT_EQ(project.excite.order, 5);
  EXPECT_EQ(project.excite.trajectories, 3);
  EXPECT_EQ(project.excite.noise, std::vector({0.0, 0.0}));
  ASSERT_EQ(project.logs.size(), 3U);
  EXPECT_TRUE(project.logs[0].file.is_absolute());
  EXPECT_EQ(project.logs[0].line, 12);
  EXPECT_EQ(*project.logs[0].to_s, 50);
  EXPECT_EQ(project.logs[0].format.columns.at("tau"), "i");
  EXPECT_EQ(project.logs[0].format.columns.at("dq"), "v");  // the default of [signals]
  EXPECT_EQ(project.logs[0].format.torque_gain[0], 12.5);
  EXPECT_EQ(project.logs[1].format.columns.at("tau"), "torque");
  EXPECT_EQ(project.logs[1].role, Role::test);
  EXPECT_EQ(project.logs[2].scenario_log, "slow");
  EXPECT_TRUE(project.logs[2].file.empty());
  EXPECT_TRUE(project.has_role(Role::baseline));
  EXPECT_FALSE(project.has_role(Role::validate));
  EXPECT_EQ(*project.signals.edge_s, 0.25);
  EXPECT_EQ(project.identify.method, "ls");
  EXPECT_EQ(*project.identify.effects, (std::vector<std::string>{"viscous", "stribeck"}));
  EXPECT_FALSE(project.train.enabled);
  EXPECT_EQ(project.train.seed, 7U);
  EXPECT_EQ(*project.train.ridge, 1e-3);
  EXPECT_EQ(project.train.inputs, "state");
  EXPECT_EQ(*project.train.windows, 2);
  EXPECT_EQ(*project.train.nodes, 10);
  EXPECT_EQ(*project.train.enhancement, 20);
  EXPECT_EQ(project.train.activation, "sigmoid");
  EXPECT_EQ(project.train.features, "sparse");
  EXPECT_EQ(*project.train.wavenumber, 2.5);
  ASSERT_TRUE(project.train.pso.has_value());
  const PsoSettings& pso = *project.train.pso;
  EXPECT_EQ(pso.particles, 12);
  EXPECT_EQ(pso.iterations, 20);
  EXPECT_EQ(pso.stall, 6);
  EXPECT_EQ(pso.activations, (std::vector<std::string>{"tanh", "relu"}));
  EXPECT_EQ(pso.nodes, (std::array{5.0, 30.0}));
  EXPECT_EQ(pso.windows, (std::array{2.0, 3.0}));
  EXPECT_EQ(pso.ridge, (std::array{1e-3, 1e-2}));
  EXPECT_EQ(project.target.board, "stm32g474");
  EXPECT_EQ(project.target.accept_error, 0.02);
  EXPECT_EQ(project.report.good_enough, 0.03);
  EXPECT_EQ(project.logs[0].format.time_unit_s, 1e-6);
  EXPECT_EQ(project.logs[1].format.time_unit_s, 1e-9);  // the default of [signals]
}

TEST(Project, NeedsNoLogUntilThereIsSomethingToLearn) {
  for (const std::string& logs : {std::string(), std::string("[[log]]\nfile = \"a.csv\"\nrole = \"test\"\n")}) {
    const auto file = write_project("no_train_log", robot + logs);
    const Project project = read_project(file);
    test::expect_refused(file, {"no log to learn from", "role = \"train\""},
                         [&] { read_gate_data(project, testing::TempDir()); });
  }
}

TEST(Project, ItsHashIsOfWhatTheModelDependsOn) {
  const auto hash = [](const std::string& rest) {
    return project_hash(read_project(write_project("hashed", robot + rest + log)));
  };
  const std::string plain = hash("");
  EXPECT_EQ(hash("[target]\naccept_error = 0.03\n"), plain);  // of the export alone
  EXPECT_EQ(hash("[report]\ngood_enough = 0.02\n"), plain);   // of the page alone
  EXPECT_EQ(hash("# a word\n"), plain);
  EXPECT_NE(hash("[target]\ntick_s = 0.001\n"), plain);
  EXPECT_NE(hash("[train]\nseed = 2\n"), plain);
}

TEST(Project, ReadsTheLogsOfARole) {
  const auto file =
      write_project("logs", robot + log + "to_s = 6\n[[log]]\nfile = \"a.csv\"\nrole = \"test\"\nfrom_s = 6\n");
  const Project project = read_project(file);
  const auto train = read_logs(project, Role::train, testing::TempDir()),
             test = read_logs(project, Role::test, testing::TempDir());
  ASSERT_EQ(train.size(), 1U);
  EXPECT_EQ(train[0].samples(), 60);
  ASSERT_EQ(test.size(), 1U);
  EXPECT_EQ(test[0].samples(), 40);
  EXPECT_EQ(test[0].role, Role::test);
  EXPECT_TRUE(read_logs(project, Role::validate, testing::TempDir()).empty());
}

TEST(Project, JointsWithStopsDoNotTurnFarBeyondThem) {
  std::string csv = "t,q1,q2,tau1,tau2\n";
  const auto expect_named = [&](int range, const std::string& words) {
    std::string text = csv;
    for (int i = 0; i < 100; ++i) text += std::to_string(0.1 * i) + ",0," + std::to_string(i % range) + ",0,0\n";
    write("degrees.csv", text);
    const auto file = write_project("degrees", robot + "[[log]]\nfile = \"degrees.csv\"\nrole = \"train\"\n");
    test::expect_refused("degrees.csv", {words, "'j2' has 2 rad"},
                         [&] { read_logs(read_project(file), Role::train, testing::TempDir()); });
  };
  expect_named(30, "q2 looks like degrees");
  // 99 degrees, the joint has 115; times a gear ratio of 100 it would be 1 rad.
  expect_named(100, "or, if it is the motor's angle, divide by the gear ratio");
}

TEST(Project, ALogOfTheSameScenarioIsNotSimulatedAgain) {
  const auto file =
      write_project("scenario", robot + "[[log]]\nscenario = \"s.toml\"\nlog = \"slow\"\nrole = \"train\"\n");
  const auto directory = file.parent_path() / "out";
  std::filesystem::create_directories(directory / "logs/s");
  std::filesystem::copy_file(file.parent_path() / "a.csv", directory / "logs/s/slow.csv",
                             std::filesystem::copy_options::overwrite_existing);
  test::write("out/logs/s/scenario.hash", scenario_hash(file.parent_path() / "s.toml"));
  const Project project = read_project(file);
  EXPECT_EQ(read_logs(project, Role::train, directory).at(0).samples(), 100);
}

/// A scenario of one log for each name, all with the same motion but where a name has another seed.
void write_scenario(const std::string& name, const std::vector<std::pair<std::string, int>>& logs) {
  write("swing.urdf",
        "<robot name=\"swing\"><link name=\"base\"/><link name=\"rod\"><inertial><origin xyz=\"0.2 0 0\"/>"
        "<mass value=\"2\"/><inertia ixx=\"0.01\" ixy=\"0\" ixz=\"0\" iyy=\"0.02\" iyz=\"0\" izz=\"0.02\"/>"
        "</inertial></link><joint name=\"pivot\" type=\"revolute\"><parent link=\"base\"/><child link=\"rod\"/>"
        "<axis xyz=\"0 1 0\"/><limit lower=\"-2\" upper=\"2\" velocity=\"2\" effort=\"20\"/></joint></robot>");
  std::string text =
      "seed = 1\n[sensors]\ntorque_noise = 0.01\n[robot]\nurdf = \"swing.urdf\"\nrated_torque = [20]\n"
      "acceleration = [8]\n";
  for (const auto& [name_of, seed] : logs)
    text += "[[log]]\nname = \"" + name_of + "\"\nduration_s = 4\nperiod_s = 4\nseed = " + std::to_string(seed) + "\n";
  write(name, text);
}

std::string scenario_log(const char* scenario, const char* name, const char* role) {
  return std::string("[[log]]\nscenario = \"") + scenario + "\"\nlog = \"" + name + "\"\nrole = \"" + role + "\"\n";
}

TEST(Project, TwoTopicsOfAFileAreTwoLogs) {
  const Project project = read_project(
      write_project("two_topics", robot + log + "topic = \"episode_0\"\n" + log + "topic = \"episode_1\"\n"));
  EXPECT_EQ(project.logs.size(), 2U);
}

TEST(Project, TheSameDataMayNotTrainAndValidateUnderTwoNamesOfAScenario) {
  const std::string swing = "[robot]\nurdf = \"swing.urdf\"\n";
  const auto out = test::folder() / "copies";
  write_scenario("twice.toml", {{"a", 5}, {"b", 5}, {"c", 6}});
  const auto expect_copy = [&](const std::filesystem::path& file) {
    test::expect_refused(file, {":7:", "overlaps the log in line 3", "same content under another name"}, [&] {
      const Project project = read_project(file);
      read_logs(project, Role::train, out);
      read_logs(project, Role::validate, out);
    });
  };
  // The same seed and settings.
  expect_copy(write("same_seed.toml",
                    swing + scenario_log("twice.toml", "a", "train") + scenario_log("twice.toml", "b", "validate")));
  // What was simulated, beside the scenario that it is from.
  std::filesystem::create_directories(test::folder() / "played");
  simulate(test::folder() / "twice.toml", test::folder() / "played");
  expect_copy(write("csv_beside.toml", swing + scenario_log("twice.toml", "a", "train") +
                                           "[[log]]\nfile = \"played/b.csv\"\nrole = \"validate\"\n"));
  // A copy of the scenario under another name.
  write_scenario("again.toml", {{"other", 5}});
  expect_copy(write("two_scenarios.toml", swing + scenario_log("twice.toml", "a", "train") +
                                              scenario_log("again.toml", "other", "validate")));
  // That log anew with another motion, and the project is a good one.
  write_scenario("again.toml", {{"other", 7}});
  const Project good = read_project(test::folder() / "two_scenarios.toml");
  EXPECT_EQ(read_logs(good, Role::train, out).size(), 1U);
  EXPECT_EQ(read_logs(good, Role::validate, out).size(), 1U);
  // Windows of one log that do not overlap are no copies.
  const Project windows =
      read_project(write("windows.toml", swing + scenario_log("twice.toml", "a", "train") + "to_s = 2\n" +
                                             scenario_log("twice.toml", "a", "validate") + "from_s = 2\n"));
  EXPECT_EQ(read_logs(windows, Role::train, out).size(), 1U);
}

}  // namespace
}  // namespace fxdyn
