#include "host_tools/bytes/text_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zlib.h>

#include <algorithm>
#include <memory>

#include "host_tools/bytes/unpack.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/pipes.hpp"

namespace fxdyn {

namespace {

/// What gzip has packed; several packed files in one follow each other.
std::string unpack_gzip(std::string_view packed, const std::string& path) {
  constexpr std::size_t piece = std::size_t{1} << 20;
  constexpr int gzip = 16 + MAX_WBITS;
  z_stream stream{};
  if (::inflateInit2(&stream, gzip) != Z_OK) throw InputError(path + ": can't be unpacked: not enough memory");
  const std::unique_ptr<z_stream, int (*)(z_stream*)> end(&stream, ::inflateEnd);
  std::string text;
  int state = Z_OK;
  std::size_t used = 0;
  while (state != Z_STREAM_END || used < packed.size()) {
    if (state == Z_STREAM_END) {
      // Zeros after the end fill up blocks of a tape.
      if (packed.substr(used).find_first_not_of('\0') == std::string_view::npos) break;
      if (::inflateReset(&stream) != Z_OK) break;
    }
    const std::size_t filled = text.size(), offered = std::min(packed.size() - used, piece);
    text.resize(filled + piece);
    stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(packed.data() + used));
    stream.avail_in = static_cast<uInt>(offered);
    stream.next_out = reinterpret_cast<Bytef*>(text.data() + filled);
    stream.avail_out = static_cast<uInt>(piece);
    state = ::inflate(&stream, Z_NO_FLUSH);
    used += offered - stream.avail_in;
    text.resize(filled + piece - stream.avail_out);
    if (state == Z_OK || state == Z_STREAM_END) continue;
    if (state == Z_BUF_ERROR && used == packed.size())
      throw InputError(fmt::format("{}: compressed by gzip, and ends in the middle: copy it again", path));
    throw InputError(fmt::format("{}: compressed by gzip, and damaged after {} bytes: copy it again", path, used));
  }
  return text;
}

bool is_gzip(std::string_view bytes) { return bytes.starts_with("\x1F\x8B"); }
bool is_packed(std::string_view bytes) { return is_gzip(bytes) || is_zstd(bytes); }

std::string unpack(std::string_view packed, const std::string& path) {
  return is_gzip(packed) ? unpack_gzip(packed, path) : unpack_zstd(packed, path);
}

}  // namespace

MappedFile::MappedFile(const std::string& path) {
  if (const std::string* bytes = piped(path)) {
    unpacked_ = is_packed(*bytes) ? unpack(*bytes, path) : *bytes;
    return;
  }
  map(path);
  if (!is_packed(stored())) return;
  try {
    unpacked_ = unpack(stored(), path);
  } catch (...) {
    unmap();
    throw;
  }
  unmap();
}

void MappedFile::map(const std::string& path) {
  const int descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  struct stat status {};
  const bool regular = descriptor >= 0 && ::fstat(descriptor, &status) == 0 && S_ISREG(status.st_mode);
  if (regular && status.st_size > 0) {
    size_ = static_cast<std::size_t>(status.st_size);
    data_ = ::mmap(nullptr, size_, PROT_READ, MAP_PRIVATE, descriptor, 0);
  }
  if (descriptor >= 0) ::close(descriptor);
  if (!regular || data_ == MAP_FAILED) throw InputError(path + ": can't be read; check the path of the log");
}

void MappedFile::unmap() {
  if (size_ > 0) ::munmap(data_, size_);
  size_ = 0;
}

MappedFile::~MappedFile() { unmap(); }

void MappedFile::release(const char* at) {
  if (unpacked_) return;
  const auto page = static_cast<std::size_t>(::sysconf(_SC_PAGESIZE));
  const std::size_t end = static_cast<std::size_t>(at - static_cast<const char*>(data_)) / page * page;
  if (end < released_ + (std::size_t{16} << 20)) return;
  ::madvise(static_cast<char*>(data_) + released_, end - released_, MADV_DONTNEED);
  released_ = end;
}

std::string_view trim(std::string_view text) {
  const auto blank = [](char c) { return c == ' ' || c == '\t' || c == '\r' || c == '"'; };
  while (!text.empty() && blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && blank(text.back())) text.remove_suffix(1);
  return text;
}

LineReader::LineReader(std::string_view text) : rest_(text) {
  if (rest_.starts_with("\xEF\xBB\xBF")) rest_.remove_prefix(3);
}

bool LineReader::next(std::string_view& line) {
  while (!rest_.empty()) {
    const std::size_t end = rest_.find('\n');
    line = rest_.substr(0, end);
    rest_.remove_prefix(end == std::string_view::npos ? rest_.size() : end + 1);
    ++number_;
    const std::string_view trimmed = trim(line);
    if (trimmed.empty()) continue;
    if (trimmed.front() != '#' && trimmed.front() != '%') return true;
    comment_ = trim(trimmed.substr(std::min(trimmed.find_first_not_of("#% \t"), trimmed.size())));
  }
  return false;
}

char separator_of(LineReader lines) {
  std::string_view first, second;
  if (!lines.next(first) || !lines.next(second)) return ',';
  for (const std::string_view line : {first, second})
    if (line.find_first_of(",;") != std::string_view::npos) return ',';
  first = trim(first);
  second = trim(second);
  for (const char mark : {'\t', ' '}) {
    const auto fields = std::count(first.begin(), first.end(), mark);
    if (fields > 0 && fields == std::count(second.begin(), second.end(), mark)) return mark;
  }
  return ',';
}

}  // namespace fxdyn
