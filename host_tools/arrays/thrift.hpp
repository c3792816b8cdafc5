#pragma once

#include <cstdint>
#include <functional>
#include <stdexcept>
#include <string>
#include <string_view>

namespace fxdyn {

/// Bytes that are not what their format says; in words that go behind the name of the file or column.
struct DamagedBytes : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// Reads a struct that Thrift's compact protocol has written, as Parquet's footer and page headers are. What its caller
/// does not ask for is skipped.
/// Source: "Thrift compact protocol encoding" of Apache Thrift, doc/specs/thrift-compact-protocol.md.
class ThriftReader {
 public:
  explicit ThriftReader(std::string_view bytes) : bytes_(bytes) {}
  /// Calls `field` with the number of each field of the struct that stands next, for it to read the value.
  /// @throws DamagedBytes, as all of these: the value is of another type, or the bytes end
  void structure(const std::function<void(int id)>& field);
  /// Calls `element` for each element of the list that stands next.
  void list(const std::function<void()>& element);
  std::int64_t integer();
  bool flag();
  std::string text();
  /// How many bytes have been read.
  std::size_t at() const { return at_; }

 private:
  enum class Type : std::uint8_t { stop, yes, no, byte, i16, i32, i64, real, binary, list, set, map, structure, uuid };
  Type take();
  std::uint8_t byte();
  std::uint64_t varint();
  std::int64_t zigzag();
  std::size_t length(std::size_t least_bytes);
  void pass(std::size_t count);
  void skip(Type type, int depth);
  void skip_collection(Type type, int depth);

  std::string_view bytes_;
  std::size_t at_ = 0;
  Type next_ = Type::structure;  ///< of the value that stands next; stop: it has been read
  int depth_ = 0;
};

}  // namespace fxdyn
