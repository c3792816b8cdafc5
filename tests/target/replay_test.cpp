#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdlib>
#include <nlohmann/json.hpp>

#include "host_tools/effects/effects.hpp"
#include "host_tools/effects/identified_model.hpp"
#include "host_tools/export/export.hpp"
#include "host_tools/export/proof.hpp"
#include "host_tools/hil/qemu_target.hpp"
#include "host_tools/pipeline/pipeline.hpp"
#include "host_tools/readers/log_reader.hpp"
#include "host_tools/replay/replay.hpp"
#include "host_tools/signals/filter.hpp"
#include "host_tools/support/files.hpp"
#include "host_tools/support/random.hpp"
#include "host_tools/update/update.hpp"
#include "tests/diagnose/arm.hpp"
#include "tests/support/broad_learning.hpp"
#include "tests/support/data.hpp"
#include "tests/support/files.hpp"

namespace fxdyn {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

void shell(const std::string& command) { ASSERT_EQ(std::system(command.c_str()), 0) << command; }

/// Runs the project up to its tables, builds the firmware from them, replays on QEMU and checks every bit.
json replay_on_target(const fs::path& project, const fs::path& out) {
  Pipeline pipeline(project, out);
  pipeline.export_tables();
  shell(FXDYN_SOURCE_DIR "/toolchains/build_image.sh " + (out / "tables.hpp").string() + " " +
        (out / "firmware").string());
  const fs::path image = out / "firmware" / "fxdyn-mps2-an386.elf";
  EXPECT_TRUE(replay(pipeline, image, 1500).same);

  // The page in flash is tables.bin, byte for byte: one can be flashed for the other.
  const fs::path page = out / "page.bin";
  shell("arm-none-eabi-objcopy -O binary --only-section=.fxdyn_tables " + image.string() + " " + page.string());
  const std::string expected = read_file(out / "tables.bin");
  EXPECT_EQ(read_file(page).substr(0, expected.size()), expected);
  return json::parse(read_file(out / "replay.json"));
}

void expect_exact(const json& replayed, Eigen::Index at_least) {
  EXPECT_TRUE(replayed.at("bit_exact").get<bool>());
  Eigen::Index ticks = 0;
  bool perturbed = false;
  for (const json& log : replayed.at("logs")) {
    ticks += log.at("ticks").get<Eigen::Index>();
    EXPECT_EQ(log.at("different_ticks"), 0);
    if (log.at("log").get<std::string>().find("perturbed") != std::string::npos) {
      perturbed = true;
      EXPECT_GT(log.at("saturations").get<int>(), 0);  // it leaves the limits on purpose
      continue;
    }
    for (const json& joint : log.at("joints"))
      EXPECT_LT(joint.at("largest_error_of_rated").get<double>(), 1e-4) << joint.at("joint");
  }
  EXPECT_TRUE(perturbed);
  EXPECT_GE(ticks, at_least);
}

TEST(Target, FirmwareGivesTheHostsBitsOnASimulatedRobot) {
  // All effects, a BLS with few nodes, and a sliding joint.
  std::string urdf = read_file(FXDYN_SOURCE_DIR "/host_tools/demo/puma560.urdf");
  const fs::path robot = test::write("arm.urdf", urdf);
  std::string text =
      "seed = 4\n[sensors]\nencoder_bits = 17\ntorque_noise = 0.01\n[robot]\nurdf = \"arm.urdf\"\n"
      "rated_torque = [97.6, 186.4, 89.4, 24.2, 20.1, 21.3]\nacceleration = [10, 10, 10, 20, 20, 20]\n";
  for (int j = 1; j <= 6; ++j) {
    const std::string head = "joint = " + std::to_string(j) + "\nparameters = ";
    text += "[[effect]]\nname = \"coulomb\"\n" + head + "{ amplitude = 1.5 }\n[[effect]]\nname = \"viscous\"\n" + head +
            "{ coefficient = 0.8 }\n";
    text += "[[effect]]\nname = \"presliding\"\n" + head + "{ amplitude = 1.5, distance = 0.003 }\n";
    text += "[[effect]]\nname = \"stribeck\"\n" + head + "{ amplitude = 0.6, velocity = 0.1 }\n";
  }
  for (const char* log : {"a", "b", "c"})
    text += std::string("[[log]]\nname = \"") + log + "\"\nduration_s = 10\nseed = " + std::to_string(log[0]) + "\n";
  test::write("scenario.toml", text);
  text =
      "[robot]\nurdf = \"arm.urdf\"\nrated_torque = [97.6, 186.4, 89.4, 24.2, 20.1, 21.3]\n[train]\nnodes = 10\n"
      "[identify]\neffects = [\"viscous\", \"coulomb\", \"offset\", \"rotor_inertia\"]\n";
  const char* roles[] = {"train", "validate", "test"};
  for (int i = 0; i < 3; ++i)
    text +=
        std::string("[[log]]\nscenario = \"scenario.toml\"\nlog = \"") + "abc"[i] + "\"\nrole = \"" + roles[i] + "\"\n";
  const fs::path project = test::write("project.toml", text);
  expect_exact(replay_on_target(project, test::folder() / "simulated"), 3000);
}

/// An arm whose joints 2 and 5 have every effect of the catalogue and a BLS, of different kinds, and whose joint 3
/// slides, with a load and on a tilted base.
IdentifiedModel every_effect() {
  IdentifiedModel model;
  model.robot = read_urdf(FXDYN_SOURCE_DIR "/host_tools/demo/puma560.urdf");
  model.robot.joints[2].type = JointType::prismatic;
  const DhChain chain = to_dh(model.robot);
  Random random(8);
  for (std::size_t j = 0; j < 6; ++j) {
    model.inertia.push_back(to_link_inertia(*model.robot.joints[j].inertial, chain.urdf_in_dh[j]));
    JointFit joint;
    joint.rated_torque = joint.tau_limit = 200;
    joint.q_lower = j == 2 ? -0.4 : -2.5;
    joint.q_upper = j == 2 ? 0.5 : 2;
    joint.dq_limit = 3;
    joint.ddq_limit = 15;
    joint.sign_width = 0.02;
    if (j == 1 || j == 4) {
      for (const std::string_view name : joint_effect_names()) {
        const EffectInfo& info = *find_effect(name);
        EffectFit fit;
        fit.effect = name;
        for (const ParameterInfo& shape : info.shape)
          fit.shape.push_back(shape.name == "joint"   ? 3
                              : shape.name == "ratio" ? -0.8
                                                      : std::clamp(0.011, shape.lower, shape.upper));
        for (std::size_t i = 0; i < info.linear.size(); ++i)
          fit.linear.push_back(info.acts_on == ActsOn::position ? 1e-3 : random.uniform(0.1, 1));
        joint.effects.push_back(fit);
      }
      BroadLearningFit bls;
      bls.reference_velocity = 0.05;
      bls.weights = Eigen::MatrixXd::NullaryExpr(7, 5, [&] { return std::round(512 * random.uniform(-2, 2)) / 512; });
      bls.coefficients = Eigen::VectorXd::NullaryExpr(11, [&] { return random.uniform(-3, 3); });
      joint.bls = j == 1 ? bls : test::random_bls("extended", "relu", joint, 7, 2, 8);
    }
    model.joints.push_back(joint);
  }
  model.body.resize(2);
  model.body[0].effect = "payload";
  model.body[0].linear = {1.5, 0.02, -0.01, 0.1};
  model.body[1].effect = "gravity_tilt";
  model.body[1].linear = {0.05, -0.02};
  return model;
}

TEST(Target, EveryEffectGivesTheHostsBits) {
  const IdentifiedModel model = every_effect();
  const Formats formats = choose_formats(model);
  const Eigen::VectorXd proven = prove(model, &formats).error;
  TickStates states = within_limits(model, 400, 2);
  states.q.bottomRows(100) *= 1e3;  // far beyond the limits
  const QuantisationError error = quantisation_error(model, formats, {within_limits(model, 2000, 3)});
  for (Eigen::Index j = 0; j < 6; ++j) EXPECT_LE(error.largest[j], proven[j]) << "joint " << j + 1;
  struct Case {
    std::uint32_t outputs;
    const char *preset, *machine;
  };
  // all joints; the two with effects, on every core; one without
  for (const Case& on : {Case{0x3f, "cortex-m4", "mps2-an386"}, Case{0x12, "cortex-m3", "mps2-an385"},
                         Case{0x12, "cortex-m7", "mps2-an500"}, Case{0x12, "cortex-m33", "mps2-an505"},
                         Case{0x04, "cortex-m4", "mps2-an386"}}) {
    const std::uint32_t outputs = on.outputs;
    const fs::path out = test::folder() / ("every" + std::to_string(outputs) + on.preset);
    fs::create_directories(out);
    write_tables(model, formats, error, proven, outputs, out);
    shell(FXDYN_SOURCE_DIR "/toolchains/build_image.sh " + (out / "tables.hpp").string() + " " + out.string() + " " +
          on.preset);
    QemuTarget::Options options;
    options.machine = on.machine;
    QemuTarget target(out / ("fxdyn-" + std::string(on.machine) + ".elf"), options);
    FixedModel fixed(model, formats, outputs);
    const serial::Identity identity = target.hello();
    ASSERT_EQ(identity.state, serial::NodeState::ready);
    EXPECT_EQ(identity.layout_hash, fixed.layout_hash());
    EXPECT_EQ(identity.outputs, outputs);
    std::uint32_t fewest = UINT32_MAX, most = 0, saturated = 0;
    for (Eigen::Index k = 0; k < states.t.size(); ++k) {
      const std::vector<std::int32_t> words = raw_states(states, k, formats);
      Saturations saturations;
      const std::vector<std::int32_t> expected = fixed.tick(words, saturations);
      const TickReply reply = target.tick(words);
      ASSERT_EQ(reply.torques, expected) << "tick " << k;
      ASSERT_EQ(reply.saturations, saturations.count) << "tick " << k;
      fewest = std::min(fewest, reply.instructions);
      most = std::max(most, reply.instructions);
      saturated += saturations.count;
    }
    EXPECT_EQ(fewest, most) << "instructions depend on the data";
    EXPECT_GT(saturated, 0U);
  }
}

TEST(Target, AnUpdatedPageRunsInTheOldImageAndADamagedOneDoesNot) {
  const test::Arm arm("updated");
  const fs::path project =
      test::write("updated.project",
                  "[robot]\nurdf = \"updated.urdf\"\nrated_torque = [40, 15]\n[diagnose]\nmax_effects = 0\n"
                  "[train]\nnodes = 10\n[[log]]\nrole = \"train\"\nfile = \"" +
                      arm.logs[0].string() + "\"\n");
  // A second session, with more friction.
  Log worn = read_log(arm.logs[1], 2, {true, true}, {}, {}, {});
  worn.tau += 0.4 * (differentiate(worn.q, worn.step_s) / 0.02).array().tanh().matrix();
  write_log(test::folder() / "worn.csv", worn);

  const fs::path out = test::folder() / "updated_out";
  Pipeline pipeline(project, out);
  pipeline.export_tables();
  const IdentifiedModel before = pipeline.model();
  struct Board {
    const char *preset, *machine;
  };
  const Board boards[] = {{"cortex-m4", "mps2-an386"}, {"cortex-m33", "mps2-an505"}};
  const auto image = [&](const Board& board) {
    return out / board.preset / ("fxdyn-" + std::string(board.machine) + ".elf");
  };
  for (const Board& board : boards)
    shell(FXDYN_SOURCE_DIR "/toolchains/build_image.sh " + (out / "tables.hpp").string() + " " +
          (out / board.preset).string() + " " + board.preset);
  EXPECT_TRUE(replay(pipeline, image(boards[0]), 500).same);
  EXPECT_EQ(json::parse(read_file(out / "replay.json")).at("tables_in"), "image");

  ASSERT_TRUE(update(pipeline, {test::folder() / "worn.csv", {}, false}).accepted);
  const IdentifiedModel after = pipeline.model();
  ASSERT_NE(after.tables_crc, before.tables_crc);
  EXPECT_TRUE(replay(pipeline, image(boards[0]), 1500).same);
  const json replayed = json::parse(read_file(out / "replay.json"));
  EXPECT_EQ(replayed.at("tables_in"), "update slot");
  EXPECT_EQ(replayed.at("tables_crc"), after.tables_crc);
  expect_exact(replayed, 3000);

  // Whole, it is what the node computes with; one byte wrong or half of it, the node says that it runs on its own.
  const std::string page = read_file(out / "tables.bin");
  const auto with_byte = [&](std::size_t at) {
    std::string damaged = page;
    damaged[at] = static_cast<char>(damaged[at] ^ 0x10);
    return damaged;
  };
  struct Flashed {
    std::string bytes;
    const IdentifiedModel& runs;
  };
  const Flashed cases[] = {{page, after},
                           {with_byte(0), before},
                           {with_byte(5), before},
                           {with_byte(13), before},
                           {with_byte(page.size() / 2), before},
                           {page.substr(0, page.size() / 2), before}};
  const TickStates states = within_limits(before, 50, 4);
  for (const Board& board : boards) {
    for (const Flashed& flashed : cases) {
      QemuTarget::Options options;
      options.machine = board.machine;
      options.update_page = test::folder() / "page,flashed.bin";
      write_file(options.update_page, flashed.bytes);
      QemuTarget target(image(board), options);
      const serial::Identity identity = target.hello();
      ASSERT_EQ(identity.state, serial::NodeState::ready);
      EXPECT_EQ(identity.tables_crc, flashed.runs.tables_crc) << board.machine;
      FixedModel fixed(flashed.runs, *flashed.runs.formats);
      EXPECT_EQ(identity.layout_hash, fixed.layout_hash());
      for (Eigen::Index k = 0; k < states.t.size(); ++k) {
        const std::vector<std::int32_t> words = raw_states(states, k, fixed.formats());
        Saturations saturations;
        const std::vector<std::int32_t> expected = fixed.tick(words, saturations);
        ASSERT_EQ(target.tick(words).torques, expected) << board.machine << ", tick " << k;
      }
    }
  }
}

TEST(Demo, TheBlsLearnsTheFrictionThatTheModelLeavesOut) {
  // Diagnosis would find that friction by name: here it may not name any.
  const fs::path demo = FXDYN_SOURCE_DIR "/host_tools/demo", out = test::folder() / "demo";
  std::string text = read_file(demo / "project.toml");
  for (const std::string name : {"puma560.urdf", "scenario.toml"}) {
    for (std::size_t at = text.find('"' + name); at != std::string::npos; at = text.find('"' + name, at + 1))
      text.insert(at + 1, demo.string() + "/");
  }
  write_file(test::folder() / "nameless.toml", text + "\n[diagnose]\nmax_effects = 0\n");
  Pipeline(test::folder() / "nameless.toml", out).train();
  const json metrics = json::parse(read_file(out / "metrics.json"));
  // [diagnosed, bls][joint]: squared error over the test logs
  std::array<std::array<double, 6>, 2> square{};
  for (std::size_t s = 0; s < 2; ++s) {
    for (const json& log : metrics.at("stages").at(s + 2).at("logs")) {
      if (log.at("role") != "test") continue;
      for (std::size_t j = 0; j < 6; ++j) square[s][j] += std::pow(log.at("joints").at(j).at("rmse").get<double>(), 2);
    }
  }
  int improved = 0;
  for (std::size_t j = 0; j < 6; ++j) {
    const bool kept = metrics.at("training").at(j).at("kept");
    improved += kept && std::sqrt(square[1][j]) <= 0.7 * std::sqrt(square[0][j]);
  }
  EXPECT_GE(improved, 4);
}

TEST(Target, FirmwareGivesTheHostsBitsOnARealLog) {
  for (const char* set : {"ur10_unisa", "emps"}) {  // six revolute joints; one prismatic
    FXDYN_NEEDS_DATA(set);
    const fs::path project = fs::path(FXDYN_SOURCE_DIR) / "tests" / "real" / (std::string(set) + ".toml");
    expect_exact(replay_on_target(project, test::folder() / set), 1000);
  }
}

}  // namespace
}  // namespace fxdyn
