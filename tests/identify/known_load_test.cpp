// Gains from a known load, on torques of an inverse dynamics that is not the model's.

#include "host_tools/identify/known_load.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <kdl/chainidsolver_recursive_newton_euler.hpp>
#include <nlohmann/json.hpp>
#include <numbers>

#include "host_tools/effects/identified_model.hpp"
#include "host_tools/identify/payload_result.hpp"
#include "host_tools/pipeline/one_log.hpp"
#include "host_tools/pipeline/pipeline.hpp"
#include "host_tools/signals/fourier.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/files.hpp"
#include "host_tools/support/random.hpp"
#include "tests/support/chains.hpp"
#include "tests/support/files.hpp"
#include "tests/support/kdl.hpp"

namespace fxdyn {
namespace {

namespace fs = std::filesystem;
using Eigen::Index;
using Eigen::VectorXd;

const VectorXd rated = (VectorXd(6) << 97.6, 186.4, 89.4, 24.2, 20.1, 21.3).finished();

/// The PUMA 560 by KDL, with friction of another form than the model's.
struct Plant {
  Robot robot = read_urdf(test::puma560);
  VectorXd gain = VectorXd::Ones(6);  ///< torque over what the log calls torque
  double dry = 0.04, sliding = 0.03;  ///< shares of rated torque
  double load_friction = 0.05;        ///< share of what the joint carries
  double noise = 0.01;                ///< share of rated torque
  std::optional<Load> load{};
  Eigen::Vector3d tensor{0.002, 0.003, 0.0015};  ///< of the load about its own centre, which nobody knows

  KDL::Chain chain() const {
    KDL::Chain out = test::to_kdl(robot);
    if (load) {
      out.addSegment(KDL::Segment("load", KDL::Joint(KDL::Joint::None), KDL::Frame(test::to_kdl(load->com)),
                                  KDL::RigidBodyInertia(load->mass, KDL::Vector::Zero(),
                                                        KDL::RotationalInertia(tensor.x(), tensor.y(), tensor.z()))));
    }
    return out;
  }
  /// Sticks and slides: falls from breakaway with the speed, then rises with its root; grows with the load.
  double friction(Index j, double v, double carried) const {
    const double sign = 2 / std::numbers::pi * std::atan(v / 0.01);
    const double share = dry * (1 + 0.4 * std::exp(-std::pow(v / 0.08, 2))) + sliding * std::sqrt(std::fabs(v));
    return sign * (share * rated[j] + load_friction * std::fabs(carried));
  }
};

struct Recording {
  std::uint64_t motion = 100;  ///< seed of the trajectory
  std::uint64_t noise = 1;
  double speed = 1;  ///< share of the limits
  double duration_s = 60;
  double late_s = 0;  ///< the trajectory begins so much later
  Index still = -1;   ///< joint that does not move
};

Log record(const Plant& plant, const Recording& how) {
  constexpr Index n = 6;
  const KDL::Chain chain = plant.chain();
  KDL::ChainIdSolver_RNE dynamics(chain, KDL::Vector(0, 0, -9.81));
  Log log;
  log.file = "log.csv";
  log.step_s = 0.004;
  const auto samples = static_cast<Index>(how.duration_s / log.step_s);
  log.t = VectorXd::LinSpaced(samples, 0, log.step_s * static_cast<double>(samples - 1));
  log.to_s = how.duration_s;
  log.q = log.tau = Eigen::MatrixXd(samples, n);
  std::vector<FourierJoint> series;
  for (Index j = 0; j < n; ++j) {
    const Limits& limits = *plant.robot.joints[static_cast<std::size_t>(j)].limits;
    series.push_back(
        random_fourier(how.motion + static_cast<std::uint64_t>(j), 5, 10 / how.speed,
                       {limits.lower, limits.upper, how.speed * limits.velocity, 10 * how.speed * how.speed}, 1));
  }
  Random random(how.noise);
  KDL::JntArray q(n), dq(n), ddq(n), tau(n);
  const KDL::Wrenches none(chain.getNrOfSegments());
  for (Index k = 0; k < samples; ++k) {
    for (Index j = 0; j < n; ++j) {
      const FourierState state =
          j == how.still ? FourierState{0.3, 0, 0}
                         : evaluate(series[static_cast<std::size_t>(j)], 10 / how.speed, log.t[k] - how.late_s);
      const auto at = static_cast<unsigned>(j);
      q(at) = state.q;
      dq(at) = state.dq;
      ddq(at) = state.ddq;
    }
    EXPECT_GE(dynamics.CartToJnt(q, dq, ddq, none, tau), 0);
    log.q.row(k) = q.data.transpose();
    for (Index j = 0; j < n; ++j) {
      const double carried = tau.data[j];
      log.tau(k, j) =
          (carried + plant.friction(j, dq.data[j], carried) + plant.noise * rated[j] * random.normal()) / plant.gain[j];
    }
  }
  return log;
}

IdentifiedModel identified(const Plant& plant, const std::string& name) {
  const fs::path folder = test::folder();
  write_log(folder / (name + "_a.csv"), record(plant, {.noise = 1, .duration_s = 20}));
  write_log(folder / (name + "_b.csv"), record(plant, {.motion = 200, .noise = 2, .duration_s = 20}));
  // The URDF's masses are not the judge here: a check against them would see some of the gains.
  const std::string text = "[robot]\nurdf = \"" + test::puma560.string() + "\"\n[check]\ncolumns = false\n" +
                           "[[log]]\nfile = \"" + name + "_a.csv\"\nrole = \"train\"\n[[log]]\nfile = \"" + name +
                           "_b.csv\"\nrole = \"validate\"\n";
  Pipeline(test::write(name + ".toml", text), folder / name).identify();
  return read_model(folder / name / "model.json");
}

/// The wrist and the elbow carry about 5 % of their rated torque, the shoulder too.
const Load known{1.0, {0.05, 0, 0.08}};

Plant hidden() {
  Plant plant;
  plant.gain << 0.5, 1.5, 0.7, 1.3, 0.6, 1.4;
  return plant;
}
const IdentifiedModel& model_of_hidden() {
  static const IdentifiedModel model = identified(hidden(), "hidden");
  return model;
}
Plant loaded(Plant plant) {
  plant.load = known;
  return plant;
}

std::vector<JointGain> gains_by(const IdentifiedModel& model, const Plant& plant, const Recording& without,
                                const Recording& with) {
  return identify_gains(model, known, process(record(plant, without), model.filter),
                        process(record(loaded(plant), with), model.filter));
}

/// Seeds of noise that no two recordings share.
std::uint64_t fresh() {
  static std::uint64_t last = 1000;
  return ++last;
}

TEST(KnownLoad, GivesHiddenGainsToThreePercentOrSaysThatTheyAreUnknown) {
  Random random(5);
  int felt = 0, unknown = 0;
  double worst = 0;
  Eigen::VectorXi by_joint = Eigen::VectorXi::Zero(6);
  for (std::uint64_t robot = 0; robot < 5; ++robot) {
    Plant plant;
    for (double& gain : plant.gain) gain = random.uniform(0.5, 1.5);
    const IdentifiedModel model = identified(plant, fmt::format("robot_{}", robot));
    for (const double speed : {1.0, 0.3}) {
      const std::uint64_t motion = 1000 * (robot + 1);
      const auto gains = gains_by(model, plant, {.motion = motion, .noise = fresh(), .speed = speed},
                                  {.motion = motion, .noise = fresh(), .speed = speed});
      for (Index j = 0; j < 6; ++j) {
        const JointGain& one = gains[static_cast<std::size_t>(j)];
        ++(one.felt ? felt : unknown);
        if (!one.felt) continue;
        ++by_joint[j];
        const double error = std::fabs(one.factor / plant.gain[j] - 1);
        worst = std::max(worst, error);
        EXPECT_LT(error, 0.03) << "robot " << robot << " joint " << j + 1 << " speed " << speed;
        EXPECT_FALSE(speed < 1 && j == 0) << "its axis is vertical and nothing accelerates";
      }
    }
  }
  RecordProperty("felt", felt);
  RecordProperty("unknown", unknown);
  RecordProperty("by_joint", fmt::format("{}", fmt::join(by_joint.begin(), by_joint.end(), " ")));
  RecordProperty("worst", std::to_string(worst));
  EXPECT_GE(felt, 20);
  EXPECT_GE(unknown, 10);
}

TEST(KnownLoad, IsExactWithoutNoiseAndFriction) {
  Plant plant = hidden();
  plant.dry = plant.sliding = plant.load_friction = plant.noise = 0;
  const auto gains = gains_by(model_of_hidden(), plant, {}, {});
  for (Index j = 0; j < 6; ++j) {
    const JointGain& one = gains[static_cast<std::size_t>(j)];
    EXPECT_TRUE(one.felt) << j;
    EXPECT_NEAR(one.factor / plant.gain[j], 1, 1e-3) << j;
  }
}

TEST(KnownLoad, TensorThatNobodyKnowsBendsNothing) {
  Plant plant = hidden();
  plant.dry = plant.sliding = plant.load_friction = plant.noise = 0;
  plant.tensor *= 20;  // of a bar of half a metre
  const auto gains = gains_by(model_of_hidden(), plant, {}, {});
  for (Index j = 0; j < 6; ++j) EXPECT_NEAR(gains[static_cast<std::size_t>(j)].factor / plant.gain[j], 1, 1e-3) << j;
}

TEST(KnownLoad, DeviationsAreHonest) {
  const Plant plant = hidden();
  double square = 0;
  int count = 0;
  for (int run = 0; run < 20; ++run) {
    const auto gains =
        gains_by(model_of_hidden(), plant, {.noise = fresh(), .duration_s = 30}, {.noise = fresh(), .duration_s = 30});
    for (const Index j : {1, 2, 3, 4, 5}) {  // joint 1 hardly feels it: 1 / x is not normal there
      const JointGain& one = gains[static_cast<std::size_t>(j)];
      square += std::pow((one.factor - plant.gain[j]) / one.std, 2);
      ++count;
    }
  }
  // 100 squares of about normal errors: four standard deviations of their mean are 0.57.
  EXPECT_NEAR(square / count, 1, 0.57);
  RecordProperty("square", std::to_string(square / count));
}

TEST(KnownLoad, LogMayBeginLater) {
  const Plant plant = hidden();
  const auto gains = gains_by(model_of_hidden(), plant, {.noise = fresh()}, {.noise = fresh(), .late_s = 1.234});
  int felt = 0;
  for (Index j = 0; j < 6; ++j) {
    const JointGain& one = gains[static_cast<std::size_t>(j)];
    felt += one.felt;
    if (!one.felt) continue;
    EXPECT_NEAR(one.factor / plant.gain[j], 1, 0.03) << j;
  }
  EXPECT_GE(felt, 2);
}

TEST(KnownLoad, JointAtRestIsUnknown) {
  const Plant plant = hidden();
  const auto gains = gains_by(model_of_hidden(), plant, {.noise = fresh(), .still = 2}, {.noise = fresh(), .still = 2});
  EXPECT_FALSE(gains[2].felt);
  EXPECT_EQ(gains[2].std, 0);
  EXPECT_TRUE(gains[4].felt);
}

template <class Error>
std::string message_of(const IdentifiedModel& model, const Load& load, const Log& without, const Log& with) {
  try {
    identify_gains(model, load, process(without, model.filter), process(with, model.filter));
  } catch (const Error& error) {
    return error.what();
  }
  return "nothing thrown";
}

TEST(KnownLoad, SaysWhatIsWrong) {
  const Plant plant = hidden();
  IdentifiedModel model = model_of_hidden();
  const Log without = record(plant, {.noise = fresh(), .duration_s = 20}),
            with = record(loaded(plant), {.noise = fresh(), .duration_s = 20});
  const Log other = record(loaded(plant), {.motion = 300, .noise = fresh(), .duration_s = 20});
  EXPECT_NE(message_of<DataError>(model, known, without, other).find("another motion"), std::string::npos);
  // Nothing in the gripper.
  const std::string light = message_of<DataError>(model, {0.01, known.com}, without, without);
  EXPECT_NE(light.find("no joint feels a load of 0.01 kg"), std::string::npos) << light;
  EXPECT_NE(message_of<InputError>(model, {0, known.com}, without, with).find("above 0"), std::string::npos);
  Log no_torque = with;
  no_torque.tau.resize(0, 0);
  EXPECT_NE(message_of<InputError>(model, known, without, no_torque).find("no torque"), std::string::npos);
  Log slow = with;
  slow.step_s *= 2;
  slow.t *= 2;
  EXPECT_NE(message_of<InputError>(model, known, without, slow).find("sampled every"), std::string::npos);
  EffectFit payload;
  payload.effect = "payload";
  payload.linear = {1, 0, 0, 0};
  model.body.push_back(payload);
  EXPECT_NE(message_of<InputError>(model, known, without, with).find("has a payload already"), std::string::npos);
}

TEST(KnownLoad, FilesMultiplyTheGainThatTheLogWasReadWith) {
  IdentifiedModel model = model_of_hidden();
  Plant plant = hidden();
  const fs::path folder = test::folder() / "files";
  model.log_formats[""].torque_gain = {2, 2, 2, 2, 2, 2};
  write_file(folder / "model.json", to_json(model).dump());
  for (const bool carries : {false, true}) {
    Log log = record(carries ? loaded(plant) : plant, {.noise = fresh()});
    log.tau /= 2;
    write_log(folder / (carries ? "loaded.csv" : "empty.csv"), log);
  }
  const std::string table =
      identify_torque_gains(folder / "model.json", folder / "empty.csv", folder / "loaded.csv", known, folder / "out");
  const GainResult result = gains_of(nlohmann::json::parse(read_file(folder / "out" / "payload.json")));
  std::string line = "torque_gain = [";
  int felt = 0;
  for (std::size_t j = 0; j < 6; ++j) {
    const GainResult::Joint& one = result.joints[j];
    felt += one.felt;
    EXPECT_NEAR(one.torque_gain, one.felt ? 2 * plant.gain[static_cast<Index>(j)] : 2, 0.06 * one.torque_gain) << j;
    line += (j > 0 ? ", " : "") + fmt::format("{:.5g}", one.torque_gain);
  }
  EXPECT_GE(felt, 2);
  EXPECT_LT(felt, 6);
  EXPECT_NE(table.find(line + "]\n"), std::string::npos) << table;
  EXPECT_NE(table.find("did not feel the load"), std::string::npos) << table;
  EXPECT_NE(read_file(folder / "out" / "torque_gain.toml").find("[signals]\n" + line + "]\n"), std::string::npos);
  EXPECT_FALSE(fs::exists(folder / "out" / "model.json"));
}

}  // namespace
}  // namespace fxdyn
