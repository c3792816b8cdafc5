// The emulated part itself, by small programs and by hand: what it would let through, the tests of the image could not
// see.

#include <cstring>

#include "tests/emulated_g474/bench.hpp"

namespace {

using namespace fxdyn;
using namespace fxdyn::emulated;

/// Vectors and code in machine instructions.
class Program {
 public:
  static constexpr Address code = 0x0800'0200;
  Program() : vectors_(16 + Core::interrupts, code | 1U) { vectors_[0] = 0x2000'1000; }
  Address here() const { return code + 2 * static_cast<Address>(code_.size()); }
  Program& add(std::initializer_list<std::uint16_t> halfwords) {
    code_.insert(code_.end(), halfwords);
    return *this;
  }
  Program& handler(std::uint32_t exception) {
    vectors_[exception] = here() | 1U;
    return *this;
  }
  Image image() const {
    Bytes bytes(code - Board::flash_base + 2 * code_.size());
    std::memcpy(bytes.data(), vectors_.data(), 4 * vectors_.size());
    std::memcpy(bytes.data() + (code - Board::flash_base), code_.data(), 2 * code_.size());
    return {{{Board::flash_base, bytes}}, {}};
  }

 private:
  std::vector<std::uint32_t> vectors_;
  std::vector<std::uint16_t> code_;
};

constexpr std::uint16_t wfi = 0xbf30, back = 0x4770 /* bx lr */, loop = 0xe7fe, mask = 0xb672 /* cpsid i */,
                        unmask = 0xb662, undefined = 0xde00, add_r4 = 0x3401 /* adds r4, #1 */, add_r5 = 0x3501,
                        add_r6 = 0x3601;
constexpr std::uint32_t first = Core::first_interrupt;

void enable(Board& board, std::initializer_list<std::uint32_t> interrupts) {
  for (const std::uint32_t i : interrupts) board.core.enable(i);
}

TEST(CoreModel, ReturnsWhereTheInterruptCameAndKeepsEveryRegister) {
  Program p;
  p.add({0x2001, 0x2102, 0x2203, 0x2304, add_r4, 0xe7fd});  // r0..r3 = 1..4, count r4 for ever
  p.handler(first + 54).add({0x2000, 0x2100, 0x2200, 0x2300, add_r5, back});
  Board board(p.image());
  board.run(10 * microsecond);
  const std::uint32_t stack = board.core.reg(13);
  enable(board, {54});
  for (int i = 0; i < 5; ++i) {
    board.core.pend(54);
    board.run(5 * microsecond);
  }
  EXPECT_EQ(board.core.reg(5), 5u);
  for (int i = 0; i < 4; ++i) EXPECT_EQ(board.core.reg(i), i + 1u);
  EXPECT_EQ(board.core.reg(13), stack);
  EXPECT_TRUE(board.core.active().empty());
  EXPECT_TRUE(board.core.faults().empty());
  EXPECT_GT(board.core.reg(4), 100u);
}

TEST(CoreModel, TakesNoInterruptInsideAnItBlock) {
  Program p;
  // cmp r4, r4; ittt eq; addeq r5, #1 three times; b to cmp: r5 is a multiple of three wherever the handler looks.
  p.add({0x42a4, 0xbf02, 0x3501, 0x3501, 0x3501, 0xe7f9});
  p.handler(first + 54).add({0x462e /* mov r6, r5 */, back});
  Board board(p.image());
  enable(board, {54});
  for (Time i = 0; i < 200; ++i) {
    board.core.pend(54);
    board.run(131'000'000 + i * 7'000'000);
    ASSERT_EQ(board.core.reg(6) % 3, 0u) << i;
  }
  EXPECT_GE(board.core.taken().size(), 190u);
  EXPECT_TRUE(board.core.faults().empty());
}

TEST(CoreModel, SkipsWhatItsConditionExcludesAfterAnInterruptToo) {
  Program p;
  // cmp r4, #1; ite eq; addeq r5, #1; addne r6, #1; b to cmp: r4 is 0, so only r6 counts.
  p.add({0x2c01, 0xbf0c, 0x3501, 0x3601, 0xe7fa});
  p.handler(first + 54).add({0x2000 /* movs r0, #0: sets Z */, back});
  Board board(p.image());
  enable(board, {54});
  for (Time i = 0; i < 300; ++i) {
    board.core.pend(54);
    board.run(91'000'000 + i * 11'000'000);
  }
  EXPECT_EQ(board.core.reg(5), 0u);
  EXPECT_GT(board.core.reg(6), 300u);
}

TEST(CoreModel, AMaskedInterruptWakesButWaits) {
  Program p;
  p.add({mask, wfi, add_r4, unmask, loop});
  p.handler(first + 54).add({0x0025 /* movs r5, r4 */, back});
  Board board(p.image());
  enable(board, {54});
  board.run(millisecond);
  EXPECT_TRUE(board.core.sleeping());
  EXPECT_EQ(board.core.reg(4), 0u);
  board.core.pend(54);
  board.run(millisecond);
  EXPECT_FALSE(board.core.sleeping());
  EXPECT_EQ(board.core.reg(5), 1u);  // it came after cpsie, which came after the sleep
}

TEST(CoreModel, PreemptsByPriorityAndByNumberAmongEquals) {
  Program p;
  p.add({loop});
  const std::initializer_list<std::uint16_t> wait{0x2064 /* movs r0, #100 */, 0x3801, 0xd1fd, back};
  p.handler(first + 21).add(wait);
  p.handler(first + 54).add(wait);
  p.handler(first + 60).add(wait);
  Board board(p.image());
  board.core.prioritise(21, 0x40);
  board.core.prioritise(54, 0x40);
  board.core.prioritise(60, 0x10);
  enable(board, {21, 54, 60});
  board.core.pend(54);
  board.core.pend(21);
  board.run(500 * microsecond / 1000);
  EXPECT_EQ(board.core.active(), (std::vector<std::uint32_t>{first + 21}));
  board.core.pend(60);
  board.run(500 * microsecond / 1000);
  EXPECT_EQ(board.core.active(), (std::vector<std::uint32_t>{first + 21, first + 60}));
  board.run(millisecond);
  EXPECT_EQ(board.core.taken(), (std::vector<std::uint32_t>{first + 21, first + 60, first + 54}));
  EXPECT_TRUE(board.core.active().empty());
  EXPECT_TRUE(board.core.faults().empty());
}

TEST(CoreModel, AFaultIsAHardFaultAndWithinItALockUp) {
  Program p;
  p.add({undefined, loop});
  p.handler(Core::hard_fault).add({add_r4, undefined, loop});
  Board board(p.image());
  board.run(millisecond);
  EXPECT_TRUE(board.core.locked_up());
  EXPECT_EQ(board.core.reg(4), 1u);
  EXPECT_EQ(board.core.faults().size(), 2u);
  EXPECT_EQ(board.resets(), 0u);  // no watchdog, no end
}

TEST(CoreModel, MemoryThatIsNotThereIsAFault) {
  // ldr r0, [pc]; ldr/str r1, [r0]; loop; the address
  for (const std::uint32_t address : {0x2002'0000u, 0x1fff'fff0u, 0x4002'2400u, 0x5000'0000u, 0xe000'e010u}) {
    for (const std::uint16_t access : {std::uint16_t{0x6801}, std::uint16_t{0x6001}}) {
      Program p;
      p.add({0x4801, access, loop, 0xbf00, static_cast<std::uint16_t>(address),
             static_cast<std::uint16_t>(address >> 16)});
      p.handler(Core::hard_fault).add({add_r4, loop});
      Board board(p.image());
      board.run(millisecond);
      EXPECT_EQ(board.core.reg(4), 1u) << std::hex << address << " by " << access;
    }
  }
}

TEST(CoreModel, FlashIsNotWrittenByAStore) {
  Program p;
  p.add({0x4801, 0x6001, loop, 0xbf00, 0x0000, 0x0801});
  p.handler(Core::hard_fault).add({add_r4, loop});
  Board board(p.image());
  board.run(millisecond);
  EXPECT_EQ(board.core.reg(4), 1u);
}

TEST(CoreModel, FloatingPointIsAViolation) {
  Program p;
  p.add({0xee30, 0x0a00, loop});  // vadd.f32 s0, s0, s0
  Board board(p.image());
  board.run(millisecond);
  EXPECT_FALSE(board.take_violations().empty());
}

// --- clocks ----------------------------------------------------------------------------------------------------------

class Clocks : public testing::Test {
 protected:
  std::vector<std::string> complaints;
  ClockTree clocks{[this](const std::string& what) { complaints.push_back(what); }, {}};
  std::size_t complain() { return std::exchange(complaints, {}).size(); }
};

TEST_F(Clocks, AllowOnlyWhatTheManualAllows) {
  EXPECT_EQ(clocks.processor_hz(), 16'000'000u);
  clocks.write(0x0c, 0b11 | 5U << 4 | 85U << 8 | 1U << 24, 0);
  EXPECT_EQ(complain(), 0u);
  clocks.write(0x00, 1U << 8 | 1U << 24, 0);
  EXPECT_EQ(complain(), 1u) << "the PLL's crystal does not run";
  clocks.write(0x00, 1U << 8 | 1U << 16, 0);
  EXPECT_EQ(clocks.read(0x00, millisecond) & 1U << 17, 0u);
  EXPECT_NE(clocks.read(0x00, 3 * millisecond) & 1U << 17, 0u);
  clocks.write(0x00, 1U << 8 | 1U << 16 | 1U << 24, 3 * millisecond);
  EXPECT_EQ(complain(), 0u);
  clocks.write(0x0c, 0b11 | 5U << 4 | 80U << 8 | 1U << 24, 3 * millisecond);
  EXPECT_EQ(complain(), 1u) << "configured while on";
  clocks.write(0x08, 0b11 | 0b1000U << 4, 3 * millisecond);
  EXPECT_GE(complain(), 2u) << "not locked, too few wait states";
}

TEST_F(Clocks, KnowWaitStatesAndBoost) {
  clocks.write(0x0c, 0b10 | 3U << 4 | 85U << 8 | 1U << 24, 0);
  clocks.write(0x00, 1U << 8 | 1U << 24, 0);
  const Time then = millisecond;
  clocks.write_access(0x0004'0604);
  clocks.write(0x08, 0b11 | 0b1000U << 4, then);
  EXPECT_EQ(complain(), 0u);
  clocks.write(0x08, 0b11, then + microsecond / 2);
  EXPECT_EQ(complain(), 3u) << "too early, no boost, and 4 wait states are too few without it";
  clocks.write_power(0x80, 0);
  EXPECT_EQ(complain(), 0u);
  EXPECT_EQ(clocks.processor_hz(), 170'000'000u);
  clocks.write_access(0x0004'0603);
  EXPECT_EQ(complain(), 1u);
}

TEST_F(Clocks, APeripheralWithoutItsClockDoesNotAnswer) {
  EXPECT_FALSE(clocks.clocked(ClockTree::Gate::fdcan, millisecond));
  EXPECT_EQ(complain(), 1u);
  clocks.write(0x58, 1U << 25, millisecond);
  EXPECT_TRUE(clocks.clocked(ClockTree::Gate::fdcan, millisecond));
  EXPECT_EQ(complain(), 1u) << "less than two clocks later";
  EXPECT_TRUE(clocks.clocked(ClockTree::Gate::fdcan, millisecond + microsecond));
  EXPECT_EQ(complain(), 0u);
}

// --- FDCAN -----------------------------------------------------------------------------------------------------------

class FdcanModel : public testing::Test {
 protected:
  FdcanModel() {
    can.set_clock(170'000'000);
    can.power_on(1);
  }
  void write(Offset offset, std::uint32_t value) { can.write(offset, value, now += microsecond); }
  std::uint32_t control() { return can.read(0x18, now += microsecond); }
  /// 1 Mbit/s and 2 Mbit/s from 170 MHz.
  void configure(std::uint32_t mode = 0, std::uint32_t filters = 0) {
    write(0x18, control() | 1U);
    write(0x18, control() | 2U);
    write(0x18, 0x303);
    write(0x1c, 9U << 25 | 1U << 16 | 73U << 8 | 9U);
    write(0x0c, 3U | 3U << 4 | 11U << 8 | 4U << 16);
    write(0x80, filters);
    write(0xc0, mode);
    write(0x5c, 1);
    write(0x54, 0xff'ffff);
    write(0x18, 0x300);
    pass(millisecond);
  }
  void pass(Time time) {
    for (const Time end = now + time; now < end;) now = std::min(wire.happen(now), end);
    wire.happen(now);
  }
  void put(std::uint32_t buffer, std::uint32_t id) {
    can.write_ram(0x278 + 72 * buffer, id << 18);
    can.write_ram(0x27c + 72 * buffer, 0);
  }
  void request(std::uint32_t id) {
    const std::uint32_t put_index = can.read(0xc4, now) >> 16 & 3;
    put(put_index, id);
    write(0xcc, 1U << put_index);
  }
  std::vector<std::uint32_t> ids() {
    pass(10 * millisecond);
    std::vector<std::uint32_t> found;
    for (const auto& [at, frame] : std::exchange(wire.heard, {})) found.push_back(frame.id);
    return found;
  }
  std::size_t complain() { return std::exchange(complaints, {}).size(); }

  std::vector<std::string> complaints;
  Time now = 0;
  Fdcan can{[this](const std::string& what) { complaints.push_back(what); }};
  Wire wire{can};
};

TEST_F(FdcanModel, ProtectsItsConfiguration) {
  write(0x1c, 0);
  EXPECT_EQ(complain(), 1u);
  EXPECT_EQ(can.nominal_timing(), 0x0600'0a03u);
  write(0x18, 0x303);  // INIT is set after reset, CCE is not
  EXPECT_EQ(complain(), 1u) << "FDOE and BRSE";
  configure();
  EXPECT_EQ(complain(), 0u);
  EXPECT_EQ(can.read(0x18, now) & 3, 0u) << "clearing INIT clears CCE";
  write(0x80, 0);
  EXPECT_EQ(complain(), 1u);
}

TEST_F(FdcanModel, SendsAFifoInItsOrderAndAQueueByIdentifier) {
  for (const bool queue : {false, true}) {
    configure(queue ? 1U << 24 : 0);
    for (int round = 0; round < 4; ++round) {
      for (const std::uint32_t id : {0x701u, 0x181u, 0x081u}) request(id);
      EXPECT_NE(can.read(0xc4, now) & 1U << 21, 0u) << "full";
      // All three are asked for before the bus has been looked at.
      EXPECT_EQ(ids(), queue ? (std::vector<std::uint32_t>{0x081, 0x181, 0x701})
                             : (std::vector<std::uint32_t>{0x701, 0x181, 0x081}));
      EXPECT_EQ(can.read(0xc8, now), 0u);
      EXPECT_EQ(can.read(0xd4, now), 7u);
    }
    EXPECT_EQ(complain(), 0u);
  }
}

TEST_F(FdcanModel, LosesArbitrationToALowerIdentifier) {
  configure();
  request(0x181);
  wire.send(Bench::frame(0x080, {}), 0);
  wire.send(Bench::frame(0x201, {}), 0);
  EXPECT_EQ(ids(), (std::vector<std::uint32_t>{0x181}));
  EXPECT_EQ(wire.lost_arbitrations, 1u);
  EXPECT_EQ(can.read(0x90, now) & 0xf, 2u);
}

TEST_F(FdcanModel, BlocksOrOverwritesAFullFifo) {
  for (const bool overwrite : {false, true}) {
    configure(0, overwrite ? 1U << 9 : 0);
    for (std::uint32_t id = 1; id <= 5; ++id) wire.send(Bench::frame(id, {}), 0);
    ids();
    const std::uint32_t status = can.read(0x90, now), get = status >> 8 & 3;
    EXPECT_EQ(status & 0xf, 3u);
    EXPECT_EQ(can.read_ram(0xb0 + 72 * get) >> 18, overwrite ? 3u : 1u);
    EXPECT_EQ((can.read(0x50, now) & 4) != 0, !overwrite);
    EXPECT_TRUE(can.interrupt0());
    write(0x50, 0xff'ffff);
    for (int i = 0; i < 3; ++i) write(0x94, can.read(0x90, now) >> 8 & 3);
    EXPECT_EQ(complain(), 0u);
  }
}

TEST_F(FdcanModel, KnowsEveryKindOfFilter) {
  struct Case {
    std::uint32_t element, id;
    bool accepted;
  };
  const auto element = [](std::uint32_t type, std::uint32_t action, std::uint32_t one, std::uint32_t two) {
    return type << 30 | action << 27 | one << 16 | two;
  };
  const std::vector<Case> cases{
      {element(0, 1, 0x100, 0x10f), 0x0ff, false}, {element(0, 1, 0x100, 0x10f), 0x100, true},
      {element(0, 1, 0x100, 0x10f), 0x10f, true},  {element(0, 1, 0x100, 0x10f), 0x110, false},
      {element(1, 1, 0x100, 0x10f), 0x105, false}, {element(1, 1, 0x100, 0x10f), 0x10f, true},
      {element(2, 1, 0x100, 0x7f0), 0x10f, true},  {element(2, 1, 0x100, 0x7f0), 0x110, false},
      {element(3, 1, 0x000, 0x7ff), 0x100, false}, {element(0, 0, 0x000, 0x7ff), 0x100, false},
      {element(0, 3, 0x000, 0x7ff), 0x100, false}};
  for (const Case& c : cases) {
    configure(0, 1U << 16 | 0b10U << 4 | 0b10U << 2);
    can.write_ram(0, c.element);
    wire.send(Bench::frame(c.id, {}), 0);
    ids();
    EXPECT_EQ((can.read(0x90, now) & 0xf) != 0, c.accepted) << std::hex << c.element << ", " << c.id;
  }
}

TEST_F(FdcanModel, GoesOffTheBusAndComesBackAfter129Sequences) {
  configure();
  wire.disturbed = 40;
  request(0x181);
  pass(10 * millisecond);
  EXPECT_TRUE(can.bus_off());
  EXPECT_NE(can.read(0x18, now) & 1, 0u) << "INIT by itself";
  EXPECT_NE(can.read(0x44, now) & 1U << 7, 0u);
  pass(10 * millisecond);
  EXPECT_TRUE(can.bus_off()) << "not while INIT is set";
  wire.disturbed = 0;
  write(0xd0, 1);
  write(0x18, 0x300);
  pass(1410 * microsecond);
  EXPECT_TRUE(can.bus_off());
  pass(15 * microsecond);
  EXPECT_FALSE(can.bus_off());
  EXPECT_EQ(can.transmit_errors(), 0u);
  EXPECT_TRUE(ids().empty());
  EXPECT_EQ(complain(), 0u);
}

TEST_F(FdcanModel, SeesItsOwnDataBitsOnlyWithTheDelayCompensatedWhereItIsLong) {
  WireRates rates;
  configure();
  EXPECT_TRUE(can.follows(rates, true));
  rates.loop_delay = 255 * (microsecond / 1000);
  EXPECT_TRUE(can.sees_itself(rates));  // 2 Mbit/s, sample point at 382 ns
  rates.loop_delay = 400 * (microsecond / 1000);
  EXPECT_FALSE(can.sees_itself(rates));
  write(0x18, 0x301);
  write(0x18, 0x303);
  write(0x0c, 1U << 23 | 7U | 10U << 4 | 30U << 8);  // 43 quanta of one clock: about 4 Mbit/s
  write(0x48, 32U << 8);
  EXPECT_TRUE(can.sees_itself(rates));
  write(0x48, 60U << 8);
  EXPECT_FALSE(can.sees_itself(rates)) << "the offset lies behind the bit";
}

TEST_F(FdcanModel, FollowsARateWithinItsTolerance) {
  configure();
  for (const auto& [hz, follows] : {std::pair<std::uint64_t, bool>{170'000'000, true},
                                    {171'500'000, true},
                                    {168'500'000, true},
                                    {172'500'000, false},
                                    {167'000'000, false}}) {
    can.set_clock(hz);
    EXPECT_EQ(can.follows({}, false), follows) << hz;
  }
}

// --- the rest --------------------------------------------------------------------------------------------------------

TEST(Models, TheWatchdogBitesAfterItsTimeAndNotBefore) {
  std::vector<std::string> complaints;
  IndependentWatchdog dog([&](const std::string& what) { complaints.push_back(what); });
  dog.write(0x08, 399, 0);
  EXPECT_EQ(complaints.size(), 1u) << "locked";
  dog.write(0x00, 0xcccc, 0);
  EXPECT_EQ(dog.expires(), 512 * millisecond);
  dog.write(0x00, 0x5555, 0);
  dog.write(0x08, 399, 0);
  EXPECT_NE(dog.read(0x0c, 0), 0u);
  EXPECT_EQ(dog.read(0x0c, 2 * millisecond), 0u);
  dog.write(0x00, 0xaaaa, millisecond);
  EXPECT_EQ(dog.expires(), 51 * millisecond);
}

TEST(Models, EccNamesTheDoubleWordAndKeepsTheFirst) {
  FlashEcc ecc;
  ecc.detects(0x4'0018);
  EXPECT_EQ(ecc.read(), 1U << 31 | 1U << 21 | 0x18U);
  ecc.detects(0x20);
  EXPECT_EQ(ecc.read(), 1U << 31 | 1U << 21 | 0x18U);
  ecc.write(1U << 31);
  EXPECT_FALSE(ecc.interrupt());
  ecc.dual_bank = false;
  ecc.detects(0x4'0018);
  EXPECT_EQ(ecc.read(), 1U << 29 | 0x4'0010U);
  ecc.write(1U << 31);
  EXPECT_TRUE(ecc.interrupt()) << "ECCD2 stays";
}

TEST(Models, ATimerCountsItsClockAndInterruptsAtItsPeriod) {
  std::vector<std::string> complaints;
  Timer timer([&](const std::string& what) { complaints.push_back(what); }, 16);
  timer.reset();
  timer.set_clock(170'000'000, 0);
  timer.write(0x28, 169, 0);
  timer.write(0x2c, 499, 0);
  timer.write(0x14, 1, 0);
  timer.write(0x10, 0, 0);
  timer.write(0x0c, 1, 0);
  timer.write(0x00, 1, 0);
  EXPECT_EQ(timer.read(0x24, 250 * microsecond + microsecond / 2), 250u);
  timer.happen(499 * microsecond);
  EXPECT_FALSE(timer.interrupt());
  timer.happen(500 * microsecond + 1);
  EXPECT_TRUE(timer.interrupt());
  timer.write(0x10, 0, 500 * microsecond);
  for (int i = 2; i < 100; ++i) {
    EXPECT_NEAR(static_cast<double>(timer.next_event()) / microsecond, 500 * i, 0.01);
    timer.happen(timer.next_event());
  }
  EXPECT_TRUE(complaints.empty());
}

TEST(Models, APinKnowsWhoDrivesIt) {
  GpioPort port([](const std::string& what) { FAIL() << what; }, 'B');
  port.reset();
  port.write(0x00, 0xffff'fcbfU, 0);  // PB4 an input, its pull-up (NJTRST) from reset
  EXPECT_EQ(port.level(4), true);
  port.pull_down(4, true);
  EXPECT_EQ(port.level(4), false) << "5.1 kOhm win";
  port.drive(4, true);
  EXPECT_EQ(port.read(0x10) >> 4 & 1, 1u);
  port.write(0x18, 1U << 5, 0);
  port.write(0x00, 0xffff'f4bfU, 3);  // PB5 an output, high at once
  ASSERT_EQ(port.edges.size(), 1u);
  EXPECT_TRUE(port.edges[0].level);
}

}  // namespace
