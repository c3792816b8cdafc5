#include "host_tools/arrays/parquet_chunk.hpp"

#include <fmt/format.h>
#include <lz4.h>
#include <snappy-c.h>
#include <zlib.h>
#include <zstd.h>

#include <algorithm>
#include <cstring>
#include <limits>
#include <memory>
#include <optional>

#include "host_tools/arrays/parquet_values.hpp"
#include "host_tools/arrays/thrift.hpp"
#include "host_tools/support/error.hpp"

namespace fxdyn {
namespace {

enum class PageKind : std::uint8_t { data = 0, index = 1, dictionary = 2, data_2 = 3 };
/// Unpacked. Writers make pages of a megabyte; a damaged length shall not ask for all memory.
constexpr std::int64_t largest_page = std::int64_t{1} << 28;
/// Numbers that go on at once.
constexpr std::size_t at_once = 4096;
/// Encoding of levels that all writers of this century use.
constexpr std::int64_t levels_in_runs = static_cast<std::int64_t>(ParquetEncoding::runs);

struct PageHead {
  PageKind kind = PageKind::index;
  std::int64_t size = -1, packed = -1;  ///< of its bytes, unpacked and in the file
  std::optional<std::uint32_t> sum;     ///< CRC-32 of those in the file
  std::int64_t values = 0, encoding = 0;
  std::int64_t defined_encoding = levels_in_runs, repeated_encoding = levels_in_runs;
  std::int64_t defined = 0, repeated = 0;  ///< version 2: bytes of the levels, which are not packed
  bool is_packed = true;
  std::size_t length = 0;  ///< of the head itself
};

void read_data_head(ThriftReader& in, PageHead& out) {
  in.structure([&](int field) {
    if (field == 1) out.values = in.integer();
    if (field == 2) out.encoding = in.integer();
    if (field == 3) out.defined_encoding = in.integer();
    if (field == 4) out.repeated_encoding = in.integer();
  });
}

void read_data_2_head(ThriftReader& in, PageHead& out) {
  in.structure([&](int field) {
    if (field == 1) out.values = in.integer();
    if (field == 4) out.encoding = in.integer();
    if (field == 5) out.defined = in.integer();
    if (field == 6) out.repeated = in.integer();
    if (field == 7) out.is_packed = in.flag();
  });
}

PageHead read_page_head(std::string_view bytes) {
  PageHead out;
  ThriftReader in(bytes);
  in.structure([&](int field) {
    if (field == 1) out.kind = static_cast<PageKind>(in.integer());
    if (field == 2) out.size = in.integer();
    if (field == 3) out.packed = in.integer();
    if (field == 4) out.sum = static_cast<std::uint32_t>(in.integer());
    if (field == 5) read_data_head(in, out);
    if (field == 7)
      in.structure([&](int part) {
        if (part == 1) out.values = in.integer();
        if (part == 2) out.encoding = in.integer();
      });
    if (field == 8) read_data_2_head(in, out);
  });
  out.length = in.at();
  if (out.size < 0 || out.size > largest_page || out.packed < 0 || out.values < 0 || out.defined < 0 ||
      out.repeated < 0 || out.defined > out.packed || out.repeated > out.packed - out.defined ||
      out.defined + out.repeated > out.size)
    throw DamagedBytes("is damaged");
  return out;
}

bool inflate_into(std::string_view packed, std::span<char> room) {
  constexpr int gzip_or_zlib = 32 + MAX_WBITS;
  z_stream stream{};
  if (::inflateInit2(&stream, gzip_or_zlib) != Z_OK) return false;
  const std::unique_ptr<z_stream, int (*)(z_stream*)> end(&stream, ::inflateEnd);
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(packed.data()));
  stream.avail_in = static_cast<uInt>(packed.size());
  stream.next_out = reinterpret_cast<Bytef*>(room.data());
  stream.avail_out = static_cast<uInt>(room.size());
  return ::inflate(&stream, Z_FINISH) == Z_STREAM_END && stream.avail_out == 0;
}

/// Fills the room. False: they are damaged, or of another size.
bool unpack_into(ParquetCodec codec, std::string_view packed, std::span<char> room) {
  switch (codec) {
    case ParquetCodec::snappy: {
      std::size_t size = 0;
      if (::snappy_uncompressed_length(packed.data(), packed.size(), &size) != SNAPPY_OK || size != room.size())
        return false;
      return ::snappy_uncompress(packed.data(), packed.size(), room.data(), &size) == SNAPPY_OK;
    }
    case ParquetCodec::gzip:
      return inflate_into(packed, room);
    case ParquetCodec::zstd: {
      const std::size_t got = ::ZSTD_decompress(room.data(), room.size(), packed.data(), packed.size());
      return ::ZSTD_isError(got) == 0 && got == room.size();
    }
    case ParquetCodec::lz4:
      return ::LZ4_decompress_safe(packed.data(), room.data(), static_cast<int>(packed.size()),
                                   static_cast<int>(room.size())) == static_cast<int>(room.size());
    default:
      return false;
  }
}

std::uint32_t bits_of(std::uint32_t most) {
  std::uint32_t out = 0;
  for (; most > 0; most >>= 1) ++out;
  return out;
}

class PartReader {
 public:
  PartReader(ByteFile& file, ParquetBuffers& buffers, const ParquetPart& part, std::uint64_t begin, std::uint64_t end,
             const std::function<void(std::span<const double>)>& take)
      : file_(file), buffers_(buffers), part_(part), take_(take), from_(begin * part.each), to_(end * part.each) {}

  void read() {
    buffers_.dictionary.clear();  // was another part's
    const std::uint64_t all = part_.rows * part_.each;
    if (part_.chunk.values != all) throw DamagedBytes("has lists of different lengths");
    for (std::uint64_t at = part_.chunk.begin; entry_ < to_;) {
      const std::uint64_t room = part_.chunk.end - at;
      constexpr std::uint64_t longest_head = 1 << 16;
      if (room == 0) throw DamagedBytes("ends in the middle");
      const PageHead head = read_page_head(file_.bytes(at, static_cast<std::size_t>(std::min(room, longest_head))));
      if (static_cast<std::uint64_t>(head.packed) > room - head.length) throw DamagedBytes("ends in the middle");
      page(head, at + head.length, all);
      at += head.length + static_cast<std::uint64_t>(head.packed);
    }
  }

 private:
  void page(const PageHead& head, std::uint64_t at, std::uint64_t all) {
    const bool has_data = head.kind == PageKind::data || head.kind == PageKind::data_2;
    if (!has_data && head.kind != PageKind::dictionary) return;
    const auto values = static_cast<std::uint64_t>(head.values);
    if (has_data && values > all - entry_) throw DamagedBytes("is damaged");
    if (has_data && entry_ + values <= from_) {
      entry_ += values;  // unread
      return;
    }
    const std::string_view packed = file_.bytes(at, static_cast<std::size_t>(head.packed));
    if (head.sum &&
        ::crc32(0, reinterpret_cast<const Bytef*>(packed.data()), static_cast<uInt>(packed.size())) != *head.sum)
      throw DamagedBytes("is damaged");
    if (head.kind == PageKind::dictionary) {
      const std::string_view bytes = unpacked(packed, static_cast<std::size_t>(head.size), part_.chunk.codec);
      // Booleans have none; of all other numbers each needs four bytes or more.
      if (values > bytes.size() / 4) throw DamagedBytes("is damaged");
      buffers_.dictionary.resize(values);
      parquet_values(ParquetEncoding::plain, part_.column, bytes, {})->take(buffers_.dictionary);
    } else {
      head.kind == PageKind::data ? data(head, packed) : data_2(head, packed);
    }
  }

  std::string_view unpacked(std::string_view packed, std::size_t size, ParquetCodec codec) {
    if (codec == ParquetCodec::none) {
      if (packed.size() != size) throw DamagedBytes("is damaged");
      return packed;
    }
    if (buffers_.page.size() < size) buffers_.page.resize(size);
    if (size > 0 && !unpack_into(codec, packed, {buffers_.page.data(), size})) throw DamagedBytes("is damaged");
    return {buffers_.page.data(), size};
  }

  /// Levels of version 1: their length, then runs.
  static std::string_view levels(std::string_view& bytes, std::int64_t encoding) {
    if (encoding != levels_in_runs)
      throw DamagedBytes("has levels in an encoding of old: write it with a newer program");
    std::uint32_t length = 0;
    if (bytes.size() < sizeof length) throw DamagedBytes("ends in the middle");
    std::memcpy(&length, bytes.data(), sizeof length);
    bytes.remove_prefix(sizeof length);
    if (length > bytes.size()) throw DamagedBytes("ends in the middle");
    const std::string_view out = bytes.substr(0, length);
    bytes.remove_prefix(length);
    return out;
  }

  void data(const PageHead& head, std::string_view packed) {
    std::string_view bytes = unpacked(packed, static_cast<std::size_t>(head.size), part_.chunk.codec);
    std::string_view repeated, defined;
    if (part_.column.repeated > 0) repeated = levels(bytes, head.repeated_encoding);
    if (part_.column.defined > 0) defined = levels(bytes, head.defined_encoding);
    entries(head, repeated, defined, bytes);
  }

  void data_2(const PageHead& head, std::string_view packed) {
    const auto repeated = static_cast<std::size_t>(head.repeated), defined = static_cast<std::size_t>(head.defined);
    const std::string_view values = packed.substr(repeated + defined);
    const ParquetCodec codec = head.is_packed ? part_.chunk.codec : ParquetCodec::none;
    entries(head, packed.substr(0, repeated), packed.substr(repeated, defined),
            unpacked(values, static_cast<std::size_t>(head.size) - repeated - defined, codec));
  }

  void entries(const PageHead& head, std::string_view repeated, std::string_view defined, std::string_view bytes) {
    const ParquetColumn& column = part_.column;
    RunReader repeats(repeated, bits_of(column.repeated)), defines(defined, bits_of(column.defined));
    const auto values = parquet_values(static_cast<ParquetEncoding>(head.encoding), column, bytes, buffers_.dictionary);
    std::vector<std::uint32_t>& levels = buffers_.levels;
    std::vector<double>& numbers = buffers_.numbers;
    levels.resize(at_once);
    numbers.resize(at_once);
    for (auto left = static_cast<std::uint64_t>(head.values); left > 0;) {
      const std::size_t some = std::min<std::uint64_t>(left, at_once);
      left -= some;
      if (column.repeated > 0) {
        repeats.take({levels.data(), some});
        for (std::size_t k = 0; k < some; ++k)
          if ((levels[k] == 0) != ((entry_ + k) % part_.each == 0))
            throw DamagedBytes("has lists of different lengths");
      }
      std::size_t there = some;
      if (column.defined > 0) {
        defines.take({levels.data(), some});
        const auto end = levels.begin() + static_cast<std::ptrdiff_t>(some);
        there = static_cast<std::size_t>(std::count(levels.begin(), end, column.defined));
        if (part_.each > 1 && std::any_of(levels.begin(), end, [&](std::uint32_t one) { return one < column.element; }))
          throw DamagedBytes("has lists of different lengths");
      }
      values->take({numbers.data(), there});
      if (there < some) spread(levels, numbers, some, there);
      give({numbers.data(), some});
      entry_ += some;
    }
  }

  /// Those that are there to their places, NaN between them.
  void spread(const std::vector<std::uint32_t>& levels, std::vector<double>& numbers, std::size_t all,
              std::size_t there) const {
    for (std::size_t k = all; k-- > 0;)
      numbers[k] = levels[k] == part_.column.defined ? numbers[--there] : std::numeric_limits<double>::quiet_NaN();
  }

  void give(std::span<const double> numbers) const {
    const std::uint64_t begin = std::max(entry_, from_), end = std::min(entry_ + numbers.size(), to_);
    if (begin < end) take_(numbers.subspan(begin - entry_, end - begin));
  }

  ByteFile& file_;
  ParquetBuffers& buffers_;
  const ParquetPart& part_;
  const std::function<void(std::span<const double>)>& take_;
  std::uint64_t from_, to_;  ///< in numbers
  std::uint64_t entry_ = 0;  ///< the next one
};

}  // namespace

void read_parquet_part(ByteFile& file, ParquetBuffers& buffers, const ParquetPart& part, std::uint64_t begin,
                       std::uint64_t end, const std::function<void(std::span<const double>)>& take) {
  if (begin >= end) return;
  try {
    PartReader(file, buffers, part, begin, end, take).read();
  } catch (const DamagedBytes& error) {
    const std::string_view what = error.what();
    const bool is_damage = what == "is damaged" || what == "ends in the middle";
    throw InputError(
        fmt::format("{} {}{}", part.where, what, is_damage ? ": copy the file again, or write it again" : ""));
  }
}

}  // namespace fxdyn
