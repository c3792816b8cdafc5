// The bounds that firmware/tick_budget.hpp offers are those of firmware/cycles.csv.

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <fstream>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include "firmware/tick_budget.hpp"

namespace fxdyn {
namespace {

/// Cycles of a hundred instructions at the slowest, by set-up of the flash: the newest row of each.
std::map<std::string, double> recorded() {
  std::ifstream file(FXDYN_SOURCE_DIR "/firmware/cycles.csv");
  std::map<std::string, double> found;
  std::string line;
  std::getline(file, line);
  while (std::getline(file, line)) {
    std::vector<std::string> cells;
    std::istringstream row(line);
    for (std::string cell; std::getline(row, cell, ',');) cells.push_back(cell);
    if (cells.size() == 9) found[cells[4]] = 100 * std::stod(cells[8]) / std::stod(cells[5]);
  }
  return found;
}

void expect_bound(CyclesPerInstruction bound, double measured) {
  EXPECT_GE(static_cast<double>(bound.hundredths), measured);
  EXPECT_LE(static_cast<double>(bound.hundredths), 1.05 * measured) << "a bound, not a guess";
}

TEST(TickBudget, BoundsAreTheRecordedFigures) {
  auto figures = recorded();
  ASSERT_TRUE(figures.contains("no_caches"));
  expect_bound(cycles_per_instruction::stm32g4_no_wait_states, figures["no_wait_states"]);
  expect_bound(cycles_per_instruction::stm32g4_no_caches, figures["no_caches"]);
  double caches = 0;
  for (const auto& [setup, figure] : figures)
    if (setup.starts_with("caches") || setup.starts_with("prefetch")) caches = std::max(caches, figure);
  expect_bound(cycles_per_instruction::stm32g4_caches, caches);
  for (const auto& [setup, figure] : figures)
    EXPECT_GE(static_cast<double>(cycles_per_instruction::worst.hundredths), figure) << setup;
}

TEST(TickBudget, CountsCyclesAndInstructions) {
  constexpr TickBudget budget{.clock_hz = 100'000'000, .tick_us = 1000};  // 100 000 cycles
  EXPECT_EQ(budget.load_percent(Cycles{50'000}), 50);
  EXPECT_EQ(budget.load_percent(Cycles{50'001}), 51);
  EXPECT_EQ(budget.load_percent(Cycles{}), 0) << "nothing takes no time";
  EXPECT_TRUE(budget.allows(Instructions{}, CyclesPerInstruction{10'000'000'000}));
  EXPECT_TRUE(budget.allows(Cycles{50'000}));
  EXPECT_FALSE(budget.allows(Cycles{50'001}));
  EXPECT_TRUE(budget.allows(Instructions{25'000}, CyclesPerInstruction{200}));
  EXPECT_FALSE(budget.allows(Instructions{25'001}, CyclesPerInstruction{200}));
  EXPECT_FALSE(budget.allows(Instructions{1}, CyclesPerInstruction{5'000'001}));
  EXPECT_EQ(budget.allows(Instructions{15'625}), true);  // 50 000 cycles at 3.2
  EXPECT_EQ(budget.allows(Instructions{15'626}), false);
}

}  // namespace
}  // namespace fxdyn
