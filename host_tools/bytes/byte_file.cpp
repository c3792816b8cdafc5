#include "host_tools/bytes/byte_file.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>

#include "host_tools/support/error.hpp"

namespace fxdyn {
namespace {

/// What is read at once at least: small records follow each other.
constexpr std::size_t least = std::size_t{64} << 10;

}  // namespace

ByteFile::ByteFile(const std::filesystem::path& file) : name_(file.string()) {
  descriptor_ = ::open(name_.c_str(), O_RDONLY | O_CLOEXEC);
  struct stat status {};
  if (descriptor_ >= 0 && ::fstat(descriptor_, &status) == 0 && S_ISREG(status.st_mode)) {
    size_ = static_cast<std::uint64_t>(status.st_size);
    return;
  }
  if (descriptor_ >= 0) ::close(descriptor_);
  throw InputError(name_ + ": can't be read; check the path of the log");
}

ByteFile::~ByteFile() { ::close(descriptor_); }

std::string_view ByteFile::bytes(std::uint64_t at, std::size_t count) {
  if (at >= first_ && at - first_ <= filled_ && count <= filled_ - (at - first_))
    return {window_.data() + (at - first_), count};
  const std::size_t wanted = std::max(count, static_cast<std::size_t>(std::min<std::uint64_t>(least, size_ - at)));
  if (window_.size() < wanted) window_.resize(wanted);
  first_ = at;
  filled_ = 0;
  while (filled_ < wanted) {
    const ssize_t got =
        ::pread(descriptor_, window_.data() + filled_, wanted - filled_, static_cast<off_t>(at + filled_));
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) break;
    filled_ += static_cast<std::size_t>(got);
  }
  if (filled_ < count) throw InputError(name_ + ": can't be read to its end; is it still being written?");
  return {window_.data(), count};
}

}  // namespace fxdyn
