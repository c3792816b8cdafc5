// The golden tables, written by an earlier export, are still a valid page: magic, layout hash and CRC as they stand in
// a drive's flash. A firmware that reads them in another way refuses every table out there.

#include <gtest/gtest.h>

#include "model/table_page.hpp"
#include "tests/golden/tables.hpp"

namespace fxdyn {
namespace {

TEST(GoldenPage, IsValidAndBeginsWithItsName) {
  EXPECT_TRUE(page_is_valid(tables::page));
  EXPECT_EQ(tables::page.header.magic, std::uint32_t{'F'} | 'X' << 8 | 'D' << 16 | '1' << 24);
}

TEST(GoldenPage, TheDefaultMagicIsTheOneOfThePage) { EXPECT_EQ(PageHeader{}.magic, tables::page.header.magic); }

}  // namespace
}  // namespace fxdyn
