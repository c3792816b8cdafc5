#include "model/table_page.hpp"

#include <gtest/gtest.h>

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

TablePage<Model> valid_page() {
  TablePage<Model> page{};
  page.parameters.words = {100, 200};
  page.header.layout_hash = Model::layout_hash();
  page.header.words = TablePage<Model>::parameter_words;
  Crc32 crc;
  const auto* words = reinterpret_cast<const std::uint32_t*>(&page.parameters);
  for (std::size_t i = 0; i < TablePage<Model>::parameter_words; ++i) crc.add(words[i]);
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

TEST(TablePage, LayoutTellsFormatsAndEffectsApart) {
  using Swapped = RobotModel<FixedNumbers<Formats9>, 1, JointModel<Revolute, Coulomb, Viscous>>;
  using Longer = RobotModel<FixedNumbers<Formats9>, 1, JointModel<Revolute, Viscous, Coulomb>, JointModel<Revolute>>;
  EXPECT_NE(Model::layout_hash(), ModelOf<OtherFormats>::layout_hash());
  EXPECT_NE(Model::layout_hash(), Swapped::layout_hash());
  EXPECT_NE(Model::layout_hash(), Longer::layout_hash());
}

}  // namespace
}  // namespace fxdyn
