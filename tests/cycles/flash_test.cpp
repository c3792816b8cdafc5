// The STM32G4's flash interface (RM0440, "Embedded flash memory"): sequences whose cycles can be counted by hand.

#include <gtest/gtest.h>

#include <string>

#include "tests/cycles/assembled.hpp"

namespace fxdyn::cycles {
namespace {

constexpr int wait_states = 4;
constexpr FlashSetup plain{.wait_states = wait_states};
constexpr FlashSetup cached{.wait_states = wait_states, .caches = true};
FlashSetup with(Prefetch prefetch) { return {.wait_states = wait_states, .prefetch = prefetch, .caches = true}; }

constexpr std::uint32_t a = 0x0800'0000;
constexpr std::uint32_t line = 8;

TEST(Flash, AReadTakesTheWaitStatesAndItsLineStays) {
  Flash flash(plain);
  EXPECT_EQ(flash.fetch(a, 10), 15);
  EXPECT_EQ(flash.fetch(a + 4, 15), 16);
  EXPECT_EQ(flash.fetch(a + line, 16), 21);
  EXPECT_EQ(flash.fetch(a, 21), 26);  // one line, no more
  EXPECT_EQ(flash.load(a, 30), 35);   // data have a buffer of their own
  EXPECT_EQ(flash.load(a + 4, 35), 36);
}
TEST(Flash, ASingleBankGivesTwiceAsMuch) {
  FlashSetup setup = plain;
  setup.width = 16;
  Flash flash(setup);
  EXPECT_EQ(flash.fetch(a, 10), 15);
  EXPECT_EQ(flash.fetch(a + 12, 15), 16);
  EXPECT_EQ(flash.fetch(a + 16, 16), 21);
}
TEST(Flash, OneReadAfterTheOther) {
  Flash flash(plain);
  EXPECT_EQ(flash.fetch(a, 10), 15);
  EXPECT_EQ(flash.load(a + 0x1000, 11), 20);  // a read that runs is not broken off
  EXPECT_EQ(flash.fetch(a + line, 15), 25);
}
TEST(Flash, PrefetchesTheNextLine) {
  Flash flash(with(Prefetch::copied));
  EXPECT_EQ(flash.fetch(a, 10), 15);
  EXPECT_EQ(flash.fetch(a + line, 17), 20);      // since 15 on its way
  EXPECT_EQ(flash.fetch(a + 2 * line, 30), 31);  // there since 25
}
TEST(Flash, DataGoBeforeAPrefetchThatHasNotBegun) {
  Flash flash(with(Prefetch::copied));
  EXPECT_EQ(flash.fetch(a, 10), 15);
  EXPECT_EQ(flash.load(a + 0x1000, 15), 20);
  EXPECT_EQ(flash.fetch(a + line, 18), 25);
}
TEST(Flash, CachesWhatMissed) {
  Flash flash(cached);
  EXPECT_EQ(flash.fetch(a, 10), 15);
  EXPECT_EQ(flash.fetch(a + line, 15), 20);
  EXPECT_EQ(flash.fetch(a, 20), 21);
  EXPECT_EQ(flash.load(a + 0x1000, 30), 35);
  EXPECT_EQ(flash.load(a + 0x2000, 40), 45);
  EXPECT_EQ(flash.load(a + 0x1000, 50), 51);
  flash.forget();
  EXPECT_EQ(flash.fetch(a, 60), 65);
}
TEST(Flash, WhatWasPrefetchedIsCachedOrNot) {
  for (const Prefetch prefetch :
       {Prefetch::copied, Prefetch::copied_if_late, Prefetch::apart, Prefetch::apart_after_hits}) {
    for (const Time asked : {30, 19, 18}) {
      Flash flash(with(prefetch));
      flash.fetch(a, 10);
      EXPECT_EQ(flash.fetch(a + line, asked), asked == 30 ? 31 : 20);
      const bool late = asked == 18;               // it comes at 20
      EXPECT_EQ(flash.fetch(a + 0x1000, 50), 55);  // elsewhere, prefetches there
      EXPECT_EQ(flash.fetch(a, 70), 71);           // missed once, so it is cached
      const bool is_cached = prefetch == Prefetch::copied || (prefetch == Prefetch::copied_if_late && late);
      // A line out of the cache is followed by a prefetch unless `apart`.
      EXPECT_EQ(flash.fetch(a + line, 90), is_cached || prefetch != Prefetch::apart ? 91 : 95);
      EXPECT_EQ(flash.fetch(a, 110), 111);
      EXPECT_EQ(flash.fetch(a + line, 111), is_cached || prefetch == Prefetch::apart ? 112 : 116);
    }
  }
}
TEST(Flash, ALoadThatMissesWhateverHappensHelpsNobody) {
  Flash flash(cached);
  flash.load(a, 10);
  EXPECT_EQ(flash.load(a, 20, true), 25);
  EXPECT_EQ(flash.load(a, 30), 31);  // still there from the first one
  for (Time now = 40; now < 120; now += 10) flash.load(a + 0x1000, now, true);
  EXPECT_EQ(flash.load(a, 200), 205);  // eight others have pushed it out
  EXPECT_EQ(flash.load(a + 0x1000, 210), 215);
}

/// 1 KB for instructions, 256 bytes for data (RM0440: 32 and 8 lines of 4 x 64 bits).
TEST(Cache, HasTheManualsSize) {
  for (const bool data : {false, true}) {
    const std::uint32_t lines = (data ? 256 : 1024) / line;
    const auto second_round = [&](std::uint32_t count) {
      Flash flash(cached);
      Time now = 10;
      int hits = 0;
      for (int round = 0; round < 2; ++round) {
        for (std::uint32_t i = 0; i < count; ++i) {
          const Time ready = data ? flash.load(a + i * line, now) : flash.fetch(a + i * line, now);
          hits += round == 1 && ready == now + 1 ? 1 : 0;
          now = ready + 20;
        }
      }
      return hits;
    };
    EXPECT_EQ(second_round(lines), static_cast<int>(lines));
    EXPECT_EQ(second_round(lines + 4), 0);  // least recently used: in a circle all of them
  }
}
TEST(Cache, TheLeastRecentlyUsedLineGoes) {
  LineCache cache(2, line);
  cache.fill(0);
  cache.fill(32);
  EXPECT_TRUE(cache.use(0));
  cache.fill(64);
  EXPECT_TRUE(cache.has(0));
  EXPECT_FALSE(cache.has(32));
}
TEST(Cache, PartsOfALineAreValidOneByOne) {
  LineCache cache(2, line);
  cache.fill(8);
  EXPECT_TRUE(cache.has(12));
  EXPECT_FALSE(cache.has(0) || cache.has(16) || cache.use(24));
  cache.fill(24);
  EXPECT_TRUE(cache.has(8) && cache.has(24));
}

std::string repeat(const std::string& line_, int times) {
  std::string all;
  for (int i = 0; i < times; ++i) all += line_ + "\n";
  return all;
}

/// Straight code out of the flash: a line of 8 bytes every 5 cycles, unless its instructions take longer.
TEST(StraightCode, TakesAReadALine) {
  const auto a_line = [](const char* instruction, int in_a_line, const FlashSetup& setup) {
    const auto cycles = [&](int lines) { return Assembled(repeat(instruction, lines * in_a_line)).cycles({}, setup); };
    return static_cast<double>(cycles(60) - cycles(20)) / 40;
  };
  EXPECT_EQ(a_line("mov.w r1, r2", 2, plain), 1 + wait_states + 1);  // word after word, then the next line
  EXPECT_EQ(a_line("mov.w r1, r2", 2, with(Prefetch::copied)), 1 + wait_states);
  EXPECT_EQ(a_line("nop", 4, with(Prefetch::copied)), 1 + wait_states);
  EXPECT_EQ(a_line("udiv r1, r2, r3", 2, with(Prefetch::copied)), 24);
}

/// Words are fetched ahead, three at the most: while UDIV takes 12 cycles, the words of the next three instructions
/// come, and the fourth's is asked for when UDIV has left its place.
TEST(StraightCode, IsFetchedAheadByThreeWords) {
  EXPECT_EQ(Assembled("udiv r1, r2, r3\n" + repeat("mov.w r1, r2", 4)).cycles({}, plain), 12 + 3 + 3 + 1);
}
/// At NOP the next line is asked for; the target of B has to wait for it: 5 cycles for each, and one to decode.
TEST(Branch, WaitsForAFetchThatRuns) {
  EXPECT_EQ(Assembled("nop\nb 1f\n.align 4\n" + repeat("nop", 8) + "1: nop").cycles({}, plain), 5 + 5 + 1 + 1);
}

TEST(Data, WordsOfOneLoadComeOneAfterTheOther) {
  const auto cycles = [&](const char* load, const FlashSetup& setup) {
    // UDIV: what follows has been fetched when the load begins
    return Assembled("ldr r5, =0x08001000\n" + repeat("udiv r0, r0, r7", 2) + load).cycles({}, setup);
  };
  const Time one_line = cycles("ldrd r1, r2, [r5]", plain);
  EXPECT_EQ(cycles("ldrd r1, r2, [r5, #4]", plain), one_line + 1 + wait_states - 1);
  EXPECT_EQ(cycles("ldm r5, {r1, r2, r3, r4}", plain), one_line + 2 + 1 + wait_states - 1);
  EXPECT_EQ(cycles("strd r1, r2, [r5]", plain), one_line - wait_states);  // nothing to wait for
}
TEST(Data, MissWhereTheyMay) {
  Trace trace = Assembled("ldr r5, =0x08001000\nldr r1, [r5]\nnop\nldr r2, [r5]").trace();
  const auto cycles = [&](bool misses) { return Core({.misses = misses}, cached).run(trace); };
  const Time hit = cycles(true);
  EXPECT_EQ(cycles(false), hit);
  trace.accesses.back().may_miss = true;
  EXPECT_EQ(cycles(false), hit);
  EXPECT_EQ(cycles(true), hit + wait_states);
}
/// Code and tables moved by a word: other words share a line.
TEST(Placement, MovesCodeAndTables) {
  const Assembled two_words("mov.w r1, r2\nmov.w r1, r2");
  EXPECT_EQ(two_words.cycles({.moved_by = 0}, plain), 2);
  EXPECT_EQ(two_words.cycles({.moved_by = 4}, plain), 2 + wait_states);
  EXPECT_EQ(two_words.cycles({.moved_by = 8}, plain), 2);
  const auto pair = [](const char* load, std::uint32_t moved_by) {
    return Assembled("ldr r5, =0x08001000\n" + repeat("udiv r0, r0, r7", 2) + load)
        .cycles({.moved_by = moved_by}, plain);
  };
  EXPECT_EQ(pair("ldrd r1, r2, [r5, #4]", 0) - pair("ldrd r1, r2, [r5]", 0), wait_states);
  EXPECT_EQ(pair("ldrd r1, r2, [r5]", 4) - pair("ldrd r1, r2, [r5, #4]", 4), wait_states);
}

/// A loop that fits into the cache runs as without wait states. A public measurement on an STM32F4 found the same of a
/// function of 90 bytes: 44 cycles with 0 and with 5 wait states.
TEST(Loop, RunsOutOfTheCacheWithoutWaiting) {
  const auto round = [](const CoreSetup& core, const FlashSetup& setup) {
    const auto cycles = [&](int rounds) {
      return Assembled("movs r0, #" + std::to_string(rounds) + "\n1:\n" + repeat("mov.w r1, r2", 21) +
                       "subs r0, #1\nbne 1b")
          .cycles(core, setup);
    };
    return cycles(200) - cycles(100);
  };
  const Time without = round({.ideal_memory = true}, {});
  EXPECT_EQ(round({}, cached), without);
  EXPECT_EQ(round({}, with(Prefetch::copied)), without);
  EXPECT_EQ(round({}, with(Prefetch::copied_if_late)), without);
  EXPECT_EQ(round({}, with(Prefetch::apart)), without);
  EXPECT_GT(round({}, with(Prefetch::apart_after_hits)), without);  // the one reading that does not give that
  EXPECT_GT(round({}, plain), 2 * without);
}

}  // namespace
}  // namespace fxdyn::cycles
