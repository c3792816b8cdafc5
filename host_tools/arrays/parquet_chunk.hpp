#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "host_tools/arrays/parquet_footer.hpp"

namespace fxdyn {

/// A column's part of a row group, with the same count of numbers in each of its rows.
struct ParquetPart {
  const ParquetColumn& column;
  const ParquetChunk& chunk;
  std::uint64_t rows = 0, each = 1;
  std::string where;  ///< in front of complaints: file and column
};

/// What is read into; kept from part to part, for new memory costs more than the numbers that go through it.
struct ParquetBuffers {
  std::vector<char> page;
  std::vector<double> dictionary, numbers;
  std::vector<std::uint32_t> levels;
};

/// Gives the numbers of the rows [begin, end) of the part to `take`, piece by piece, NaN for those that are null. Holds
/// one page, and unpacks none that it does not need.
/// @throws InputError: damaged, a list of another length, an encoding or packing that is not read
void read_parquet_part(ByteFile& file, ParquetBuffers& buffers, const ParquetPart& part, std::uint64_t begin,
                       std::uint64_t end, const std::function<void(std::span<const double>)>& take);

}  // namespace fxdyn
