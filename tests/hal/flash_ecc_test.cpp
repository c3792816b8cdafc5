// Double words of the STM32G4's flash that can't be read, by its registers.

#include <gtest/gtest.h>

#include "hal/stm32g4/flash.hpp"
#include "model/joint_model.hpp"
#include "model/table_page.hpp"
#include "tests/golden/tables.hpp"
#include "tests/hal/models/flash_ecc_model.hpp"

namespace fxdyn::test {
namespace {

using Model = FlashEccModel;

struct FlashEcc : testing::Test {
  Model model;
  hal::stm32g4::BasicFlashEcc<Modelled> ecc{Modelled{&model}};
  FlashEcc() {
    model.handler = [this] { return ecc.on_nmi(); };
  }
  ~FlashEcc() override { EXPECT_TRUE(model.violations.empty()) << model.violations.front(); }
};

TEST_F(FlashEcc, APageWithoutErrorsIsRead) {
  ecc.begin();
  EXPECT_TRUE(ecc.all_read());
  ecc.trust();
  EXPECT_EQ(model.calls, 0);
}

TEST_F(FlashEcc, AnErrorIsCountedAndForgottenAndTheNmiEnds) {
  for (const std::uint32_t flag : {Model::eccd, Model::eccd2}) {
    ecc.begin();
    for (int i = 0; i < 3; ++i) model.fail(flag, 0x7'8000);
    EXPECT_FALSE(ecc.all_read());
    EXPECT_EQ(model.status() & (Model::eccd | Model::eccd2), 0U);
  }
  EXPECT_EQ(model.calls, 6);
  EXPECT_EQ(model.faults, 0);
  ecc.begin();
  EXPECT_TRUE(ecc.all_read()) << "the next page is another one";
}

TEST_F(FlashEcc, AnNmiMayComeLate) {
  model.late = true;
  ecc.begin();
  model.fail(Model::eccd, 0x7'8000);
  EXPECT_FALSE(ecc.all_read());
  model.let_in();  // without a cause by now
  EXPECT_EQ(model.faults, 0);
  EXPECT_FALSE(ecc.all_read());
}

TEST_F(FlashEcc, AnErrorOfBeforeIsNotThisPages) {
  model.late = true;
  model.fail(Model::eccd, 0x1'0000);
  ecc.begin();
  model.let_in();
  EXPECT_TRUE(ecc.all_read());
  EXPECT_EQ(model.faults, 0);
}

TEST_F(FlashEcc, ACorrectedBitIsNoError) {
  model.fail(Model::eccc, 0x1'0000);
  ecc.begin();
  EXPECT_TRUE(ecc.all_read());
  model.fail(Model::eccd, 0x7'8000);  // whose address the register does not show
  EXPECT_FALSE(ecc.all_read());
  EXPECT_EQ(model.status(), Model::eccc | Model::correction_interrupt | 0x1'0000U);
  EXPECT_EQ(model.faults, 0);
}

TEST_F(FlashEcc, AnErrorBeforeTablesAreReadIsAFault) {
  model.fail(Model::eccd, 0x1'0000);
  EXPECT_EQ(model.faults, 1);
}

TEST_F(FlashEcc, AnErrorInWhatIsComputedWithIsAFault) {
  ecc.begin();
  EXPECT_TRUE(ecc.all_read());
  ecc.trust();
  model.fail(Model::eccd, 0x7'8000);
  EXPECT_EQ(model.faults, 1);
  EXPECT_NE(model.status() & Model::eccd, 0U) << "left for the debugger";
}

TEST_F(FlashEcc, ADeadClockIsAFaultWhateverIsRead) {
  ecc.begin();
  model.stop_the_clock();
  EXPECT_EQ(model.faults, 1);
}

TEST_F(FlashEcc, ADeadClockIsAFaultBesideAnErrorToo) {
  model.late = true;
  ecc.begin();
  model.fail(Model::eccd, 0x7'8000);
  model.stop_the_clock();
  EXPECT_EQ(model.faults, 1);
}

/// The flash as choose_tables() reads it: the pages in order, some with a torn double word.
struct TornPages {
  hal::stm32g4::BasicFlashEcc<Modelled>& ecc;
  FlashEccModel& model;
  bool own, slot;
  int pages = 0;
  void begin() {
    ecc.begin();
    ++pages;
    if (pages == 1 ? own : slot) model.fail(Model::eccd, pages == 1 ? 0x1'0000 : 0x7'8000);
  }
  bool all_read() { return ecc.all_read(); }
  void trust() { ecc.trust(); }
};

TEST_F(FlashEcc, ATornSlotLeavesTheImagesOwnTables) {
  const auto own = tables::page;
  auto update = own;
  ++update.header.sequence;
  update.header = with_check(update.header);
  TornPages whole{ecc, model, false, false};
  EXPECT_EQ(choose_tables(own, update, whole).update, UpdateSlot::used);
  TornPages torn{ecc, model, false, true};
  const auto chosen = choose_tables(own, update, torn);
  EXPECT_EQ(chosen.update, UpdateSlot::unreadable);
  EXPECT_EQ(&chosen.page, &own);
  EXPECT_TRUE(chosen.valid);
  EXPECT_EQ(model.faults, 0);
  model.fail(Model::eccd, 0x1'0000);
  EXPECT_EQ(model.faults, 1) << "from here on it is one";
}

TEST_F(FlashEcc, WithoutTablesReadingThemIsNoFault) {
  const auto own = tables::page;
  TornPages torn{ecc, model, true, true};
  const auto chosen = choose_tables(own, own, torn);
  EXPECT_FALSE(chosen.valid);
  model.fail(Model::eccd, 0x1'0000);  // as the object dictionary does
  EXPECT_EQ(model.faults, 0);
}

}  // namespace
}  // namespace fxdyn::test
