#include "host_tools/signals/text_file.hpp"

#include <gtest/gtest.h>

#include "host_tools/support/error.hpp"
#include "tests/support/files.hpp"

namespace fxdyn {
namespace {

TEST(TextFile, LinesThatAreNotBlankKeepTheirNumbers) {
  LineReader lines("\xEF\xBB\xBFt,q1\n\n  \r\n1,2\r\nlast");
  std::string_view line;
  ASSERT_TRUE(lines.next(line));
  EXPECT_EQ(line, "t,q1");
  EXPECT_EQ(lines.number(), 1);
  ASSERT_TRUE(lines.next(line));
  EXPECT_EQ(trim(line), "1,2");
  EXPECT_EQ(lines.number(), 4);
  EXPECT_EQ(lines.rest(), "last");
  ASSERT_TRUE(lines.next(line));
  EXPECT_EQ(line, "last");
  EXPECT_FALSE(lines.next(line));
}

TEST(TextFile, BlanksAndQuotationMarksAreTrimmed) { EXPECT_EQ(trim(" \"q1\"\t\r"), "q1"); }

TEST(TextFile, AFileIsInMemoryAsItIs) {
  const MappedFile file(test::write("text_file.txt", "a\nb"));
  EXPECT_EQ(file.text(), "a\nb");
  EXPECT_TRUE(MappedFile(test::write("no_text.txt", "")).text().empty());
}

TEST(TextFile, AMissingFileIsRefused) { EXPECT_THROW(MappedFile("no/such/file"), InputError); }

}  // namespace
}  // namespace fxdyn
