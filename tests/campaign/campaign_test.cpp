#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <set>

#include "host_tools/effects/effects.hpp"
#include "host_tools/effects/evaluator.hpp"
#include "host_tools/effects/identified_model.hpp"
#include "host_tools/support/files.hpp"
#include "tests/campaign/generate.hpp"
#include "tests/campaign/score.hpp"
#include "tests/campaign/truth.hpp"
#include "tests/campaign/write_up.hpp"
#include "tests/support/files.hpp"

namespace fxdyn::campaign {
namespace {

namespace fs = std::filesystem;
using Eigen::Index;
using Eigen::MatrixXd;
using nlohmann::json;

Case case_of(const std::string& effect, double share, std::size_t robot = 2) {
  Case one;
  one.name = effect;
  one.robot = robot;
  one.seed = 77;
  one.effects = {{effect, share}};
  return one;
}

// The size that was asked for, whatever the effect turns to reach it.
TEST(Campaign, EffectsHaveTheSizeAskedFor) {
  const fs::path folder = test::folder() / "sizes";
  const Plan plan = plan_case(case_of("stribeck", 0.006), folder).plan;
  for (const char* effect :
       {"stribeck", "presliding", "friction_drift", "saturation", "delay", "payload", "gravity_tilt", "ripple",
        "load_friction", "joint_coupling", "motor_coupling", "backlash"}) {
    Random random(5);
    std::size_t reached = 0;
    for (std::size_t joint = 0; joint < plan.joints(); ++joint) {
      const auto drawn = draw(effect, joint, plan, random);
      if (!drawn) continue;
      const auto fit = scaled(*drawn, 0.004, plan);
      if (!fit) continue;
      ++reached;
      const auto change = torque_change(plan, with_effect(plan.healthy, drawn->joint, *fit));
      EXPECT_NEAR(shares_of_rated(plan, change).maxCoeff(), 0.004, 4e-5) << effect << " " << joint;
    }
    EXPECT_GT(reached, 0U) << effect;
  }
}

MatrixXd truth_of(const fs::path& folder, const std::string& log, std::size_t joints) {
  return read_truth(folder / (log + ".truth.csv"), joints);
}

// Two sessions that differ in the effect alone: the logs' noise-free torques differ by the effect's own formula.
TEST(Campaign, TruthMinusHealthyTruthIsTheEffect) {
  const fs::path folder = test::folder() / "difference";
  Case with = case_of("viscous_cubic", 0.01), without = with;
  without.effects.clear();
  generate(with, folder / "with" / "data", folder / "with" / "truth");
  generate(without, folder / "without" / "data", folder / "without" / "truth");
  const json truth = json::parse(read_file(folder / "with" / "truth" / "truth.json"));
  const json& effect = truth.at("effects").at(0);
  const auto j = effect.at("joint").get<Index>() - 1;
  const double coefficient = effect.at("parameters").at("coefficient");

  // exact motion of the test logs
  const fs::path exact = folder / "with" / "truth" / "exact";
  const Robot robot = read_urdf(folder / "with" / "data" / "robot.urdf");
  const Log log = read_exact(exact / "test_fast.csv", robot);
  MatrixXd expected = MatrixXd::Zero(log.samples(), log.joints());
  expected.col(j) = coefficient * log.dq.col(j).array().cube();
  const MatrixXd change = truth_of(folder / "with" / "truth", "test_fast", robot.size()) -
                          truth_of(folder / "without" / "truth", "test_fast", robot.size());
  EXPECT_LT((change - expected).cwiseAbs().maxCoeff(), 1e-6 * expected.cwiseAbs().maxCoeff());
  // and the diagnosis sees none of it
  EXPECT_FALSE(fs::exists(folder / "with" / "data" / "truth.json"));
  for (const auto& entry : fs::directory_iterator(folder / "with" / "data"))
    EXPECT_EQ(entry.path().string().find("truth"), std::string::npos) << entry.path();
}

TEST(Campaign, WhatIsOutsideTheCatalogueIsAddedToLogAndTruth) {
  const fs::path folder = test::folder() / "outside";
  Case with = case_of("square_wave", 0.02), without = with;
  without.effects.clear();
  generate(with, folder / "with" / "data", folder / "with" / "truth");
  generate(without, folder / "without" / "data", folder / "without" / "truth");
  const json truth = json::parse(read_file(folder / "with" / "truth" / "truth.json"));
  const auto j = truth.at("effects").at(0).at("joint").get<Index>() - 1;
  const std::size_t n = truth.at("rated_torque").size();
  double power = 0;
  for (const char* log : {"train_fast", "train_mid", "train_slow", "train_reversals"}) {
    const MatrixXd change =
        truth_of(folder / "with" / "truth", log, n) - truth_of(folder / "without" / "truth", log, n);
    power += change.col(j).squaredNorm() / static_cast<double>(change.rows()) / 4;
    const Eigen::VectorXd measured = read_truth(folder / "with" / "data" / (std::string(log) + ".csv"), n).col(j) -
                                     read_truth(folder / "without" / "data" / (std::string(log) + ".csv"), n).col(j);
    EXPECT_LT((measured - change.col(j)).cwiseAbs().maxCoeff(), 1e-9);
  }
  EXPECT_NEAR(std::sqrt(power), 0.02 * truth.at("rated_torque").at(static_cast<std::size_t>(j)).get<double>(),
              0.02 * std::sqrt(power));
  EXPECT_EQ(read_file(folder / "with" / "data" / "train_fast.csv").substr(0, 200).find("dq1"), std::string::npos);
}

// A change that friction can take entirely is hidden; one of its own kind of torque is not.
TEST(Campaign, VisibilityIsToldBeforehand) {
  const Plan plan = plan_case(case_of("stribeck", 0.006), test::folder() / "visible").plan;
  const double rated = plan.healthy.joints[0].rated_torque;
  const auto expected = [&](auto&& torque, const std::vector<std::string>& names) {
    std::vector<MatrixXd> change;
    for (const Motion& motion : plan.motions) {
      change.emplace_back(MatrixXd::Zero(motion.q.rows(), motion.q.cols()));
      change.back().col(0) = 0.01 * rated * torque(motion).matrix();
    }
    return expect(plan, change, names, 0, true, {});
  };
  const auto viscous = [&](const Motion& m) { return (m.dq.col(0) / plan.largest_velocity[0]).array().eval(); };
  EXPECT_EQ(to_string(expected(viscous, {})), "hidden");
  const auto ripple = [](const Motion& m) { return (20 * m.q.col(0).array()).sin().eval(); };
  EXPECT_EQ(to_string(expected(ripple, {"ripple"})), "visible");
  // a spring, and nothing else of the catalogue; under another name the spring is the rival
  const auto spring = [](const Motion& m) { return m.q.col(0).array().eval(); };
  const Expected unnamed = expected(spring, {});
  EXPECT_EQ(to_string(unnamed), "ambiguous");
  EXPECT_EQ(unnamed.rival, "spring");
}

const char* const diagnosis_text = R"({"verdict": "explained",
 "joints": [
  {"index": 1, "verdict": "nothing_missing", "where": {"sentence": "", "regions": []}, "effects": []},
  {"index": 2, "verdict": "explained", "where": {"sentence": "", "regions": []}, "effects": [
    {"effect": "stribeck", "certainty": "established", "score": 20.0, "alternatives": ["presliding", "ripple"]},
    {"effect": "spring", "certainty": "established", "score": 90.0, "alternatives": ["gravity_compensator"]}]},
  {"index": 3, "verdict": "unexplained", "where": {"sentence": "", "regions": []}, "effects": []}],
 "robot_effects": [{"effect": "payload", "certainty": "established", "score": 50.0, "alternatives": []}]})";

json truth_with(const json& effects) { return {{"effects", effects}, {"background", json::array()}}; }

TEST(CampaignScore, StrongestNameCounts) {
  const json diagnosis = json::parse(diagnosis_text);
  const auto scored = [&](const json& effects) { return score(truth_with(effects), diagnosis, {}); };
  const json right = scored({{{"effect", "spring"}, {"joint", 2}}});
  EXPECT_TRUE(right.at("top1"));
  EXPECT_TRUE(right.at("passed"));
  EXPECT_TRUE(right.at("right_joint"));
  EXPECT_EQ(right.at("spurious"), 2);
  const json second = scored({{{"effect", "stribeck"}, {"joint", 2}}});
  EXPECT_FALSE(second.at("top1"));
  EXPECT_TRUE(second.at("found"));
  EXPECT_EQ(second.at("named_as"), "spring");
  const json stated = scored({{{"effect", "gravity_compensator"}, {"joint", 2}}});
  EXPECT_FALSE(stated.at("top1"));
  EXPECT_TRUE(stated.at("top3"));
  const json elsewhere = scored({{{"effect", "spring"}, {"joint", 1}}});
  EXPECT_FALSE(elsewhere.at("top1"));
  EXPECT_FALSE(elsewhere.at("top3"));
  EXPECT_FALSE(elsewhere.at("right_joint"));
  EXPECT_TRUE(elsewhere.at("wrong_name"));
}

TEST(CampaignScore, PairsOutsideAndClean) {
  json diagnosis = json::parse(diagnosis_text);
  const auto scored = [&](const json& effects) { return score(truth_with(effects), diagnosis, {}); };
  EXPECT_TRUE(scored({{{"effect", "stribeck"}, {"joint", 2}}, {{"effect", "payload"}}}).at("both"));
  EXPECT_FALSE(scored({{{"effect", "stribeck"}, {"joint", 2}}, {{"effect", "ripple"}, {"joint", 1}}}).at("both"));
  const json flagged = scored({{{"effect", "jerk"}, {"joint", 3}, {"outside", true}}});
  EXPECT_TRUE(flagged.at("flagged"));
  EXPECT_TRUE(flagged.at("accepted"));  // at other joints
  diagnosis["joints"][1]["effects"] = json::array();
  diagnosis["robot_effects"] = json::array();
  EXPECT_FALSE(scored({{{"effect", "jerk"}, {"joint", 3}, {"outside", true}}}).at("accepted"));
  diagnosis = json::parse(diagnosis_text);
  const json accepted = scored({{{"effect", "jerk"}, {"joint", 2}, {"outside", true}}});
  EXPECT_FALSE(accepted.at("flagged"));
  EXPECT_TRUE(accepted.at("accepted"));
  EXPECT_TRUE(scored(json::array()).at("false_alarm"));
  EXPECT_EQ(scored(json::array()).at("joints_placed"), 0);
  // A healthy robot's own friction, rightly named, has a place.
  json placed_friction = diagnosis, healthy = truth_with(json::array());
  placed_friction["joints"][1]["where"]["regions"] = json::array({{{"signal", "dq"}, {"from", 0.1}, {"to", 0.2}}});
  EXPECT_EQ(score(healthy, placed_friction, {}).at("joints_placed"), 1);
  healthy["background"] = json::array({{{"effect", "stribeck"}, {"joint", 2}, {"names", {"stribeck"}}}});
  EXPECT_EQ(score(healthy, placed_friction, {}).at("joints_placed"), 0);
  EXPECT_EQ(score(healthy, placed_friction, {}).at("joints"), 2);

  // Where it sits: in the signal, and they overlap.
  const json spot{{"effect", "tight_spot"},
                  {"joint", 3},
                  {"outside", true},
                  {"place", {{"signal", "q"}, {"from", 0.2}, {"to", 0.4}}}};
  const auto placed = [&](const json& region) {
    json moved = diagnosis;
    moved["joints"][2]["where"]["regions"] = json::array({region});
    return score(truth_with(json::array({spot})), moved, {}).at("placed").get<bool>();
  };
  EXPECT_TRUE(placed({{"signal", "q"}, {"from", 0.3}, {"to", 0.6}}));
  EXPECT_FALSE(placed({{"signal", "q"}, {"from", 0.5}, {"to", 0.6}}));
  EXPECT_FALSE(placed({{"signal", "q"}, {"joint", 1}, {"from", 0.3}, {"to", 0.6}}));
  EXPECT_FALSE(placed({{"signal", "dq"}, {"from", 0.3}, {"to", 0.6}}));
  EXPECT_FALSE(score(truth_with(json::array({spot})), diagnosis, {}).at("placed"));

  // The curve of the right variable, there and nowhere else.
  const auto curved = [&](std::size_t joint, const char* effect) {
    json moved = diagnosis;
    moved["joints"][joint - 1]["curve"] = {{"effect", effect}};
    json of = spot;
    of["curve"] = "friction_over_position";
    return score(truth_with(json::array({of})), moved, {}).at("curve_right").get<bool>();
  };
  EXPECT_TRUE(curved(3, "friction_over_position"));
  EXPECT_FALSE(curved(3, "velocity_curve"));
  EXPECT_FALSE(curved(2, "friction_over_position"));
  const auto wound = [&](int other) {
    json moved = diagnosis;
    moved["joints"][2]["curve"] = {{"effect", "cross_position"}, {"joint", other}};
    json of = spot;
    of["curve"] = "cross_position 1";
    return score(truth_with(json::array({of})), moved, {}).at("curve_right").get<bool>();
  };
  EXPECT_TRUE(wound(1));
  EXPECT_FALSE(wound(2));

  // A background that was there before is no alarm.
  json quiet = truth_with(json::array());
  quiet["background"] = {
      {{"effect", "spring"}, {"joint", 2}}, {{"effect", "stribeck"}, {"joint", 2}}, {{"effect", "payload"}}};
  diagnosis["joints"][2]["verdict"] = "nothing_missing";
  EXPECT_FALSE(score(quiet, diagnosis, {}).at("false_alarm"));
}

TEST(CampaignScore, WhatGrewIsNotTheBackground) {
  const json diagnosis = json::parse(diagnosis_text);
  json grown = truth_with({{{"effect", "spring"}, {"joint", 2}, {"feels", 2}}});
  grown["background"] = {{{"effect", "spring"}, {"joint", 2}}, {{"effect", "payload"}}};
  const json scored = score(grown, diagnosis, {});
  EXPECT_TRUE(scored.at("top1"));
  EXPECT_EQ(scored.at("spurious"), 1);  // Stribeck; the load was there before
  EXPECT_TRUE(scored.at("too_many"));
  EXPECT_TRUE(scored.at("flagged_elsewhere"));  // joint 3
  grown["effects"][0]["feels"] = 3;
  EXPECT_FALSE(score(grown, diagnosis, {}).at("flagged_elsewhere"));
}

// The truth as the model closes the gap entirely, the healthy model not at all. Drift runs on through the session.
TEST(CampaignScore, ClosureAgainstTheNoiseFreeTorque) {
  const fs::path folder = test::folder() / "closure";
  const Case wanted = case_of("friction_drift", 0.006);
  generate(wanted, folder / "data", folder / "truth");
  const Ground ground = plan_case(wanted, folder / "again");
  const json truth = json::parse(read_file(folder / "truth" / "truth.json"));
  const auto write = [&](const char* file, const IdentifiedModel& model) {
    write_file(folder / "out" / file, to_json(model).dump());
  };
  write("nominal.json", ground.plan.healthy);
  write("model.json", ground.measured);
  EXPECT_GT(true_closure(truth, folder / "truth", folder / "out").value(), 0.999);
  write("model.json", ground.plan.healthy);
  EXPECT_NEAR(true_closure(truth, folder / "truth", folder / "out").value(), 0, 1e-9);
}

TEST(Campaign, ListsAreComplete) {
  const auto cases = all_cases();
  EXPECT_GE(cases.size(), 400U);
  std::set<std::string> names, wanted;
  for (const Case& one : cases) {
    EXPECT_TRUE(names.insert(one.name).second) << one.name;
    if (one.group != Group::single) continue;
    wanted.insert(one.effects.front().effect);
  }
  for (const std::string_view effect : effect_names()) {
    // What unites others has no cases of its own: its plant has other formulas (lugre_plant_test, identify_test).
    EXPECT_EQ(wanted.contains(std::string(effect)), find_effect(effect)->sought()) << effect;
  }
}

}  // namespace
}  // namespace fxdyn::campaign
