#include "host_tools/identify/flexible.hpp"
#include "host_tools/effects/effects.hpp"
#include "host_tools/effects/identified_model.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "host_tools/effects/evaluator.hpp"
#include "host_tools/readers/log_reader.hpp"
#include "host_tools/regression/fitter.hpp"
#include "host_tools/simulate/simulate.hpp"
#include "host_tools/support/parallel.hpp"
#include "host_tools/support/random.hpp"
#include "tests/support/files.hpp"
#include "tests/support/filter.hpp"
#include "tests/support/sanitizers.hpp"

namespace fxdyn {
namespace {

namespace fs = std::filesystem;

struct Gear {
  double stiffness, damping, rotor;
};
// Deflections of 0.1 to 1 mrad and B / K of 4 ms; joint 5 is rigid, joint 6 has no link encoder.
constexpr std::array gears{Gear{3e4, 120, 1.14}, Gear{6e4, 240, 4.71}, Gear{2e4, 80, 0.83}, Gear{3e3, 12, 0.2}};
const std::vector<double> rotors{1.14, 4.71, 0.83, 0.2, 0.18, 0.19};

std::string effect(std::size_t joint, const std::string& name, const std::string& parameters) {
  return fmt::format("[[effect]]\nname = \"{}\"\njoint = {}\nparameters = {{ {} }}\n", name, joint, parameters);
}

/// The PUMA 560 with elastic gears: plays one log of 40 s with the given sensors.
fs::path play(const std::string& name, const std::string& sensors, const std::string& more = {}) {
  std::string text = "seed = 3\n[sensors]\n" + sensors +
                     "\n[robot]\nurdf = \"" FXDYN_SOURCE_DIR
                     "/host_tools/demo/puma560.urdf\"\nrated_torque = [97.6, 186.4, 89.4, 24.2, 20.1, 21.3]\n"
                     "acceleration = [8, 8, 10, 20, 20, 20]\n";
  text += "[[log]]\nname = \"" + name + "\"\nduration_s = 40\nperiod_s = 8\nseed = 5\n" + more;
  for (std::size_t j = 0; j < gears.size(); ++j) {
    text += effect(j + 1, "elasticity",
                   fmt::format("compliance = {:.17g}, relaxation = {:.17g}", 1 / gears[j].stiffness,
                               gears[j].damping / gears[j].stiffness));
  }
  for (std::size_t j = 0; j < rotors.size(); ++j) {
    text += effect(j + 1, "rotor_inertia", fmt::format("inertia = {}", rotors[j])) +
            effect(j + 1, "viscous", "coefficient = 2.0") + effect(j + 1, "coulomb", "amplitude = 1.5");
  }
  return simulate(test::write(name + ".toml", text), test::folder())[0];
}

Log read(const fs::path& file) { return read_log(file, 6, std::vector<bool>(6, true), {}, {}, {}); }

const FilterFit filter = test::filter_of(25, 15, 0.3);

/// The plant's own model: rigid body of the URDF, effects but for those on the position.
IdentifiedModel truth() {
  IdentifiedModel model = read_model(test::folder() / "truth.json");
  for (JointFit& joint : model.joints) {
    std::erase_if(joint.effects,
                  [](const EffectFit& fit) { return find_effect(fit.effect)->acts_on == ActsOn::position; });
  }
  return model;
}

/// Rigid body and friction from the log's torque; rotor inertia where torque tells it.
IdentifiedModel identified(const Robot& robot, const ProcessedLog& log) {
  const DhChain chain = to_dh(robot);
  const BaseSet base = find_base(chain);
  std::vector<JointFit> design(6);
  for (std::size_t j = 0; j < 6; ++j) {
    for (const char* name : {"viscous", "coulomb", "offset", "rotor_inertia"}) {
      EffectFit fit;
      fit.effect = name;
      if (fit.effect == "rotor_inertia" && rotor_inertia_is_absorbed(chain, base, static_cast<Eigen::Index>(j)))
        continue;
      design[j].effects.push_back(fit);
    }
  }
  const std::vector<ProcessedLog> logs{log};
  Fitter fitter(robot, logs, design);
  fitter.reweight();
  return fitter.to_model(fitter.fit());
}

void encode(Eigen::MatrixXd& q, int bits, Random& random) {
  const double step = 2 * std::numbers::pi / std::ldexp(1.0, bits);
  for (Eigen::Index j = 0; j < q.cols(); ++j) {
    const double zero = random.uniform() * step;  // where the disc was mounted
    q.col(j) = ((q.col(j).array() + zero) / step).round() * step - zero;
  }
}

/// An exact log with encoders and torque noise of 1 % put on it.
Log noisy(const Log& exact, const IdentifiedModel& plant, int bits, std::uint64_t seed) {
  Random random(seed);
  Log log = exact;
  encode(log.q, bits, random);
  encode(log.qlink, bits, random);
  for (Eigen::Index j = 0; j < log.joints(); ++j) {
    const double sigma = 0.01 * plant.joints[static_cast<std::size_t>(j)].rated_torque;
    for (Eigen::Index k = 0; k < log.samples(); ++k) log.tau(k, j) += sigma * random.normal();
  }
  return log;
}

/// Mean square of error / standard deviation of stiffness, damping and rotor. Base parameters' errors count as
/// independent, which is too much on the joints that carry the others: their intervals are up to three times too wide,
/// none too narrow.
constexpr std::array<std::array<double, 3>, 3> normalised_errors{
    {{0.102, 0.801, 0.111}, {0.359, 0.572, 0.264}, {0.513, 1.087, 1.032}}};

constexpr const char* exact_sensors = "link_encoders = [1, 2, 3, 4, 5]";

TEST(Flexible, StiffnessDampingAndRotorOfASimulatedRobotOverThirtySeeds) {
  if (test::sanitized) GTEST_SKIP() << "statistics of many runs";
  // 40 s, 20-bit encoders, torque noise of 1 %, everything identified from the log.
  const Log exact = read(play("seeds", exact_sensors));
  const IdentifiedModel plant = truth();
  constexpr std::size_t seeds = 30;
  std::vector<std::vector<FlexibleJoint>> results(seeds);
  parallel_for(seeds, [&](std::size_t seed) {
    const Log log = noisy(exact, plant, 20, 100 + seed);
    const ProcessedLog processed = process(log, filter);
    const IdentifiedModel model = identified(plant.robot, processed);
    results[seed] = identify_flexible({model, {processed}});
  });
  for (std::size_t j = 0; j < 3; ++j) {
    const Gear& gear = gears[j];
    Eigen::Array3d square = Eigen::Array3d::Zero(), normalised = square, inside = square;
    for (const auto& joints : results) {
      ASSERT_EQ(joints.size(), 5U);
      const FlexibleJoint& f = joints[j];
      EXPECT_TRUE(f.found) << f.note;
      EXPECT_GT(f.explained, 0.99);
      const Eigen::Array3d scale(gear.stiffness, gear.damping, gear.rotor);
      const Eigen::Array3d error = Eigen::Array3d(f.stiffness, f.damping, f.effective_inertia) / scale - 1;
      const Eigen::Array3d std = Eigen::Array3d(f.stiffness_std, f.damping_std, f.inertia_std) / scale;
      square += error.square() / seeds;
      normalised += (error / std).square() / seeds;
      inside += ((error / std).abs() < 1.96).cast<double>() / seeds;
    }
    EXPECT_LT(std::sqrt(square[0]), 0.02) << "stiffness of joint " << j + 1;
    EXPECT_LT(std::sqrt(square[1]), 0.15) << "damping of joint " << j + 1;
    EXPECT_LT(std::sqrt(square[2]), 0.03) << "rotor of joint " << j + 1;
    for (int i = 0; i < 3; ++i) {
      EXPECT_GE(inside[i], 0.9) << "figure " << i << " of joint " << j + 1;
      // As measured with these seeds. Twice or half the standard deviation would be 4 or 1/4 of it.
      EXPECT_LT(std::fabs(std::log(normalised[i] / normalised_errors[j][static_cast<std::size_t>(i)])), std::log(1.5))
          << "figure " << i << " of joint " << j + 1 << ": " << normalised[i];
    }
  }
  for (const auto& joints : results) {
    // Joint 4 bends by 5 microradians under a load of a hundredth of the torque noise: where it is found, within its
    // std.
    const FlexibleJoint& light = joints[3];
    EXPECT_TRUE(!light.found || std::fabs(light.stiffness - gears[3].stiffness) < 4 * light.stiffness_std);
    EXPECT_FALSE(joints[4].found) << "a rigid joint with a stiffness of " << joints[4].stiffness;
    EXPECT_NE(joints[4].note.find("no elasticity"), std::string::npos) << joints[4].note;
  }
}

/// What the fit makes of joint 3 with another effect beside its elasticity, the rigid body known.
FlexibleJoint third_joint(const std::string& name, const std::string& more) {
  const Log log = read(play(name, std::string(exact_sensors) + "\nencoder_bits = 19\ntorque_noise = 0.01", more));
  return identify_flexible({truth(), {process(log, filter)}})[2];
}

TEST(Flexible, SimulateWritesTheLinkEncodersAskedFor) {
  const auto encoded = [](const Log& log, Eigen::Index joint) { return !std::isnan(log.qlink(0, joint)); };
  const Log some = read(play("some", "link_encoders = [2, 3]\nlink_encoder_bits = 16"));
  EXPECT_TRUE(!encoded(some, 0) && encoded(some, 1) && encoded(some, 2) && !encoded(some, 5));
  const Eigen::ArrayXd steps = some.qlink.col(1).array() * 65536 / (2 * std::numbers::pi);
  EXPECT_LT((steps - steps.round()).abs().maxCoeff(), 1e-9);
  const Log all = read(play("all", "link_encoder_bits = 0"));
  EXPECT_TRUE(encoded(all, 0) && encoded(all, 5));
  EXPECT_EQ((all.q - all.qlink).col(5).cwiseAbs().maxCoeff(), 0);
  EXPECT_GT((all.q - all.qlink).col(1).cwiseAbs().maxCoeff(), 1e-4);
  EXPECT_EQ(read(play("none", "encoder_bits = 19")).qlink.size(), 0);
  EXPECT_THROW(play("bad", "link_encoders = [7]"), InputError);
  EXPECT_THROW(play("bad", "link_encoders = \"some\""), InputError);
}

TEST(Flexible, OtherDeflectionsAreTakenOutAndSaid) {
  const FlexibleJoint alone = third_joint("alone", "");
  EXPECT_EQ(alone.note, "");
  EXPECT_NEAR(alone.stiffness, gears[2].stiffness, 0.005 * gears[2].stiffness);
  const FlexibleJoint eccentric = third_joint("eccentric", effect(3, "eccentricity", "sin = 2e-4, cos = -1e-4"));
  EXPECT_NE(eccentric.note.find("eccentric gear or encoder disc of 0.22 mrad"), std::string::npos) << eccentric.note;
  EXPECT_NEAR(eccentric.stiffness, gears[2].stiffness, 0.02 * gears[2].stiffness);
  const FlexibleJoint play = third_joint("play", effect(3, "backlash", "half_gap = 2e-4, torque_scale = 0.5"));
  EXPECT_NE(play.note.find("play of "), std::string::npos) << play.note;
  EXPECT_NEAR(play.stiffness, gears[2].stiffness, 0.02 * gears[2].stiffness);
}

TEST(Flexible, ALinkEncoderTheWrongWayRoundIsSaid) {
  const Log log = read(play("turned", exact_sensors));
  Log turned = log;
  turned.q = log.qlink.array().isNaN().select(log.q, log.qlink);
  turned.qlink = log.q;
  const std::vector<FlexibleJoint> joints = identify_flexible({truth(), {process(turned, filter)}});
  EXPECT_FALSE(joints[1].found);
  EXPECT_NE(joints[1].note.find("wrong way"), std::string::npos) << joints[1].note;
}

TEST(Flexible, LogsWithAndWithoutLinkEncodersTogether) {
  const Log log = read(play("apart", exact_sensors));
  Log without = log;
  without.qlink.resize(0, 0);
  const ProcessedLog processed = process(log, filter);
  const IdentifiedModel model = truth();
  const ProcessedLog bare = process(without, filter);
  const auto one = identify_flexible({model, {processed}});
  const auto two = identify_flexible({model, {bare, processed}});
  ASSERT_EQ(one.size(), 5U);
  ASSERT_EQ(two.size(), 5U);
  EXPECT_EQ(one[1].stiffness, two[1].stiffness);
  EXPECT_TRUE(identify_flexible({model, {bare}}).empty());
}

TEST(Flexible, TheModelGetsTheGearAsAnEffect) {
  const Log log = read(play("effect", exact_sensors));
  const ProcessedLog processed = process(log, filter);
  IdentifiedModel model = truth();
  const auto joints = identify_flexible({model, {processed}});
  for (const FlexibleJoint& joint : joints) {
    if (joint.found) model.joints[joint.joint].effects.push_back(elasticity_effect(joint));
  }
  Eigen::MatrixXd deflections;
  const MotionRows motion = processed.motion();
  predict(model, motion.q, motion.dq, motion.ddq, processed.step_s, &deflections);
  for (Eigen::Index j = 0; j < 3; ++j) {
    const Eigen::VectorXd measured = (log.q - log.qlink).col(j);
    const auto inside = [&](const Eigen::VectorXd& x) {
      return Eigen::VectorXd(x.segment(processed.first, processed.last - processed.first));
    };
    EXPECT_LT(inside(measured - deflections.col(j)).norm(), 0.01 * inside(measured).norm()) << "joint " << j + 1;
  }
  const nlohmann::json json = flexible_json(joints[0], model.robot);
  EXPECT_EQ(json.at("index"), 1);
  EXPECT_EQ(json.at("stiffness").at("unit"), "N*m/rad");
  EXPECT_EQ(json.at("damping").at("unit"), "N*m*s/rad");
  EXPECT_EQ(json.at("effective_inertia").at("value"), joints[0].effective_inertia);
  EXPECT_FALSE(flexible_json(joints[4], model.robot).contains("stiffness"));
}

}  // namespace
}  // namespace fxdyn
