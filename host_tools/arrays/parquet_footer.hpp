#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "host_tools/bytes/byte_file.hpp"

namespace fxdyn {

/// How values are stored; the numbers are the format's own.
enum class ParquetType : std::uint8_t { boolean, int32, int64, int96, real32, real64, bytes, fixed_bytes };

/// A leaf of the schema: one number a row, or a list of numbers a row.
struct ParquetColumn {
  std::vector<std::string> path;  ///< as its writer called it, without what the format puts around a list's elements
  ParquetType type = ParquetType::real64;
  bool is_unsigned = false;
  double per_second = 0;  ///< of time stamps; 0: these are none
  /// Levels: of a number that is there, of an element of a list, of rows in a list.
  std::uint32_t defined = 0, element = 0, repeated = 0;
  std::string name;     ///< of the type, for people
  std::string trouble;  ///< why it can't be read as numbers; empty: it can
};

enum class ParquetCodec : std::uint8_t { none, snappy, gzip, lzo, brotli, lz4_of_hadoop, zstd, lz4 };

/// A column's part of a row group: its pages one after another.
struct ParquetChunk {
  std::uint64_t begin = 0, end = 0;  ///< in the file
  std::uint64_t values = 0;          ///< those that are null too; an empty list counts as one
  ParquetCodec codec = ParquetCodec::none;
};

struct ParquetRows {
  std::uint64_t rows = 0;
  std::vector<ParquetChunk> chunks;  ///< one a column
};

struct ParquetFooter {
  std::uint64_t rows = 0;
  std::vector<ParquetColumn> columns;
  std::vector<ParquetRows> groups;
};

/// What stands at the end of a Parquet file: schema and row groups.
/// Source: Apache Parquet format 2.11.0, parquet.thrift and README.md.
/// @throws InputError naming the file: it is cut, damaged or encrypted
ParquetFooter read_parquet_footer(ByteFile& file, const std::string& where);

/// What its pages are packed by: "snappy".
std::string codec_name(ParquetCodec codec);

}  // namespace fxdyn
