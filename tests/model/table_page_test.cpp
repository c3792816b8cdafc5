#include "model/table_page.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <random>

#include "model/joint_model.hpp"

namespace fxdyn {
namespace {

struct Formats9 {
  static constexpr int position = 28, velocity = 27, acceleration = 23, linear_acceleration = 24, length = 29,
                       force = 18, torque = 19, inverse_velocity = 20, inverse_path = 24, weight = 28,
                       velocity_squared = 20, velocity_cubed = 16, inverse_position = 24, inverse_torque = 24,
                       force_sum = 45, torque_sum = 50, deflection_sum = 50;
};
struct OtherFormats : Formats9 {
  static constexpr int torque = 18;
};
using Revolute = Link<JointType::revolute>;
template <class F>
using ModelOf = RobotModel<FixedNumbers<F>, 1, JointModel<Revolute, Viscous, Coulomb>>;
using Model = ModelOf<Formats9>;

using Page = TablePage<Model>;

constexpr std::uint32_t origin = 0xA110'CA7E;

Page page_of(std::array<std::int32_t, 2> words, std::uint32_t sequence, std::uint32_t page_origin = origin) {
  Page page{};
  page.parameters.words = {words[0], words[1]};
  Crc32 crc;
  const auto* all = reinterpret_cast<const std::uint32_t*>(&page.parameters);
  for (std::size_t i = 0; i < Page::parameter_words; ++i) crc.add(all[i]);
  page.header = with_check({.layout_hash = Model::layout_hash(),
                            .words = Page::parameter_words,
                            .crc32 = crc.value(),
                            .origin = page_origin,
                            .sequence = sequence});
  return page;
}

TEST(TablePage, CrcIsTheOneOfTheStandard) {
  Crc32 crc;  // of the bytes "12345678"
  crc.add(0x34333231U);
  crc.add(0x38373635U);
  EXPECT_EQ(crc.value(), 0x9AE0DAAFU);
}

TEST(TablePage, AnyFlippedBitIsFound) {
  const Page page = page_of({100, 200}, 1);
  EXPECT_TRUE(page_is_valid(page));
  for (std::size_t bit = 0; bit < 8 * sizeof page; ++bit) {
    Page damaged = page;
    reinterpret_cast<unsigned char*>(&damaged)[bit / 8] ^= static_cast<unsigned char>(1U << (bit % 8));
    ASSERT_FALSE(page_is_valid(damaged)) << "bit " << bit;
  }
}

/// What a slot of flash may hold: any bytes, of the size that the reader expects.
struct Slot {
  explicit Slot(const Page& page) { std::memcpy(&bytes, &page, sizeof bytes); }
  explicit Slot(unsigned char everywhere) { std::memset(raw(), everywhere, sizeof bytes); }
  bool operator==(const Slot& other) const { return std::memcmp(&bytes, &other.bytes, sizeof bytes) == 0; }
  unsigned char* raw() { return reinterpret_cast<unsigned char*>(&bytes); }
  Page bytes;
};

/// A memory in which the second page that is read, the slot, has words that can't be read.
struct TornSlot {
  int pages = 0;
  bool trusted = false;
  void begin() { ++pages; }
  bool all_read() const { return pages != 2; }
  void trust() { trusted = true; }
};

class Choice : public testing::Test {
 protected:
  const Page own = page_of({100, 200}, 3);
  UpdateSlot judged(const Slot& slot) {
    const auto chosen = choose_tables(own, slot.bytes);
    const bool used = chosen.update == UpdateSlot::used;
    EXPECT_EQ(&chosen.page, used ? &slot.bytes : &own);
    EXPECT_EQ(chosen.header.crc32, (used ? slot.bytes : own).header.crc32);
    EXPECT_TRUE(chosen.valid);
    return chosen.update;
  }
};

TEST_F(Choice, AnUpdateIsTakenWhereItIsNewerThanTheImagesOwn) {
  EXPECT_EQ(judged(Slot(page_of({110, -3}, 4))), UpdateSlot::used);
  EXPECT_EQ(judged(Slot(page_of({110, -3}, UINT32_MAX))), UpdateSlot::used);
  EXPECT_EQ(judged(Slot(page_of({110, -3}, 3))), UpdateSlot::older) << "another update of the same number";
  EXPECT_EQ(judged(Slot(page_of({110, -3}, 2))), UpdateSlot::older);
  EXPECT_EQ(judged(Slot(page_of({110, -3}, 0))), UpdateSlot::older);
  EXPECT_EQ(judged(Slot(page_of({100, 200}, 2))), UpdateSlot::older) << "the same parameters";
  EXPECT_EQ(judged(Slot(own)), UpdateSlot::same);
}

TEST_F(Choice, AnUpdateOfAnotherModelIsRefusedHoweverNew) {
  EXPECT_EQ(judged(Slot(page_of({110, -3}, 9, origin + 1))), UpdateSlot::other_origin);
  EXPECT_EQ(judged(Slot(page_of({100, 200}, 3, origin + 1))), UpdateSlot::other_origin);
}

TEST_F(Choice, TellsWhyAPageIsNone) {
  const Page newer = page_of({110, -3}, 4);
  EXPECT_EQ(judged(Slot(0xFF)), UpdateSlot::empty) << "erased";
  EXPECT_EQ(judged(Slot(0x00)), UpdateSlot::empty) << "never written";
  EXPECT_EQ(judged(Slot(0x55)), UpdateSlot::damaged);
  // whole in itself, but another firmware's
  Slot slot(newer);
  slot.bytes.header.layout_hash = ModelOf<OtherFormats>::layout_hash();
  EXPECT_EQ(judged(slot), UpdateSlot::damaged) << "the header's own check";
  slot.bytes.header = with_check(slot.bytes.header);
  EXPECT_EQ(judged(slot), UpdateSlot::other_layout);
  slot = Slot(newer);
  slot.bytes.header.words = UINT32_MAX;
  slot.bytes.header = with_check(slot.bytes.header);
  EXPECT_EQ(judged(slot), UpdateSlot::other_layout) << "another size";
  slot = Slot(newer);
  slot.bytes.header.magic ^= 1;
  slot.bytes.header = with_check(slot.bytes.header);
  EXPECT_EQ(judged(slot), UpdateSlot::damaged) << "wrong magic";
  slot = Slot(newer);
  slot.bytes.header.crc32 ^= 1;
  slot.bytes.header = with_check(slot.bytes.header);
  EXPECT_EQ(judged(slot), UpdateSlot::damaged) << "wrong CRC";
}

// A sequence number that is wrong by any bits makes no page newer.
TEST_F(Choice, AFlippedBitOfAnyPageIsNotBelieved) {
  for (const Page& page : {page_of({110, -3}, 4), page_of({110, -3}, 2), page_of({110, -3}, 9, origin ^ 1)}) {
    for (std::size_t bit = 0; bit < 8 * sizeof page; ++bit) {
      Slot slot(page);
      slot.raw()[bit / 8] ^= static_cast<unsigned char>(1U << (bit % 8));
      ASSERT_EQ(judged(slot), UpdateSlot::damaged) << "bit " << bit;
    }
  }
}

TEST_F(Choice, WhatCanNotBeReadIsNotUsed) {
  const Slot slot(page_of({110, -3}, 4));  // whole this time, as a cell that is only half programmed may read
  TornSlot memory;
  const auto chosen = choose_tables(own, slot.bytes, memory);
  EXPECT_EQ(chosen.update, UpdateSlot::unreadable);
  EXPECT_EQ(&chosen.page, &own);
  EXPECT_TRUE(chosen.valid);
  EXPECT_TRUE(memory.trusted);
}

TEST_F(Choice, WithoutAnyValidPageItIsTheImagesOwnWhichIsThenRefused) {
  Page damaged = own;
  damaged.parameters.words[0] = 101;
  const Slot erased(0xFF), newer(page_of({110, -3}, 4));
  struct Memory : PlainMemory {
    bool trusted = false;
    void trust() { trusted = true; }
  } memory;
  const auto chosen = choose_tables(damaged, erased.bytes, memory);
  EXPECT_EQ(&chosen.page, &damaged);
  EXPECT_FALSE(chosen.valid);
  EXPECT_FALSE(memory.trusted) << "its limits are still read, for the object dictionary";
  EXPECT_EQ(chosen.update, UpdateSlot::empty);
  // Its header is whole and says that the update is one of it.
  EXPECT_TRUE(choose_tables(damaged, newer.bytes).valid);
  damaged.header.origin ^= 1;
  const auto unknown = choose_tables(damaged, newer.bytes);
  EXPECT_FALSE(unknown.valid);
  EXPECT_EQ(unknown.update, UpdateSlot::other_origin);
  damaged.header.origin ^= 1;
  damaged.header.sequence = 0;
  EXPECT_EQ(choose_tables(damaged, newer.bytes).update, UpdateSlot::other_origin) << "a header that nobody believes";
}

// --- power that fails while the slot is written ----------------------------------------------------------------------

constexpr std::size_t double_word = 8;  // what an STM32G4 programs at a time; the last one may end beyond the page
constexpr std::size_t double_words = (sizeof(Page) + double_word - 1) / double_word;

/// The slot when the first `count` double words are programmed and the rest is erased.
Slot programmed(const Page& page, std::size_t count) {
  Slot slot(0xFF);
  std::memcpy(&slot.bytes, &page, std::min(count * double_word, sizeof page));
  return slot;
}

class PowerLoss : public Choice {
 protected:
  const Page old_page = page_of({90, 80}, 4), new_page = page_of({110, -3}, 5);

  /// Old, new or the image's own, never a mixture; the state says which.
  void expect_whole(const Slot& slot, bool readable, UpdateSlot expected) {
    TornSlot torn{.pages = readable ? 2 : 0};
    const auto chosen = choose_tables(own, slot.bytes, torn);
    EXPECT_EQ(chosen.update, expected);
    EXPECT_TRUE(chosen.valid);
    const Slot used(chosen.page);
    if (chosen.update == UpdateSlot::used)
      EXPECT_TRUE(readable && (used == Slot(old_page) || used == Slot(new_page)));
    else
      EXPECT_TRUE(used == Slot(own));
  }
};

TEST_F(PowerLoss, WhileTheNewPageIsProgrammed) {
  for (std::size_t count = 0; count <= double_words; ++count) {
    SCOPED_TRACE(count);
    const UpdateSlot clean = count == 0              ? UpdateSlot::empty
                             : count == double_words ? UpdateSlot::used
                                                     : UpdateSlot::damaged;
    expect_whole(programmed(new_page, count), true, clean);
    if (count < double_words) expect_whole(programmed(new_page, count + 1), false, UpdateSlot::unreadable);
  }
}

// A memory that needs no erasing.
TEST_F(PowerLoss, WhileTheNewPageIsWrittenOverTheOldOne) {
  for (std::size_t count = 0; count <= double_words; ++count) {
    SCOPED_TRACE(count);
    Slot slot(old_page);
    std::memcpy(slot.raw(), &new_page, std::min(count * double_word, sizeof new_page));
    const bool whole = slot == Slot(old_page) || slot == Slot(new_page);
    expect_whole(slot, true, whole ? UpdateSlot::used : UpdateSlot::damaged);
    expect_whole(slot, false, UpdateSlot::unreadable);
  }
}

// Pages of flash are erased one after the other, in either order.
TEST_F(PowerLoss, WhileTheOldPageIsErased) {
  for (std::size_t count = 0; count <= double_words; ++count) {
    SCOPED_TRACE(count);
    const std::size_t cut = std::min(count * double_word, sizeof(Page));
    Slot from_the_start(old_page), from_the_end(old_page);
    std::memset(from_the_start.raw(), 0xFF, cut);
    std::memset(from_the_end.raw() + sizeof(Page) - cut, 0xFF, cut);
    const UpdateSlot expected = count == 0              ? UpdateSlot::used
                                : count == double_words ? UpdateSlot::empty
                                                        : UpdateSlot::damaged;
    expect_whole(from_the_start, true, expected);
    expect_whole(from_the_end, true, expected);
  }
}

// A flash without ECC gives whatever bits of the torn word have already fallen.
TEST_F(PowerLoss, WithoutEccATornWordIsNoticedByTheChecks) {
  std::mt19937 random(5);
  for (std::size_t count = 0; count < double_words; ++count) {
    for (int draw = 0; draw < 50; ++draw) {
      Slot slot = programmed(new_page, count + 1);
      auto* bytes = slot.raw();
      for (std::size_t i = count * double_word; i < std::min((count + 1) * double_word, sizeof(Page)); ++i)
        bytes[i] = static_cast<unsigned char>(bytes[i] | random());
      const UpdateSlot judged_as = judged(slot);
      if (slot == Slot(new_page))
        EXPECT_EQ(judged_as, UpdateSlot::used);
      else
        EXPECT_NE(judged_as, UpdateSlot::used) << count;
    }
  }
}

TEST(TablePage, LayoutTellsFormatsAndEffectsApart) {
  using Swapped = RobotModel<FixedNumbers<Formats9>, 1, JointModel<Revolute, Coulomb, Viscous>>;
  using Longer = RobotModel<FixedNumbers<Formats9>, 1, JointModel<Revolute, Viscous, Coulomb>, JointModel<Revolute>>;
  EXPECT_NE(Model::layout_hash(), ModelOf<OtherFormats>::layout_hash());
  EXPECT_NE(Model::layout_hash(), Swapped::layout_hash());
  EXPECT_NE(Model::layout_hash(), Longer::layout_hash());
}

}  // namespace
}  // namespace fxdyn
