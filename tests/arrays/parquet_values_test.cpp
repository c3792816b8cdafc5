// Values as the examples of the format's own pages have them, and bytes that no writer makes.
#include "host_tools/arrays/parquet_values.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "host_tools/arrays/thrift.hpp"
#include "tests/arrays/small_parquet.hpp"

namespace fxdyn {
namespace {

using namespace std::string_view_literals;

std::vector<std::uint32_t> taken(std::string_view bytes, std::uint32_t bits, std::size_t count) {
  std::vector<std::uint32_t> out(count);
  RunReader(bytes, bits).take(out);
  return out;
}

std::vector<double> values(ParquetEncoding encoding, ParquetType type, std::string_view bytes, std::size_t count,
                           const std::vector<double>& dictionary = {}) {
  ParquetColumn column;
  column.type = type;
  std::vector<double> out(count);
  parquet_values(encoding, column, bytes, dictionary)->take(out);
  return out;
}

using Numbers = std::vector<double>;
using Places = std::vector<std::uint32_t>;

TEST(RunReader, GroupsOfEightAndRepeatedNumbers) {
  EXPECT_EQ(taken("\x03\x88\xC6\xFA"sv, 3, 8), (Places{0, 1, 2, 3, 4, 5, 6, 7}));
  EXPECT_EQ(taken("\x06\x05\x03\x88\xC6\xFA"sv, 3, 6), (Places{5, 5, 5, 0, 1, 2}));
  EXPECT_EQ(taken("\x04\x2C\x01"sv, 9, 2), (Places{300, 300}));
  EXPECT_EQ(taken(""sv, 0, 3), (Places{0, 0, 0}));
  EXPECT_EQ(taken("\x02\xFF\xFF\xFF\xFF"sv, 32, 1), (Places{0xFFFFFFFF}));
}

TEST(RunReader, BytesThatEndAreToo) {
  EXPECT_THROW(taken("\x03\x88\xC6"sv, 3, 8), DamagedBytes);
  EXPECT_THROW(taken("\x06\x05"sv, 3, 4), DamagedBytes);
  EXPECT_THROW(taken(""sv, 1, 1), DamagedBytes);
  EXPECT_THROW(taken("\xFF\xFF\xFF\xFF\xFF\xFF\xFF\xFF\xFF\xFF\xFF"sv, 1, 1), DamagedBytes);
  EXPECT_THROW(taken("\xFF\xFF\xFF\xFF\x0F\x01"sv, 1, 1), DamagedBytes);
  EXPECT_THROW(taken("\x02\x01"sv, 33, 1), DamagedBytes);
}

TEST(ParquetValues, Differences) {
  EXPECT_EQ(values(ParquetEncoding::delta, ParquetType::int64, "\x08\x01\x05\x02\x02\x00"sv, 5),
            (Numbers{1, 2, 3, 4, 5}));
  EXPECT_EQ(values(ParquetEncoding::delta, ParquetType::int32, "\x08\x01\x08\x0E\x03\x02\xC0\x3F"sv, 8),
            (Numbers{7, 5, 3, 1, 2, 3, 4, 5}));
  // The largest number, then the smallest: their difference wraps, in 32 bits and in 64.
  EXPECT_EQ(values(ParquetEncoding::delta, ParquetType::int32, "\x08\x01\x02\xFE\xFF\xFF\xFF\x0F\x02\x00"sv, 2),
            (Numbers{2147483647.0, -2147483648.0}));
  EXPECT_EQ(values(ParquetEncoding::delta, ParquetType::int64,
                   "\x08\x01\x02\xFE\xFF\xFF\xFF\xFF\xFF\xFF\xFF\xFF\x01\x02\x00"sv, 2),
            (Numbers{9223372036854775807.0, -9223372036854775808.0}));
}

TEST(ParquetValues, DifferencesOfAllWidths) {
  for (std::size_t width = 1; width <= 64; ++width) {
    const auto word = static_cast<char>(width);
    // One part of eight: all ones, seven times nothing.
    std::string bits(width, '\0');
    for (std::size_t bit = 0; bit < width; ++bit) bits[bit / 8] = static_cast<char>(bits[bit / 8] | (1 << bit % 8));
    // ... and the other way round.
    std::string last(width, '\0');
    for (std::size_t bit = 7 * width; bit < 8 * width; ++bit)
      last[bit / 8] = static_cast<char>(last[bit / 8] | (1 << bit % 8));
    const double most = static_cast<double>(width == 64 ? -1 : static_cast<std::int64_t>((1ULL << width) - 1));
    const auto read = [&](const std::string& packed) {
      return values(ParquetEncoding::delta, ParquetType::int64, std::string("\x08\x01\x09\x00\x00"sv) + word + packed,
                    9);
    };
    EXPECT_EQ(read(bits)[1], most) << width;
    EXPECT_EQ(read(bits)[8], most) << width;
    EXPECT_EQ(read(last)[7], 0) << width;
    EXPECT_EQ(read(last)[8], most) << width;
  }
}

TEST(ParquetValues, DifferencesThatNoWriterMakes) {
  const auto refused = [](std::string_view bytes, std::size_t count) {
    EXPECT_THROW(values(ParquetEncoding::delta, ParquetType::int64, bytes, count), DamagedBytes);
  };
  refused("\x08\x01\x05\x02\x02\x00"sv, 6);
  refused("\x08\x00\x05\x02\x02\x00"sv, 5);
  refused("\x00\x01\x05\x02\x02\x00"sv, 5);
  refused("\x08\x03\x05\x02\x02\x00"sv, 5);
  refused("\x08\x01\x05\x02\x02\x41"sv, 5);
  refused("\x08\x01\x05\x02\x02\x08\x01"sv, 5);
  refused("\x08\x01\x05"sv, 5);
}

TEST(ParquetValues, BytesApart) {
  EXPECT_EQ(values(ParquetEncoding::bytes_apart, ParquetType::int32, "\x01\x02\x00\x00\x00\x00\x00\xFF"sv, 2),
            (Numbers{1, static_cast<double>(static_cast<std::int32_t>(0xFF000002))}));
  EXPECT_THROW(values(ParquetEncoding::bytes_apart, ParquetType::real64, "\x01\x02"sv, 1), DamagedBytes);
}

TEST(ParquetValues, TruthsAndPlaces) {
  EXPECT_EQ(values(ParquetEncoding::plain, ParquetType::boolean, "\x05\x01"sv, 9),
            (Numbers{1, 0, 1, 0, 0, 0, 0, 0, 1}));
  EXPECT_EQ(values(ParquetEncoding::runs, ParquetType::boolean, "\x02\x00\x00\x00\x06\x01"sv, 3), (Numbers{1, 1, 1}));
  EXPECT_EQ(values(ParquetEncoding::dictionary, ParquetType::real64, "\x01\x03\x02"sv, 3, {0.5, 7}),
            (Numbers{0.5, 7, 0.5}));
  EXPECT_THROW(values(ParquetEncoding::dictionary, ParquetType::real64, "\x02\x04\x02"sv, 2, {0.5, 7}), DamagedBytes);
  EXPECT_THROW(values(ParquetEncoding::dictionary, ParquetType::real64, ""sv, 1, {}), DamagedBytes);
  EXPECT_THROW(values(ParquetEncoding::runs, ParquetType::real64, "\x02\x00\x00\x00\x06\x01"sv, 1), DamagedBytes);
  EXPECT_THROW(values(static_cast<ParquetEncoding>(6), ParquetType::real64, ""sv, 1), DamagedBytes);
  EXPECT_THROW(values(ParquetEncoding::plain, ParquetType::boolean, "\x05"sv, 9), DamagedBytes);
}

TEST(ParquetValues, UnsignedNumbersAndStamps) {
  ParquetColumn column;
  column.type = ParquetType::int32;
  column.is_unsigned = true;
  Numbers out(1);
  parquet_values(ParquetEncoding::plain, column, "\xFF\xFF\xFF\xFF"sv, {})->take(out);
  EXPECT_EQ(out[0], 4294967295.0);
  column = {};
  column.type = ParquetType::int64;
  column.per_second = 1e6;
  parquet_values(ParquetEncoding::plain, column, "\x40\x42\x0F\x00\x00\x00\x00\x00"sv, {})->take(out);
  EXPECT_EQ(out[0], 1);
}

TEST(ThriftReader, WhatNobodyAsksForIsSkipped) {
  test::ThriftBytes inner, all;
  inner.integer(1, -5).flag(2, true).text(3, "some");
  all.integer(1, 300).structure(2, inner).list(3, {inner, inner}).text(4, "name").flag(5, false);
  all.raw(6, 7, std::string(8, 'x')).raw(7, 11, std::string("\x02\x58\x01\x01\x61\x02\x00"sv));
  all.raw(8, 13, std::string(16, 'u')).raw(9, 10, std::string("\x21\x01\x02"sv)).integer(10, -1);
  std::int64_t first = 0, last = 0;
  bool flag = true;
  std::string name;
  const std::string bytes = all.bytes();
  ThriftReader in(bytes);
  in.structure([&](int id) {
    if (id == 1) first = in.integer();
    if (id == 4) name = in.text();
    if (id == 5) flag = in.flag();
    if (id == 10) last = in.integer();
  });
  EXPECT_EQ(first, 300);
  EXPECT_EQ(last, -1);
  EXPECT_EQ(name, "name");
  EXPECT_FALSE(flag);
  EXPECT_EQ(in.at(), bytes.size());
  for (std::size_t cut = 0; cut < bytes.size(); ++cut) {
    ThriftReader shorter(std::string_view(bytes).substr(0, cut));
    EXPECT_THROW(shorter.structure([](int) {}), DamagedBytes) << cut;
  }
}

TEST(ThriftReader, OtherTypesAndEndlessNestingAreRefused) {
  ThriftReader text("\x18\x01x\x00"sv);
  EXPECT_THROW(text.structure([&](int) { text.integer(); }), DamagedBytes);
  const std::string deep(100'000, '\x1C');
  ThriftReader nested(deep);
  EXPECT_THROW(nested.structure([](int) {}), DamagedBytes);
  const std::string lists = "\x19" + std::string(100'000, '\x19');
  ThriftReader in(lists);
  EXPECT_THROW(in.structure([](int) {}), DamagedBytes);
}

}  // namespace
}  // namespace fxdyn
