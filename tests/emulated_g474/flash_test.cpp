// The slot for updated tables: power that fails while a page is written, flash that cannot be read.

#include <bit>
#include <cstring>
#include <tuple>

#include "tests/emulated_g474/bench.hpp"
#include "tests/firmware/node_bench.hpp"

namespace {

using namespace fxdyn;
using namespace fxdyn::emulated;

/// The image's own page with other numbers in it, and newer.
template <class Page>
Page make_update(Page page) {
  auto words = std::bit_cast<std::array<std::uint32_t, Page::parameter_words>>(page.parameters);
  words.back() ^= 1U;
  page.parameters = std::bit_cast<decltype(page.parameters)>(words);
  Crc32 crc;
  for (const std::uint32_t word : words) crc.add(word);
  page.header.crc32 = crc.value();
  ++page.header.sequence;
  page.header = with_check(page.header);
  return page;
}

class Slot : public testing::Test {
 protected:
  Slot() : page_(make_update(tables::page)), bytes_(sizeof page_) { std::memcpy(bytes_.data(), &page_, sizeof page_); }

  Address slot() const { return node_image().symbol("fxdyn_update_begin"); }
  std::size_t double_words() const { return (bytes_.size() + 7) / 8; }

  /// The slot erased, then the page's first double words programmed.
  void write_prefix(std::size_t count) {
    bench_.board.mend();
    bench_.board.erase(slot(), node_image().symbol("fxdyn_update_end"));
    bench_.board.program(slot(), {bytes_.begin(), bytes_.begin() + static_cast<std::ptrdiff_t>(bytes(count))});
  }
  /// The next double word was under way when the power went: some of its bits are programmed.
  void tear(std::size_t at) {
    std::vector<std::uint8_t> half(bytes_.begin() + static_cast<std::ptrdiff_t>(bytes(at)),
                                   bytes_.begin() + static_cast<std::ptrdiff_t>(bytes(at + 1)));
    for (std::uint8_t& byte : half) byte |= 0xa5;
    const Address address = slot() + static_cast<Address>(8 * at);
    bench_.board.program(address, half);
    bench_.board.tear(address);
  }
  std::size_t bytes(std::size_t count) const { return std::min(8 * count, bytes_.size()); }

  void power_on(std::uint32_t seed) {
    bench_.board.power_on(seed);
    bench_.heard();
  }
  void expect_tables(bool update) {
    EXPECT_EQ(bench_.read(0x2000, 3), 1u) << "not valid";
    EXPECT_EQ(bench_.read(0x2000, 6), update ? 1u : 0u) << "page";
    EXPECT_EQ(bench_.read(0x2000, 1), update ? page_.header.crc32 : tables::page.header.crc32) << "CRC";
  }
  void expect_slot(std::uint32_t state) { EXPECT_EQ(bench_.read(0x2000, 8), state) << "state of the slot"; }

  using Page = std::remove_const_t<decltype(tables::page)>;
  Bench bench_;
  Page page_;
  Bytes bytes_;
};

TEST_F(Slot, BootsFromAWholePage) {
  write_prefix(double_words());
  power_on(1);
  ASSERT_TRUE(bench_.boot());
  expect_tables(true);
  bench_.expect_clean();
}

TEST_F(Slot, BootsFromItsOwnTablesWhereverThePowerFailedBetweenDoubleWords) {
  for (std::size_t count = 0; count < double_words(); ++count) {
    write_prefix(count);
    power_on(static_cast<std::uint32_t>(count));
    ASSERT_TRUE(bench_.boot()) << count;
    expect_tables(false);
    ASSERT_FALSE(HasFailure()) << count;
  }
  EXPECT_EQ(bench_.board.resets(), 0u);
  bench_.expect_clean();
}

// An ECC error that cannot be corrected is an NMI.
TEST_F(Slot, BootsFromItsOwnTablesWhereverThePowerToreADoubleWord) {
  for (std::size_t count = 0; count < double_words(); ++count) {
    write_prefix(count);
    tear(count);
    power_on(static_cast<std::uint32_t>(count));
    ASSERT_TRUE(bench_.boot()) << count;
    expect_tables(false);
    expect_slot(7);
    ASSERT_FALSE(HasFailure()) << count;
  }
  EXPECT_EQ(bench_.board.resets(), 0u);
  bench_.expect_clean();
}

TEST_F(Slot, SaysWhatBecameOfThePage) {
  for (const auto& [count, state] :
       {std::pair<std::size_t, std::uint32_t>{0, 0}, {1, 6}, {40, 6}, {double_words(), 1}}) {
    write_prefix(count);
    power_on(7);
    ASSERT_TRUE(bench_.boot()) << count;
    expect_slot(state);
    bench_.run_ms(50);
    const bool told = !bench_.emergencies().empty();
    EXPECT_EQ(told, state > 2) << count;
  }
  bench_.expect_clean();
}

// A flash read 128 bits at a time has a flag of its own for the upper double word (option DBANK = 0).
TEST_F(Slot, AnEraseThatWasCutOffIsSurvivedInBothBankModes) {
  for (const auto& [dual, first, step] : {std::tuple{true, 0, 1}, {false, 0, 1}, {false, 0, 2}, {false, 1, 2}}) {
    bench_.board.ecc.dual_bank = dual;
    write_prefix(double_words());
    for (auto i = static_cast<std::size_t>(first); i < double_words(); i += static_cast<std::size_t>(step)) tear(i);
    power_on(3);
    ASSERT_TRUE(bench_.boot()) << dual << ", " << first << ", " << step;
    expect_tables(false);
    expect_slot(7);
  }
  bench_.expect_clean();
}

// Whatever becomes of reading a page, the watchdog ends it: it runs by then, and long enough for both pages.
TEST_F(Slot, TheWatchdogRunsBeforeAPageIsRead) {
  const Address own = node_image().symbol("fxdyn_tables_begin");
  for (const auto& [begin, end] : {std::pair{slot(), slot() + 64}, {own, own + 64}}) {
    write_prefix(double_words());
    bench_.board.note_first_read(begin, end);
    power_on(8);
    ASSERT_TRUE(bench_.boot());
    const auto& read = bench_.board.first_read();
    ASSERT_TRUE(read) << std::hex << begin << " is never read";
    EXPECT_TRUE(read->watchdog_runs) << std::hex << begin;
    EXPECT_GT(read->watchdog_expires, read->at + 400 * millisecond);
    EXPECT_LT(read->watchdog_expires, read->at + 1000 * millisecond);
    bench_.board.note_first_read(0, 0);
  }
  EXPECT_EQ(bench_.board.watchdog_resets(), 0u);
  bench_.expect_clean();
}

TEST_F(Slot, WithoutReadableTablesItStaysPreOperationalAndSaysSo) {
  write_prefix(0);
  bench_.board.tear(node_image().symbol("fxdyn_tables_begin") + 1024);
  power_on(4);
  ASSERT_TRUE(bench_.boot());
  EXPECT_EQ(bench_.read(0x2000, 3), 0u);
  bench_.nmt(canopen::NmtCommand::start);
  bench_.run_ms(200);
  EXPECT_EQ(bench_.heard(0x701).back(), Bytes{0x7f});
  EXPECT_EQ(bench_.board.resets(), 0u);
}

TEST_F(Slot, APageThatBecomesUnreadableWhileItIsUsedEndsWithAResetAndTheOwnTables) {
  write_prefix(double_words());
  power_on(5);
  bench_.start();
  expect_tables(true);
  for (std::size_t k = 0; k < 10; ++k) bench_.tick(test::motion(k));
  // A double word that every tick reads: the page's first parameters lie behind the header.
  for (std::size_t i = 4; i < double_words(); ++i) tear(i);
  bench_.heard();
  ASSERT_TRUE(bench_.board.run_until(
      [&] {
        bench_.tick(test::motion(11));
        return bench_.board.watchdog_resets() == 1;
      },
      200 * millisecond));
  ASSERT_TRUE(bench_.boot());
  bench_.run_ms(50);
  const auto codes = bench_.emergencies();
  EXPECT_NE(std::find(codes.begin(), codes.end(), 0x6010), codes.end());
  expect_tables(false);
  expect_slot(7);
}

}  // namespace
