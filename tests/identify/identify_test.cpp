#include "host_tools/identify/identify.hpp"
#include "host_tools/effects/identified_model.hpp"
#include "host_tools/effects/link_parameters.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <sstream>

#include "host_tools/effects/evaluator.hpp"
#include "host_tools/pipeline/one_log.hpp"
#include "host_tools/pipeline/pipeline.hpp"
#include "host_tools/readers/log_reader.hpp"
#include "host_tools/readers/truth.hpp"
#include "host_tools/robot/write_urdf.hpp"
#include "host_tools/simulate/simulate.hpp"
#include "host_tools/support/files.hpp"
#include "tests/support/files.hpp"

namespace fxdyn {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

const std::string robot_lines = "urdf = \"" FXDYN_SOURCE_DIR "/host_tools/demo/puma560.urdf\"\n";

/// A scenario with three trajectories of the PUMA 560; `more` adds sensors and effects.
fs::path scenario(const std::string& name, const std::string& more) {
  std::string text = "seed = 1\n" + more + "[robot]\n" + robot_lines +
                     "rated_torque = [97.6, 186.4, 89.4, 24.2, 20.1, 21.3]\nacceleration = [10, 10, 10, 20, 20, 20]\n";
  for (const char* log : {"a", "b", "c"})
    text += std::string("[[log]]\nname = \"") + log + "\"\nduration_s = 10\nseed = " + std::to_string(log[0]) + "\n";
  return test::write(name, text);
}

fs::path project(const std::string& name, const fs::path& scenario_file, const std::string& more) {
  std::string text = more + "[robot]\n" + robot_lines + "rated_torque = [97.6, 186.4, 89.4, 24.2, 20.1, 21.3]\n";
  const char* roles[] = {"train", "validate", "test"};
  for (int i = 0; i < 3; ++i) {
    text += std::string("[[log]]\nscenario = \"") + scenario_file.filename().string() + "\"\nlog = \"" + "abc"[i] +
            "\"\nrole = \"" + roles[i] + "\"\n";
  }
  return test::write(name, text);
}

/// Largest relative error of any joint on the test logs.
double worst_relative(const fs::path& directory) {
  double worst = 0;
  int joints = 0;
  const json metrics = json::parse(read_file(directory / "metrics.json"));
  for (const json& log : metrics.at("logs")) {
    if (log.at("role") != "test") continue;
    for (const json& joint : log.at("joints")) {
      worst = std::max(worst, joint.at("relative").get<double>());
      ++joints;
    }
  }
  EXPECT_EQ(joints, 6);
  return worst;
}

constexpr const char* rigid_only = "[identify]\neffects = []\n[train]\nenabled = false\n";

TEST(Identify, ExactMotionWithoutNoiseGivesTheRigidModelToOneInAMillionMillion) {
  const fs::path file = project("exact.toml", scenario("exact_s.toml", "[sensors]\nexact_motion = true\n"), rigid_only);
  const fs::path out = test::folder() / "exact";
  Pipeline(file, out).identify();
  EXPECT_LT(worst_relative(out), 1e-9);
}

TEST(Identify, PositionAloneWithoutNoiseGivesTheRigidModelToOneInAHundredThousand) {
  const fs::path file = project("position.toml", scenario("position_s.toml", ""), rigid_only);
  const fs::path out = test::folder() / "position";
  Pipeline(file, out).identify();
  EXPECT_LT(worst_relative(out), 1e-5);
}

TEST(Identify, RecoversTheParametersThatMadeTheData) {
  std::string effects = "[sensors]\nexact_motion = true\n";
  for (int j = 1; j <= 6; ++j) {
    const std::string joint = "joint = " + std::to_string(j) + "\n";
    effects += "[[effect]]\nname = \"viscous\"\n" + joint + "parameters = { coefficient = 1.5 }\n";
    effects += "[[effect]]\nname = \"offset\"\n" + joint + "parameters = { torque = 0.7 }\n";
    if (j >= 3) effects += "[[effect]]\nname = \"rotor_inertia\"\n" + joint + "parameters = { inertia = 0.3 }\n";
  }
  const fs::path file =
      project("recover.toml", scenario("recover_s.toml", effects),
              "[identify]\neffects = [\"viscous\", \"offset\", \"rotor_inertia\"]\n[train]\nenabled = false\n"
              "[signals]\nposition_cutoff_hz = 1000\ntorque_cutoff_hz = 1000\n");  // no filter: exact data
  const fs::path out = test::folder() / "recover";
  Pipeline(file, out).identify();
  const IdentifiedModel model = read_model(out / "model.json");
  for (std::size_t j = 0; j < 6; ++j) {
    EXPECT_NEAR(model.joints[j].find("viscous")->linear[0], 1.5, 1e-8);
    EXPECT_NEAR(model.joints[j].find("offset")->linear[0], 0.7, 1e-8);
    ASSERT_EQ(model.joints[j].find("rotor_inertia") != nullptr, j >= 2);  // J1, J2: absorbed by link inertia
    if (j < 2) continue;
    EXPECT_NEAR(model.joints[j].find("rotor_inertia")->linear[0], 0.3, 1e-8);
  }
  // Base parameters: grouping times the parameters of the plant.
  const IdentifiedModel truth = read_model(out / "logs" / "recover_s" / "truth.json");
  const BaseSet base = find_base(to_dh(truth.robot));
  Eigen::VectorXd parameters(60);
  for (std::size_t i = 0; i < 6; ++i) {
    const auto values = to_array(truth.inertia[i]);
    for (std::size_t p = 0; p < parameters_per_link; ++p) parameters[static_cast<Eigen::Index>(10 * i + p)] = values[p];
  }
  const Eigen::VectorXd beta = base.grouping * parameters;
  ASSERT_EQ(model.base.size(), base.columns.size());
  for (std::size_t i = 0; i < model.base.size(); ++i)
    EXPECT_NEAR(model.base[i].value, beta[static_cast<Eigen::Index>(i)], 1e-7 * (1 + beta.cwiseAbs().maxCoeff()))
        << model.base[i].name;
}

TEST(Identify, ModelFileKeepsEverythingThatPredictionNeeds) {
  const fs::path s =
      scenario("keep_s.toml",
               "[sensors]\nencoder_bits = 17\ntorque_noise = 0.01\n"
               "[[effect]]\nname = \"coulomb\"\njoint = 2\nparameters = { amplitude = 8.0 }\n"
               "[[effect]]\nname = \"presliding\"\njoint = 2\nparameters = { amplitude = 8.0, distance = 0.003 }\n");
  const fs::path out = test::folder() / "keep";
  Pipeline pipeline(project("keep.toml", s, "[train]\nnodes = 10\n"), out);
  pipeline.identify();
  pipeline.train();
  const IdentifiedModel model = read_model(out / "model.json");
  EXPECT_EQ(to_json(model).dump(), to_json([&] {
                                     write_file(test::folder() / "copy.json", to_json(model).dump());
                                     return read_model(test::folder() / "copy.json");
                                   }())
                                       .dump());
  // predict: from model.json and a log alone, at the log's own time stamps, and never over the log itself.
  const fs::path log = out / "logs" / "keep_s" / "c.csv";
  predict_log(out / "model.json", log, {}, test::folder() / "prediction");
  const auto lines = [](const fs::path& file) {
    const std::string text = read_file(file);
    return std::count(text.begin(), text.end(), '\n');
  };
  EXPECT_EQ(lines(test::folder() / "prediction" / "c.csv"), lines(log));
  // Below the torque's cut-off, unless as computed.
  predict_log(out / "model.json", log, {.raw = true}, test::folder() / "raw");
  const auto torque = [&](const char* folder) {
    return read_truth(test::folder() / folder / "c.csv", model.robot.size());
  };
  const Eigen::MatrixXd raw = torque("raw"), filtered = torque("prediction");
  const double apart = (raw - filtered).norm() / raw.norm();
  EXPECT_GT(apart, 1e-6);
  EXPECT_LT(apart, 0.05);
  EXPECT_THROW(predict_log(out / "model.json", log, {}, log.parent_path()), InputError);
  // CSV by name, too, whatever the log is.
  fs::copy_file(log, test::folder() / "c.run.txt", fs::copy_options::overwrite_existing);
  predict_log(out / "model.json", test::folder() / "c.run.txt", {}, test::folder() / "prediction");
  EXPECT_EQ(lines(test::folder() / "prediction" / "c.run.csv"), lines(log));
  // Beside the log it does not take another log's place.
  fs::copy_file(log, test::folder() / "c.run.csv", fs::copy_options::overwrite_existing);
  EXPECT_THROW(predict_log(out / "model.json", test::folder() / "c.run.txt", {}, test::folder()), InputError);
  fs::create_directories(test::folder() / "run_0.3");
  EXPECT_EQ(prediction_name(test::folder() / "run_0.3"), "run_0.3.csv");
  EXPECT_EQ(prediction_name("logs/run.csv.zst"), "run.csv");
  // The same input gives the same bytes, by `run` as by the verbs one by one, each a process of its own.
  const fs::path again = test::folder() / "again", verbs = test::folder() / "verbs";
  Pipeline(out.parent_path() / "keep.toml", again).run();
  Pipeline(out.parent_path() / "keep.toml", verbs).identify();
  Pipeline(out.parent_path() / "keep.toml", verbs).train();
  Pipeline(out.parent_path() / "keep.toml", verbs).export_tables();
  Pipeline(out.parent_path() / "keep.toml", verbs).report();
  for (const char* name : {"model.json", "metrics.json", "export.json", "tables.hpp", "tables.bin", "report.html"}) {
    EXPECT_EQ(read_file(again / name), read_file(verbs / name)) << name;
  }
}

TEST(Identify, FindsPreslidingWhereThereIsNoOtherFriction) {
  // Viscous friction is zero in truth and comes out a little negative: that must not keep the effect out.
  std::string effects = "[sensors]\nencoder_bits = 19\ntorque_noise = 0.002\n";
  for (int j = 1; j <= 6; ++j) {
    const std::string head = "joint = " + std::to_string(j) + "\nparameters = ";
    effects += "[[effect]]\nname = \"coulomb\"\n" + head + "{ amplitude = 4.0 }\n";
    effects += "[[effect]]\nname = \"presliding\"\n" + head + "{ amplitude = 4.0, distance = 0.01 }\n";
  }
  const fs::path out = test::folder() / "presliding";
  Pipeline(project("presliding.toml", scenario("presliding_s.toml", effects), ""), out).identify();
  const IdentifiedModel model = read_model(out / "model.json");
  for (std::size_t j = 0; j < model.joints.size(); ++j) {
    const EffectFit *fit = model.joints[j].find("presliding"), *coulomb = model.joints[j].find("coulomb");
    ASSERT_NE(fit, nullptr) << "joint " << j + 1;
    ASSERT_NE(coulomb, nullptr) << "joint " << j + 1;
    // 1.1 to 1.9 % too long: the filter rounds the corner that it is seen by. Amplitudes are off by 0.7 and 0.1 %.
    EXPECT_NEAR(fit->shape[0], 0.01, 0.03 * 0.01) << "joint " << j + 1;
    EXPECT_NEAR(fit->linear[0], 4, 0.01 * 4) << "joint " << j + 1;
    EXPECT_NEAR(coulomb->linear[0], 4, 0.005 * 4) << "joint " << j + 1;
  }
}

TEST(Identify, FindsLugresShapesWhereItIsAskedFor) {
  // The plant integrates it as a differential equation.
  std::string effects = "[sensors]\nencoder_bits = 19\ntorque_noise = 0.002\n";
  for (int j = 1; j <= 6; ++j) {
    const std::string head = "joint = " + std::to_string(j) + "\nparameters = ";
    effects += "[[effect]]\nname = \"coulomb\"\n" + head + "{ amplitude = 4.0 }\n";
    effects += "[[effect]]\nname = \"lugre\"\n" + head +
               "{ distance = 0.01, velocity = 0.1, share = 0.666667, static = 6.0, damping = 10.0 }\n";
  }
  const fs::path out = test::folder() / "lugre";
  Pipeline(project("lugre.toml", scenario("lugre_s.toml", effects),
                   "[identify]\neffects = [\"viscous\", \"coulomb\", \"offset\", \"rotor_inertia\", \"lugre\"]\n"),
           out)
      .identify();
  const IdentifiedModel model = read_model(out / "model.json");
  int found = 0;
  for (const JointFit& joint : model.joints) {
    const EffectFit* fit = joint.find("lugre");
    if (fit == nullptr) continue;
    found += std::fabs(fit->shape[0] - 0.01) < 0.002 && std::fabs(fit->shape[1] - 0.1) < 0.02 &&
             std::fabs(fit->shape[2] - 0.667) < 0.13 && std::fabs(fit->linear[0] - 6) < 0.73 &&
             std::fabs(fit->linear[1] - 10) < 1.5;
  }
  // Four standard deviations of joint 3, the least certain one; joint 2 reverses too seldom in one short log.
  EXPECT_GE(found, 5);
}

/// The PUMA's URDF with masses and inertias that are about 30 % off.
fs::path guessed_urdf(const std::string& name) {
  const fs::path original = FXDYN_SOURCE_DIR "/host_tools/demo/puma560.urdf";
  fs::path out = test::folder() / name;
  const Robot robot = read_urdf(original);
  const DhChain chain = to_dh(robot);
  const std::array factors{0.76, 0.94, 1.43, 1.08, 1.06, 1.22};
  std::vector<LinkInertia<Real>> links;
  for (std::size_t i = 0; i < robot.size(); ++i) {
    Inertial body = *robot.joints[i].inertial;
    body.mass *= factors[i];
    body.tensor *= factors[i];
    links.push_back(to_link_inertia(body, chain.urdf_in_dh[i]));
  }
  write_urdf(original, out, robot, chain, links);
  return out;
}

TEST(Identify, InertiasOfAUrdfThatAreThirtyPercentOffHelpAShortLog) {
  const fs::path made = scenario("prior_s.toml", "[sensors]\nencoder_bits = 17\ntorque_noise = 0.02\n");
  const fs::path urdf = guessed_urdf("guessed.urdf");
  const auto error = [&](const std::string& name, const std::string& identify) {
    std::string text = "[identify]\neffects = []\n" + identify + "[robot]\nurdf = \"" + urdf.string() +
                       "\"\nrated_torque = [97.6, 186.4, 89.4, 24.2, 20.1, 21.3]\n[train]\nenabled = false\n";
    for (const auto& [log, role] : {std::pair{"a", "train"}, {"c", "test"}}) {
      text +=
          "[[log]]\nscenario = \"" + made.filename().string() + "\"\nlog = \"" + log + "\"\nrole = \"" + role + "\"\n";
      if (role == std::string("train")) text += "to_s = 3\n";
    }
    const fs::path out = test::folder() / name;
    Pipeline(test::write(name + ".toml", text), out).identify();
    std::vector<double> relative;
    const json metrics = json::parse(read_file(out / "metrics.json"));
    for (const json& log : metrics.at("logs")) {
      if (log.at("role") != "test") continue;
      for (const json& joint : log.at("joints")) relative.push_back(joint.at("relative"));
    }
    return relative;
  };
  const std::vector<double> without = error("no_prior", ""), with = error("prior", "prior_error = 0.3\n");
  for (std::size_t j = 0; j < 6; ++j) EXPECT_LT(with.at(j), without.at(j)) << j;
  // The wrist's torque is noise for the most part, the elbow's is not.
  EXPECT_LT(with[2], 0.75 * without[2]);
}

TEST(Export, FixedPredictionRunsAtTheDrivesTicks) {
  // Log at 1 ms, drive at 4 ms: presliding must not run at the log's rate.
  const fs::path s = scenario(
      "rate_s.toml",
      "[sensors]\nsample_s = 0.001\n[[effect]]\nname = \"coulomb\"\njoint = 1\nparameters = { amplitude = 8.0 }\n"
      "[[effect]]\nname = \"presliding\"\njoint = 1\nparameters = { amplitude = 8.0, distance = 0.01 }\n");
  const fs::path out = test::folder() / "rate";
  Pipeline(project("rate.toml", s, "[target]\ntick_s = 0.004\n[train]\nenabled = false\n"), out).export_tables();
  const fs::path log = out / "logs" / "rate_s" / "c.csv";
  predict_log(out / "model.json", log, {}, test::folder() / "rate_real");
  predict_log(out / "model.json", log, {.fixed = true}, test::folder() / "rate_fixed");
  const auto relative = [](const fs::path& directory) {
    const json metrics = json::parse(read_file(directory / "metrics.json"));
    return metrics.at("logs").at(0).at("joints").at(0).at("relative").get<double>();
  };
  EXPECT_LT(relative(test::folder() / "rate_fixed"), relative(test::folder() / "rate_real") + 0.02);
}

TEST(Report, ExportsAgainWhenTheModelHasChanged) {
  const fs::path s = scenario(
      "stale_s.toml",
      "[sensors]\ntorque_noise = 0.01\n[[effect]]\nname = \"coulomb\"\njoint = 1\nparameters = { amplitude = 8.0 }\n");
  const fs::path out = test::folder() / "stale";
  Pipeline(project("stale.toml", s, "[train]\nenabled = false\n"), out).run();
  const std::string before = read_file(out / "tables.bin");
  Pipeline(project("stale.toml", s, "[train]\nenabled = false\n[identify]\neffects = [\"viscous\"]\n"), out).report();
  EXPECT_NE(read_file(out / "tables.bin"), before);
  EXPECT_EQ(json::parse(read_file(out / "export.json")).at("tables_crc"),
            json::parse(read_file(out / "model.json")).at("tables_crc"));
}

TEST(Simulate, SameScenarioSameBytesAndTruthApart) {
  const fs::path s = scenario("bytes.toml", "[sensors]\nencoder_bits = 16\ntorque_noise = 0.01\n");
  const auto one = simulate(s, test::folder() / "one"), two = simulate(s, test::folder() / "two");
  ASSERT_EQ(one.size(), 3U);
  for (std::size_t i = 0; i < one.size(); ++i) EXPECT_EQ(read_file(one[i]), read_file(two[i]));
  const Log log = read_log(one[0], 6, std::vector<bool>(6, true), {}, {}, {});
  const double step = 2 * M_PI / 65536;
  for (Eigen::Index k = 0; k < log.samples(); ++k) ASSERT_NEAR(std::remainder(log.q(k, 1), step), 0, 1e-9);
  EXPECT_EQ(log.dq.size(), 0);
  EXPECT_TRUE(fs::exists(test::folder() / "one" / "a.truth.csv"));
}

}  // namespace
}  // namespace fxdyn
