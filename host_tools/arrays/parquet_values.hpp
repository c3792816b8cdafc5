#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "host_tools/arrays/parquet_footer.hpp"

namespace fxdyn {

/// Small whole numbers (levels, places in a dictionary, truth values) in runs: one of them repeated, or groups of eight
/// side by side in so many bits each.
/// Source: Apache Parquet format 2.11.0, Encodings.md, "RLE = 3".
class RunReader {
 public:
  /// @param bits of a number, 0 to 32. With 0 all are 0, whatever the bytes say.
  /// @throws DamagedBytes, as its functions: too many bits, or the bytes end
  RunReader(std::string_view bytes, std::uint32_t bits);
  void take(std::span<std::uint32_t> out);

 private:
  void next_run();
  std::uint32_t packed();
  std::uint8_t byte();

  std::string_view bytes_;
  std::uint32_t bits_;
  std::uint64_t left_ = 0;  ///< of the run
  bool is_packed_ = false;
  std::uint32_t value_ = 0;
  std::uint64_t store_ = 0;  ///< bits that have been read and not taken
  std::uint32_t stored_ = 0;
};

/// How the values of a page are stored; the numbers are the format's own.
enum class ParquetEncoding : std::uint8_t {
  plain = 0,
  plain_dictionary = 2,
  runs = 3,
  delta = 5,
  dictionary = 8,
  bytes_apart = 9,
};

/// The numbers of a page, those that are there, as doubles; time stamps in seconds.
class ParquetValues {
 public:
  virtual ~ParquetValues() = default;
  /// @throws DamagedBytes: the page has fewer
  virtual void take(std::span<double> out) = 0;
};

/// @param bytes of the page, behind its levels; they have to stay. So has the dictionary.
/// @throws DamagedBytes: another encoding, or it is none of that type
std::unique_ptr<ParquetValues> parquet_values(ParquetEncoding encoding, const ParquetColumn& column,
                                              std::string_view bytes, const std::vector<double>& dictionary);

}  // namespace fxdyn
