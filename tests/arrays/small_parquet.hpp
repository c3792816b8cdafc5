#pragma once

#include <string>
#include <vector>

namespace fxdyn::test {

/// A struct in Thrift's compact protocol, field by field.
class ThriftBytes {
 public:
  ThriftBytes& integer(int id, std::int64_t value) {
    return raw(id, 6, varint((static_cast<std::uint64_t>(value) << 1) ^ static_cast<std::uint64_t>(value >> 63)));
  }
  ThriftBytes& text(int id, const std::string& value) { return raw(id, 8, varint(value.size()) + value); }
  ThriftBytes& flag(int id, bool value) { return raw(id, value ? 1 : 2, ""); }
  ThriftBytes& structure(int id, const ThriftBytes& value) { return raw(id, 12, value.bytes()); }
  /// Of structs, 14 at most.
  ThriftBytes& list(int id, const std::vector<ThriftBytes>& values) {
    std::string content(1, static_cast<char>((values.size() << 4) | 12));
    for (const ThriftBytes& value : values) content += value.bytes();
    return raw(id, 9, content);
  }
  /// A field of that type, its value as it is. Numbers have to rise.
  ThriftBytes& raw(int id, int type, const std::string& value) {
    fields_ += static_cast<char>(((id - last_) << 4) | type);
    fields_ += value;
    last_ = id;
    return *this;
  }
  std::string bytes() const { return fields_ + '\0'; }

  static std::string varint(std::uint64_t value) {
    std::string out;
    for (; value > 127; value >>= 7) out += static_cast<char>((value & 127) | 128);
    return out + static_cast<char>(value);
  }

 private:
  std::string fields_;
  int last_ = 0;
};

/// One column of a small Parquet file.
struct SmallColumn {
  std::string name;
  int type = 5, repetition = 0, codec = 0;  ///< as the format counts them: double, required, not packed
  std::int64_t values = 0;
  std::string pages;   ///< heads and contents
  int converted = -1;  ///< what older writers say of the type's meaning
};

/// A page of version 1: its head, then its content.
inline std::string small_page(std::int64_t values, const std::string& content, int encoding = 0,
                              std::int64_t size = -1) {
  return ThriftBytes()
             .integer(1, 0)
             .integer(2, size < 0 ? static_cast<std::int64_t>(content.size()) : size)
             .integer(3, static_cast<std::int64_t>(content.size()))
             .structure(5, ThriftBytes().integer(1, values).integer(2, encoding).integer(3, 3).integer(4, 3))
             .bytes() +
         content;
}

inline std::string small_numbers(const std::vector<double>& numbers) {
  return {reinterpret_cast<const char*>(numbers.data()), numbers.size() * sizeof(double)};
}

/// A whole file with one row group.
inline std::string small_parquet(const std::vector<SmallColumn>& columns, std::int64_t rows) {
  std::string out = "PAR1";
  std::vector<ThriftBytes> schema{ThriftBytes().text(4, "root").integer(5, static_cast<std::int64_t>(columns.size()))};
  std::vector<ThriftBytes> chunks;
  for (const SmallColumn& column : columns) {
    ThriftBytes element;
    element.integer(1, column.type).integer(3, column.repetition).text(4, column.name);
    if (column.converted >= 0) element.integer(6, column.converted);
    schema.push_back(element);
    chunks.push_back(ThriftBytes().structure(3, ThriftBytes()
                                                    .integer(1, column.type)
                                                    .integer(4, column.codec)
                                                    .integer(5, column.values)
                                                    .integer(7, static_cast<std::int64_t>(column.pages.size()))
                                                    .integer(9, static_cast<std::int64_t>(out.size()))));
    out += column.pages;
  }
  const std::string footer = ThriftBytes()
                                 .integer(1, 2)
                                 .list(2, schema)
                                 .integer(3, rows)
                                 .list(4, {ThriftBytes().list(1, chunks).integer(3, rows)})
                                 .bytes();
  const auto length = static_cast<std::uint32_t>(footer.size());
  return out + footer + std::string(reinterpret_cast<const char*>(&length), sizeof length) + "PAR1";
}

}  // namespace fxdyn::test
