#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace fxdyn {

/// A file in memory: mapped, or, of a pipe ("-": standard input) and of a file compressed by gzip or zstd, its text.
class MappedFile {
 public:
  /// @throws InputError: it can't be read, or ends in the middle of what is compressed
  explicit MappedFile(const std::string& path);
  ~MappedFile();
  MappedFile(const MappedFile&) = delete;
  MappedFile& operator=(const MappedFile&) = delete;
  std::string_view text() const { return unpacked_ ? std::string_view(*unpacked_) : stored(); }
  /// What is before `at` is not needed any more: a long log does not stay in memory beside its numbers.
  void release(const char* at);

 private:
  std::string_view stored() const { return {static_cast<const char*>(data_), size_}; }
  void map(const std::string& path);
  void unmap();

  void* data_ = nullptr;
  std::size_t size_ = 0, released_ = 0;
  std::optional<std::string> unpacked_;
};

/// Without blanks and quotation marks at both ends.
std::string_view trim(std::string_view text);

/// Line by line, with numbers from 1; a byte order mark at the start is skipped, and so are comments (# or % in front).
class LineReader {
 public:
  explicit LineReader(std::string_view text);
  /// The next line that is neither blank nor a comment; false at the end.
  bool next(std::string_view& line);
  int number() const { return number_; }
  std::string_view rest() const { return rest_; }
  /// The last comment that was skipped, without its mark.
  std::string_view comment() const { return comment_; }

 private:
  std::string_view rest_, comment_;
  int number_ = 0;
};

/// What is between the fields of a table: a comma; or a tab or a blank, where the first two lines have no comma and as
/// many of those each (record.py of Universal Robots, numpy.savetxt).
char separator_of(LineReader lines);

}  // namespace fxdyn
