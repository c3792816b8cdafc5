// What [train] lets one choose: sparse features, growing sizes, inputs and activations, from logs to fixed point.

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <set>

#include "host_tools/effects/evaluator.hpp"
#include "host_tools/effects/identified_model.hpp"
#include "host_tools/export/export.hpp"
#include "host_tools/export/proof.hpp"
#include "host_tools/pipeline/pipeline.hpp"
#include "host_tools/signals/fourier.hpp"
#include "host_tools/support/files.hpp"
#include "host_tools/support/random.hpp"
#include "host_tools/train/sparse_features.hpp"
#include "host_tools/train/train.hpp"
#include "host_tools/train/tuning.hpp"
#include "tests/support/chains.hpp"
#include "tests/support/files.hpp"
#include "tests/support/filter.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
namespace fs = std::filesystem;

MatrixXd random_inputs(Index rows, Index columns) {
  Random random(9);
  return MatrixXd::NullaryExpr(rows, columns, [&] { return random.uniform(-1, 1); });
}

TEST(SparseFeatures, LassoIsTheMinimum) {
  // Where W is not zero the slope of the squares is -lambda sign(W), elsewhere at most lambda: what makes it a minimum.
  const MatrixXd u = random_inputs(500, 5), a = u * random_inputs(5, 10);
  constexpr double lambda = 1e-3;
  const MatrixXd w = lasso(a, u, lambda);
  const MatrixXd slope = a.transpose() * (a * w - u) / 500;
  int zeros = 0;
  for (Index i = 0; i < w.size(); ++i) {
    const double x = w.data()[i], s = slope.data()[i];
    if (x == 0) {
      ++zeros;
      EXPECT_LE(std::fabs(s), 1.01 * lambda);
    } else {
      EXPECT_NEAR(s, x > 0 ? -lambda : lambda, 0.01 * lambda) << x;
    }
  }
  // Ten features for five inputs: at most five of ten pay.
  EXPECT_GE(zeros, w.size() / 2);
  EXPECT_LT((a * w - u).norm(), 0.05 * u.norm());
}

TEST(SparseFeatures, AreTheSameAgainAndFewerNodesAreTheFirstOfMore) {
  const MatrixXd u = random_inputs(300, 4);
  const MatrixXd forty = sparse_weights(u, 40, 3, 6, 5);
  EXPECT_EQ(sparse_weights(u, 40, 3, 6, 5), forty);
  EXPECT_EQ(sparse_weights(u, 10, 3, 6, 5), forty.topRows(10));
  EXPECT_NE(sparse_weights(u, 40, 3, 6, 6), forty);
  MatrixXd inputs(300, 5);
  inputs << u, VectorXd::Ones(300);
  const VectorXd largest = (inputs * forty.transpose()).cwiseAbs().colwise().maxCoeff();
  EXPECT_LE(largest.maxCoeff(), 2 + 1e-9);
  EXPECT_GT(largest.minCoeff(), 0.5);
}

/// The PUMA 560 with friction that Coulomb's and viscous coefficients do not explain.
IdentifiedModel plant() {
  IdentifiedModel model;
  model.robot = read_urdf(test::puma560);
  const DhChain chain = to_dh(model.robot);
  for (std::size_t j = 0; j < model.robot.size(); ++j) {
    model.inertia.push_back(to_link_inertia(model.robot.joints[j].inertial.value_or(Inertial{}), chain.urdf_in_dh[j]));
    JointFit joint;
    joint.rated_torque = joint.tau_limit = model.robot.joints[j].limits->effort;
    joint.sign_width = 0.03;
    joint.q_lower = -2;
    joint.q_upper = 2;
    joint.dq_limit = 2;
    joint.ddq_limit = 10;
    const auto add = [&](const char* name, double share, std::vector<double> shape) {
      EffectFit fit;
      fit.effect = name;
      fit.linear = {share * joint.rated_torque};
      fit.shape = std::move(shape);
      joint.effects.push_back(fit);
    };
    add("viscous", 0.02, {});
    add("coulomb", 0.03, {});
    add("presliding", 0.03, {0.01});
    add("stribeck", 0.02, {0.1});
    model.joints.push_back(joint);
  }
  return model;
}

std::vector<ProcessedLog> record(const IdentifiedModel& model, int count) {
  std::vector<ProcessedLog> logs;
  for (int l = 0; l < count; ++l) {
    Log log;
    log.file = fmt::format("log_{}.csv", l);
    log.step_s = 0.004;
    log.role = l + 1 < count ? Role::train : Role::validate;
    constexpr Index samples = 2500;
    const auto n = static_cast<Index>(model.robot.size());
    log.t = VectorXd::LinSpaced(samples, 0, log.step_s * (samples - 1));
    log.to_s = log.step_s * samples;
    log.q.resize(samples, n);
    log.dq = log.ddq = log.q;
    for (Index j = 0; j < n; ++j) {
      const FourierJoint joint =
          random_fourier(40 + static_cast<std::uint64_t>(10 * l + j), 5, 10, {-2, 2, 2, 10}, l % 2 == 0 ? 1 : 0.3);
      for (Index k = 0; k < samples; ++k) {
        const FourierState state = evaluate(joint, 10, log.t[k]);
        log.q(k, j) = state.q;
        log.dq(k, j) = state.dq;
        log.ddq(k, j) = state.ddq;
      }
    }
    log.tau = predict(model, log.q, log.dq, log.ddq, log.step_s);
    Random random(static_cast<std::uint64_t>(l) + 1);
    for (double& tau : log.tau.reshaped()) tau += 0.1 * random.normal();
    logs.push_back(process(std::move(log), test::filter_of(25, 12, 0.3)));
  }
  return logs;
}

std::vector<JointFit> nominal(const IdentifiedModel& model) {
  std::vector<JointFit> design = model.joints;
  for (JointFit& joint : design) joint.effects.resize(2);
  return design;
}

TEST(Growth, EverySizeAndRidgeIsTheFitFromScratch) {
  const IdentifiedModel model = plant();
  const std::vector<ProcessedLog> logs = record(model, 3);
  Fitter fitter(model.robot, logs, nominal(model));
  fitter.reweight();
  const std::vector<Index> sizes{10, 20, 40};
  const std::vector<double> ridges{1e-5, 1e-4, 1e-3, 1e-2};
  TrainSettings settings;
  for (const std::size_t j : {std::size_t{0}, std::size_t{4}}) {
    const JointFit largest = BlsDesigner(fitter, j, settings)({.nodes = 40});
    const std::vector<std::vector<Judgement>> grown = fitter.held_out_with(j, largest, sizes, ridges);
    ASSERT_EQ(grown.size(), sizes.size());
    for (std::size_t s = 0; s < sizes.size(); ++s) {
      const JointFit design = BlsDesigner(fitter, j, settings)({.nodes = sizes[s]});
      EXPECT_EQ(design.bls->weights, first_nodes(largest, sizes[s]).bls->weights);
      const std::vector<Judgement> fresh = fitter.held_out_with(j, design, ridges);
      ASSERT_EQ(grown[s].size(), ridges.size());
      for (std::size_t r = 0; r < ridges.size(); ++r) {
        EXPECT_NEAR(grown[s][r].rmse, fresh[r].rmse, 1e-7 * fresh[r].rmse) << sizes[s] << ' ' << ridges[r];
        EXPECT_NEAR(grown[s][r].coefficient_sum, fresh[r].coefficient_sum, 1e-5 * fresh[r].coefficient_sum)
            << sizes[s] << ' ' << ridges[r];
        ASSERT_EQ(grown[s][r].blocks.size(), fresh[r].blocks.size());
        for (std::size_t b = 0; b < fresh[r].blocks.size(); ++b)
          EXPECT_NEAR(grown[s][r].blocks[b], fresh[r].blocks[b], 1e-7 * fresh[r].blocks[b]);
      }
    }
  }
}

TEST(Growth, JointsWithABlsOfTheirOwnStayAsTheyAre) {
  const IdentifiedModel model = plant();
  const std::vector<ProcessedLog> logs = record(model, 2);
  Fitter fitter(model.robot, logs, nominal(model));
  fitter.reweight();
  TrainSettings settings;
  fitter.set_design(1, BlsDesigner(fitter, 1, settings)({.nodes = 6, .ridge = 1e-3}));
  const JointFit design = BlsDesigner(fitter, 3, settings)({.nodes = 12});
  const double grown = fitter.held_out_with(3, design, std::vector<Index>{12}, {1e-3})[0][0].rmse;
  EXPECT_NEAR(grown, fitter.held_out_with(3, design, {1e-3})[0].rmse, 1e-7 * grown);
}

TEST(Training, NothingIsKeptWhereTrainLogsDoNotPredictOneAnother) {
  const IdentifiedModel model = plant();
  std::vector<ProcessedLog> logs = record(model, 3);
  const auto kept = [&](double carries_over) {
    Fitter fitter(model.robot, logs, nominal(model));
    fitter.reweight();
    Progress progress;
    return train(fitter, {}, progress, {}, {.carries_over = carries_over})[0].kept;
  };
  EXPECT_TRUE(kept(0.1));  // a validate log judges what the drive will do, whatever the structure does there
  logs.back().role = Role::train;
  EXPECT_TRUE(kept(3));
  EXPECT_FALSE(kept(0.1));
}

TEST(Designs, ASigmoidIsHalfATanhAndAnOffset) {
  const IdentifiedModel model = plant();
  const std::vector<ProcessedLog> logs = record(model, 2);
  Fitter fitter(model.robot, logs, nominal(model));
  TrainSettings settings;
  const BlsDesigner designer(fitter, 0, settings);
  const JointFit tanh = designer({.nodes = 8, .scale = 2}),
                 sigmoid = designer({.activation = "sigmoid", .nodes = 8, .scale = 2});
  EXPECT_EQ(sigmoid.bls->activation, "tanh");
  EXPECT_LE((2 * sigmoid.bls->weights - tanh.bls->weights).cwiseAbs().maxCoeff(), 1.5 / 512);  // the weights' grid
  EXPECT_NE(sigmoid.find("offset"), nullptr);
  EXPECT_EQ(tanh.find("offset"), nullptr);
  // The columns span those of sigmoids: 1 / (1 + e^-x) = 1/2 + tanh(x / 2) / 2.
  for (const double x : {-3.0, -0.2, 0.0, 1.7}) EXPECT_NEAR(1 / (1 + std::exp(-x)), 0.5 + std::tanh(x / 2) / 2, 1e-15);
  // With an offset there already none is added.
  EffectFit offset;
  offset.effect = "offset";
  JointFit design = fitter.design(0);
  design.effects.push_back(offset);
  fitter.set_design(0, design);
  EXPECT_EQ(BlsDesigner(fitter, 0, settings)({.activation = "sigmoid", .nodes = 8}).effects.size(),
            design.effects.size());
}

TEST(Designs, ASwarmMayChooseTheActivation) {
  TrainSettings settings;
  EXPECT_EQ(BlsSpace(settings).lower().size(), 7);
  settings.pso = PsoSettings{};
  settings.pso->activations = {"tanh", "relu"};
  const BlsSpace space(settings);
  ASSERT_EQ(space.lower().size(), 8);
  EXPECT_EQ(space(space.lower()).activation, "tanh");
  EXPECT_EQ(space(space.upper()).activation, "relu");
}

TEST(Designs, ASwarmSearchesTheStribeckVelocityAndTheShareOfBristles) {
  TrainSettings settings;
  settings.inputs = "bristles";
  settings.pso = PsoSettings{};
  settings.pso->activations = {"tanh", "relu"};
  const BlsSpace space(settings);
  ASSERT_EQ(space.lower().size(), 10);
  EXPECT_NEAR(space(space.lower()).stribeck, 3e-3, 1e-12);
  EXPECT_NEAR(space(space.upper()).stribeck, 0.3, 1e-12);
  EXPECT_EQ(space(space.lower()).share, 0.4);
  EXPECT_EQ(space(space.upper()).share, 0.95);
  EXPECT_EQ(space(space.upper()).activation, "relu");
}

TEST(Designs, ExtendedInputsNeedTheRigidBodysTorque) {
  const IdentifiedModel model = plant();
  const std::vector<ProcessedLog> logs = record(model, 2);
  Fitter fitter(model.robot, logs, nominal(model));
  TrainSettings settings;
  settings.inputs = "extended";
  const JointFit design = BlsDesigner(fitter, 1, settings)({.nodes = 6});
  EXPECT_THROW(fitter.held_out_with(1, design, {1e-3}), InputError);
  fitter.set_structural(structural_torque(model, logs));
  EXPECT_LT(fitter.held_out_with(1, design, {1e-3})[0].rmse, fitter.held_out()[1].rmse);
  // Columns of the fit are the model's: what is fitted is what is predicted.
  fitter.set_design(1, design);
  const MatrixXd u = fitter.bls_inputs(1, *design.bls);
  EXPECT_EQ(u.cols(), 8);
  EXPECT_LE(u.cwiseAbs().maxCoeff(), 1.0);
}

/// Two joints with friction that has a memory, a spring that follows the angle and friction that grows with the load.
std::string scenario() {
  test::write("arm.urdf", R"(<robot name="arm"><link name="base"/>
<link name="upper"><inertial><origin xyz="0.2 0.01 0"/><mass value="5"/><inertia ixx="0.01" ixy="0" ixz="0" iyy="0.08" iyz="0" izz="0.08"/></inertial></link>
<link name="fore"><inertial><origin xyz="0.15 0 0.02"/><mass value="3"/><inertia ixx="0.006" ixy="0" ixz="0" iyy="0.05" iyz="0" izz="0.05"/></inertial></link>
<joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><origin xyz="0 0 0.3"/><axis xyz="0 1 0"/><limit lower="-2" upper="2" velocity="2" effort="60"/></joint>
<joint name="elbow" type="revolute"><parent link="upper"/><child link="fore"/><origin xyz="0.4 0 0"/><axis xyz="0 1 0"/><limit lower="-2" upper="2" velocity="2" effort="60"/></joint>
</robot>
)");
  std::string text =
      "seed = 4\n[sensors]\nencoder_bits = 20\ntorque_noise = 0.003\n[robot]\nurdf = \"arm.urdf\"\n"
      "rated_torque = [60, 20]\nacceleration = [8, 8]\n";
  for (const char* joint : {"1", "2"}) {
    for (const char* effect : {"viscous/coefficient = 1.0", "coulomb/amplitude = 1.5, width = 0.004",
                               "presliding/distance = 0.004, amplitude = 1.5",
                               "stribeck/velocity = 0.1, amplitude = 0.6", "load_friction/coefficient = 0.1"}) {
      const std::string all = effect;
      const std::size_t slash = all.find('/');
      text += fmt::format("[[effect]]\nname = \"{}\"\njoint = {}\nparameters = {{ {} }}\n", all.substr(0, slash), joint,
                          all.substr(slash + 1));
    }
  }
  for (const char* log : {"a", "b", "c"})
    text += fmt::format("[[log]]\nname = \"{}\"\nduration_s = 20\nspeed = 0.6\nseed = {}\n", log, int{log[0]});
  return test::write("arm.toml", text).filename().string();
}

fs::path project(const std::string& name, const std::string& train) {
  std::string text = "[robot]\nurdf = \"arm.urdf\"\nrated_torque = [60, 20]\n";
  const char* roles[] = {"train", "validate", "test"};
  for (int i = 0; i < 3; ++i)
    text += fmt::format("[[log]]\nscenario = \"{}\"\nlog = \"{}\"\nrole = \"{}\"\n", scenario(), "abc"[i], roles[i]);
  return test::write(
      name, text + "[identify]\neffects = [\"viscous\", \"coulomb\"]\n[diagnose]\nmax_effects = 0\n[train]\n" + train);
}

/// metrics.json has what the search settled on for every joint, kept or not.
void expect_choices(const fs::path& out, const std::string& inputs, const std::string& by) {
  const IdentifiedModel model = read_model(out / "model.json");
  const nlohmann::json training = nlohmann::json::parse(read_file(out / "metrics.json")).at("training");
  ASSERT_EQ(training.size(), 2U);
  for (std::size_t j = 0; j < 2; ++j) {
    const nlohmann::json& choice = training[j].at("choice");
    EXPECT_EQ(choice.at("by"), by);
    EXPECT_EQ(choice.at("inputs"), inputs);
    EXPECT_EQ(choice.contains("distances"), inputs != "state");
    EXPECT_EQ(choice.contains("generations"), by == "pso");
    EXPECT_GE(training[j].at("evaluations").get<int>(), choice.value("generations", 1));
    // The price of multiplications and rounding comes on top of the error.
    const double rated = model.joints[j].rated_torque, error = training[j].at("held_out_with");
    EXPECT_GT(choice.at("J").get<double>(), error / rated);
    EXPECT_LT(choice.at("J").get<double>(), error / rated + 1e-3);
    EXPECT_EQ(training[j].at("kept").get<bool>(), model.joints[j].bls.has_value());
    if (!model.joints[j].bls) continue;
    const BroadLearningFit& bls = *model.joints[j].bls;
    EXPECT_EQ(choice.at("nodes").get<Index>(), bls.nodes());
    EXPECT_EQ(choice.at("ridge").get<double>(), bls.ridge);
    EXPECT_EQ(choice.at("reference_velocity").get<double>(), bls.reference_velocity);
  }
}

TEST(Train, EveryKindGoesFromLogsToFixedPointWithinTheProvenBound) {
  struct Case {
    const char *name, *train, *inputs, *activation;
  };
  for (const Case& c : {Case{"extended", "inputs = \"extended\"\n", "extended", "tanh"},
                        Case{"extended_relu", "inputs = \"extended\"\nactivation = \"relu\"\n", "extended", "relu"},
                        Case{"state", "inputs = \"state\"\n", "state", "tanh"},
                        Case{"relu", "activation = \"relu\"\n", "physical", "relu"},
                        Case{"sigmoid", "activation = \"sigmoid\"\n", "physical", "tanh"},
                        Case{"sparse", "features = \"sparse\"\n", "physical", "tanh"},
                        Case{"swarm",
                             "[train.pso]\nparticles = 6\niterations = 3\nactivations = [\"tanh\", \"relu\"]\n"
                             "bounds = { nodes = [4, 12] }\n",
                             "physical", nullptr}}) {
    const fs::path out = test::folder() / c.name;
    Pipeline pipeline(project(std::string(c.name) + ".toml", c.train), out);
    pipeline.export_tables();  // refuses models whose fixed point leaves the proven bound on logs and beyond
    const IdentifiedModel model = read_model(out / "model.json");
    const Proof proof = prove(model, &model.formats.value());
    std::vector<TickStates> states{within_limits(model, 3000, 3)};
    for (const ProcessedLog& log : pipeline.logs(Role::test)) states.push_back(at_ticks(log, model.tick_s));
    const QuantisationError error = quantisation_error(model, *model.formats, states);
    int kept = 0;
    for (std::size_t j = 0; j < 2; ++j) {
      EXPECT_LE(error.largest[static_cast<Index>(j)], proof.error[static_cast<Index>(j)]) << c.name;
      if (!model.joints[j].bls) continue;
      ++kept;
      EXPECT_EQ(model.joints[j].bls->inputs, c.inputs) << c.name;
      const std::string& activation = model.joints[j].bls->activation;
      EXPECT_EQ(activation, c.activation != nullptr ? c.activation : activation) << c.name;
    }
    // Friction with a memory: the state alone says nothing of it, and is kept nowhere.
    if (c.inputs == std::string("state")) {
      EXPECT_EQ(kept, 0);
    } else {
      EXPECT_GE(kept, 1) << c.name;
    }
    expect_choices(out, c.inputs, c.name == std::string("swarm") ? "pso" : "grid");
    // Tables made again from the file are the same words.
    EXPECT_EQ(FixedModel(model, *model.formats).crc(), model.tables_crc) << c.name;
  }
}

TEST(Train, OlderModelsAreReadAsTheyWere) {
  const fs::path out = test::folder() / "older";
  Pipeline(project("older.toml", "nodes = 10\n"), out).train();
  std::string text = read_file(out / "model.json");
  const IdentifiedModel now = read_model(out / "model.json");
  const auto erase = [&](const std::string& what) {
    for (std::size_t at = text.find(what); at != std::string::npos; at = text.find(what)) {
      const std::size_t end = text.find('\n', at);
      text.erase(at, end + 1 - at);
    }
  };
  erase("\"inputs\": \"physical\",");
  erase("\"activation\": \"tanh\",");
  EXPECT_EQ(text.find("\"inputs\""), std::string::npos);
  const IdentifiedModel then = read_model(test::write("older.json", text));
  ASSERT_TRUE(now.joints[0].bls.has_value());
  EXPECT_EQ(then.joints[0].bls->inputs, "physical");
  EXPECT_EQ(then.joints[0].bls->activation, "tanh");
  EXPECT_EQ(then.joints[0].bls->weights, now.joints[0].bls->weights);
  EXPECT_EQ(then.joints[0].bls->distances, now.joints[0].bls->distances);
}

TEST(Train, WrongOptionsAreRefusedWithWhatIsThere) {
  test::expect_refused(project("bad.toml", "inputs = \"all\"\n"), {"inputs", "extended"},
                       [&] { Pipeline(test::folder() / "bad.toml", test::folder() / "bad"); });
  test::expect_refused(project("bad.toml", "activation = \"sine\"\n"), {"activation", "relu"},
                       [&] { Pipeline(test::folder() / "bad.toml", test::folder() / "bad"); });
  test::expect_refused(project("bad.toml", "features = \"learned\"\n"), {"features", "sparse"},
                       [&] { Pipeline(test::folder() / "bad.toml", test::folder() / "bad"); });
  test::expect_refused(project("bad.toml", "[train.pso]\nactivations = []\n"), {"activation"},
                       [&] { Pipeline(test::folder() / "bad.toml", test::folder() / "bad"); });
}

}  // namespace
}  // namespace fxdyn
