// The table of what thresholds decide: its list, its cases, its counts, and the page that shows it.

#include "tests/campaign/thresholds.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "host_tools/support/files.hpp"

namespace fxdyn::campaign {
namespace {

using nlohmann::json;

TEST(Thresholds, AreMembersOfTheOptions) {
  const std::vector<Threshold>& all = deciding_thresholds();
  EXPECT_LE(all.size(), 40U);
  std::set<std::string> names;
  std::set<const double*> places;
  diagnosis::Options options;
  for (const Threshold& one : all) {
    EXPECT_TRUE(names.insert(one.name).second) << one.name;
    EXPECT_TRUE(places.insert(&one.of(options)).second) << one.name;
    EXPECT_GT(one.of(options), 0) << one.name;
  }
  options.gate.least_gain = 17;
  const auto gain =
      std::find_if(all.begin(), all.end(), [](const Threshold& one) { return one.name == "gate.least_gain"; });
  ASSERT_NE(gain, all.end());
  EXPECT_EQ(gain->of(options), 17);
}

TEST(Thresholds, AreReadWhereTheCaseHasWhatTheyAreOf) {
  Case one;
  one.baseline = true;
  Threshold threshold = deciding_thresholds().front();
  threshold.reads = Threshold::Reads::with_baseline;
  EXPECT_TRUE(threshold.is_read(one));
  threshold.reads = Threshold::Reads::without_baseline;
  EXPECT_FALSE(threshold.is_read(one));
  threshold.reads = Threshold::Reads::with_link_encoders;
  EXPECT_FALSE(threshold.is_read(one));
  one.link_encoders = true;
  EXPECT_TRUE(threshold.is_read(one));
}

TEST(Thresholds, HaveFortyCases) {
  std::set<std::string> names;
  std::set<std::uint64_t> seeds;
  for (const Case& one : threshold_cases()) {
    names.insert(one.name);
    seeds.insert(one.seed);
  }
  EXPECT_EQ(names.size(), 40U);
  EXPECT_EQ(seeds.size(), 40U);
}

TEST(Thresholds, AnAnswerIsVerdictNamesAndJoints) {
  const json truth = {{"effects", {{{"effect", "spring"}, {"joint", 2}}}}, {"background", json::array()}};
  const json report = {{"verdict", "unexplained"},
                       {"joints",
                        {{{"index", 1}, {"verdict", "unexplained"}, {"effects", json::array()}},
                         {{"index", 2},
                          {"verdict", "explained"},
                          {"effects", {{{"effect", "spring"}, {"certainty", "established"}, {"score", 10}}}}}}},
                       {"robot_effects", json::array()}};
  const Answer answer = answer_of(truth, report);
  EXPECT_EQ(answer.verdict, "unexplained");
  EXPECT_EQ(answer.effects, std::set<std::string>{"spring"});
  EXPECT_EQ(answer.joints, (std::set<std::size_t>{1, 2}));
  EXPECT_TRUE(answer.right);
}

TEST(Thresholds, ChangesAreCountedCaseByCase) {
  const Answer found{"explained", {"spring"}, {2}, true}, other{"explained", {"ripple"}, {2}, false},
      nothing{"nothing_missing", {}, {}, false};
  const Threshold gain = deciding_thresholds().front();
  const auto rows = rows_of({gain}, {{found, {found}, {nothing}}, {found, {other}, {found}}});
  ASSERT_EQ(rows.size(), 1U);
  EXPECT_EQ(rows[0].cases, 2U);
  EXPECT_EQ(rows[0].right, 2U);
  EXPECT_EQ(rows[0].halved.verdict, 0U);
  EXPECT_EQ(rows[0].halved.effects, 1U);
  EXPECT_EQ(rows[0].halved.joints, 0U);
  EXPECT_EQ(rows[0].halved.right, 1U);
  EXPECT_EQ(rows[0].doubled.verdict, 1U);
  EXPECT_EQ(rows[0].doubled.effects, 1U);
  EXPECT_EQ(rows[0].doubled.joints, 1U);
  EXPECT_FALSE(rows[0].without_effect());
  EXPECT_TRUE(rows_of({gain}, {{found, {found}, {found}}})[0].without_effect());
}

TEST(Thresholds, AnswersAreReadAsTheyAreWritten) {
  const CaseAnswers answers{
      {"unexplained", {"spring"}, {0, 2}, true}, {{"refused", {}, {}, false}}, {{"unexplained", {}, {1}, false}}};
  const CaseAnswers again = case_answers(to_json(answers));
  EXPECT_EQ(again.normal.effects, answers.normal.effects);
  EXPECT_EQ(again.normal.joints, answers.normal.joints);
  EXPECT_TRUE(again.normal.right);
  ASSERT_EQ(again.halved.size(), 1U);
  EXPECT_EQ(again.halved[0].verdict, "refused");
  ASSERT_EQ(again.doubled.size(), 1U);
  EXPECT_EQ(again.doubled[0].joints, answers.doubled[0].joints);
}

TEST(Thresholds, AllHaveTheirLineOnThePage) {
  const std::string page = read_file(std::string(FXDYN_SOURCE_DIR) + "/docs/findings/thresholds.md");
  diagnosis::Options defaults;
  for (const Threshold& one : deciding_thresholds()) {
    const std::string line = fmt::format("\n| {} | {:g} | {} |", one.name, one.of(defaults), one.unit);
    EXPECT_NE(page.find(line), std::string::npos) << line;
  }
}

}  // namespace
}  // namespace fxdyn::campaign
