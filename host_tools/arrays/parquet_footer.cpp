#include "host_tools/arrays/parquet_footer.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>

#include "host_tools/arrays/thrift.hpp"
#include "host_tools/support/error.hpp"

namespace fxdyn {
namespace {

constexpr std::string_view parquet_magic = "PAR1", encrypted_magic = "PARE";
constexpr std::size_t footer_end = 8;  // its length, then the magic bytes
/// Rows for each byte of the file: far beyond what numbers of a motion pack to. Damaged ones claim any number.
constexpr std::uint64_t most_rows_a_byte = 256;
/// Numbers of one column, likewise: a row may be a list.
constexpr std::uint64_t most_values_a_byte = 4096;

enum Repetition { required = 0, optional = 1, repeated = 2 };
enum Converted {
  of_map = 1,
  of_key_value = 2,
  of_list = 3,
  decimal = 5,
  date = 6,
  time_ms = 7,
  stamp_us = 10,
  uint8 = 11,
  uint64 = 14
};

/// An element of the schema: a leaf, or a group of those that follow.
struct SchemaElement {
  std::string name;
  int type = -1, repetition = required, converted = -1;
  std::int64_t children = 0;
  bool is_list = false, is_map = false, is_decimal = false, is_unsigned = false, is_half = false;
  double per_second = 0;
};

/// Names stand in complaints, which have one line.
std::string in_one_line(std::string name) {
  for (char& c : name)
    if (static_cast<unsigned char>(c) < ' ') c = '_';
  return name;
}

/// Unit of a LogicalType TIME or TIMESTAMP.
double read_unit(ThriftReader& in) {
  constexpr std::array units{0.0, 1e3, 1e6, 1e9};
  double out = 0;
  in.structure([&](int field) {
    if (field == 2)
      in.structure([&](int unit) {
        if (unit > 0 && unit < static_cast<int>(units.size())) out = units[static_cast<std::size_t>(unit)];
      });
  });
  return out;
}

void read_logical(ThriftReader& in, SchemaElement& out) {
  in.structure([&](int kind) {
    if (kind == 2) out.is_map = true;
    if (kind == 3) out.is_list = true;
    if (kind == 5) out.is_decimal = true;
    if (kind == 7 || kind == 8) out.per_second = read_unit(in);
    if (kind == 10)
      in.structure([&](int field) {
        if (field == 2) out.is_unsigned = !in.flag();
      });
    if (kind == 15) out.is_half = true;
  });
}

SchemaElement read_element(ThriftReader& in) {
  SchemaElement out;
  in.structure([&](int field) {
    if (field == 1) out.type = static_cast<int>(in.integer());
    if (field == 3) out.repetition = static_cast<int>(in.integer());
    if (field == 4) out.name = in_one_line(in.text());
    if (field == 5) out.children = in.integer();
    if (field == 6) out.converted = static_cast<int>(in.integer());
    if (field == 10) read_logical(in, out);
  });
  if (out.type > static_cast<int>(ParquetType::fixed_bytes) || out.repetition < required || out.repetition > repeated)
    throw DamagedBytes("is damaged");
  out.is_map |= out.converted == of_map || out.converted == of_key_value;
  out.is_list |= out.converted == of_list;
  out.is_decimal |= out.converted == decimal;
  out.is_unsigned |= out.converted >= uint8 && out.converted <= uint64;
  // Older writers: TIME and TIMESTAMP, in ms and us each.
  if (out.per_second == 0 && out.converted >= time_ms && out.converted <= stamp_us)
    out.per_second = (out.converted - time_ms) % 2 == 0 ? 1e3 : 1e6;
  return out;
}

/// Leaves of the schema, depth first as its elements are.
class Leaves {
 public:
  explicit Leaves(const std::vector<SchemaElement>& elements) : elements_(elements) {
    if (elements.empty()) throw DamagedBytes("has no columns");
    for (std::int64_t child = 0; child < elements[0].children; ++child) add({});
    if (next_ != elements.size()) throw DamagedBytes("is damaged");
  }
  std::vector<ParquetColumn> all;

 private:
  struct Around {
    std::vector<std::string> path;
    std::uint32_t defined = 0, element = 0, repeated = 0;
    int depth = 0;
    bool in_map = false;
    bool is_list = false;  ///< what stands next is the format's own: the list's elements
    bool is_only = false;  ///< and so is its only child
  };

  void add(Around around) {
    constexpr int deepest = 64;
    if (next_ >= elements_.size() || ++around.depth > deepest) throw DamagedBytes("is damaged");
    const SchemaElement& one = elements_[next_++];
    if (one.repetition != required) ++around.defined;
    if (one.repetition == repeated) {
      ++around.repeated;
      around.element = around.defined;
    }
    const bool is_named = !around.is_list && !around.is_only;
    if (is_named) around.path.push_back(one.name);
    around.in_map |= one.is_map;
    if (one.type < 0) {
      around.is_only = around.is_list && one.children == 1;
      around.is_list = one.is_list && one.children == 1;
      for (std::int64_t child = 0; child < one.children; ++child) add(around);
      return;
    }
    all.push_back(leaf(one, around));
  }

  static ParquetColumn leaf(const SchemaElement& one, Around& around) {
    ParquetColumn out;
    out.path = std::move(around.path);
    out.type = static_cast<ParquetType>(one.type);
    out.is_unsigned = one.is_unsigned;
    const bool is_integer = out.type == ParquetType::int32 || out.type == ParquetType::int64;
    if (is_integer) out.per_second = one.per_second;
    out.defined = around.defined;
    out.element = around.element;
    out.repeated = around.repeated;
    constexpr std::array names{"bool", "int32", "int64", "int96", "float", "double", "text", "bytes"};
    out.name = out.per_second > 0 ? "time" : names[static_cast<std::size_t>(out.type)];
    out.trouble = trouble_of(one, out, around.in_map);
    return out;
  }

  static std::string trouble_of(const SchemaElement& one, const ParquetColumn& column, bool in_map) {
    if (column.path.empty()) return "has no name";
    if (one.is_decimal) return "is decimal: write it as double";
    if (one.is_half) return "has half precision: write it as float";
    if (in_map) return "is a map: write each of its values as a column";
    if (column.repeated > 1) return "is a list of lists: write each as a column";
    if (column.type == ParquetType::int96) return "has time stamps of 96 bits: write them as seconds";
    if (column.type == ParquetType::bytes || column.type == ParquetType::fixed_bytes) return "is text";
    return "";
  }

  const std::vector<SchemaElement>& elements_;
  std::size_t next_ = 1;
};

/// What a row group says of a column.
struct ChunkWords {
  std::int64_t values = 0, size = 0, data = -1, dictionary = 0, codec = 0;
  bool is_elsewhere = false, is_encrypted = false;
};

ChunkWords read_chunk_words(ThriftReader& in) {
  ChunkWords out;
  in.structure([&](int field) {
    if (field == 1) out.is_elsewhere = !in.text().empty();
    if (field == 8 || field == 9) out.is_encrypted = true;
    if (field != 3) return;
    in.structure([&](int part) {
      if (part == 4) out.codec = in.integer();
      if (part == 5) out.values = in.integer();
      if (part == 7) out.size = in.integer();
      if (part == 9) out.data = in.integer();
      if (part == 11) out.dictionary = in.integer();
    });
  });
  return out;
}

/// @param room bytes of the file in front of the footer
ParquetChunk chunk_of(const ChunkWords& words, std::uint64_t room, ParquetColumn& column) {
  ParquetChunk out;
  if (words.is_encrypted || words.is_elsewhere) {
    column.trouble = words.is_encrypted ? "is encrypted" : "is in another file";
    return out;
  }
  constexpr auto codecs = static_cast<std::int64_t>(ParquetCodec::lz4);
  const std::int64_t begin = words.dictionary > 0 ? std::min(words.dictionary, words.data) : words.data;
  if (begin < 0 || words.size < 0 || words.values < 0 || words.codec < 0 || static_cast<std::uint64_t>(begin) > room ||
      static_cast<std::uint64_t>(words.size) > room - static_cast<std::uint64_t>(begin) ||
      static_cast<std::uint64_t>(words.values) > most_values_a_byte * room)
    throw DamagedBytes("is damaged");
  out.begin = static_cast<std::uint64_t>(begin);
  out.end = out.begin + static_cast<std::uint64_t>(words.size);
  out.values = static_cast<std::uint64_t>(words.values);
  out.codec = static_cast<ParquetCodec>(std::min(words.codec, codecs + 1));
  const bool can_unpack = words.codec <= codecs && out.codec != ParquetCodec::brotli &&
                          out.codec != ParquetCodec::lzo && out.codec != ParquetCodec::lz4_of_hadoop;
  if (!can_unpack && column.trouble.empty())
    column.trouble = fmt::format("is packed by {}: write it with compression='zstd'", codec_name(out.codec));
  return out;
}

ParquetRows read_group(ThriftReader& in, std::uint64_t room, std::vector<ParquetColumn>& columns) {
  ParquetRows out;
  std::int64_t rows = -1;
  in.structure([&](int field) {
    if (field == 3) rows = in.integer();
    if (field != 1) return;
    in.list([&] {
      if (out.chunks.size() == columns.size()) throw DamagedBytes("is damaged");
      const ChunkWords words = read_chunk_words(in);
      out.chunks.push_back(chunk_of(words, room, columns[out.chunks.size()]));
    });
  });
  if (rows < 0 || out.chunks.size() != columns.size()) throw DamagedBytes("is damaged");
  out.rows = static_cast<std::uint64_t>(rows);
  return out;
}

ParquetFooter parse(std::string_view bytes, std::uint64_t room) {
  ParquetFooter out;
  std::vector<SchemaElement> schema;
  std::int64_t rows = -1;
  ThriftReader in(bytes);
  in.structure([&](int field) {
    if (field == 2) in.list([&] { schema.push_back(read_element(in)); });
    if (field == 3) rows = in.integer();
    if (field != 4) return;
    out.columns = Leaves(schema).all;
    in.list([&] { out.groups.push_back(read_group(in, room, out.columns)); });
  });
  if (out.groups.empty()) out.columns = Leaves(schema).all;
  for (const ParquetRows& group : out.groups) {
    if (group.rows > most_rows_a_byte * room) throw DamagedBytes("is damaged");
    out.rows += group.rows;
  }
  if (rows < 0 || out.rows != static_cast<std::uint64_t>(rows) || out.rows > most_rows_a_byte * room)
    throw DamagedBytes("is damaged");
  return out;
}

}  // namespace

std::string codec_name(ParquetCodec codec) {
  constexpr std::array names{"nothing", "snappy", "gzip", "LZO", "brotli", "the LZ4 of Hadoop", "zstd", "LZ4"};
  const auto number = static_cast<std::size_t>(codec);
  return number < names.size() ? names[number] : "what is newer than this reader";
}

ParquetFooter read_parquet_footer(ByteFile& file, const std::string& where) {
  const std::uint64_t size = file.size();
  if (size < parquet_magic.size() + footer_end) throw InputError(where + ": ends in the middle: copy it again");
  const std::string end(file.bytes(size - footer_end, footer_end));
  if (end.ends_with(encrypted_magic) || file.bytes(0, 4) == encrypted_magic)
    throw InputError(where + ": is encrypted: write it without");
  if (!end.ends_with(parquet_magic))
    throw InputError(where + ": ends in the middle, or its writer was not closed: copy it again, or close the writer");
  std::uint32_t length = 0;
  std::memcpy(&length, end.data(), sizeof length);
  if (length > size - footer_end - parquet_magic.size()) throw InputError(where + ": is damaged: copy it again");
  const std::uint64_t begin = size - footer_end - length;
  try {
    return parse(file.bytes(begin, length), begin);
  } catch (const DamagedBytes& error) {
    throw InputError(fmt::format("{}: its footer {}: copy it again, or write it again", where, error.what()));
  }
}

}  // namespace fxdyn
