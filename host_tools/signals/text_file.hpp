#pragma once

#include <string>
#include <string_view>

namespace fxdyn {

/// A file in memory.
class MappedFile {
 public:
  /// @throws InputError: it can't be read
  explicit MappedFile(const std::string& path);
  ~MappedFile();
  MappedFile(const MappedFile&) = delete;
  MappedFile& operator=(const MappedFile&) = delete;
  std::string_view text() const { return {static_cast<const char*>(data_), size_}; }
  /// What is before `at` is not needed any more: a long log does not stay in memory beside its numbers.
  void release(const char* at);

 private:
  void* data_ = nullptr;
  std::size_t size_ = 0, released_ = 0;
};

/// Without blanks and quotation marks at both ends.
std::string_view trim(std::string_view text);

/// Line by line, with numbers from 1; a byte order mark at the start is skipped.
class LineReader {
 public:
  explicit LineReader(std::string_view text);
  /// The next line that is not blank; false at the end.
  bool next(std::string_view& line);
  int number() const { return number_; }
  std::string_view rest() const { return rest_; }

 private:
  std::string_view rest_;
  int number_ = 0;
};

}  // namespace fxdyn
