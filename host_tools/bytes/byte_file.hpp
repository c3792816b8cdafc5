#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace fxdyn {

/// A file of any size, seen through a window: what is not looked at is not read.
class ByteFile {
 public:
  /// @throws InputError: it can't be read
  explicit ByteFile(const std::filesystem::path& file);
  ~ByteFile();
  ByteFile(const ByteFile&) = delete;
  ByteFile& operator=(const ByteFile&) = delete;
  std::uint64_t size() const { return size_; }
  bool holds(std::uint64_t at, std::uint64_t count) const { return at <= size_ && count <= size_ - at; }
  /// Those bytes, which holds() has said are there; gone with the next call.
  /// @throws InputError: the file has become shorter, or its disk fails
  std::string_view bytes(std::uint64_t at, std::size_t count);

 private:
  std::string name_;
  int descriptor_ = -1;
  std::uint64_t size_ = 0, first_ = 0;  ///< of the window, in the file
  std::vector<char> window_;
  std::size_t filled_ = 0;
};

}  // namespace fxdyn
