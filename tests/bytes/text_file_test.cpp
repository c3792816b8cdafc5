#include "host_tools/bytes/text_file.hpp"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <zlib.h>

#include <fstream>
#include <thread>

#include "host_tools/bytes/foreign_format.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/files.hpp"
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

TEST(TextFile, WhatGzipPackedIsItsText) {
  std::string text;
  for (int i = 0; i < 400'000; ++i) text += "0.25,1,2\n";  // several pieces of the reader's buffer
  const auto pack = [](const std::filesystem::path& file, const std::string& bytes, const char* mode) {
    gzFile out = ::gzopen(file.c_str(), mode);
    ASSERT_EQ(::gzwrite(out, bytes.data(), static_cast<unsigned>(bytes.size())), static_cast<int>(bytes.size()));
    ::gzclose(out);
  };
  const auto file = test::folder() / "packed.csv.gz";
  pack(file, text, "wb");
  EXPECT_TRUE(MappedFile(file).text() == text);
  pack(file, "tail", "ab");  // two packed files, one behind the other
  EXPECT_TRUE(MappedFile(file).text() == text + "tail");
  std::filesystem::resize_file(file, 100);
  test::expect_refused(file, {"ends in the middle"}, [&] { const MappedFile half(file); });
  test::write("packed.csv.gz", "\x1F\x8B\x08 this is not what gzip writes");
  test::expect_refused(file, {"damaged"}, [&] { const MappedFile none(file); });
}

TEST(TextFile, AFifoIsReadOnceAndKept) {
  const auto file = test::folder() / "pipe";
  ASSERT_EQ(::mkfifo(file.c_str(), 0600), 0);
  std::thread writer([&] { std::ofstream(file) << "a\nb"; });
  EXPECT_EQ(MappedFile(file).text(), "a\nb");
  writer.join();
  EXPECT_EQ(MappedFile(file).text(), "a\nb");  // nobody writes any more
  EXPECT_EQ(hash_of_file(file), hash_of("a\nb"));
}

TEST(TextFile, CommentsAreSkipped) {
  LineReader lines("# one\n  %two, three\nt,q1\n#\n1,2\n");
  std::string_view line;
  ASSERT_TRUE(lines.next(line));
  EXPECT_EQ(line, "t,q1");
  EXPECT_EQ(lines.number(), 3);
  EXPECT_EQ(lines.comment(), "two, three");
  ASSERT_TRUE(lines.next(line));
  EXPECT_EQ(line, "1,2");
  EXPECT_EQ(lines.comment(), "");
}

TEST(TextFile, OtherFormatsAreNamed) {
  const auto holds = [](std::string_view bytes, const char* words) {
    EXPECT_NE(foreign_format(bytes).find(words), std::string::npos) << foreign_format(bytes);
  };
  using namespace std::string_view_literals;
  holds("PAR1\x15\x04"sv, "Parquet");
  holds("\xFF\xFEt\0,\0"sv, "UTF-16");
  holds(
      "t\0,\0q\0"
      "1\0\n\0"sv,
      "UTF-16 without a mark");
  holds("t,q1\n\0\0\1"sv, "binary");
  EXPECT_EQ(foreign_format("t,q1\n0,1\n"), "");
  EXPECT_EQ(foreign_format(""), "");
}

TEST(TextFile, AMissingFileIsRefused) { EXPECT_THROW(MappedFile("no/such/file"), InputError); }

}  // namespace
}  // namespace fxdyn
