#include "host_tools/report/diagnosis_table.hpp"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <sstream>

#include "tests/diagnose/example.hpp"

namespace fxdyn {
namespace {

using nlohmann::json;

void expect_parts(const std::string& table, const std::vector<std::string>& parts) {
  for (const std::string& part : parts) EXPECT_NE(table.find(part), std::string::npos) << part << " not in\n" << table;
}

std::size_t widest(const std::string& text) {
  std::size_t width = 0;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) width = std::max(width, line.size());
  return width;
}

/// Lines joined, runs of blanks as one: wrapped text can be searched.
std::string flat(const std::string& text) {
  std::string out;
  for (const char c : text) {
    const char one = c == '\n' ? ' ' : c;
    if (one != ' ' || out.empty() || out.back() != ' ') out += one;
  }
  return out;
}

TEST(DiagnosisTable, SaysEveryVerdictAndWhatWasFound) {
  const std::string table = diagnosis_table(diagnosis_of(test::diagnosis()));
  expect_parts(flat(table), {"diagnosis: unexplained",
                             "gaps on test logs; change since the baseline",
                             "elbow: presliding or lugre is there",
                             "robot: payload or gravity_tilt is there",
                             "likely saturation",
                             "explained",
                             "nothing missing",
                             "unexplained",
                             "not excited",
                             "1.9 -> 0.4",
                             "roll nothing missing 0.1 -> 0.1 N*m 0.1 - ",
                             "0.35",
                             "17 % (12 .. 22)",
                             "amplitude 2.1+-0.05 N*m",
                             "velocity 0.04+-0.01 rad/s",
                             "61 % of the gap is at velocity -0.05 .. 0.05 rad/s, 8 % of the time",
                             "elbow: 90 % of the gap is in negative direction",
                             "could as well be presliding",
                             "payload: mass 2+-0.1 kg",
                             "seen on joints 2, 3, 4; closes 80 % of the gap",
                             "spring",
                             "next: slow reversals of joint 1 through +-0.02 rad would separate stribeck from"});
}

TEST(DiagnosisTable, ShowsFixedPointAndClosedLoop) {
  const std::string table = diagnosis_table(diagnosis_of(test::diagnosis()));
  expect_parts(flat(table), {"1.88 -> 0.41 0.42 N*m", "0.002 -> 0.0003 rad", "1.5 -> 0.2"});
}

TEST(DiagnosisTable, EachExperimentHasALineAndAShareHasNoUnit) {
  json diagnosis = test::diagnosis();
  diagnosis["next_experiment"] = "a or b at joint 1: slow reversals; c or d at joint 2: constant speeds";
  diagnosis["joints"][0]["effects"][0]["parameters"][0]["unit"] = "1";
  const std::string table = diagnosis_table(diagnosis_of(diagnosis));
  EXPECT_NE(table.find("\n  next: a or b at joint 1: slow reversals\n  next: c or d at joint 2: constant speeds\n"),
            std::string::npos)
      << table;
  EXPECT_EQ(flat(table).find("+-0.05 1"), std::string::npos);
  EXPECT_NE(flat(table).find("+-0.05"), std::string::npos);
}

TEST(DiagnosisTable, IsAtMostAHundredColumnsWideWhateverTheNames) {
  json diagnosis = test::diagnosis();
  EXPECT_LE(widest(diagnosis_table(diagnosis_of(diagnosis))), 100U);
  diagnosis["joints"][0]["joint"] = std::string(60, 'j');
  diagnosis["joints"][0]["gap_before"] = -1.2345e-100;
  diagnosis["joints"][0]["effects"][0]["effect"] = std::string(150, 'e');
  diagnosis["joints"][0]["effects"].push_back(diagnosis["joints"][0]["effects"][0]);
  diagnosis["next_experiment"] = std::string(250, 'n');
  EXPECT_LE(widest(diagnosis_table(diagnosis_of(diagnosis))), 100U) << diagnosis_table(diagnosis_of(diagnosis));
}

TEST(DiagnosisTable, IsAsWideAsTheTerminal) {
  json diagnosis = test::diagnosis();
  diagnosis["next_experiment"] = std::string(250, 'n');
  for (const std::size_t width : {100, 130, 160})
    EXPECT_EQ(widest(diagnosis_table(diagnosis_of(diagnosis), {width, false})), width);
}

TEST(DiagnosisTable, ColoursAreVerdictsAndChangeNothingElse) {
  const std::string plain = diagnosis_table(diagnosis_of(test::diagnosis()));
  std::string coloured = diagnosis_table(diagnosis_of(test::diagnosis()), {100, true});
  EXPECT_EQ(plain.find('\033'), std::string::npos);
  expect_parts(coloured, {"\033[31munexplained  ", "\033[32mnothing missing", "diagnosis: \033[31munexplained\033[0m"});
  for (std::size_t at = 0; (at = coloured.find('\033')) != std::string::npos;)
    coloured.erase(at, coloured.find('m', at) + 1 - at);
  EXPECT_EQ(coloured, plain);
}

TEST(DiagnosisTable, ManagesWithWhatIsThere) {
  DiagnosisResult diagnosis;
  diagnosis.joints = {{"a", "N*m", 1, Verdict::nothing_missing}};
  diagnosis.evidence = HeldOutEvidence{};
  const std::string table = diagnosis_table(diagnosis);
  expect_parts(table, {"nothing missing", "- -> -"});
  EXPECT_EQ(table.find("where the gap"), std::string::npos);
  EXPECT_EQ(table.find("next"), std::string::npos);
}

}  // namespace
}  // namespace fxdyn
