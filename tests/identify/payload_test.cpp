#include "host_tools/identify/payload.hpp"
#include "host_tools/effects/identified_model.hpp"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "host_tools/effects/evaluator.hpp"
#include "host_tools/pipeline/one_log.hpp"
#include "host_tools/pipeline/pipeline.hpp"
#include "host_tools/regression/physical.hpp"
#include "host_tools/signals/fourier.hpp"
#include "host_tools/support/files.hpp"
#include "host_tools/support/random.hpp"
#include "tests/support/chains.hpp"
#include "tests/support/files.hpp"
#include "tests/support/filter.hpp"

namespace fxdyn {
namespace {

namespace fs = std::filesystem;

constexpr double step_s = 0.004;

IdentifiedModel puma() {
  IdentifiedModel model;
  model.robot = read_urdf(test::puma560);
  const DhChain chain = to_dh(model.robot);
  const double rated[] = {97.6, 186.4, 89.4, 24.2, 20.1, 21.3};
  for (std::size_t i = 0; i < 6; ++i) {
    model.inertia.push_back(to_link_inertia(*model.robot.joints[i].inertial, chain.urdf_in_dh[i]));
    JointFit joint;
    joint.rated_torque = rated[i];
    for (const auto& [name, value] : {std::pair{"coulomb", 0.03 * rated[i]}, std::pair{"viscous", 0.02 * rated[i]}}) {
      EffectFit effect;
      effect.effect = name;
      effect.linear = {value};
      joint.effects.push_back(effect);
    }
    joint.q_lower = joint.dq_limit = joint.ddq_limit = joint.tau_limit = 0;
    model.joints.push_back(joint);
  }
  model.filter = test::filter_of(100, 20, 0.2);
  return model;
}

Inertial load() {
  Inertial body;
  body.mass = 2.5;
  body.centre = {0.03, -0.02, 0.1};
  body.tensor = Eigen::Vector3d(0.006, 0.007, 0.005).asDiagonal();
  return body;
}

IdentifiedModel with_load(IdentifiedModel model, const Inertial& body) {
  const DhChain chain = to_dh(model.robot);
  model.inertia.back() = from_pseudo_inertia(pseudo_inertia(model.inertia.back()) +
                                             pseudo_inertia(to_link_inertia(body, chain.urdf_in_dh.back())));
  for (JointFit& joint : model.joints) joint.effects[0].linear[0] *= 1.2;  // Coulomb friction rises with the load
  return model;
}

/// 20 s of random motion. @param speed share of the velocity and acceleration limits; noise: share of rated torque
Log record(const IdentifiedModel& plant, double noise, std::uint64_t seed, double speed = 1) {
  const auto n = static_cast<Eigen::Index>(plant.robot.size());
  Log log;
  log.file = "loaded.csv";
  log.step_s = step_s;
  constexpr Eigen::Index samples = 5000;
  log.t = Eigen::VectorXd::LinSpaced(samples, 0, step_s * (samples - 1));
  log.to_s = step_s * samples;
  log.q.resize(samples, n);
  log.dq = log.ddq = log.q;
  for (Eigen::Index j = 0; j < n; ++j) {
    const auto& limits = *plant.robot.joints[static_cast<std::size_t>(j)].limits;
    const double acceleration = 10 * speed * speed;
    const FourierJoint joint = random_fourier(100 + static_cast<std::uint64_t>(j), 5, 10 / speed,
                                              {limits.lower, limits.upper, speed * limits.velocity, acceleration}, 1);
    for (Eigen::Index k = 0; k < samples; ++k) {
      const FourierState state = evaluate(joint, 10 / speed, log.t[k]);
      log.q(k, j) = state.q;
      log.dq(k, j) = state.dq;
      log.ddq(k, j) = state.ddq;
    }
  }
  log.tau = predict(plant, log.q, log.dq, log.ddq, step_s);
  Random random(seed);
  for (Eigen::Index j = 0; j < n; ++j) {
    for (Eigen::Index k = 0; k < samples; ++k)
      log.tau(k, j) += noise * plant.joints[static_cast<std::size_t>(j)].rated_torque * random.normal();
  }
  return log;
}

TEST(Load, IsExactWithoutNoise) {
  const IdentifiedModel model = puma();
  const LoadFit fit = identify_load(model, process(record(with_load(model, load()), 0, 1), model.filter));
  EXPECT_FALSE(fit.constrained);
  EXPECT_NEAR(fit.body.mass, 2.5, 1e-6);
  EXPECT_LT((fit.body.centre - load().centre).norm(), 1e-6);
  EXPECT_LT((fit.body.tensor - load().tensor).norm(), 1e-6);
  for (Eigen::Index j = 0; j < 6; ++j) {
    EXPECT_NEAR(fit.coulomb[j], 0.2 * model.joints[static_cast<std::size_t>(j)].effects[0].linear[0], 1e-6);
    EXPECT_LT(fit.after[j], 1e-6 * fit.before[j]);
  }
  for (const LoadParameter& parameter : fit.parameters) EXPECT_TRUE(parameter.identifiable) << parameter.name;
}

TEST(Load, NoisyDataGivesMassAndCentreWithHonestDeviations) {
  const IdentifiedModel model = puma();
  const Inertial truth = load();
  const IdentifiedModel plant = with_load(model, truth);
  constexpr int runs = 50;
  int covered = 0;
  double square = 0;
  for (int run = 0; run < runs; ++run) {
    const LoadFit fit =
        identify_load(model, process(record(plant, 0.01, 1000 + static_cast<std::uint64_t>(run)), model.filter));
    EXPECT_NEAR(fit.body.mass, truth.mass, 0.01 * truth.mass);
    EXPECT_LT((fit.body.centre - truth.centre).norm(), 0.002);
    EXPECT_EQ(
        Eigen::LLT<Eigen::Matrix4d>(pseudo_inertia(to_link_inertia(fit.body, Eigen::Isometry3d::Identity()))).info(),
        Eigen::Success);
    const double errors[] = {fit.body.mass - truth.mass, fit.body.centre.x() - truth.centre.x(),
                             fit.body.centre.y() - truth.centre.y(), fit.body.centre.z() - truth.centre.z()};
    for (std::size_t k = 0; k < 4; ++k) {
      const double ratio = errors[k] / fit.parameters[k].std;
      covered += std::fabs(ratio) < 1.96;
      square += ratio * ratio / (4 * runs);
    }
  }
  // 95 % of 200; four standard deviations of a binomial either side are 0.89 and 1.
  EXPECT_GE(covered, 178);
  EXPECT_NEAR(std::sqrt(square), 1, 0.25);
  RecordProperty("covered", covered);
  RecordProperty("ratio", std::to_string(std::sqrt(square)));
}

TEST(Load, SlowMotionTellsItByGravityAlone) {
  const IdentifiedModel model = puma();
  const LoadFit fit = identify_load(model, process(record(with_load(model, load()), 0.005, 3, 0.1), model.filter));
  EXPECT_NEAR(fit.body.mass, 2.5, 0.05 * 2.5);
  EXPECT_LT((fit.body.centre - load().centre).norm(), 0.02);
}

template <class Error>
std::string message_of(const IdentifiedModel& model, const Log& log) {
  try {
    identify_load(model, process(log, model.filter));
  } catch (const Error& error) {
    return error.what();
  }
  return "nothing thrown";
}

TEST(Load, SaysWhatIsWrong) {
  IdentifiedModel model = puma();
  const Log empty = record(model, 0.01, 5);
  EXPECT_NE(message_of<DataError>(model, empty).find("no load to be seen"), std::string::npos);

  // A turntable: one vertical axis, which can't tell mass from inertia.
  IdentifiedModel table = puma();
  table.robot.joints.resize(1);
  table.inertia.resize(1);
  table.joints.resize(1);
  const std::string message = message_of<DataError>(table, record(with_load(table, load()), 0.001, 6));
  EXPECT_NE(message.find("mass of the load cannot be identified"), std::string::npos) << message;
  EXPECT_NE(message.find("no joint of this robot lifts the load"), std::string::npos) << message;

  // Standing still.
  Log still = record(with_load(model, load()), 0.01, 7);
  for (Eigen::Index k = 0; k < still.samples(); ++k) still.q.row(k) = still.q.row(0);
  still.dq.setZero();
  still.ddq.setZero();
  EXPECT_NE(message_of<DataError>(model, still).find("move joint"), std::string::npos)
      << message_of<DataError>(model, still);

  Log no_torque = empty;
  no_torque.tau.resize(0, 0);
  EXPECT_NE(message_of<InputError>(model, no_torque).find("no torque"), std::string::npos);
  EffectFit payload;
  payload.effect = "payload";
  payload.linear = {1, 0, 0, 0};
  model.body.push_back(payload);
  EXPECT_NE(message_of<InputError>(model, empty).find("has a payload already"), std::string::npos);
}

TEST(Load, ModelWithItPredictsTheLoadedLog) {
  IdentifiedModel model = puma();
  model.log_formats[""] = {};
  const fs::path folder = test::folder();
  write_file(folder / "model.json", to_json(model).dump());
  Inertial point = load();
  point.tensor *= 0.01;
  IdentifiedModel plant = with_load(model, point);
  for (JointFit& joint : plant.joints) joint.effects[0].linear[0] /= 1.2;
  write_log(folder / "loaded.csv", record(plant, 0.001, 9));
  identify_payload(folder / "model.json", folder / "loaded.csv", folder / "loaded");
  const auto report = nlohmann::json::parse(read_file(folder / "loaded" / "payload.json"));
  EXPECT_EQ(report.at("schema"), "fxdyn.payload/1");
  EXPECT_NEAR(report.at("mass").at("value"), 2.5, 0.025);
  const IdentifiedModel loaded = read_model(folder / "loaded" / "model.json");
  const Log log = record(plant, 0, 9);
  const Eigen::MatrixXd error = predict(loaded, log.q, log.dq, log.ddq, step_s) - log.tau;
  const Eigen::MatrixXd before = predict(model, log.q, log.dq, log.ddq, step_s) - log.tau;
  for (Eigen::Index j = 1; j < 5; ++j) EXPECT_LT(error.col(j).norm(), 0.03 * before.col(j).norm()) << j;
  EXPECT_THROW(identify_payload(folder / "model.json", folder / "loaded.csv", folder), InputError);
}

}  // namespace
}  // namespace fxdyn
