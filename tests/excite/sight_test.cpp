#include "host_tools/excite/sight.hpp"
#include "host_tools/effects/identified_model.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>
#include <sstream>

#include "host_tools/effects/effects.hpp"
#include "host_tools/effects/evaluator.hpp"
#include "host_tools/excite/nominal.hpp"
#include "host_tools/regression/regressor.hpp"
#include "host_tools/signals/filter.hpp"
#include "host_tools/signals/fourier.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/random.hpp"
#include "tests/support/sanitizers.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double pi = std::numbers::pi;
const std::vector<double> rated{97.6, 186.4, 89.4, 24.2, 20.1, 21.3}, velocity{1.6, 1.5, 2.2, 4, 3.6, 4};

const Robot& puma() {
  static const Robot robot = read_urdf(FXDYN_SOURCE_DIR "/host_tools/demo/puma560.urdf");
  return robot;
}
const IdentifiedModel& nominal() {
  static const IdentifiedModel model = nominal_from_urdf(puma(), rated, velocity).model;
  return model;
}
SightSettings one_percent() {
  SightSettings settings;
  settings.noise = 0.01 * Eigen::Map<const VectorXd>(rated.data(), 6);
  return settings;
}

/// q(k, j), dq, ddq = state(t, j)
template <class State>
Motion motion_of(const std::string& name, double seconds, double step, State&& state) {
  const auto samples = static_cast<Index>(std::llround(seconds / step));
  Motion motion{name, step, VectorXd::LinSpaced(samples, 0, step * static_cast<double>(samples - 1)), {}, {}, {}};
  motion.q = motion.dq = motion.ddq = MatrixXd(samples, 6);
  for (Index j = 0; j < 6; ++j) {
    for (Index k = 0; k < samples; ++k) {
      const FourierState s = state(motion.t[k], static_cast<std::size_t>(j));
      motion.q(k, j) = s.q;
      motion.dq(k, j) = s.dq;
      motion.ddq(k, j) = s.ddq;
    }
  }
  return motion;
}

Motion fourier(std::uint64_t seed, double seconds, double speed, double step = 0.002) {
  std::vector<FourierJoint> joints;
  for (std::size_t j = 0; j < 6; ++j) {
    const Limits& limits = *puma().joints[j].limits;
    joints.push_back(random_fourier(seed * 100 + j, 5, 10, {limits.lower, limits.upper, limits.velocity, 10}, speed));
  }
  return motion_of("fourier", seconds, step, [&](double t, std::size_t j) { return evaluate(joints[j], 10, t); });
}

FourierState sine(double centre, double amplitude, double w, double t) {
  return {centre + amplitude * std::sin(w * t), amplitude * w * std::cos(w * t), -amplitude * w * w * std::sin(w * t)};
}

Sight judge(const std::vector<Motion>& motions, const SightSettings& settings = one_percent()) {
  Progress progress;
  return see(nominal(), motions, settings, progress);
}

const EffectSight& of(const Sight& sight, std::string_view effect, std::size_t joint = 0) {
  for (const EffectSight& e : sight.effects) {
    if (e.effect == effect && (!e.joint || *e.joint == joint)) return e;
  }
  throw std::runtime_error("no such entry: " + std::string(effect));
}

double confusion(const EffectSight& e, std::string_view other) {
  for (const Confusion& c : e.confused) {
    if (c.effect == other) return c.correlation;
  }
  return 0;
}

const Sight& usual() {
  static const Sight sight = judge({fourier(1, 20, 1), fourier(2, 20, 1), fourier(3, 20, 0.1)});
  return sight;
}

TEST(Sight, HasEveryEffectOfTheCatalogueAtEveryJoint) {
  for (const EffectInfo& info : effect_infos()) {
    if (info.unites_others() || info.curve) continue;  // seen by what shows the others; of no name
    const auto entries = std::count_if(usual().effects.begin(), usual().effects.end(),
                                       [&](const EffectSight& e) { return e.effect == info.name; });
    EXPECT_EQ(entries, info.acts_on == ActsOn::body ? 1 : 6) << info.name;
  }
  for (const EffectSight& e : usual().effects) {
    EXPECT_GE(e.typical.rho, 0) << e.effect;
    EXPECT_LE(e.typical.rho, 1) << e.effect;
    EXPECT_GE(e.worst.smallest, e.typical.smallest) << e.effect;
    // With more known beforehand an effect can only be seen better.
    if (e.healthy) {
      EXPECT_LE(e.healthy->smallest, e.typical.smallest * 1.001) << e.effect;
    }
    EXPECT_EQ(e.typical.parameters.size(), find_effect(e.effect)->linear.size());
  }
}

/// The effect added to the nominal model, its first parameter `theta`.
IdentifiedModel with(const EffectSight& effect, double theta) {
  IdentifiedModel model = nominal();
  EffectFit fit;
  fit.effect = effect.effect;
  fit.shape = effect.typical.shape;
  fit.linear.assign(find_effect(effect.effect)->linear.size(), 0);
  fit.linear[0] = theta;
  (effect.joint ? model.joints[*effect.joint].effects : model.body).push_back(fit);
  return model;
}

/// Rows of all joints over all motions, filtered, without the edges, each joint over its rated torque (the noise is one
/// share of it everywhere): what an identification sees, assembled here once more and in a plain way.
VectorXd stack(const std::vector<MatrixXd>& torques, double step, double cutoff) {
  std::vector<double> rows;
  const auto edge = static_cast<Index>(std::ceil(3 / cutoff / step));
  for (const MatrixXd& tau : torques) {
    const MatrixXd filtered = ZeroPhaseFilter(cutoff, step).apply(tau);
    for (Index j = 0; j < 6; ++j) {
      for (Index k = edge; k < tau.rows() - edge; ++k)
        rows.push_back(filtered(k, j) / rated[static_cast<std::size_t>(j)]);
    }
  }
  return Eigen::Map<const VectorXd>(rows.data(), static_cast<Index>(rows.size()));
}

/// Projects rows onto what the nominal columns leave. With a baseline the rows are those of a healthy session, then
/// those of the session in question, the same motions: base parameters are shared, friction is each session's own.
class NominalRows {
 public:
  NominalRows(const std::vector<Motion>& motions, double cutoff, bool baseline = false) {
    std::vector<MatrixXd> torques;  // of one column, every motion
    const auto clear = [&] {
      torques.clear();
      for (const Motion& motion : motions) torques.push_back(MatrixXd::Zero(motion.q.rows(), 6));
    };
    const auto column = [&] { return VectorXd(stack(torques, motions[0].step_s, cutoff)); };
    clear();
    MatrixXd base(column().size(), 60), friction(column().size(), 24);
    Regressor regressor(to_dh(puma()));
    std::vector<std::vector<MatrixXd>> y(motions.size());
    for (std::size_t m = 0; m < motions.size(); ++m) {
      for (Index k = 0; k < motions[m].q.rows(); ++k)
        y[m].push_back(regressor(motions[m].q.row(k), motions[m].dq.row(k), motions[m].ddq.row(k)));
    }
    for (Index c = 0; c < 60; ++c) {
      for (std::size_t m = 0; m < motions.size(); ++m) {
        for (std::size_t k = 0; k < y[m].size(); ++k)
          torques[m].row(static_cast<Index>(k)) = y[m][k].col(c).transpose();
      }
      base.col(c) = column();
    }
    for (Index c = 0; c < 24; ++c) {
      clear();
      const double width = nominal().joints[static_cast<std::size_t>(c / 4)].sign_width;
      for (std::size_t m = 0; m < motions.size(); ++m) {
        const VectorXd dq = motions[m].dq.col(c / 4);
        auto tau = torques[m].col(c / 4);
        if (c % 4 == 0) tau = dq;
        if (c % 4 == 1) tau = (dq / width).array().tanh();
        if (c % 4 == 2) tau.setOnes();
        if (c % 4 == 3) tau = motions[m].ddq.col(c / 4);
      }
      friction.col(c) = column();
    }
    const Index rows = base.rows();
    MatrixXd a = MatrixXd::Zero(baseline ? 2 * rows : rows, baseline ? 108 : 84);
    a.topLeftCorner(rows, 60) = base;
    a.block(0, 60, rows, 24) = friction;
    if (baseline) {
      a.bottomLeftCorner(rows, 60) = base;
      a.bottomRightCorner(rows, 24) = friction;
    }
    for (Index c = 0; c < a.cols(); ++c) {
      if (a.col(c).norm() > 0) a.col(c).normalize();
    }
    Eigen::ColPivHouseholderQR<MatrixXd> qr(a);
    qr.setThreshold(1e-9);
    span_ = qr.householderQ() * MatrixXd::Identity(a.rows(), qr.rank());
  }
  VectorXd remove(const VectorXd& rows) const { return rows - span_ * (span_.transpose() * rows); }

 private:
  MatrixXd span_;
};

/// Torques with white noise of 1 % of rated torque.
std::vector<MatrixXd> noisy(std::uint64_t seed, std::vector<MatrixXd> torques) {
  Random random(seed);
  for (MatrixXd& tau : torques) {
    for (Index j = 0; j < 6; ++j) {
      for (Index k = 0; k < tau.rows(); ++k) tau(k, j) += 0.01 * rated[static_cast<std::size_t>(j)] * random.normal();
    }
  }
  return torques;
}

TEST(Sight, TheDetectionLimitIsWhatSimulatedExperimentsShow) {
  if (test::sanitized) GTEST_SKIP() << "statistics of many runs";
  constexpr double step = 0.005;
  const std::vector<Motion> motions{fourier(1, 10, 1, step), fourier(3, 10, 0.15, step)};
  const Sight sight = judge(motions);
  const double cutoff = sight.torque_cutoff_hz;
  const NominalRows nominal_rows(motions, cutoff);
  const auto torque = [&](const IdentifiedModel& model) {
    std::vector<MatrixXd> out;
    for (const Motion& m : motions) out.push_back(predict(model, m.q, m.dq, m.ddq, step));
    return out;
  };
  const std::vector<MatrixXd> healthy = torque(nominal());
  constexpr std::uint64_t clean_runs = 150, runs = 50;
  std::vector<VectorXd> clean;
  for (std::uint64_t seed = 0; seed < clean_runs; ++seed) clean.push_back(stack(noisy(seed, healthy), step, cutoff));

  struct Case {
    const char* effect;
    std::size_t joint;
  };
  for (const Case& c : {Case{"stribeck", 0},
                        {"viscous_cubic", 2},
                        {"load_friction", 1},
                        {"elasticity", 2},
                        {"delay", 4},
                        {"torque_gain", 2},
                        {"gravity_tilt", 0},
                        {"joint_coupling", 5}}) {
    const EffectSight& effect = of(sight, c.effect, c.joint);
    const double smallest = effect.typical.parameters[0];
    ASSERT_TRUE(std::isfinite(smallest)) << c.effect;
    // The fit of this one parameter after the nominal model: its other parameters are zero, as in `parameters`.
    const std::vector<MatrixXd> changed = torque(with(effect, smallest));
    std::vector<MatrixXd> column = changed;
    for (std::size_t m = 0; m < column.size(); ++m) column[m] = (changed[m] - healthy[m]) / smallest;
    const VectorXd left = nominal_rows.remove(stack(column, step, cutoff));
    const auto fitted = [&](const VectorXd& rows) { return left.dot(rows) / left.squaredNorm(); };

    double square = 0;
    for (const VectorXd& rows : clean) {
      const double theta = fitted(rows);
      square += theta * theta;
    }
    const double deviation = std::sqrt(square / clean_runs);
    // 150 runs tell a standard deviation to 6 %; the filter's edge is not a rectangle: some % more.
    EXPECT_NEAR(deviation / (smallest / sight.threshold), 1, 0.2) << c.effect;
    int found_twice = 0, found_half = 0;
    const auto found = [&](std::uint64_t seed, double theta) {
      return fitted(stack(noisy(seed, torque(with(effect, theta))), step, cutoff)) > sight.threshold * deviation;
    };
    for (std::uint64_t seed = 1000; seed < 1000 + runs; ++seed) {
      found_twice += found(seed, 2 * smallest);
      found_half += found(seed, 0.5 * smallest);
    }
    EXPECT_GE(found_twice, 49) << c.effect;  // 10 standard deviations, 5 needed
    EXPECT_LE(found_half, 3) << c.effect;    // 2.5 of 5: 0.6 % of runs
  }
}

TEST(Sight, TheLimitWithABaselineIsThatOfTwoSessionsFittedTogether) {
  if (test::sanitized) GTEST_SKIP() << "statistics of many runs";
  constexpr double step = 0.005;
  const std::vector<Motion> motions{fourier(1, 10, 1, step), fourier(3, 10, 0.15, step)};
  const Sight sight = judge(motions);
  const double cutoff = sight.torque_cutoff_hz;
  const NominalRows nominal_rows(motions, cutoff, true);
  constexpr std::uint64_t runs = 150;
  for (const char* name : {"payload", "spring", "torque_gain"}) {
    const EffectSight& effect = of(sight, name, 1);
    std::vector<MatrixXd> still, column;
    for (const Motion& motion : motions) {
      still.push_back(MatrixXd::Zero(motion.q.rows(), 6));
      column.push_back(still.back());
      const EffectColumns c = RobotColumns(nominal(), motion)({name, 1, {}});
      for (Index j = 0; j < 6; ++j) {
        const MatrixXd& of_joint = c.joints[static_cast<std::size_t>(j)];
        if (of_joint.size() > 0) column.back().col(j) = of_joint.col(0);
      }
    }
    const auto sessions = [&](const std::vector<MatrixXd>& first, const std::vector<MatrixXd>& second) {
      const VectorXd a = stack(first, step, cutoff), b = stack(second, step, cutoff);
      VectorXd both(a.size() + b.size());
      both << a, b;
      return both;
    };
    const VectorXd left = nominal_rows.remove(sessions(still, column));
    double square = 0;
    for (std::uint64_t seed = 0; seed < runs; ++seed) {
      const double theta = left.dot(sessions(noisy(seed, still), noisy(seed + runs, still))) / left.squaredNorm();
      square += theta * theta;
    }
    ASSERT_TRUE(effect.healthy);
    EXPECT_NEAR(std::sqrt(square / runs) / (effect.healthy->parameters[0] / sight.threshold), 1, 0.2) << name;
  }
}

TEST(Sight, SmallestRmsIsThatOfTheSmallestParameter) {
  // One column, one joint: torque of the smallest parameter, RMS over the motion without its edges.
  const Motion motion = fourier(1, 20, 1, 0.004);
  const Sight sight = judge({motion});
  const auto edge = static_cast<Index>(std::ceil(3 / sight.torque_cutoff_hz / motion.step_s));
  for (const char* name : {"viscous_cubic", "stribeck", "delay"}) {
    const EffectSight& effect = of(sight, name, 2);
    const MatrixXd change = RobotColumns(nominal(), motion)({name, 2, effect.typical.shape}).joints[2];
    const auto inside = change.col(0).segment(edge, change.rows() - 2 * edge);
    const double rms = inside.norm() / std::sqrt(static_cast<double>(inside.size()));
    EXPECT_NEAR(effect.typical.smallest / (rms * effect.typical.parameters[0] / rated[2]), 1, 1e-9) << name;
  }
}

TEST(Sight, WhiteNoiseWeighsTheSameWhateverTheCutOff) {
  // A column within both cut-offs: half the band has half the samples and half the noise power.
  SightSettings narrow = one_percent(), wide = one_percent();
  narrow.torque_cutoff_hz = 20;
  wide.torque_cutoff_hz = 40;
  const std::vector<Motion> motions{fourier(1, 20, 1, 0.004)};
  const double a = of(judge(motions, narrow), "spring", 0).typical.smallest;
  const double b = of(judge(motions, wide), "spring", 0).typical.smallest;
  EXPECT_NEAR(a / b, 1, 0.02);
}

TEST(Sight, SlowReversalsShowFrictionAtLowSpeedBetterThanFastMotion) {
  const Motion fast = fourier(1, 20, 1, 0.004);
  const Motion slow = motion_of("slow", 20, 0.004, [](double t, std::size_t j) {
    return sine(0.3, 0.02, 2 * pi * (0.3 + 0.05 * static_cast<double>(j)), t);
  });
  const Sight only_fast = judge({fast, fast}), both = judge({fast, slow});
  for (const char* name : {"presliding", "stribeck"}) {
    for (std::size_t j = 0; j < 6; ++j) {
      // In its own parameter: an RMS over other motions is another RMS. The same shapes, since they come from `fast`.
      EXPECT_LT(of(both, name, j).typical.parameters[0], 0.9 * of(only_fast, name, j).typical.parameters[0])
          << name << " " << j;
    }
  }
}

TEST(Sight, KnownPairsComeOutAndTheirCureHelps) {
  // Joint 1 turns about the vertical: no gravity. A range of 0.1 rad far from zero; two frequencies, since in one sine
  // the position is an acceleration.
  const auto swing = [](double centre, double amplitude) {
    return motion_of("swing", 20, 0.004, [=](double t, std::size_t j) {
      const double w = 2 * pi * (0.1 + 0.02 * static_cast<double>(j));
      const FourierState slow = sine(centre, 0.6 * amplitude, w, t), fast = sine(0, 0.4 * amplitude, 3.3 * w, t);
      return FourierState{slow.q + fast.q, slow.dq + fast.dq, slow.ddq + fast.ddq};
    });
  };
  const Sight narrow = judge({swing(0.8, 0.05)});
  EXPECT_GT(confusion(of(narrow, "spring"), "gravity_compensator"), 0.99);
  EXPECT_GT(confusion(of(narrow, "gravity_compensator"), "spring"), 0.95);
  EXPECT_GT(confusion(of(narrow, "offset"), "spring"), 0.99);
  EXPECT_GT(confusion(of(narrow, "spring"), "offset"), 0.99);
  EXPECT_GT(confusion(of(narrow, "offset"), "asymmetric_friction"), 0.95);
  const auto& confused = of(narrow, "spring").confused;
  EXPECT_TRUE(std::any_of(confused.begin(), confused.end(), [](const Confusion& c) {
    return c.effect == "gravity_compensator" && c.cure.find("range") != std::string::npos;
  }));
  const Sight wide = judge({swing(0.3, 2.4)});
  EXPECT_EQ(confusion(of(wide, "spring"), "gravity_compensator"), 0);
  EXPECT_EQ(confusion(of(wide, "offset"), "spring"), 0);
  EXPECT_LT(of(wide, "gravity_compensator").typical.smallest, of(narrow, "gravity_compensator").typical.smallest);
}

TEST(Sight, SpeedsInANarrowBandConfusePowersOfSpeed) {
  // Speed between 0.6 and 1 of the largest, both ways: a triangle in position, rounded.
  const auto at = [](double period, double low, double t) {
    const double w = 2 * pi / period, x = std::sin(w * t), steep = 20;
    const double s = std::tanh(steep * x), ds = (1 - s * s) * steep * w * std::cos(w * t);
    const double wobble = low + (1 - low) * 0.5 * (1 + std::sin(5.3 * w * t));
    return std::pair(s * wobble, ds * wobble + s * (1 - low) * 0.5 * 5.3 * w * std::cos(5.3 * w * t));
  };
  const auto plan = [&](double low) {
    double q = 0;
    std::size_t joint = 99;
    return motion_of("band", 30, 0.004, [&, low](double t, std::size_t j) {
      if (j != joint) q = 0;
      joint = j;
      const auto [dq, ddq] = at(3 + 0.3 * static_cast<double>(j), low, t);
      q += dq * 0.004;
      return FourierState{q, dq, ddq};
    });
  };
  const Sight band = judge({plan(0.6)}), from_zero = judge({plan(0)});
  EXPECT_GT(confusion(of(band, "viscous_quadratic"), "viscous_cubic"), 0.97);
  EXPECT_GT(of(from_zero, "viscous_quadratic").typical.rho, of(band, "viscous_quadratic").typical.rho);
}

TEST(Sight, WhatTheNominalModelHoldsIsNotIdentifiable) {
  const EffectSight& payload = of(usual(), "payload");
  EXPECT_EQ(payload.verdict, SightVerdict::not_identifiable);
  EXPECT_FALSE(std::isfinite(payload.typical.smallest));
  EXPECT_GT(confusion(payload, "base parameters"), 0.999);
  ASSERT_TRUE(payload.healthy);
  EXPECT_LT(payload.healthy->smallest, 0.005);  // with a healthy recording beside it, it is seen
  EXPECT_EQ(of(usual(), "rotor_inertia", 0).verdict, SightVerdict::not_identifiable);
  EXPECT_EQ(of(usual(), "rotor_inertia", 1).verdict, SightVerdict::not_identifiable);
  EXPECT_EQ(of(usual(), "rotor_inertia", 4).verdict, SightVerdict::seen);
}

TEST(Sight, IdenticalColumnsAreNotIdentifiableAndRestShowsNothing) {
  // Joint 2 moves as joint 1 does, and its sign has the same width: friction of the one is friction of the other. Joint
  // 6 rests.
  IdentifiedModel model = nominal();
  model.joints[1].sign_width = model.joints[0].sign_width;
  const Motion motion = motion_of("twins", 20, 0.004, [](double t, std::size_t j) {
    if (j == 5) return FourierState{0.1, 0, 0};
    return sine(0.1, 0.6, 2 * pi * (0.2 + (j < 2 ? 0 : 0.04 * static_cast<double>(j))), t);
  });
  Progress progress;
  const Sight sight = see(model, {motion}, one_percent(), progress);
  EXPECT_EQ(of(sight, "joint_coupling", 1).typical.shape, std::vector{1.0});
  EXPECT_EQ(of(sight, "joint_coupling", 1).verdict, SightVerdict::not_identifiable);
  EXPECT_EQ(of(sight, "joint_coupling", 2).verdict, SightVerdict::seen);
  for (const char* name : {"viscous", "stribeck", "viscous_cubic", "ripple", "load_friction"})
    EXPECT_EQ(of(sight, name, 5).verdict, SightVerdict::not_identifiable) << name;
}

TEST(Sight, TableAndJson) {
  const std::string table = sight_table(usual(), {"friction"});
  std::istringstream lines(table);
  for (std::string line; std::getline(lines, line);) EXPECT_LE(line.size(), 100U) << line;
  for (const EffectInfo& info : effect_infos())
    EXPECT_EQ(info.unites_others() || info.curve, table.find("\n" + std::string(info.name) + " ") == std::string::npos)
        << info.name;
  const nlohmann::json json = sight_json(usual(), {"friction"});
  EXPECT_EQ(json.at("effects").size(), usual().effects.size());
  EXPECT_EQ(json.dump().find("inf"), std::string::npos);
  for (const auto& effect : json.at("effects")) {
    if (effect.at("effect") != "payload") continue;
    EXPECT_EQ(effect.at("verdict"), "not_identifiable");
    EXPECT_TRUE(effect.at("smallest_percent").is_null());
    EXPECT_EQ(effect.at("joints").size(), 6U);
    EXPECT_EQ(effect.at("parameters").at(1).at("name"), "mass com_x");
    EXPECT_GT(effect.at("with_baseline").at("smallest_percent").get<double>(), 0);
  }
}

TEST(Sight, OneSlidingJointHasNoCouplings) {
  Robot robot;
  robot.name = "slide";
  robot.joints.resize(1);
  robot.joints[0].name = "rail";
  robot.joints[0].link = "carriage";
  robot.joints[0].type = JointType::prismatic;
  robot.joints[0].axis = Eigen::Vector3d::UnitX();
  robot.joints[0].inertial = Inertial{90, Eigen::Vector3d::Zero(), Eigen::Matrix3d::Identity()};
  Motion motion = fourier(1, 20, 0.2, 0.004);
  for (MatrixXd* m : {&motion.q, &motion.dq, &motion.ddq}) *m = MatrixXd(m->col(2));
  SightSettings settings;
  settings.noise = VectorXd::Constant(1, 2);
  Progress progress;
  const Sight sight = see(nominal_from_urdf(robot, {200}, {0.5}).model, {motion}, settings, progress);
  for (const EffectSight& e : sight.effects) EXPECT_FALSE(e.effect.ends_with("coupling"));
  EXPECT_EQ(of(sight, "asymmetric_friction").verdict, SightVerdict::seen);
  EXPECT_EQ(of(sight, "rotor_inertia").verdict, SightVerdict::not_identifiable);
  EXPECT_EQ(of(sight, "ripple").typical.shape, std::vector{600.0});
  const nlohmann::json json = sight_json(sight);
  EXPECT_NE(json.dump().find("\"N*s/m\""), std::string::npos);
  EXPECT_EQ(json.dump().find("N*m*s/rad"), std::string::npos);
}

TEST(Sight, SameResultAgain) {
  const std::vector<Motion> motions{fourier(1, 10, 1, 0.004)};
  EXPECT_EQ(sight_json(judge(motions)).dump(), sight_json(judge(motions)).dump());
}

TEST(Sight, RefusesWhatItCannotJudge) {
  Progress progress;
  const Motion motion = fourier(1, 10, 1, 0.004);
  EXPECT_THROW(judge({}), InputError);
  SightSettings settings = one_percent();
  settings.noise[2] = 0;
  EXPECT_THROW(judge({motion}, settings), InputError);
  EXPECT_THROW(judge({motion, fourier(1, 10, 1, 0.002)}), InputError);
  SightSettings narrow = one_percent();
  narrow.torque_cutoff_hz = 10;
  EXPECT_THROW(judge({fourier(1, 0.5, 1)}, narrow), DataError);  // nothing left between the filter's edges
  EXPECT_THROW(judge({fourier(1, 1, 1)}, narrow), DataError);    // fewer independent torques than parameters
  Motion less = motion;
  less.q.conservativeResize(Eigen::NoChange, 5);
  EXPECT_THROW(judge({less}), InputError);
}

TEST(NominalModel, StandsInWhereTheUrdfHasNoInertias) {
  Robot bare = puma();
  for (Joint& joint : bare.joints) joint.inertial.reset();
  const NominalModel model = nominal_from_urdf(bare, rated, velocity);
  EXPECT_EQ(nominal_from_urdf(puma(), rated, velocity).assumptions.size(), 1U);
  ASSERT_EQ(model.assumptions.size(), 2U);
  EXPECT_NE(model.assumptions[1].find("no inertias"), std::string::npos);
  // Gravity at random poses: up to 30 % of rated torque, the same poses or others.
  Random random(7);
  MatrixXd q(500, 6);
  for (Index i = 0; i < q.size(); ++i) q.data()[i] = random.uniform(-pi, pi);
  IdentifiedModel frictionless = model.model;
  for (JointFit& joint : frictionless.joints) joint.effects.clear();
  const MatrixXd still = MatrixXd::Zero(500, 6), tau = predict(frictionless, q, still, still, 0.002);
  double most = 0;
  for (Index j = 0; j < 6; ++j)
    most = std::max(most, tau.col(j).cwiseAbs().maxCoeff() / rated[static_cast<std::size_t>(j)]);
  EXPECT_GT(most, 0.24);
  EXPECT_LT(most, 0.36);
  EXPECT_THROW(nominal_from_urdf(puma(), {1, 2}, velocity), InputError);
  EXPECT_THROW(nominal_from_urdf(puma(), rated, {1, 1, 1, 0, 1, 1}), InputError);
}

}  // namespace
}  // namespace fxdyn
