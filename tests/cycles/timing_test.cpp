// Single instructions and pairs against the Cortex-M4 Technical Reference Manual (DDI 0439): 3.3.1 "Table of processor
// instructions", 3.3.2 "Load/store timings". Memory without wait states, as there.

#include <gtest/gtest.h>

#include <ostream>
#include <string>

#include "tests/cycles/assembled.hpp"

namespace fxdyn::cycles {
namespace {

constexpr CoreSetup likely{.ideal_memory = true};
constexpr CoreSetup fastest{.ends = Ends::fastest, .ideal_memory = true};
constexpr CoreSetup slowest{.ends = Ends::slowest, .ideal_memory = true};

Time cycles(const std::string& lines, const CoreSetup& setup = likely) { return Assembled(lines).cycles(setup); }

/// Of these lines between instructions that have nothing to do with them.
Time alone(const std::string& lines, const CoreSetup& setup = likely) {
  return cycles("nop\nnop\n" + lines + "\nnop\nnop", setup) - 4;
}

struct Row {
  const char* lines;
  Time cycles;
};
void PrintTo(const Row& row, std::ostream* out) { *out << row.lines << ": " << row.cycles; }

/// Rows of the table that have one number. Forms with a shifted operand are in the table's <op2>.
class Table : public testing::TestWithParam<Row> {};

TEST_P(Table, SaysHowManyCycles) {
  for (const CoreSetup& setup : {fastest, likely, slowest})
    EXPECT_EQ(alone(GetParam().lines, setup), GetParam().cycles);
}

INSTANTIATE_TEST_SUITE_P(
    Data, Table,
    testing::Values(Row{"mov r1, r2", 1}, Row{"movs r1, #3", 1}, Row{"movw r1, #1234", 1}, Row{"movt r1, #1234", 1},
                    Row{"mvn r1, r2", 1}, Row{"add r1, r2, r3", 1}, Row{"add r1, r2, r3, lsl #4", 1},
                    Row{"add r1, r2, #0xe000e000", 1}, Row{"adds r1, #1", 1}, Row{"adc r1, r2, r3", 1},
                    Row{"adr r1, . + 8", 1}, Row{"sub r1, r2, r3", 1}, Row{"sbc r1, r2, r3", 1},
                    Row{"rsb r1, r2, r3", 1}, Row{"mul r1, r2, r3", 1}, Row{"muls r1, r2", 1},
                    Row{"smull r1, r2, r3, r4", 1}, Row{"umull r1, r2, r3, r4", 1}, Row{"smlal r1, r2, r3, r4", 1},
                    Row{"umlal r1, r2, r3, r4", 1}, Row{"umaal r1, r2, r3, r4", 1}, Row{"smulbb r1, r2, r3", 1},
                    Row{"smlabb r1, r2, r3, r4", 1}, Row{"smlalbb r1, r2, r3, r4", 1}, Row{"smulwb r1, r2, r3", 1},
                    Row{"smlawb r1, r2, r3, r4", 1}, Row{"smuad r1, r2, r3", 1}, Row{"smlad r1, r2, r3, r4", 1},
                    Row{"smlald r1, r2, r3, r4", 1}, Row{"smlsld r1, r2, r3, r4", 1}, Row{"smmul r1, r2, r3", 1},
                    Row{"smmla r1, r2, r3, r4", 1}, Row{"smmls r1, r2, r3, r4", 1}, Row{"ssat r1, #16, r2", 1},
                    Row{"usat r1, #16, r2", 1}, Row{"ssat16 r1, #8, r2", 1}, Row{"qadd r1, r2, r3", 1},
                    Row{"sadd16 r1, r2, r3", 1}, Row{"sel r1, r2, r3", 1}, Row{"cmp r1, r2", 1}, Row{"cmp r1, #3", 1},
                    Row{"cmn r1, r2", 1}, Row{"tst r1, r2", 1}, Row{"teq r1, r2", 1}, Row{"and r1, r2, r3", 1},
                    Row{"eor r1, r2, r3", 1}, Row{"orr r1, r2, r3", 1}, Row{"orn r1, r2, r3", 1},
                    Row{"bic r1, r2, r3", 1}, Row{"lsl r1, r2, #3", 1}, Row{"lsl r1, r2, r3", 1},
                    Row{"lsr r1, r2, #3", 1}, Row{"asr r1, r2, r3", 1}, Row{"ror r1, r2, #3", 1}, Row{"rrx r1, r2", 1},
                    Row{"clz r1, r2", 1}, Row{"rbit r1, r2", 1}, Row{"rev r1, r2", 1}, Row{"rev16 r1, r2", 1},
                    Row{"revsh r1, r2", 1}, Row{"sxth r1, r2", 1}, Row{"sxtb r1, r2", 1}, Row{"uxth r1, r2", 1},
                    Row{"uxtb r1, r2", 1}, Row{"sxtah r1, r2, r3", 1}, Row{"ubfx r1, r2, #3, #4", 1},
                    Row{"sbfx r1, r2, #3, #4", 1}, Row{"bfi r1, r2, #3, #4", 1}, Row{"bfc r1, #3, #4", 1},
                    Row{"pkhbt r1, r2, r3", 1}, Row{"pkhtb r1, r2, r3, asr #1", 1}, Row{"nop", 1}, Row{"cpsie i", 1},
                    Row{"clrex", 1}, Row{"mrs r1, primask", 2}, Row{"msr primask, r1", 2}));

INSTANTIATE_TEST_SUITE_P(LoadsAndStores, Table,
                         testing::Values(Row{"ldr r1, [r2]", 2}, Row{"ldr r1, [r2, #8]", 2}, Row{"ldr r1, [r2, r7]", 2},
                                         Row{"ldr r1, [r2, r7, lsl #2]", 2}, Row{"ldr r1, [r2], #4", 2},
                                         Row{"ldr r1, [r2, #4]!", 2}, Row{"ldrb r1, [r2]", 2}, Row{"ldrh r1, [r2]", 2},
                                         Row{"ldrsb r1, [r2]", 2}, Row{"ldrsh r1, [r2]", 2}, Row{"ldrex r1, [r2]", 2},
                                         Row{"ldrd r0, r1, [r2]", 3}, Row{"ldm r2, {r1}", 2},
                                         Row{"ldm r2, {r1, r3, r4}", 4}, Row{"ldmdb r2, {r1, r3, r4}", 4},
                                         Row{"ldm r2!, {r0, r1, r3, r4, r5, r8, r9, r10}", 9}, Row{"str r1, [r2]", 1},
                                         Row{"str r1, [r2, #8]", 1}, Row{"strb r1, [r2]", 1},
                                         Row{"strh r1, [r2, #4]", 1}, Row{"str r1, [r2, r7]", 2},
                                         Row{"strb r1, [r2, r7]", 2}, Row{"strh r1, [r2, r7, lsl #1]", 2},
                                         Row{"strd r0, r1, [r2]", 3}, Row{"stm r2, {r0, r1, r3}", 4},
                                         Row{"stm r2!, {r0, r1, r3, r4, r5, r8, r9, r10}", 9},
                                         Row{"push {r0, r1, lr}", 4}, Row{"pop {r0, r1}", 3}));

struct Range {
  const char* lines;
  Time least, likely, most;
};
void PrintTo(const Range& row, std::ostream* out) { *out << row.lines; }

/// Rows that have a range, or a number that depends on what is around.
class Ranges : public testing::TestWithParam<Range> {};

TEST_P(Ranges, EveryEndIsWithinTheManuals) {
  EXPECT_EQ(alone(GetParam().lines, fastest), GetParam().least);
  EXPECT_EQ(alone(GetParam().lines, likely), GetParam().likely);
  EXPECT_EQ(alone(GetParam().lines, slowest), GetParam().most);
}

INSTANTIATE_TEST_SUITE_P(
    Some, Ranges,
    testing::Values(
        Range{"mla r1, r2, r3, r4", 1, 1, 2}, Range{"mls r1, r2, r3, r4", 1, 1, 2}, Range{"udiv r1, r2, r3", 2, 12, 12},
        Range{"sdiv r1, r2, r3", 2, 12, 12}, Range{"dsb", 1, 1, 4}, Range{"isb", 1, 1, 4},
        // 1 + P: the target's address is in the instruction; the same, but a 32-bit target that is not word-aligned and
        // so needs two fetches
        Range{"b 1f\n.align 2\n1:", 2, 2, 4}, Range{"b 1f\n.align 2\nnop\n1: mov.w r1, r1", 4, 4, 5},
        Range{"b 1f\n.align 2\n1: mov.w r1, r1", 3, 3, 5}, Range{"cmp r1, r1\nbeq 1f\nnop\n1:", 3, 3, 5},
        Range{"cmp r1, r1\nbne 1f\n1:", 2, 2, 2}, Range{"cbnz r1, 1f\nnop\n1:", 2, 2, 4},
        Range{"cbz r1, 1f\n1:", 1, 1, 1}, Range{"bl 1f\nnop\n1:", 2, 2, 4},
        // the target's address is in a register (ORR before it), or comes out of memory (PUSH of one before it: 2)
        Range{"adr r1, 1f\norr r1, #1\nbx r1\nnop\n.align 2\n1:", 4, 5, 6},
        Range{"adr r1, 1f\norr r1, #1\nblx r1\nnop\n.align 2\n1:", 4, 5, 6},
        Range{"adr r1, 1f\nmov pc, r1\nnop\n.align 2\n1:", 3, 4, 5},
        Range{"adr r1, 1f\norr r1, #1\npush {r1}\npop {pc}\n.align 2\n1:", 7, 9, 9},
        // IT: folded or not; what it leaves out takes its cycle all the same
        Range{"it eq\naddeq r1, r1, #1", 1, 2, 2}, Range{"cmp r1, #0\nitt eq\nldreq r1, [r2]\naddeq r1, #1", 3, 4, 4},
        Range{"cmp r1, r1\nit eq\nldreq r1, [r2]", 3, 4, 4}, Range{"ldr r1, =0x12345678", 2, 2, 3}));

/// 3.3.2, its examples.
TEST(Loads, ArePipelined) {
  EXPECT_EQ(alone("ldr r0, [r1]\nldr r1, [r2]"), 3);
  EXPECT_EQ(alone("ldr r0, [r1, r7]\nstr r0, [r3, #20]"), 3);
  EXPECT_EQ(alone("ldr r0, [r1, r7]\nstr r1, [r3, r7]"), 3);
  EXPECT_EQ(alone("ldr r0, [r1, r7]\nldr r1, [r2]\nldr r2, [r3, #4]"), 4);
}
TEST(Loads, AreNotPipelinedBehindAnythingElse) {
  EXPECT_EQ(alone("str r0, [r1, #4]\nldr r2, [r3]"), 3);
  EXPECT_EQ(alone("str r0, [r1, r7]\nldr r2, [r3]"), 4);
  EXPECT_EQ(alone("ldrd r0, r1, [r2]\nldr r3, [r4]"), 5);
  EXPECT_EQ(alone("ldr r3, [r4]\nldrd r0, r1, [r2]"), 5);
  EXPECT_EQ(alone("ldm r2, {r0, r1, r3}\nldr r4, [r5]"), 6);
  EXPECT_EQ(alone("ldr r0, [r1]\nnop\nldr r1, [r2]"), 5);
}
TEST(Loads, WaitForAnAddressThatIsLoaded) {
  EXPECT_EQ(cycles("str r1, [r2]\nnop\nnop\nldr r0, [r2]\nldr r3, [r0]\nnop\nnop"), 5 + 4);
}
TEST(Loads, WaitForAnAddressThatHasJustBeenComputed) {
  EXPECT_EQ(alone("add r1, r2, #4\nldr r0, [r1]"), 4);
  EXPECT_EQ(alone("add r1, r2, #4\nstr r0, [r1]"), 3);
  EXPECT_EQ(alone("add r1, r2, #4\nnop\nldr r0, [r1]"), 4);
  EXPECT_EQ(alone("add r1, r2, #4\nstr r1, [r2]"), 2);  // the value is forwarded, only the address is not
  EXPECT_EQ(alone("sub sp, #8\npush {r0}"), 4);
  EXPECT_EQ(alone("add r1, r2, #4\nldr r0, [r1]", fastest), 3);
}
TEST(Loads, ThatAreLeftOutAreNoLoads) { EXPECT_EQ(alone("cmp r1, #0\nit eq\nldreq r3, [r2]\nldr r4, [r5]"), 5); }

TEST(Fetch, KeepsUpWithWordsOfStraightCode) {
  for (const int count : {1, 7, 50}) {
    std::string lines;
    for (int i = 0; i < count; ++i) lines += "mov.w r1, r2\n";
    EXPECT_EQ(cycles(lines), count);
    EXPECT_EQ(cycles("nop\n" + lines + "nop"), count + 2);  // not word-aligned
  }
}

/// "subs, bne" takes three cycles a round on a Cortex-M3 and M4 without wait states: DELAY_SLOW_CYCLES of Arm's
/// CMSIS-DAP.
TEST(Published, DelayLoopTakesThreeCyclesARound) {
  const auto loop = [](int rounds) {
    return cycles("movs r0, #" + std::to_string(rounds) + "\n1: subs r0, #1\nbne 1b");
  };
  EXPECT_EQ(loop(200) - loop(100), 300);
}

TEST(Decoder, GuessesNoTiming) {
  EXPECT_THROW(cycles(".fpu fpv4-sp-d16\nvadd.f32 s0, s1, s2"), std::runtime_error);
  EXPECT_THROW(cycles("svc 0"), std::runtime_error);
}

}  // namespace
}  // namespace fxdyn::cycles
