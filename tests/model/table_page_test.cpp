#include "model/table_page.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cstring>

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

TablePage<Model> valid_page(std::array<std::int32_t, 2> words = {100, 200}) {
  TablePage<Model> page{};
  page.parameters.words = {words[0], words[1]};
  page.header.layout_hash = Model::layout_hash();
  page.header.words = TablePage<Model>::parameter_words;
  Crc32 crc;
  const auto* all = reinterpret_cast<const std::uint32_t*>(&page.parameters);
  for (std::size_t i = 0; i < TablePage<Model>::parameter_words; ++i) crc.add(all[i]);
  page.header.crc32 = crc.value();
  return page;
}

TEST(TablePage, CrcIsTheOneOfTheStandard) {
  Crc32 crc;  // of the bytes "12345678"
  crc.add(0x34333231U);
  crc.add(0x38373635U);
  EXPECT_EQ(crc.value(), 0x9AE0DAAFU);
}

TEST(TablePage, AnyFlippedBitIsFound) {
  const TablePage<Model> page = valid_page();
  EXPECT_TRUE(page_is_valid(page));
  for (std::size_t bit = 0; bit < 8 * sizeof page; ++bit) {
    TablePage<Model> damaged = page;
    reinterpret_cast<unsigned char*>(&damaged)[bit / 8] ^= static_cast<unsigned char>(1U << (bit % 8));
    ASSERT_FALSE(page_is_valid(damaged)) << "bit " << bit;
  }
}

/// What a slot of flash may hold: any bytes, of the size that the reader expects.
struct Slot {
  explicit Slot(const TablePage<Model>& page) { std::memcpy(&bytes, &page, sizeof bytes); }
  explicit Slot(unsigned char everywhere) { std::memset(&bytes, everywhere, sizeof bytes); }
  TablePage<Model> bytes;
};

TEST(TablePage, AnUpdateIsTakenWhereItIsWholeAndForThisLayout) {
  const TablePage<Model> built_in = valid_page({100, 200}), newer = valid_page({110, -3});
  const auto chosen = [&](const Slot& slot) { return &newest_valid_page(slot.bytes, built_in); };
  const Slot whole(newer);
  EXPECT_EQ(chosen(whole), &whole.bytes);
  const Slot erased(0xFF), never_written(0x00);
  EXPECT_EQ(chosen(erased), &built_in);
  EXPECT_EQ(chosen(never_written), &built_in);

  Slot slot(newer);
  slot.bytes.header.magic ^= 1;
  EXPECT_EQ(chosen(slot), &built_in) << "wrong magic";
  // whole in itself, but another firmware's
  slot = Slot(newer);
  slot.bytes.header.layout_hash = ModelOf<OtherFormats>::layout_hash();
  EXPECT_EQ(chosen(slot), &built_in) << "another layout";
  slot = Slot(newer);
  slot.bytes.header.words = UINT32_MAX;
  EXPECT_EQ(chosen(slot), &built_in) << "another size";
  slot = Slot(newer);
  slot.bytes.header.crc32 ^= 1;
  EXPECT_EQ(chosen(slot), &built_in) << "wrong CRC";
  // Flashing stopped: the rest is still erased.
  for (std::size_t written = 0; written < sizeof newer; written += 4) {
    Slot half(0xFF);
    std::memcpy(&half.bytes, &newer, written);
    EXPECT_EQ(chosen(half), &built_in) << written << " bytes";
  }
}

TEST(TablePage, WithoutAnyValidPageItIsTheImagesOwnWhichIsThenRefused) {
  TablePage<Model> built_in = valid_page({100, 200});
  built_in.parameters.words[0] = 101;
  const Slot erased(0xFF);
  const TablePage<Model>& page = newest_valid_page(erased.bytes, built_in);
  EXPECT_EQ(&page, &built_in);
  EXPECT_FALSE(page_is_valid(page));
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
