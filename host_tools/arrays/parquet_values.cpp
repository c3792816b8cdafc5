#include "host_tools/arrays/parquet_values.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>

#include "host_tools/arrays/thrift.hpp"

namespace fxdyn {
namespace {

static_assert(std::endian::native == std::endian::little);

std::uint8_t first_byte(std::string_view& bytes) {
  if (bytes.empty()) throw DamagedBytes("ends in the middle");
  const auto out = static_cast<std::uint8_t>(bytes.front());
  bytes.remove_prefix(1);
  return out;
}

std::uint64_t first_varint(std::string_view& bytes) {
  std::uint64_t out = 0;
  for (unsigned shift = 0; shift < 64; shift += 7) {
    const std::uint8_t part = first_byte(bytes);
    out |= static_cast<std::uint64_t>(part & 127) << shift;
    if (part < 128) return out;
  }
  throw DamagedBytes("is damaged");
}

std::uint64_t first_zigzag(std::string_view& bytes) {
  const std::uint64_t value = first_varint(bytes);
  return (value >> 1) ^ (0 - (value & 1));
}

/// Numbers of a column's type as doubles.
class Conversion {
 public:
  explicit Conversion(const ParquetColumn& column)
      : is_unsigned_(column.is_unsigned),
        is_short_(column.type == ParquetType::int32),
        per_second_(column.per_second) {}
  double operator()(float value) const { return value; }
  double operator()(double value) const { return value; }
  double operator()(std::int32_t value) const {
    return scaled(is_unsigned_ ? static_cast<double>(static_cast<std::uint32_t>(value)) : value);
  }
  double operator()(std::int64_t value) const {
    return scaled(is_unsigned_ ? static_cast<double>(static_cast<std::uint64_t>(value)) : static_cast<double>(value));
  }
  /// Of either length; what does not fit wraps, as its writer's sums did.
  double of_bits(std::uint64_t bits) const {
    return is_short_ ? (*this)(static_cast<std::int32_t>(bits)) : (*this)(static_cast<std::int64_t>(bits));
  }

 private:
  double scaled(double value) const { return per_second_ > 0 ? value / per_second_ : value; }
  bool is_unsigned_, is_short_;
  double per_second_;
};

template <class Number>
class PlainValues : public ParquetValues {
 public:
  PlainValues(const ParquetColumn& column, std::string_view bytes) : conversion_(column), bytes_(bytes) {}
  void take(std::span<double> out) override {
    if (out.size() > bytes_.size() / sizeof(Number)) throw DamagedBytes("ends in the middle");
    for (std::size_t k = 0; k < out.size(); ++k) {
      Number value;
      std::memcpy(&value, bytes_.data() + k * sizeof(Number), sizeof(Number));
      out[k] = conversion_(value);
    }
    bytes_.remove_prefix(out.size() * sizeof(Number));
  }

 private:
  Conversion conversion_;
  std::string_view bytes_;
};

/// The first bytes of all numbers, then their second ones, and so on.
template <class Number>
class ApartValues : public ParquetValues {
 public:
  ApartValues(const ParquetColumn& column, std::string_view bytes)
      : conversion_(column), bytes_(bytes), count_(bytes.size() / sizeof(Number)) {}
  void take(std::span<double> out) override {
    if (out.size() > count_ - at_) throw DamagedBytes("ends in the middle");
    for (double& into : out) {
      std::array<char, sizeof(Number)> one;
      for (std::size_t k = 0; k < one.size(); ++k) one[k] = bytes_[k * count_ + at_];
      into = conversion_(std::bit_cast<Number>(one));
      ++at_;
    }
  }

 private:
  Conversion conversion_;
  std::string_view bytes_;
  std::size_t count_, at_ = 0;
};

class PlainTruths : public ParquetValues {
 public:
  explicit PlainTruths(std::string_view bytes) : bytes_(bytes) {}
  void take(std::span<double> out) override {
    if (out.size() > bytes_.size() * 8 - at_) throw DamagedBytes("ends in the middle");
    for (double& into : out) {
      into = (static_cast<std::uint8_t>(bytes_[at_ / 8]) >> (at_ % 8)) & 1;
      ++at_;
    }
  }

 private:
  std::string_view bytes_;
  std::size_t at_ = 0;
};

class RunTruths : public ParquetValues {
 public:
  /// @param bytes behind their length
  explicit RunTruths(std::string_view bytes) : runs_(bytes, 1) {}
  void take(std::span<double> out) override {
    for (double& into : out) {
      std::uint32_t one = 0;
      runs_.take({&one, 1});
      into = one;
    }
  }

 private:
  RunReader runs_;
};

class DictionaryValues : public ParquetValues {
 public:
  DictionaryValues(std::string_view bytes, const std::vector<double>& dictionary)
      : runs_(bytes.substr(std::min<std::size_t>(1, bytes.size())),
              bytes.empty() ? 0 : static_cast<std::uint8_t>(bytes[0])),
        dictionary_(dictionary) {}
  void take(std::span<double> out) override {
    places_.resize(out.size());
    runs_.take(places_);
    for (std::size_t k = 0; k < out.size(); ++k) {
      if (places_[k] >= dictionary_.size()) throw DamagedBytes("is damaged");
      out[k] = dictionary_[places_[k]];
    }
  }

 private:
  RunReader runs_;
  const std::vector<double>& dictionary_;
  std::vector<std::uint32_t> places_;
};

/// The first number, then blocks of differences: the least of a block, and what the others exceed it by, in as few bits
/// as a part of the block needs. Source: Apache Parquet format 2.11.0, Encodings.md, "DELTA_BINARY_PACKED = 5".
class DeltaValues : public ParquetValues {
 public:
  DeltaValues(const ParquetColumn& column, std::string_view bytes) : conversion_(column), bytes_(bytes) {
    constexpr std::uint64_t most_parts = 512, longest_block = 1 << 20;
    const std::uint64_t block = first_varint(bytes_);
    parts_ = first_varint(bytes_);
    left_ = first_varint(bytes_);
    value_ = first_zigzag(bytes_);
    if (parts_ == 0 || parts_ > most_parts || block > longest_block || block % (8 * parts_) != 0 || block == 0)
      throw DamagedBytes("is damaged");
    length_ = block / parts_;
    part_ = parts_;  // the first block is still to come
  }

  void take(std::span<double> out) override {
    if (out.size() > left_) throw DamagedBytes("ends in the middle");
    left_ -= out.size();
    for (double& into : out) {
      if (is_first_) {
        is_first_ = false;
      } else {
        const std::uint64_t more = difference();  // a new block has a least difference of its own
        value_ += least_ + more;
      }
      into = conversion_.of_bits(value_);
    }
  }

 private:
  std::uint64_t difference() {
    if (at_ == in_part_) next_part();
    const std::size_t bit = at_ * width_;
    ++at_;
    std::uint64_t out = 0;
    // A number of 64 bits may lie in nine bytes.
    for (std::size_t k = 0, first = bit / 8; 8 * k < bit % 8 + width_; ++k) {
      const std::uint64_t byte = static_cast<std::uint8_t>(bits_[first + k]);
      const std::size_t shift = 8 * k;
      out |= shift >= bit % 8 ? byte << (shift - bit % 8) : byte >> (bit % 8 - shift);
    }
    return width_ < 64 ? out & ((std::uint64_t{1} << width_) - 1) : out;
  }

  void next_part() {
    if (part_ == parts_) {
      least_ = first_zigzag(bytes_);
      if (bytes_.size() < parts_) throw DamagedBytes("ends in the middle");
      widths_ = bytes_.substr(0, parts_);
      bytes_.remove_prefix(parts_);
      part_ = 0;
    }
    width_ = static_cast<std::uint8_t>(widths_[part_++]);
    const std::size_t size = (length_ * width_ + 7) / 8;
    if (width_ > 64 || size > bytes_.size()) throw DamagedBytes("ends in the middle");
    bits_ = bytes_.substr(0, size);
    bytes_.remove_prefix(size);
    in_part_ = length_;
    at_ = 0;
  }

  Conversion conversion_;
  std::string_view bytes_, widths_, bits_;
  std::uint64_t parts_ = 0, length_ = 0, part_ = 0, left_ = 0, value_ = 0, least_ = 0;
  std::size_t width_ = 0, at_ = 0, in_part_ = 0;
  bool is_first_ = true;
};

template <template <class> class Values>
std::unique_ptr<ParquetValues> of_type(const ParquetColumn& column, std::string_view bytes) {
  switch (column.type) {
    case ParquetType::int32:
      return std::make_unique<Values<std::int32_t>>(column, bytes);
    case ParquetType::int64:
      return std::make_unique<Values<std::int64_t>>(column, bytes);
    case ParquetType::real32:
      return std::make_unique<Values<float>>(column, bytes);
    case ParquetType::real64:
      return std::make_unique<Values<double>>(column, bytes);
    default:
      throw DamagedBytes("is damaged");
  }
}

/// As the format's pages and other programs call it.
std::string encoding_name(ParquetEncoding encoding) {
  constexpr std::array names{"PLAIN",
                             "1",
                             "PLAIN_DICTIONARY",
                             "RLE",
                             "BIT_PACKED",
                             "DELTA_BINARY_PACKED",
                             "DELTA_LENGTH_BYTE_ARRAY",
                             "DELTA_BYTE_ARRAY",
                             "RLE_DICTIONARY",
                             "BYTE_STREAM_SPLIT"};
  const auto number = static_cast<std::size_t>(encoding);
  return number < names.size() ? names[number] : std::to_string(number);
}

}  // namespace

RunReader::RunReader(std::string_view bytes, std::uint32_t bits) : bytes_(bytes), bits_(bits) {
  if (bits > 32) throw DamagedBytes("is damaged");
}

void RunReader::take(std::span<std::uint32_t> out) {
  for (std::size_t k = 0; k < out.size();) {
    if (bits_ == 0) {
      std::fill(out.begin(), out.end(), 0U);
      return;
    }
    if (left_ == 0) next_run();
    const std::size_t some = std::min<std::uint64_t>(left_, out.size() - k);
    if (is_packed_) {
      for (std::size_t end = k + some; k < end; ++k) out[k] = packed();
    } else {
      std::fill_n(out.begin() + static_cast<std::ptrdiff_t>(k), some, value_);
      k += some;
    }
    left_ -= some;
  }
}

void RunReader::next_run() {
  const std::uint64_t head = first_varint(bytes_);
  is_packed_ = (head & 1) != 0;
  left_ = head >> 1;
  store_ = stored_ = 0;
  if (is_packed_) {
    // Whole groups, though the last one may hold less than eight numbers that count.
    if (left_ > bytes_.size() / bits_ + 1) throw DamagedBytes("ends in the middle");
    left_ *= 8;
    return;
  }
  value_ = 0;
  for (std::uint32_t shift = 0; shift < bits_; shift += 8)
    value_ |= static_cast<std::uint32_t>(first_byte(bytes_)) << shift;
}

std::uint32_t RunReader::packed() {
  while (stored_ < bits_) {
    store_ |= static_cast<std::uint64_t>(first_byte(bytes_)) << stored_;
    stored_ += 8;
  }
  const auto out = static_cast<std::uint32_t>(store_ & ((std::uint64_t{1} << bits_) - 1));
  store_ >>= bits_;
  stored_ -= bits_;
  return out;
}

std::unique_ptr<ParquetValues> parquet_values(ParquetEncoding encoding, const ParquetColumn& column,
                                              std::string_view bytes, const std::vector<double>& dictionary) {
  const bool is_truth = column.type == ParquetType::boolean;
  const bool is_integer = column.type == ParquetType::int32 || column.type == ParquetType::int64;
  switch (encoding) {
    case ParquetEncoding::plain:
      if (is_truth) return std::make_unique<PlainTruths>(bytes);
      return of_type<PlainValues>(column, bytes);
    case ParquetEncoding::plain_dictionary:
    case ParquetEncoding::dictionary:
      return std::make_unique<DictionaryValues>(bytes, dictionary);
    case ParquetEncoding::runs:
      if (!is_truth || bytes.size() < 4) break;
      return std::make_unique<RunTruths>(bytes.substr(4));  // behind their length
    case ParquetEncoding::delta:
      if (!is_integer) break;
      return std::make_unique<DeltaValues>(column, bytes);
    case ParquetEncoding::bytes_apart:
      return of_type<ApartValues>(column, bytes);
  }
  throw DamagedBytes(
      fmt::format("has numbers in an encoding that is not read ({}): write them plain or with a dictionary",
                  encoding_name(encoding)));
}

}  // namespace fxdyn
