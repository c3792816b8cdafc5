#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <sstream>

#include "host_tools/effects/evaluator.hpp"
#include "host_tools/effects/identified_model.hpp"
#include "host_tools/project/project.hpp"
#include "host_tools/readers/log_reader.hpp"
#include "host_tools/signals/fourier.hpp"
#include "host_tools/simulate/scenario.hpp"
#include "host_tools/simulate/simulate.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/files.hpp"
#include "tests/simulate/support.hpp"

namespace fxdyn {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

const std::string log_text = "[[log]]\nname = \"run\"\nduration_s = 4\nperiod_s = 4\nspeed = 0.5\nseed = 7\n";

struct Played {
  Log log, truth;
  IdentifiedModel plant;
};

/// Plays a scenario of one log.
Played play(const std::string& name, const std::string& text) {
  const auto out = test::folder() / name;
  const auto file = simulate(test::write(name + ".toml", text), out)[0];
  const std::vector<bool> revolute(6, true);
  Played played{read_log(file, 6, revolute, {}, {}, {}), {}, read_model(out / "truth.json")};
  // the truth has torques only: it borrows the log's positions
  const std::string truth = read_file(out / "run.truth.csv");
  LogFormat format;
  format.columns = {{"q", "tau"}};
  played.truth = read_log(test::write(name + "_truth.csv", truth), 6, std::vector<bool>(6, false), format, {}, {});
  return played;
}

const std::string friction = test::effect_text(1, "viscous", "coefficient = 5.0") +
                             test::effect_text(1, "coulomb", "amplitude = 7.0, width = 0.002") +
                             test::effect_text(2, "rotor_inertia", "inertia = 4.0") +
                             test::effect_text(3, "presliding", "distance = 0.003, amplitude = 3.0") +
                             test::effect_text(4, "friction_drift", "time_constant = 30, coulomb = 2, viscous = 1");

TEST(Scenario, TruthIsTheModelsTorqueOnTheMotionThatTheLogShows) {
  for (const std::string top : {"motion = \"prescribed\"", "motion = \"closed_loop\""}) {
    // at the plant's own step nothing is left out between the samples
    const std::string text =
        test::puma_scenario(top, "exact_motion = true\nsample_s = 0.0005") + friction + log_text + "start_s = 12\n";
    const Played played = play("truth", text);
    const MatrixXd model = predict(played.plant, played.log.q, played.log.dq, played.log.ddq, 0.0005, nullptr, 12);
    EXPECT_LT((model - played.truth.tau).rightCols(3).cwiseAbs().maxCoeff(), 0.1) << top;
    EXPECT_LT((model - played.truth.tau).leftCols(2).cwiseAbs().maxCoeff(), 1e-9) << top;
  }
}

TEST(Scenario, AnEffectOnSeveralJoints) {
  const std::string one_by_one = test::effect_text(1, "coulomb", "amplitude = 7, width = 0.002") +
                                 test::effect_text(3, "coulomb", "amplitude = 6, width = 0.004");
  const std::string together =
      "[[effect]]\nname = \"coulomb\"\njoint = [1, 3]\nparameters = { amplitude = [7, 6], width = [0.002, 0.004] }\n";
  const Played a = play("one_by_one", test::puma_scenario("", "") + one_by_one + log_text);
  const Played b = play("together", test::puma_scenario("", "") + together + log_text);
  EXPECT_EQ(a.log.tau, b.log.tau);
  const Played all =
      play("all", test::puma_scenario("", "") +
                      "[[effect]]\nname = \"viscous\"\njoint = \"all\"\nparameters = { coefficient = 2 }\n" + log_text);
  for (const JointFit& joint : all.plant.joints) EXPECT_NE(joint.find("viscous"), nullptr);
}

TEST(Scenario, PlaysAPlannedTrajectory) {
  const FourierJoint series{0.3, Eigen::Vector3d(0.2, -0.3, 0.1), Eigen::Vector3d::Zero()};
  std::string joints;
  for (int j = 0; j < 6; ++j)
    joints += std::string(j == 0 ? "" : ",") + "{\"joint\":\"j\",\"centre\":0.3,\"a\":[0.2,-0.3,0.1],\"b\":[0,0,0]}";
  test::write("plan.json", "{\"trajectories\":[{\"name\":\"fast\",\"period_s\":4,\"series\":[" + joints + "]}]}");
  const std::string planned =
      "[[log]]\nname = \"run\"\nduration_s = 4\nseed = 7\nplan = \"plan.json\"\ntrajectory = \"fast\"\n";
  const Played played = play("planned", test::puma_scenario("", "exact_motion = true") + planned);
  for (Eigen::Index k = 0; k < played.log.q.rows(); k += 100)
    EXPECT_NEAR(played.log.q(k, 2), evaluate(series, 4, played.log.t[k]).q, 1e-9);
}

/// What comes with the program can be read: robots, effects, logs, settings.
TEST(Scenario, BundledOnesAreRead) {
  const std::filesystem::path demo = std::filesystem::path(FXDYN_SOURCE_DIR) / "host_tools" / "demo";
  for (const char* name : {".", "paper", "rich", "efficiency", "vibration"}) {
    const Scenario scenario = read_scenario(demo / name / "scenario.toml");
    const Project project = read_project(demo / name / "project.toml");
    for (const LogEntry& entry : project.logs) {
      EXPECT_TRUE(std::any_of(scenario.logs.begin(), scenario.logs.end(),
                              [&](const ScenarioLog& log) { return log.name == entry.scenario_log; }))
          << name << " " << entry.scenario_log;
    }
  }
}

TEST(Scenario, ClosedLoopStaysNearTheReference) {
  const std::string sensors = "exact_motion = true";
  const Played free = play("free", test::puma_scenario("", sensors) + friction + log_text);
  const Played held = play("held", test::puma_scenario("motion = \"closed_loop\"\n[control]\nbandwidth_hz = 10\n"
                                                       "tick_s = 0.001\n",
                                                       sensors) +
                                       friction + log_text);
  const double error = test::rms(held.log.q - free.log.q);
  EXPECT_LT(error, 0.02);
  EXPECT_GT(error, 1e-5);
  const Played blind =
      play("blind", test::puma_scenario("motion = \"closed_loop\"\n[control]\nfeedforward = false\n", sensors) +
                        friction + log_text);
  EXPECT_GT(test::rms(blind.log.q - free.log.q), 2 * error);
}

TEST(Scenario, MujocoWritesTheSameFiles) {
  for (const std::string top : {"plant = \"mujoco\"", "plant = \"mujoco\"\nmotion = \"closed_loop\""}) {
    const Played played =
        play("mujoco", test::puma_scenario(top, "encoder_bits = 17\ntorque_noise = 0.01") + friction + log_text);
    EXPECT_EQ(played.log.samples(), 2000);
    EXPECT_EQ(played.truth.tau.rows(), 2000);
    EXPECT_EQ(played.plant.joints[0].effects.size(), 2U);
    EXPECT_NEAR(test::rms((played.log.tau - played.truth.tau).col(0)), 0.976, 0.05);
  }
}

TEST(Scenario, AutoregressiveNoiseHasItsSizeAndMemory) {
  const std::string text = test::puma_scenario("", "ar_noise = 0.02\nar_pole = 0.9\nsample_s = 0.001") +
                           "[[log]]\nname = \"run\"\nduration_s = 60\nseed = 7\n";
  const Played played = play("ar", text);
  const MatrixXd noise = played.log.tau - played.truth.tau;
  const Eigen::Index n = noise.rows();
  const VectorXd e = noise.col(1);
  EXPECT_NEAR(test::rms(e), 0.02 * 186.4, 0.02 * 186.4 * 0.05);
  const double power = e.squaredNorm();
  for (const Eigen::Index lag : {1, 5, 10}) {
    EXPECT_NEAR(e.head(n - lag).dot(e.tail(n - lag)) / power, std::pow(0.9, lag), 0.05) << lag;
  }
  EXPECT_LT(std::fabs(noise.col(0).dot(noise.col(1))), 0.05 * noise.col(0).norm() * noise.col(1).norm());
  // Stationary from the first sample on, over many sessions; and the white noise stays what it was.
  double first = 0;
  constexpr int sessions = 200;
  std::string many = test::puma_scenario("", "ar_noise = 0.02\nar_pole = 0.99");
  for (int k = 0; k < sessions; ++k)
    many += fmt::format("[[log]]\nname = \"s{}\"\nduration_s = 0.01\nseed = {}\n", k, k);
  const auto files = simulate(test::write("many.toml", many), test::folder() / "many");
  for (std::size_t k = 0; k < sessions; ++k) {
    const Log log = read_log(files[k], 6, std::vector<bool>(6, true), {}, {}, {});
    LogFormat format;
    format.columns = {{"q", "tau"}};
    const Log truth = read_log(test::folder() / "many" / fmt::format("s{}.truth.csv", k), 6,
                               std::vector<bool>(6, false), format, {}, {});
    first += std::pow((log.tau(0, 0) - truth.tau(0, 0)) / (0.02 * 97.6), 2) / sessions;
  }
  EXPECT_NEAR(first, 1, 0.3);
}

/// A vibration is a sine of its amplitude and frequency on the measured torque alone, in another phase on every joint
/// and log.
TEST(Scenario, VibrationIsOnTheMeasuredTorque) {
  const std::string sensors = "sample_s = 0.001\ntorque_vibration = { amplitude = 0.02, frequency_hz = 62.5 }";
  const std::string another = "[[log]]\nname = \"other\"\nduration_s = 4\nseed = 8\n";
  const Played still = play("still", test::puma_scenario("", "sample_s = 0.001") + friction + log_text);
  const Played played = play("vibrates", test::puma_scenario("", sensors) + friction + log_text + another);
  EXPECT_EQ(played.truth.tau, still.truth.tau);
  EXPECT_EQ(played.log.q, still.log.q);
  const std::array rated{97.6, 186.4, 89.4, 24.2, 20.1, 21.3};
  const MatrixXd vibration = played.log.tau - still.log.tau;
  std::vector<double> phases;
  for (Eigen::Index j = 0; j < 6; ++j) {
    // 4 s hold a whole number of its periods, so that sine and cosine are orthogonal over the log.
    const Eigen::ArrayXd angle = 2 * std::numbers::pi * 62.5 * still.log.t.array();
    const double half = 0.5 * static_cast<double>(vibration.rows());
    const double in_phase = (vibration.col(j).array() * angle.sin()).sum() / half;
    const double quadrature = (vibration.col(j).array() * angle.cos()).sum() / half;
    const double amplitude = 0.02 * rated[static_cast<std::size_t>(j)];
    EXPECT_NEAR(std::hypot(in_phase, quadrature), amplitude, 1e-6 * amplitude) << j;
    // .. and nothing else is in it.
    EXPECT_NEAR(test::rms(vibration.col(j)), amplitude / std::sqrt(2.0), 1e-6 * amplitude) << j;
    phases.push_back(std::atan2(quadrature, in_phase));
  }
  for (std::size_t j = 1; j < phases.size(); ++j) EXPECT_GT(std::fabs(phases[j] - phases[0]), 1e-3) << j;
}

/// The white noise and the other draws stay what they were.
TEST(Scenario, VibrationLeavesTheNoiseAsItWas) {
  const std::string noise = "torque_noise = 0.01\nar_noise = 0.01";
  const std::string both = noise + "\ntorque_vibration = { amplitude = 0.02, frequency_hz = 60 }";
  const Played quiet = play("noise", test::puma_scenario("", "") + log_text);
  const Played noisy = play("noise", test::puma_scenario("", noise) + log_text);
  const Played shaken =
      play("noise", test::puma_scenario("", "torque_vibration = { amplitude = 0.02, frequency_hz = 60 }") + log_text);
  const Played all = play("noise", test::puma_scenario("", both) + log_text);
  EXPECT_LT(((all.log.tau - shaken.log.tau) - (noisy.log.tau - quiet.log.tau)).cwiseAbs().maxCoeff(), 1e-9);
}

/// With the paper's vibration is the paper's scenario and nothing else: a robot or trajectory that differs would be
/// compared.
TEST(Scenario, ThePapersVibrationIsItsScenarioAndAVibration) {
  const std::filesystem::path paper = std::filesystem::path(FXDYN_SOURCE_DIR) / "host_tools" / "demo" / "paper";
  const Scenario with = read_scenario(paper / "scenario_vibration.toml");
  const Scenario without = read_scenario(paper / "scenario.toml");
  EXPECT_GT(with.vibration.amplitude, 0);
  EXPECT_EQ(without.vibration.amplitude, 0);
  const auto lines = [](const std::filesystem::path& file) {
    std::vector<std::string> kept;
    std::istringstream text(read_file(file));
    for (std::string line; std::getline(text, line);) {
      line = line.substr(0, line.find('#'));
      while (!line.empty() && line.back() == ' ') line.pop_back();
      if (!line.empty() && line.rfind("torque_vibration", 0) != 0) kept.push_back(line);
    }
    return kept;
  };
  EXPECT_EQ(lines(paper / "scenario_vibration.toml"), lines(paper / "scenario.toml"));
  std::vector<std::string> project = lines(paper / "project_vibration.toml");
  for (std::string& line : project) {
    if (line == "scenario = \"scenario_vibration.toml\"") line = "scenario = \"scenario.toml\"";
  }
  EXPECT_EQ(project, lines(paper / "project.toml"));
}

TEST(Scenario, JitteredStampsAreReadAndResampled) {
  const std::string sensors = "exact_motion = true";
  const Played regular = play("regular", test::puma_scenario("", sensors) + friction + log_text);
  const Played irregular = play("irregular", test::puma_scenario("", sensors + "\njitter = 0.5") + friction + log_text);
  EXPECT_FALSE(regular.log.resampled);
  ASSERT_TRUE(irregular.log.resampled);
  const VectorXd off = irregular.log.stamps - regular.log.t;
  EXPECT_LE(off.cwiseAbs().maxCoeff(), 0.0005);
  EXPECT_GT(off.maxCoeff(), 0.0004);
  EXPECT_NEAR(test::rms(off), 0.0005 / std::sqrt(3.0), 2e-5);
  // Sampled at the very instants: resampled it is the regular log again.
  const Eigen::Index common = std::min(regular.log.samples(), irregular.log.samples());
  const MatrixXd back = interpolate(irregular.log.q, irregular.log.t, regular.log.t.head(common));
  EXPECT_LT((back - regular.log.q.topRows(common)).middleRows(2, common - 4).cwiseAbs().maxCoeff(), 1e-5);
  const MatrixXd tau = interpolate(irregular.truth.tau, irregular.truth.t, regular.log.t.head(common));
  EXPECT_LT(test::rms((tau - regular.truth.tau.topRows(common)).middleRows(2, common - 4)), 0.2);
}

TEST(Scenario, StartsShiftTheStampsAndWarmTheDrift) {
  const std::string sensors = "exact_motion = true\nstart_s = 1000";
  const std::string drift = test::effect_text(1, "friction_drift", "time_constant = 30, coulomb = 0, viscous = 5");
  for (const std::string top : {"", "plant = \"mujoco\""}) {
    const Played cold = play("cold", test::puma_scenario(top, sensors) + drift + log_text);
    const Played warm = play("warm", test::puma_scenario(top, sensors) + drift + log_text + "start_s = 45\n");
    EXPECT_EQ(cold.log.t[0], 1000);
    EXPECT_EQ(warm.log.t[0], 1045);
    EXPECT_EQ(cold.log.q, warm.log.q);
    for (Eigen::Index k = 0; k < cold.log.samples(); k += 100) {
      const double t = 0.002 * static_cast<double>(k), more = std::exp(-t / 30) - std::exp(-(t + 45) / 30);
      EXPECT_NEAR((warm.truth.tau - cold.truth.tau)(k, 0), more * 5 * cold.log.dq(k, 0), 1e-6);
    }
  }
}

TEST(Scenario, AmplitudeScalesTheMotionAboutItsCentre) {
  const std::string head = test::puma_scenario("", "exact_motion = true") + log_text;
  const Log whole = play("whole", head).log, part = play("part", head + "amplitude = 0.05\n").log;
  EXPECT_LT((whole.q.row(0) - part.q.row(0)).cwiseAbs().maxCoeff(), 1e-12);  // a period starts at the centre
  EXPECT_LT((part.dq - 0.05 * whole.dq).cwiseAbs().maxCoeff(), 1e-12);
  EXPECT_LT((part.ddq - 0.05 * whole.ddq).cwiseAbs().maxCoeff(), 1e-12);
}

/// What is refused as no friction (BadScenario lugre) is taken just below, and further up with viscous friction beside
/// it.
TEST(Scenario, LugreIsTakenWhileItBrakes) {
  const auto lugre = [](double damping, const std::string& more) {
    return test::puma_scenario("", "") + more +
           test::effect_text(
               2, "lugre",
               fmt::format("distance = 0.01, velocity = 0.3, share = 0.5, static = 8, damping = {}", damping)) +
           log_text;
  };
  EXPECT_NO_THROW(read_scenario(test::write("brakes.toml", lugre(57, ""))));
  EXPECT_THROW(read_scenario(test::write("drives.toml", lugre(58, ""))), InputError);
  // + 10 n / (1 - n) = 21.6
  const std::string viscous = test::effect_text(2, "viscous", "coefficient = 10");
  EXPECT_NO_THROW(read_scenario(test::write("viscous.toml", lugre(79, viscous))));
  EXPECT_THROW(read_scenario(test::write("viscous_drives.toml", lugre(80, viscous))), InputError);
}

TEST(Scenario, LongDelaysMakeThePlantsStepCoarser) {
  const std::string text = test::puma_scenario("", "exact_motion = true") + log_text;
  const Played late = play("late", text + test::effect_text(2, "delay", "time = 0.02, share = 1"));
  const Played now = play("now", text);
  EXPECT_LT((late.truth.tau.bottomRows(1990).col(1) - now.truth.tau.topRows(1990).col(1)).cwiseAbs().maxCoeff(), 1e-9);
}

class BadScenario : public testing::TestWithParam<test::Bad> {};

TEST_P(BadScenario, IsRefusedWithItsLine) {
  const auto file = test::write(GetParam().name + ".toml", GetParam().text);
  test::expect_refused(file, GetParam().message, [&] { simulate(file, test::folder() / "bad"); });
}

std::string scenario(const std::string& top, const std::string& sensors, const std::string& more = {}) {
  return test::puma_scenario(top, sensors) + more + log_text;
}

// Lines count from "seed = 4".
INSTANTIATE_TEST_SUITE_P(
    Scenario, BadScenario,
    testing::Values(
        test::Bad{"plant", scenario("plant = \"mojoco\"", ""), {":2:", "unknown plant 'mojoco'", "mujoco"}},
        test::Bad{"motion", scenario("motion = \"loop\"", ""), {":2:", "unknown motion", "closed_loop"}},
        test::Bad{"control", scenario("[control]\nbandwidth_hz = 6", ""), {":2:", "closed_loop"}},
        test::Bad{
            "bandwidth", scenario("motion = \"closed_loop\"\n[control]\nbandwidth_hz = 0", ""), {":4:", "above 0"}},
        test::Bad{
            "tick", scenario("motion = \"closed_loop\"\n[control]\ntick_s = 0.1", ""), {":3:", "ticks of at most"}},
        test::Bad{"key", scenario("motion = \"closed_loop\"\n[control]\ntick = 0.1", ""), {":4:", "'tick'", "tick_s"}},
        test::Bad{"jitter", scenario("", "jitter = 1.0"), {":4:", "below 1"}},
        test::Bad{"vibration_amplitude",
                  scenario("", "torque_vibration = { amplitude = -0.1, frequency_hz = 60 }"),
                  {":4:", "torque_vibration.amplitude", "above 0"}},
        test::Bad{"vibration_nan",
                  scenario("", "torque_vibration = { amplitude = nan, frequency_hz = 60 }"),
                  {":4:", "torque_vibration.amplitude", "expected a number"}},
        test::Bad{"vibration_alone",
                  scenario("", "torque_vibration = { amplitude = 0.1 }"),
                  {":4:", "'frequency_hz' is missing"}},
        test::Bad{"vibration_fast",
                  scenario("", "torque_vibration = { amplitude = 0.1, frequency_hz = 250 }"),
                  {":4:", "below 250", "500 Hz"}},
        test::Bad{"vibration_key",
                  scenario("", "torque_vibration = { amplitude = 0.1, frequency = 60, frequency_hz = 60 }"),
                  {":4:", "'frequency'", "frequency_hz"}},
        test::Bad{"vibration_number", scenario("", "torque_vibration = 0.1"), {":4:", "expected a table"}},
        test::Bad{"ar_noise", scenario("", "ar_noise = -0.1"), {":4:", "at least 0"}},
        test::Bad{"ar_pole", scenario("", "ar_pole = 1.0"), {":4:", "below 1"}},
        test::Bad{"amplitude", scenario("", "") + "amplitude = 2.0", {":15:", "at most 1"}},
        test::Bad{"start", scenario("", "") + "start_s = -1", {":15:", "at least 0"}},
        test::Bad{"noise", scenario("", "torque_noise = -0.1"), {":4:", "at least 0"}},
        test::Bad{"two_names", scenario("", "", log_text), {":15:", "\"run\" is there already"}},
        test::Bad{"outside",
                  test::puma_scenario("", "") + "[[log]]\nname = \"../run\"\nduration_s = 4\nseed = 7\n",
                  {":9:", "without a folder"}},
        test::Bad{"no_time",
                  test::puma_scenario("", "") + "[[log]]\nname = \"run\"\nduration_s = 0.001\nseed = 7\n",
                  {":9:", "less than two samples"}},
        test::Bad{"elastic",
                  scenario("plant = \"mujoco\"", "",
                           test::effect_text(1, "elasticity", "compliance = 1e-4, relaxation = 0.004")),
                  {":9:", "rotor_inertia"}},
        test::Bad{"delay",
                  scenario("motion = \"closed_loop\"", "", test::effect_text(1, "delay", "time = 0.01, share = 1")),
                  {":9:", "0.0075 s at most"}},
        // n = 0.5 + 0.5 / e = 0.684 at 0.3 rad/s: it brakes up to 8 / 0.3 * n / (1 - n) = 57.7 N*m s/rad
        test::Bad{"lugre",
                  scenario("", "",
                           test::effect_text(2, "lugre",
                                             "distance = 0.01, velocity = 0.3, share = 0.5, static = 8, damping = 60")),
                  {":9:", "lugre: with a damping of 60", "at most 57.7"}},
        test::Bad{"peer",
                  scenario("", "", test::effect_text(1, "joint_coupling", "joint = 7, coulomb = 1, viscous = 1")),
                  {":12:", "another joint of 1 .. 6"}},
        test::Bad{"self",
                  scenario("", "", test::effect_text(2, "joint_coupling", "joint = 2, coulomb = 1, viscous = 1")),
                  {":12:", "another joint of 1 .. 6"}},
        test::Bad{
            "joints",
            scenario("", "", "[[effect]]\nname = \"viscous\"\njoint = [1, 7]\nparameters = { coefficient = 1 }\n"),
            {":11:", "the robot has 6 joints"}},
        test::Bad{
            "twice",
            scenario("", "", "[[effect]]\nname = \"viscous\"\njoint = [1, 1]\nparameters = { coefficient = 1 }\n"),
            {":11:", "joint 1 has viscous already"}},
        test::Bad{
            "each",
            scenario("", "", "[[effect]]\nname = \"viscous\"\njoint = [1, 2]\nparameters = { coefficient = [1] }\n"),
            {":12:", "has 1 values, expected 2"}},
        test::Bad{"plan", scenario("", "") + "plan = \"nowhere.json\"\ntrajectory = \"fast\"\n", {"nowhere.json"}},
        test::Bad{"backlash",
                  scenario("plant = \"mujoco\"\nmotion = \"closed_loop\"", "",
                           test::effect_text(1, "rotor_inertia", "inertia = 1") +
                               test::effect_text(1, "backlash", "half_gap = 1e-3, torque_scale = 1")),
                  {":14:", "prescribed"}}),
    [](const auto& bad) { return bad.param.name; });

}  // namespace
}  // namespace fxdyn
