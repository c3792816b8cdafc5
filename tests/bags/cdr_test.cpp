#include "host_tools/bags/cdr.hpp"

#include <gtest/gtest.h>

namespace fxdyn {
namespace {

std::string_view bytes(const char* text, std::size_t size) { return {text, size}; }

// 7, then 1.5 (0x3FF8000000000000), by hand from OMG CORBA 3.3, 9.3.1: aligned to its own size, counted from behind the
// header of four bytes.
TEST(Cdr, ADoubleIsAlignedToEightBytesInVersionOne) {
  for (const std::string_view message : {bytes("\0\1\0\0\x07\0\0\0\0\0\0\0\0\0\0\0\0\0\xF8\x3F", 20),
                                         bytes("\0\0\0\0\0\0\0\x07\0\0\0\0\x3F\xF8\0\0\0\0\0\0", 20)}) {
    CdrReader cdr(message);
    EXPECT_EQ(cdr.unsigned_32(), 7U);
    EXPECT_EQ(cdr.real_64(), 1.5);
    EXPECT_TRUE(cdr.at_end());
  }
}

// OMG DDS-XTypes 1.3, 7.4.2: the largest alignment of version 2 is 4.
TEST(Cdr, ADoubleIsAlignedToFourBytesInVersionTwo) {
  CdrReader cdr(bytes("\0\7\0\0\x07\0\0\0\0\0\0\0\0\0\xF8\x3F", 16));
  EXPECT_EQ(cdr.unsigned_32(), 7U);
  EXPECT_EQ(cdr.real_64(), 1.5);
}

TEST(Cdr, AStringCountsItsZeroAndASequenceItsElements) {
  CdrReader cdr(
      bytes("\0\1\0\0"
            "\2\0\0\0\3\0\0\0ab\0\0\1\0\0\0\0\0\0\0"
            "\0\0\0\0\1\0\0\0\0\0\0\0\0\0\0\0\0\0\xF8\x3F",
            44));
  std::vector<std::string_view> names;
  cdr.strings(names);
  EXPECT_EQ(names, (std::vector<std::string_view>{"ab", ""}));
  std::vector<double> none{1}, one;
  cdr.reals(none);  // its length alone: no element, no alignment
  EXPECT_TRUE(none.empty());
  cdr.reals(one);
  EXPECT_EQ(one, std::vector<double>{1.5});
}

TEST(Cdr, WhatIsTooShortOrOfAnotherEncodingIsRefused) {
  EXPECT_THROW(CdrReader(bytes("\0\1\0", 3)), MessageError);
  EXPECT_THROW(CdrReader(bytes("\0\3\0\0", 4)), MessageError);  // a list of parameters
  EXPECT_THROW(CdrReader(bytes("\0\1\0\0\1\0", 6)).unsigned_32(), MessageError);
  EXPECT_THROW(CdrReader(bytes("\0\1\0\0\xFF\xFF\xFF\xFF", 8)).string(), MessageError);  // no 4 GB are asked for
  std::vector<double> values;
  CdrReader cdr(bytes("\0\1\0\0\2\0\0\0\0\0\0\0\0\0\0\0", 16));
  EXPECT_THROW(cdr.reals(values), MessageError);
}

}  // namespace
}  // namespace fxdyn
